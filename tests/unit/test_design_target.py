"""Target files of a design: what is wrong in one is said at once, with its place; the page has every key."""

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
import xarray as xr
from pydantic import BaseModel

from lidarspectra.errors import LidarSpectraError, MapError, RunFileError
from lidarspectra.mapping.design.candidates import candidate_grid
from lidarspectra.mapping.design.conditions import TOLERANCE
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.spectra.spectrum_files import read_spectrum_file, write_spectrum_file
from lidarspectra.workflow.calibration.light import RunRoom
from lidarspectra.workflow.design import target as design_target
from lidarspectra.workflow.design.designed_run_file import DIM_DIGITS, mixtures_of
from lidarspectra.workflow.design.designing import _rounded_up
from lidarspectra.workflow.design.lamps import mixture
from lidarspectra.workflow.design.points import target_points
from lidarspectra.workflow.design.target import TargetSection, read_target

FAULTS = {
    '[[targets]]\nname = "a"\natleast = 3': "did you mean 'at_least'",
    '[[targets]]\nname = "a"': "give at_least, at_most, about, uniformity, spectrum or channels",
    '[[targets]]\nname = "a"\nat_least = -5': "greater than 0",
    '[[targets]]\nname = "a"\nat_least = 500\nat_most = 300': "at_least = 500 is above at_most = 300",
    '[[targets]]\nname = "a"\nat_least = 500\nabout = 300': "about or at_least, not both",
    '[[targets]]\nname = "a"\nuniformity = 1.5': "less than 1",
    '[[targets]]\nname = "a"\nspectrum = "D65"': "give at_least or about too",
    '[[targets]]\nname = "a"\nabout = 3\nchannels = [0, 0]': "all 0",
    '[[targets]]\nname = "a"\nabout = 3\nquantity = "lux"': "none of irradiance_W_m2, illuminance_lx",
    '[[targets]]\nname = "a"\nabout = 3\npoints = [1]\nplaces = [[0, 0, 0]]': "one of points and places",
    '[[targets]]\nname = "a"\nabout = 3\npolygon = [[0, 0], [1, 1]]': "at least 3 values",
    '[[targets]]\nname = "a"\nabout = 3\ndirection = [1, 0, 0]': "direction goes with places",
    '[[targets]]\nname = "a"\nabout = 3\n[[targets]]\nname = "a"\nabout = 4': "two targets have the name 'a'",
    '[[targets]]\nname = "a"\nabout = 3\n[candidates]\nlike = "b"': "give either centers or spacing",
    '[[targets]]\nname = "a"\nabout = 3\n[lamps]\ncount = 0': "greater than or equal to 1",
    '[[targets]]\nname = "a"\nabout = 3\n[lamps]\npresent_spectra = false': "to choose from",
    '[[targets]]\nname = "a"\nabout = 3\n[[spectra]]\nspectrum = "A"\n[[spectra]]\nspectrum = "A"': "given twice",
    "targets = []": "one or more",
    "[[targets]": "valid TOML",
}


@pytest.mark.parametrize(("text", "words"), FAULTS.items(), ids=range(len(FAULTS)))
def test_a_fault_is_said_with_the_file_and_what_to_do(text: str, words: str, tmp_path: Path) -> None:
    file = tmp_path / "target.toml"
    file.write_text(text, encoding="utf-8-sig")  # as editors of Windows save it
    with pytest.raises(RunFileError, match=re.escape(words)) as caught:
        read_target(file)
    assert "target.toml" in str(caught.value)
    assert caught.value.todo


def test_a_missing_file_is_an_error_and_tables_from_python_are_checked_alike(tmp_path: Path) -> None:
    with pytest.raises(RunFileError, match="readable target file"):
        read_target(tmp_path / "absent.toml")
    target, where, _ = read_target({"targets": [{"name": "desks", "at_least": 500}]})
    assert target.targets[0].quantity == "illuminance_lx"
    assert where == "target"
    with pytest.raises(RunFileError, match="unknown key"):
        read_target({"target": []})


def test_every_key_is_on_the_page_and_every_key_on_the_page_exists(project: Path) -> None:
    page = (project / "docs" / "howto-design.md").read_text(encoding="utf-8")
    sections: dict[str, type[BaseModel]] = {
        "### `[[targets]]`": design_target.TargetSection,
        "### `[lamps]`": design_target.LampsToDesignSection,
        "### `[[spectra]]`": design_target.LibrarySection,
        "### `[candidates]`": design_target.CandidatesSection,
    }
    starts = {heading: page.index("\n" + heading) for heading in sections}
    ends = [*sorted(starts.values()), page.index("\n## ", max(starts.values()))]
    for heading, section in sections.items():
        part = page[starts[heading] : ends[ends.index(starts[heading]) + 1]]
        rows = [line.split("|")[1] for line in part.splitlines() if line.startswith("| `")]
        assert {key for row in rows for key in re.findall(r"`(\w+)`", row)} == set(section.model_fields), heading


