"""What is of a wrong type or shape gets a sentence that names what was meant, as docs/api.md promises."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import lidarspectra as ls
from lidarspectra.lamps.lamp_spectra import luminous_flux_lm

BOX = ls.RoomModel.from_box(3.0, 3.0, 3.0)


def lamp(**changes: object) -> ls.Lamp:
    given: dict[str, object] = {"size": 0.6, "spectrum": "LED-B3", "luminous_flux_lm": 3400}
    return ls.make_lamp("panel", (1, 1, 2), **{**given, **changes})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda: lamp(luminous_flux_lm="3400"), r"'lamp' luminous_flux_lm: expected a number \[lm\], found a str"),
        (lambda: lamp(luminous_flux_lm=np.array([1.0])), "luminous_flux_lm: expected a number .* found an ndarray"),
        (lambda: lamp(luminous_flux_lm=float("nan")), "luminous_flux_lm: expected a number"),
        (lambda: lamp(luminous_flux_lm=0), "expected a luminous_flux_lm above 0, found 0"),
        (lambda: lamp(spectrum=None, cct_k="4000"), r"cct_k: expected a number \[K\], found a str, '4000'"),
        (lambda: lamp(spectrum=None, cct_k=0), "colour temperature: expected 1000 to 25000 K, found 0 K"),
        (lambda: lamp(rotation_deg=None), r"rotation_deg: expected a number \[deg\], found None"),
        (lambda: lamp(size=[[0.6, 0.6]]), "size: expected an array of shape .any,., found shape .1, 2."),
        (lambda: BOX.grid(height=None, spacing=1.0), r"height of the sensor grid: expected a number \[m\], found None"),
        (lambda: BOX.grid(height=1.0, spacing="1"), "spacing of the sensor grid: expected a number"),
        (lambda: ls.LampOrder(lamp="a", dim="half"), "LampOrder of 'a', dim: expected a number, found a str, 'half'"),
        (lambda: ls.LampOrder(lamp="a", luminous_flux_lm="9"), r"luminous_flux_lm: expected a number \[lm\]"),
        (lambda: ls.load_reflectances("builtin"), r"expected a list of str, found a single str\. Write \[\.\.\.\]"),
        (lambda: ls.light_of_map("map.nc"), "expected a Dataset, found a str, 'map.nc'. load_map reads one"),
        (lambda: ls.plan_readings(Path("room.run"), "six"), "count of readings: expected a number"),
        (lambda: ls.plan_readings(Path("room.run"), 0), "count of readings: expected 1 or more, found 0"),
        (lambda: ls.present_light(Path("room.run"), None), "sources: expected a list of str, found None"),
        (lambda: ls.make_lamp("panel", None, size=0.6), r"center: expected an array of shape \(3,\), found shape \(\)"),
    ],
)
def test_a_value_that_is_none_of_what_was_meant_is_refused_by_its_name(wrong: Callable[[], object], words: str) -> None:
    with pytest.raises(ls.LidarSpectraError, match=words):
        wrong()


def test_a_map_in_place_of_its_numbers_is_refused_with_what_to_take() -> None:
    import xarray as xr

    with pytest.raises(ls.LidarSpectraError, match=r"real map: .* found a Dataset\. Take its \['irradiance'\]"):
        ls.compare_maps(np.ones((2, 3)), xr.Dataset())  # type: ignore[arg-type]


def test_numbers_and_sizes_of_numpy_are_numbers() -> None:
    made = lamp(size=np.array([1.2, 0.3]), luminous_flux_lm=np.float32(3400), rotation_deg=np.int64(90))
    assert made.size == (1.2, 0.3)
    assert luminous_flux_lm(made.flux) == pytest.approx(3400)
    assert len(BOX.grid(height=np.float64(1.0), count=np.int64(9))) == 9
