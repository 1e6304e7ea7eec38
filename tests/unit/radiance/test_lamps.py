"""The run file's lamps become lamps with absolute spectra."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lidarspectra.config import LampSection
from lidarspectra.errors import ArgumentError, ArrayError, DatabaseError, LampError
from lidarspectra.lamps.lamp_spectra import cct_spectrum, luminous_flux_lm
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.make_lamp import lamps_from_lit, make_lamp
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps

HERE = Path()


def section(**settings: object) -> LampSection:
    fields = {"name": "one", "shape": "panel", "center": (0, 0, 2.5), "size": (0.6, 0.6), "spectrum": "LED-B3"}
    return LampSection(**{key: value for key, value in (fields | settings).items() if value is not None})


def only(**settings: object) -> Lamp:
    (lamp,) = resolve_lamps([section(**settings)], HERE)
    return lamp


def test_lumens_come_out_as_they_went_in() -> None:
    assert luminous_flux_lm(only(luminous_flux_lm=3400.0).flux) == pytest.approx(3400.0)


def test_watts_come_out_as_they_went_in() -> None:
    assert only(radiant_flux_W=12.0).flux.integral() == pytest.approx(12.0)


def test_dimming_scales_and_zero_switches_off() -> None:
    assert only(radiant_flux_W=12.0, dim=0.25).flux.integral() == pytest.approx(3.0)
    assert resolve_lamps([section(radiant_flux_W=12.0, dim=0.0)], HERE) == ()


def test_an_absolute_spectrum_is_taken_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "lamp.csv").write_text("wavelength_nm,flux W/nm\n400,0.1\n500,0.3\n600,0.2\n", encoding="utf-8")
    (lamp,) = resolve_lamps([section(spectrum="lamp.csv")], tmp_path)
    np.testing.assert_array_equal(lamp.flux.values, [0.1, 0.3, 0.2])


def test_a_relative_spectrum_without_flux_is_refused() -> None:
    with pytest.raises(LampError, match="lumens"):
        only()


def test_an_unknown_spectrum_is_refused() -> None:
    with pytest.raises(DatabaseError):
        only(spectrum="no such lamp", radiant_flux_W=1.0)


def test_lumens_of_a_lamp_that_no_eye_sees_are_refused(tmp_path: Path) -> None:
    (tmp_path / "heat.csv").write_text("wavelength_nm,value\n900,1\n1000,1\n", encoding="utf-8")
    with pytest.raises(LampError, match="lumens"):
        resolve_lamps([section(spectrum="heat.csv", luminous_flux_lm=10.0)], tmp_path)


@pytest.mark.parametrize("shape", ["panel", "strip", "disc", "window"])
def test_an_area_lamp_must_say_its_size(shape: str) -> None:
    with pytest.raises(LampError, match="size"):
        only(shape=shape, size=None, radiant_flux_W=1.0)


@pytest.mark.parametrize("shape", ["bulb", "point"])
def test_small_lamps_have_a_common_size(shape: str) -> None:
    assert len(only(shape=shape, size=None, radiant_flux_W=1.0).size) == 1


def test_one_number_is_a_square_panel() -> None:
    assert only(size=0.6, radiant_flux_W=1.0).size == (0.6, 0.6)


@pytest.mark.parametrize(("shape", "size"), [("strip", 1.2), ("disc", (0.2, 0.2)), ("bulb", (0.1, 0.1))])
def test_a_size_that_does_not_fit_the_shape_is_refused(shape: str, size: object) -> None:
    with pytest.raises(LampError, match="size"):
        only(shape=shape, size=size, radiant_flux_W=1.0)


def test_lit_lamps_send_the_stated_exitance_times_their_area() -> None:
    flat = only(shape="disc", size=0.4, radiant_flux_W=1.0)  # any lamp has the outline that is asked for
    (lamp,) = lamps_from_lit([flat], cct_spectrum(4000), luminous_exitance_lm_m2=8000)
    assert luminous_flux_lm(lamp.flux) == pytest.approx(8000 * np.pi * 0.04)
    assert lamp.name == "lit 1"


def test_no_lit_lamp_is_an_error_that_says_what_to_do() -> None:
    with pytest.raises(LampError, match=r"\[\[lamps\]\]"):
        lamps_from_lit([], cct_spectrum(4000))


def test_a_lamp_of_plain_values_is_the_run_files() -> None:
    plain = make_lamp("panel", (0, 0, 2.5), name="one", size=(0.6, 0.6), spectrum="LED-B3", luminous_flux_lm=3400.0)
    written = only(luminous_flux_lm=3400.0)
    np.testing.assert_array_equal(plain.flux.values, written.flux.values)
    assert (plain.name, plain.shape, plain.size) == (written.name, written.shape, written.size)


def test_a_spectrum_of_ones_own_is_in_watts_unless_a_flux_is_given() -> None:
    own = Spectrum(wavelengths_nm=[400.0, 700.0], values=[0.01, 0.03])
    assert make_lamp("point", (0, 0, 2), spectrum=own).flux.integral() == pytest.approx(6.0)
    assert make_lamp("point", (0, 0, 2), spectrum=own, radiant_flux_W=1.0).flux.integral() == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "either spectrum or cct_k, found neither"),
        ({"spectrum": "A", "cct_k": 3000.0}, "either spectrum or cct_k, found both"),
        ({"spectrum": "A", "luminous_flux_lm": 1.0, "radiant_flux_W": 1.0}, "found both"),
        ({"spectrum": "A", "luminous_flux_lm": -1.0}, "above 0"),
        ({"spectrum": "A", "luminous_flux_lm": 1.0, "beam_angle_deg": 30.0}, "with shape 'spot'"),
        ({"spectrum": "A", "luminous_flux_lm": 1.0, "file": "a.ies"}, "with shape 'ies'"),
    ],
)
def test_a_lamp_that_contradicts_itself_is_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(LampError, match=words):
        make_lamp("bulb", (0, 0, 2), **given)


def test_a_wrong_shape_or_spectrum_is_told() -> None:
    with pytest.raises(ArgumentError, match=r"shape of a lamp: expected one of 'panel', .*, found a str, 'pannel'"):
        make_lamp("pannel", (0, 0, 2), spectrum="A", luminous_flux_lm=1.0)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="a Spectrum, a name of the databases, or a file"):
        make_lamp("bulb", (0, 0, 2), spectrum=5)  # type: ignore[arg-type]
    with pytest.raises(ArrayError, match=r"lamp 'lamp' center: expected an array of shape \(3,\)"):
        make_lamp("bulb", (0, 0), spectrum="A", luminous_flux_lm=1.0)