def test_a_grid_of_candidates_keeps_its_distance_from_the_walls_of_a_turned_room() -> None:
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    shape_of_l = np.array([[0, 0], [4, 0], [4, 2], [2, 2], [2, 3], [0, 3]], dtype=float)
    places = candidate_grid(shape_of_l @ turn.T, np.degrees(0.3), spacing=1.0, margin=0.5)
    back = places @ turn
    assert {tuple(place) for place in back.round(6)} == {
        (0.5, 0.5), (1.5, 0.5), (2.5, 0.5), (3.5, 0.5), (0.5, 1.5), (1.5, 1.5), (2.5, 1.5), (3.5, 1.5), (0.5, 2.5),
        (1.5, 2.5),
    }  # fmt: skip
    with pytest.raises(MapError, match="smaller margin"):
        candidate_grid(shape_of_l, 0.0, spacing=1.0, margin=1.8)


def test_a_mixture_is_the_sum_of_its_parts_and_comes_back_from_its_file(tmp_path: Path) -> None:
    first = Spectrum(wavelengths_nm=[400.0, 500.0], values=[1.0, 1.0])  # ends above 0
    second = Spectrum(wavelengths_nm=[450.0, 550.0, 650.0], values=[0.0, 2.0, 0.0])
    both = mixture([(first, 0.5), (second, 0.25), (first, 0.0)])
    assert both.integral() == pytest.approx(0.5 * 100.0 + 0.25 * 200.0, rel=1e-4)
    read = read_spectrum_file(write_spectrum_file(tmp_path / "mixture.csv", both))
    assert read.absolute
    assert read.spectrum.at([420.0, 480.0, 600.0], outside="zero") == pytest.approx(
        both.at([420.0, 480.0, 600.0], outside="zero")
    )


def test_a_mixture_s_file_is_named_for_its_content_so_that_a_later_design_overwrites_no_other() -> None:
    room: Any = SimpleNamespace(run_file=SimpleNamespace(calibration=None))

    def lit(name: str, *shares: float) -> Any:
        parts = [(Spectrum(wavelengths_nm=[400.0, 700.0], values=[1.0, 2.0 + n]), dim) for n, dim in enumerate(shares)]
        return SimpleNamespace(of=SimpleNamespace(lamp=SimpleNamespace(name=name)), shares=parts, flux=mixture(parts))

    evening = mixtures_of([lit("a", 0.5, 0.2), lit("b", 0.5, 0.2), lit("c", 0.7)], room)
    day = mixtures_of([lit("a", 0.2, 0.5)], room)
    assert evening.keys() == {"a", "b"}
    assert evening["a"][0] == evening["b"][0] == mixtures_of([lit("z", 0.5, 0.2)], room)["z"][0]
    assert day["a"][0] != evening["a"][0]
    assert re.fullmatch(r"mixture-[0-9a-f]{8}\.csv", day["a"][0])


def test_the_first_point_of_a_run_is_1_as_everywhere_else() -> None:
    places = xr.Dataset({"x": ("point", [0.0, 1.0, 2.0]), "y": ("point", np.zeros(3)), "buried": ("point", [0, 0, 0])})
    target = TargetSection.model_validate({"name": "a", "at_least": 1, "points": [1, 3]})
    (points,), own = target_points((target,), cast(RunRoom, None), places, where="target.toml")
    assert points.index.tolist() == [0, 2]
    assert own is None
    for number in (0, 4):
        wrong = target.model_copy(update={"points": (number,)})
        with pytest.raises(LidarSpectraError, match=f"number from 1 to 3, found {number}"):
            target_points((wrong,), cast(RunRoom, None), places, where="target.toml")


def test_dims_are_rounded_up_by_less_than_a_target_may_be_missed_by() -> None:
    dims = np.array([1.0, 0.99999999, 0.054211, 2.3e-4, 1.00001e-3, 3e-9, 0.0])
    written = _rounded_up(dims)
    lit = dims > 1e-7
    assert (written[lit] >= dims[lit] * (1.0 - 1e-6)).all()
    assert (written[lit] <= dims[lit] * (1.0 + TOLERANCE)).all()
    assert written[~lit].tolist() == [0.0, 0.0]
    assert round(float(written[2]), DIM_DIGITS) == 0.05422
