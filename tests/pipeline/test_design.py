"""`lidarspectra design`: by command and from Python, against exhaustive search and against the trace anew."""

import itertools
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import lidarspectra as ls
from lidarspectra.mapping.design.problem import Freedom, Problem, Sources, level_limit, uniformity_limit
from lidarspectra.mapping.design.solving import solve
from lidarspectra.workflow.design.designed_run_file import designed_run_file
from tests.pipeline.conftest import CommandLine, RoomWriter

pytestmark = pytest.mark.slow

DESK = [[0.2, 0.2], [1.4, 0.2], [1.4, 1.2], [0.2, 1.2]]
DIMMING = f"""
[lamps]
efficacy_lm_W = 100
[lamps.power_W]
warm = 60
[[targets]]
name = "desk"
polygon = {DESK}
at_least = 120
"""


@pytest.fixture(scope="module")
def run(write_room: RoomWriter, room_text: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A finished run of the small room; its materials are given, since views of it take a minute."""
    given = room_text.replace("coverage = 0.5", 'method = "default"')
    run_file = write_room(tmp_path_factory.mktemp("design") / "room", given)
    return ls.run(run_file, last="map").folder


def test_the_command_dims_the_lamps_and_its_run_file_gives_that_light(
    run: Path, command_line: CommandLine, tmp_path: Path
) -> None:
    file = tmp_path / "target.toml"
    file.write_text(DIMMING, encoding="utf-8")
    answer = command_line("design", run, "--target", file, "--force")
    assert answer.status == 0, answer.stderr
    table = pd.read_csv(run / "design" / "design.csv").set_index("lamp")
    # The panel gives four times the lumens a watt, so the bulb is off.
    assert table.loc["warm", "dim [1]"] == 0
    assert 0 < table.loc['lamp "one" !rm', "dim [1]"] < 1
    asked = pd.read_csv(run / "design" / "targets.csv")
    assert asked["predicted"][0] == pytest.approx(120.0, rel=1e-3)
    assert asked["met"][0] == "yes"
    assert (run / "design" / "before-after.png").is_file()
    refused = command_line("design", run, "--target", file)
    assert refused.status == 1  # it would overwrite the run file
    assert "your edits" in refused.words
    wanted = f"{0.95 * asked['before'][0]:.1f}"  # more than the panel alone can give
    both = tmp_path / "both.toml"
    both.write_text(DIMMING.replace("120", wanted) + "at_most = 900\nuniformity = 0.4\n", encoding="utf-8")
    answer = command_line("design", run, "--target", both, "--force")
    assert answer.status == 0, answer.stdout
    again = command_line("map", run.parent / "room.designed.toml")
    assert again.status == 0, again.stderr
    kept = re.findall(r"^\d (\w+) +kept", again.stdout, re.MULTILINE)
    assert kept == ["scan", "views", "materials", "scene", "trace"]  # only dimming changed
    predicted = pd.read_csv(run / "design" / "targets.csv").set_index("wanted")["predicted"]
    light = pd.read_csv(run.parent / "room.designed.run" / "6-map" / "map.csv")
    desk = light[light["x"].between(0.2, 1.4) & light["y"].between(0.2, 1.2)]["illuminance_lx"]
    assert desk.min() == pytest.approx(predicted[f"≥ {float(wanted):g} lx"], rel=1e-4)
    assert desk.max() == pytest.approx(predicted["≤ 900 lx"], rel=1e-4)
    assert desk.min() / desk.mean() == pytest.approx(predicted["U0 ≥ 0.4"], rel=1e-4)


@pytest.mark.chance("two traces agree within their noise")
def test_candidates_and_places_of_ones_own_come_true_in_a_trace_anew(run: Path) -> None:
    design = ls.design_lighting(
        run,
        {
            "targets": [
                {"name": "desk", "polygon": DESK, "at_least": 100, "of": "mean"},
                {
                    "name": "eye",
                    "quantity": "melanopic_edi_lx",
                    "places": [[1.2, 1.0, 1.2]],
                    "direction": [-1, 0, 0],
                    "at_least": 40,
                },
            ],
            "lamps": {"count": 1},
            "candidates": {"centers": [[0.4, 1.0, 2.3], [1.2, 0.4, 2.3], [2.0, 1.6, 2.3]]},
            "spectra": [{"spectrum": "LED-B5"}],
        },
    )
    assert design.is_met
    assert design.lamps.frame["state"].value_counts().to_dict() == {"off": 2, "removed": 2, "lit": 1}
    check = ls.check_design(design).frame
    assert np.abs(check["off [SE]"]).max() < 4.5
    assert any("assumed" in note for note in design.notes)
    assert any("The light is known to ±" in note for note in design.notes)  # no prediction is as sure as its noise
    run_file, _ = ls.save_design(design, run, force=True)
    written = {lamp.name: lamp for lamp in ls.read_run_file(run_file).lamps}
    assert [lamp.dim for name, lamp in written.items() if not name.startswith("candidate")] == [0.0, 0.0]
    chosen = [lamp for name, lamp in written.items() if name.startswith("candidate")]
    assert len(chosen) == 1
    assert chosen[0].dim_in_scan == 0  # the scan was photographed without it
    assert not ls.check(run_file).faults


def test_a_new_spectrum_leaves_the_lamp_that_the_scan_was_photographed_under(run: Path) -> None:
    work = ls.design_lighting(
        run,
        {
            "targets": [{"name": "desk", "polygon": DESK, "at_least": 100}],
            "spectra": [{"spectrum": "LED-B5"}],
            "lamps": {"present_spectra": False, "fixed": ["warm"]},
        },
    ).work
    by_colors = work.room.run_file.changed(materials={"method": "estimate"})
    room = replace(work.room, run_file=by_colors)
    lamps = designed_run_file(work.designed, work.lamps, room, run=run, base=Path()).lamps
    told = [(lamp.name, lamp.spectrum, lamp.dim_in_scan) for lamp in lamps]
    name = 'lamp "one" !rm'
    assert told == [(f"{name} as scanned", "LED-B3", 1.0), (name, "LED-B5", 0.0), ("warm", "A", 1.0)]
    assert lamps[0].dim == 0
    some = room.base / "some.csv"  # materials of some groups: the others are still read by the scan's light
    some.write_text("group,reflectance\n0,builtin:white-wall\n", encoding="utf-8")
    partly = replace(room, run_file=by_colors.changed(materials={"method": "file", "file": some.name}))
    assert designed_run_file(work.designed, work.lamps, partly, run=run, base=Path()).lamps == lamps
    some.write_text("group,reflectance\n*,builtin:white-wall\n", encoding="utf-8")
    assert len(designed_run_file(work.designed, work.lamps, partly, run=run, base=Path()).lamps) == 2
    given = designed_run_file(work.designed, work.lamps, work.room, run=run, base=Path()).lamps
    assert [lamp.name for lamp in given] == [name, "warm"]  # given materials know no light of the scan


def test_a_new_lamp_that_the_eye_does_not_see_is_written_with_its_watts(run: Path) -> None:
    work = ls.design_lighting(run, {"targets": [{"name": "desk", "polygon": DESK, "at_least": 100}]}).work
    infrared = ls.Spectrum(wavelengths_nm=np.array([840.0, 850.0, 860.0]), values=np.array([0.0, 0.25, 0.0]))
    panel = work.designed[0]
    section = panel.of.section.model_copy(
        update={"spectrum": "850.csv", "luminous_flux_lm": None, "radiant_flux_W": 2.5, "dim": 1.0}
    )
    lamp = replace(panel.of.lamp, name="candidate 1", flux=infrared)
    new = replace(panel, of=replace(panel.of, lamp=lamp, section=section, is_candidate=True))
    written = designed_run_file((*work.designed, new), work.lamps, work.room, run=run, base=Path()).lamps[-1]
    assert (written.name, written.luminous_flux_lm, written.radiant_flux_W) == ("candidate 1", None, 2.5)


def test_what_cannot_be_met_is_said_with_the_flux_that_would_do(
    run: Path, command_line: CommandLine, tmp_path: Path
) -> None:
    file = tmp_path / "target.toml"
    file.write_text(DIMMING.replace("at_least = 120", "at_least = 2000"), encoding="utf-8")
    answer = command_line("design", run, "--target", file, "--force")
    assert answer.status == 1
    factor = re.search(r"flux limits it: ([\d.]+) times", answer.stdout)
    assert factor is not None
    assert "% short" in answer.stdout
    value = pd.read_csv(run / "design" / "targets.csv")["predicted"][0]
    assert float(factor[1]) == pytest.approx(2000.0 / value, abs=0.011)  # both lamps are at full, and light is linear


def test_targets_of_another_room_are_refused(run: Path) -> None:
    def refused(words: str, *, lamps: dict[str, object] | None = None, **target: object) -> None:
        with pytest.raises(ls.LidarSpectraError, match=words):
            ls.design_lighting(run, {"targets": [{"name": "a", "at_least": 10, **target}], "lamps": lamps or {}})

    refused("none of them in it", polygon=[[90, 90], [91, 90], [91, 91]])
    refused("places inside the scan", places=[[0, 0, 9]])
    refused("number from 1 to 9", points=[10])
    refused("number from 1 to 9", points=[0])
    refused("column 'name'", points=["desk"])
    refused("two or more points", points=[1], uniformity=0.5)
    refused("14 channels", channels=[1, 2, 3])
    refused("one of the run's lit lamps", lamps={"fixed": ["chandelier"]})
    refused("none: all are fixed", lamps={"fixed": ['lamp "one" !rm', "warm"]})
    refused("a lamp spectrum of the databases", spectrum="LED-B77")


@pytest.mark.chance("two traces agree within their noise")
def test_in_a_room_of_python_the_choice_is_that_of_a_search_and_the_trace_anew_agrees() -> None:
    model = ls.RoomModel.from_box(4.0, 3.0, 2.6)
    points = model.grid(0.75, spacing=0.5, margin=0.3)
    places = [(x, y, 2.55) for x in (0.8, 2.0, 3.2) for y in (0.8, 2.2)]
    lamps = [
        ls.make_lamp("point", place, name=f"lamp {number}", spectrum="LED-B3", luminous_flux_lm=1500)
        for number, place in enumerate(places)
    ]
    transport = model.trace(lamps, points, accuracy="low", noise="draft", seed=1)
    full = [
        ls.light_of_lamps(
            transport, {lamp.name: lamp.flux for lamp in lamps}, {each.name: 0.0 for each in lamps if each is not lamp}
        )
        for lamp in lamps
    ]
    vision = ls.light_quantity("illuminance_lx").response
    light = np.stack([each.weigh(vision)[0] for each in full], axis=1)
    dark = np.zeros(len(points))

    def problem(chosen: tuple[int, ...], count: int | None) -> Problem:
        some = light[:, chosen]
        return Problem(
            sources=Sources(lamp=range(len(chosen)), spectrum=np.zeros(len(chosen)), watts=np.full(len(chosen), 15.0)),
            limits=(level_limit(some, dark, at_least=60.0), uniformity_limit(some, dark, 0.35)),
            freedom=Freedom(max_lamps=count),
        )

    found = solve(problem(tuple(range(6)), 3))
    searched = [solve(problem(chosen, None)) for chosen in itertools.combinations(range(6), 3)]
    best = min(float(each.dims.sum()) for each in searched if each.is_met)
    assert found.is_met
    assert found.dims.sum() == pytest.approx(best, abs=1e-4)
    lit = [number for number in range(6) if found.dims[number] > 0]
    chosen = [
        ls.make_lamp(
            "point", places[n], name=f"lamp {n}", spectrum="LED-B3", luminous_flux_lm=1500 * float(found.dims[n])
        )
        for n in lit
    ]
    anew = model.light(chosen, points, accuracy="low", noise="draft", seed=2)
    dims = {lamp.name: float(found.dims[number]) for number, lamp in enumerate(lamps)}
    value, error = ls.light_of_lamps(transport, {lamp.name: lamp.flux for lamp in lamps}, dims).weigh(vision)
    off = (anew["illuminance"].to_numpy() - value) / np.hypot(anew["illuminance_se"].to_numpy(), error)
    assert np.sqrt((off**2).mean()) < 2.0  # errors of neighbours go together
