"""What was guessed is said: in one note, in the map's attribute, and in all that is made of the map."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import lidarspectra as ls
from lidarspectra.config import RunFile
from lidarspectra.geometry.scan import ScanRecord
from lidarspectra.mapping.calibration.model import GUESSED_ALIKE
from lidarspectra.mapping.maps.assumptions import Assumptions, assumptions_of, mark_assumed
from lidarspectra.mapping.maps.light_unknowns import ALL_CAUSES, CAUSES, OF_CAUSE
from lidarspectra.mapping.maps.map_files import load_map, map_table, read_map_table, save_map, save_map_table
from lidarspectra.mapping.maps.spectral_map import spectral_map
from lidarspectra.material.estimate import one_material
from lidarspectra.room.room import Room
from lidarspectra.spectra.spectrum import gaussian_bands
from lidarspectra.workflow.calibration.unknowns_of_run import priors_of_room
from lidarspectra.workflow.run_folder.assumed import (
    assumed_lamps,
    assumed_of_scan,
    lamp_notes,
    lit_notes,
    notes_of_light,
    result_notes,
    scan_notes,
)
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps

SCAN = {"file": "room.glb"}


def run_file(lamps: list[Any], **tables: Any) -> RunFile:
    """With lamps 'panel 1', ... of which some are assumed."""
    rows = [
        {
            "name": f"panel {number}",
            "shape": "panel",
            "center": [number, 1, 2],
            "size": [0.6, 0.6],
            "spectrum": "LED-B3",
            "luminous_flux_lm": 3600,
            "assumed": assumed,
        }
        for number, assumed in enumerate(lamps, start=1)
    ]
    return RunFile.model_validate({"scan": SCAN, "lamps": rows, **tables})


def record(unit_confidence: float = 1.0, up_confidence: float = 1.0, closed_m2: float = 0.0) -> ScanRecord:
    return ScanRecord(
        file="room.glb",
        unit="cm",
        unit_confidence=unit_confidence,
        up_axis="+y",
        up_confidence=up_confidence,
        faces_read=12,
        faces_kept=12,
        closed_area_m2=closed_m2,
    )


def room(ceiling_confidence: float = 0.9) -> Room:
    return Room(
        floor_z=0.0,
        ceiling_z=2.5,
        floor_area_m2=12.0,
        ceiling_area_m2=12.0,
        floor_confidence=1.0,
        ceiling_confidence=ceiling_confidence,
        wall_angle_deg=0.0,
        wall_confidence=1.0,
        walls=(),
        outline=np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]]),
    )


def test_lamps_marked_in_the_run_file_are_named_in_one_note_with_what_to_do() -> None:
    names = [f"panel {number}" for number in range(1, 10)]
    assumed = assumed_lamps(run_file([True] * 9), names)
    assert assumed == Assumptions(lamps=tuple(names))
    (note,) = lamp_notes(assumed, 9)
    assert note.startswith("Flux and spectrum of all 9 lamps ('panel 1', 'panel 2'")
    assert "'panel 6' and 3 more" in note
    assert "take it out of 'assumed'" in note
    (note,) = lamp_notes(assumed_lamps(run_file([False, True]), ["panel 1", "panel 2"]), 2)
    assert note.startswith("Flux and spectrum of 1 of 2 lamps ('panel 2') are guesses")
    assert lamp_notes(assumed_lamps(run_file([False, False]), ["panel 1", "panel 2"]), 2) == ()


def test_lamps_found_in_the_scan_have_an_assumed_flux_until_it_is_given() -> None:
    found = {"spectrum": "LED-B3"}
    table = RunFile.model_validate({"scan": SCAN, "lamps_from_scan": found})
    assumed = assumed_lamps(table, ["lit 1", "lit 2"])
    assert assumed == Assumptions(fluxes=("lit 1", "lit 2"))
    assert assumed.of_lamp("lit 1") == "flux"
    (note,) = lit_notes(assumed, 2)
    assert "10,000 lm for each m²" in note
    assert "luminous_exitance_lm_m2" in note
    given = RunFile.model_validate({"scan": SCAN, "lamps_from_scan": {**found, "luminous_exitance_lm_m2": 10000}})
    assert not assumed_lamps(given, ["lit 1", "lit 2"])


def test_windows_and_sun_are_not_guesses_of_lamps_in_the_scan() -> None:
    window = {"name": "south", "center": [0, 0, 1], "size": [1, 1], "normal": [1, 0, 0]}
    daylight = {"latitude_deg": 48, "longitude_deg": 9, "time": "2026-06-21T12:00:00+02:00", "windows": [window]}
    table = RunFile.model_validate({"scan": SCAN, "lamps_from_scan": {"cct_k": 3000}, "daylight": daylight})
    assert assumed_lamps(table, ["lit 1", "south", "sun"]).all_lamps == ("lit 1",)


def test_an_assumption_changes_no_light(tmp_path: Path) -> None:
    marked, plain = (resolve_lamps(run_file([assumed]).lamps, tmp_path)[0] for assumed in (True, False))
    np.testing.assert_array_equal(marked.flux.values, plain.flux.values)


@pytest.mark.parametrize(
    ("marked", "pane_marked", "sure", "ceiling", "expected"),
    [
        ((), None, (1.0, 1.0), 0.9, ()),
        (("up", "unit"), None, (1.0, 1.0), 0.9, ("unit", "up")),
        ((), False, (0.94, 1.0), 0.9, ("unit",)),
        (("unit",), True, (1.0, 0.72), 0.1, ("unit", "up", "ceiling", "panes")),
    ],
)
def test_unit_axis_ceiling_and_panes_are_assumed_where_nobody_is_sure(
    marked: tuple[str, ...],
    pane_marked: bool | None,
    sure: tuple[float, float],
    ceiling: float,
    expected: tuple[str, ...],
) -> None:
    pane = {"name": "a", "kind": "glass", "center": [0, 0, 1], "size": [1, 1], "normal": [1, 0, 0]}
    panes = [] if pane_marked is None else [pane | {"assumed": pane_marked}]
    table = RunFile.model_validate(
        {"scan": SCAN | {"assumed": list(marked)}, "panes": panes, "lamps_from_scan": {"cct_k": 3000}}
    )
    assert assumed_of_scan(table, record(*sure), room(ceiling)) == expected


@pytest.mark.parametrize(
    ("ceiling", "closed_m2", "is_assumed"), [(0.7, 0.0, False), (0.7, 5.0, True), (0.9, 5.0, False)]
)
def test_a_ceiling_of_which_a_part_was_closed_is_assumed(ceiling: float, closed_m2: float, is_assumed: bool) -> None:
    assumed = assumed_of_scan(run_file([]), record(closed_m2=closed_m2), room(ceiling))
    assert assumed == (("ceiling",) if is_assumed else ())


def test_a_guessed_unit_is_a_note_of_the_scan() -> None:
    scan = RunFile.model_validate({"scan": {**SCAN, "unit": "cm", "up": "+z", "assumed": ["unit", "up"]}}).scan
    (note,) = scan_notes(scan)
    assert note.startswith('unit = "cm" and up = "+z" under [scan] are guesses')
    assert "delete 'assumed'" in note
    assert scan_notes(RunFile.model_validate({"scan": SCAN}).scan) == ()
    # What is detected anew at each run says itself how sure it is.
    assert scan_notes(RunFile.model_validate({"scan": {**SCAN, "assumed": ["unit"]}}).scan) == ()


@pytest.mark.parametrize(
    "assumed",
    [
        Assumptions(),
        Assumptions(lamps=("panel 1", "Büro \"2\", 'links'"), scan=("unit", "ceiling")),
        Assumptions(fluxes=("lit 1",)),
        Assumptions(lamps=("a",), fluxes=("b",), spectra=("c", "d"), places=("a", "e"), scan=("floor",)),
    ],
)
def test_a_map_carries_what_it_assumes_through_its_file(make_map: Any, tmp_path: Path, assumed: Assumptions) -> None:
    marked = mark_assumed(make_map, assumed)
    assert assumptions_of(marked) == assumed
    assert assumptions_of(load_map(save_map(marked, tmp_path / "map.nc"))) == assumed


def test_a_map_that_says_nothing_assumes_nothing(make_map: Any) -> None:
    assert not assumptions_of(make_map)
    for odd in ("no JSON", "[]", '{"scan": 3, "flux": [1]}', 4):
        assert not assumptions_of(make_map.assign_attrs(assumed=odd))
    assert result_notes(Assumptions()) == ()


def test_what_is_computed_from_guesses_says_so() -> None:
    assumed = Assumptions(lamps=("panel 1", "panel 2"), scan=("unit",))
    assert assumed.in_words() == "flux and spectrum of 2 lamps, the scan's unit"
    (note,) = result_notes(assumed)
    assert assumed.in_words() in note
    assert assumed.without(fluxes=["panel 1"], spectra=["panel 1"]).lamps == ("panel 2",)
    given = assumed.without(fluxes=["panel 1", "none"], spectra=["panel 2"])
    assert given == Assumptions(fluxes=("panel 2",), spectra=("panel 1",), scan=("unit",))
    assert given.of_flux == ("panel 2",)
    assert (given.of_lamp("panel 1"), given.of_lamp("none")) == ("spectrum", "")


def test_what_is_computed_from_a_map_says_how_well_its_light_is_known(make_map: Any, tmp_path: Path) -> None:
    assert notes_of_light(make_map) == ()  # a map of an earlier version states nothing
    causes = {f"{OF_CAUSE}{cause}": 0.0 for cause in CAUSES} | {ALL_CAUSES: 0.134, f"{OF_CAUSE}lamps": 0.13}
    stated = make_map.assign_attrs(causes)
    (known,) = notes_of_light(stated)
    assert "known to ± 13 % at a point (lamps 13 %), one standard uncertainty" in known
    known, guesses = notes_of_light(mark_assumed(stated, Assumptions(lamps=("panel 1",))))
    assert "rest on guesses" in guesses
    assert notes_of_light(tmp_path) == ()  # no run with a map


def test_flux_and_spectrum_of_a_lamp_are_assumed_apart() -> None:
    lamps: list[Any] = [["flux"], ["spectrum"], ["flux", "spectrum"], True, False, []]
    names = [f"panel {number}" for number in range(1, 7)]
    assumed = assumed_lamps(run_file(lamps), names)
    assert assumed == Assumptions(lamps=("panel 3", "panel 4"), fluxes=("panel 1",), spectra=("panel 2",))
    both, flux, spectrum = lamp_notes(assumed, 6)
    assert both.startswith("Flux and spectrum of 2 of 6 lamps ('panel 3', 'panel 4') are guesses")
    assert flux.startswith("The flux of 1 of 6 lamps ('panel 1') is a guess: the map scales with it")
    assert spectrum.startswith("The spectrum of 1 of 6 lamps ('panel 2') is a guess: the map takes its colours from it")
    assert assumed.in_words() == "flux and spectrum of 2 lamps, flux of 1 lamp, spectrum of 1 lamp"
    with pytest.raises(ValueError, match="assumed"):
        run_file([["size"]])


def test_a_flux_that_readings_determined_is_assumed_no_longer() -> None:
    calibration = {"lamps": {"panel 1": 1.2, "panel 2": 1.0}, "determined": ["panel 1"]}
    names = ["panel 1", "panel 2"]
    assumed = assumed_lamps(run_file([True, True], calibration=calibration), names)
    assert assumed == Assumptions(lamps=("panel 2",), spectra=("panel 1",))
    found = {"scan": SCAN, "lamps_from_scan": {"cct_k": 3000}, "calibration": calibration}
    assert assumed_lamps(RunFile.model_validate(found), names) == Assumptions(fluxes=("panel 2",))


def test_the_table_of_a_map_says_in_a_column_what_it_assumes(make_map: Any, tmp_path: Path) -> None:
    assert "assumed" not in map_table(make_map)
    marked = mark_assumed(make_map, Assumptions(lamps=("panel 1",), scan=("ceiling",)))
    table = pd.read_csv(save_map_table(marked, tmp_path / "map.csv"))
    assert table["assumed"].tolist() == ["flux and spectrum of 1 lamp; the ceiling"] * 2
    assert [name for name in table.columns if not pd.api.types.is_numeric_dtype(table[name])] == ["assumed"]
    bands = gaussian_bands("one", [560.0], 20.0)
    assert read_map_table(tmp_path / "map.csv", bands=bands).sizes["point"] == 2


@pytest.fixture
def make_map() -> Any:
    """A small map of one lamp."""
    import xarray as xr

    shape = ("lamp", "point", "band")
    point = {name: ("point", np.zeros(2)) for name in ("x", "y", "z", "nx", "ny")}
    transport = xr.Dataset(
        {
            "coefficient": (shape, np.ones((1, 2, 1))),
            "coefficient_se": (shape, np.zeros((1, 2, 1))),
            "flux": (("lamp", "band"), np.ones((1, 1))),
        },
        coords={
            "lamp": ["panel 1"],
            **point,
            "nz": ("point", np.ones(2)),
            "buried": ("point", np.zeros(2, dtype=bool)),
            "band": ("band", [560.0], {"units": "nm"}),
            "band_width": ("band", [20.0], {"units": "nm"}),
            "band_label": ("band", ["560"]),
        },
    )
    return spectral_map(transport)


def test_lamps_in_place_of_the_room_s_own_are_said_to_be_so_and_their_light_is_known_worst() -> None:
    both = run_file([["flux", "spectrum", "place"]] * 2 + [["flux"], ["place"], False])
    names = [lamp.name for lamp in both.lamps]
    assumed = assumed_lamps(both, names)
    assert assumed.places == ("panel 1", "panel 2", "panel 4")
    assert assumed.lamps == ("panel 1", "panel 2")
    assert assumed.all_lamps == ("panel 1", "panel 2", "panel 3", "panel 4")
    assert assumed.in_words() == "flux and spectrum of 2 lamps, flux of 1 lamp, place of 3 lamps"
    assert lamp_notes(assumed, 5)[-1].startswith("Nothing in the scan tells 3 of 5 lamps ('panel 1'")
    assert assumed.without(fluxes=names, spectra=names) == Assumptions(places=assumed.places)
    materials = one_material(ls.RoomModel.from_box(4.0, 3.0, 2.5).scan)
    part, areas = np.zeros(len(materials.face_material), dtype=np.int64), np.ones(len(materials.face_material))
    priors = priors_of_room(both, names, materials, part, areas)
    assert priors.flux_sd == pytest.approx([0.9, 0.9, 0.4, 0.9, 0.15])
    assert priors.flux_correlation[0, 3] == pytest.approx(GUESSED_ALIKE)  # of one rule, whatever lumens they were given
    told = both.changed(calibration={"determined": ["panel 4"]})
    assert priors_of_room(told, names, materials, part, areas).flux_sd[3] == pytest.approx(0.15)
