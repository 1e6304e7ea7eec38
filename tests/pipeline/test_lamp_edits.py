"""An edit of a lamp costs what it changes: name, flux, dimming or a like spectrum make its map again, not its trace."""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from lidarspectra.mapping.maps.map_files import load_map
from lidarspectra.progress import Progress, silent
from lidarspectra.radiance.sampling.transport import load_transport
from lidarspectra.radiance.scene.slots import MAX_OWN_ERROR
from lidarspectra.workflow.pipeline import plan, run
from lidarspectra.workflow.run_folder.light_of_run import light_of_run
from lidarspectra.workflow.run_folder.workspace import STAGES, StageName, StageResult
from lidarspectra.workflow.scenarios.relighting import LampOrder, relight_run
from lidarspectra.workflow.verify import verify_run

pytestmark = pytest.mark.slow
BY_TWO_TRACES = pytest.mark.chance(
    "two traces of one room, seeded by the clock, are held to errors known from eight batches"
)

RoomWriter = Callable[..., Path]
PANEL, BULB = 'lamp "one" !rm', "warm"
CHANNELS = "center_nm,fwhm_nm\n" + "".join(f"{center},20\n" for center in range(420, 701, 40))
SIGMAS = 7.0  # [1] two traces of one point agree within: 72 values and 9, far below one run in a million
ROUND_OFF = 1e-6  # [1] of coefficients in single precision


class Watch:
    """Collects which stages were made, and what was noted."""

    def __init__(self) -> None:
        self.made: list[str] = []
        self.notes: list[str] = []

    def start(self, stage: StageName) -> Progress:
        return silent

    def finish(self, result: StageResult[object]) -> None:
        if not result.was_fresh:
            self.made.append(result.record.stage)
        self.notes += result.record.warnings

    def note(self, words: str) -> None:
        self.notes.append(words)


def make(run_file: Path) -> Watch:
    """Run it up to the map."""
    watch = Watch()
    run(run_file, last="map", listener=watch)
    return watch


@pytest.fixture(scope="module")
def text(room_text: str) -> str:
    """A run file of few channels, and one paint of an edge that a lamp's spectrum matters to."""
    materials = "[materials]\nmethod = 'default'\ndefault = 'cc-orange'\ncoverage = 0.3\n"
    text = room_text.replace("[materials]\ncoverage = 0.5\n", materials)
    return text.replace("[sensors.grid]", "[sensors]\ndevice = 'eight.csv'\n[sensors.grid]")


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory, write_room: RoomWriter, text: str) -> Path:
    """The run file of a run up to the map."""
    run_file = write_room(tmp_path_factory.mktemp("edits") / "room", text)
    (run_file.parent / "eight.csv").write_text(CHANNELS, encoding="utf-8")
    assert make(run_file).made == list(STAGES[:-1])
    return run_file


@pytest.fixture
def edited(finished: Path, tmp_path: Path) -> Callable[..., Path]:
    """(old, new) pairs -> run file of a copy of that run, edited so."""

    def edit(*changes: tuple[str, str]) -> Path:
        if not (tmp_path / "room").exists():
            shutil.copytree(finished.parent, tmp_path / "room")
        run_file = tmp_path / "room" / finished.name
        text = finished.read_text("utf-8")
        for old, new in changes:
            assert text.count(old) == 1, old
            text = text.replace(old, new)
        run_file.write_text(text, encoding="utf-8")
        return run_file

    return edit


def map_of(run_file: Path) -> xr.Dataset:
    return load_map(run_file.with_suffix(".run") / "6-map" / "map.nc")


def irradiance_by_lamp(run_file: Path) -> np.ndarray:
    """(lamp, point, band) as it was traced [W/m²/nm]."""
    transport = load_transport(run_file.with_suffix(".run") / "5-trace" / "transport.nc")
    return np.asarray((transport["coefficient"] * transport["flux"]).transpose("lamp", "point", "band"))


def test_a_lamp_s_name_makes_its_map_again_and_no_number(edited: Callable[..., Path], finished: Path) -> None:
    run_file = edited((f"'{PANEL}'", '"ceiling"'))
    watch = make(run_file)
    assert watch.made == ["map"]
    assert not any("!rm" in note for note in watch.notes)
    for name in ("irradiance", "irradiance_se", "illuminance"):
        np.testing.assert_array_equal(map_of(run_file)[name], map_of(finished)[name])
    folder = run_file.with_suffix(".run")
    assert light_of_run(folder).lamp_names == ("ceiling", BULB)
    off = relight_run(folder, [LampOrder(lamp="ceiling", dim=0.0)])["irradiance"].to_numpy()
    np.testing.assert_allclose(off, irradiance_by_lamp(finished)[1], rtol=ROUND_OFF)


@BY_TWO_TRACES
def test_dimming_makes_the_map_again_as_a_fresh_run_has_it(
    edited: Callable[..., Path], finished: Path, tmp_path: Path, write_room: RoomWriter
) -> None:
    run_file = edited(("luminous_flux_lm = 2000", "luminous_flux_lm = 2000\ndim = 0.25"))
    watch = make(run_file)
    assert watch.made == ["map"]
    assert any("--from scene" in note for note in watch.notes), "the exported model has the lamps as they were"
    panel, bulb = irradiance_by_lamp(finished)
    dimmed = map_of(run_file)
    np.testing.assert_allclose(dimmed["irradiance"], 0.25 * panel + bulb, rtol=ROUND_OFF)

    fresh_file = write_room(tmp_path / "fresh", run_file.read_text("utf-8"))
    shutil.copyfile(finished.parent / "eight.csv", fresh_file.parent / "eight.csv")
    run(fresh_file, last="map")
    fresh = map_of(fresh_file)
    for name in ("irradiance", "illuminance"):
        spread = np.hypot(dimmed[f"{name}_se"].to_numpy(), fresh[f"{name}_se"].to_numpy())
        assert (abs(dimmed[name] - fresh[name]).to_numpy() <= SIGMAS * spread).all(), name
    for name in ("target_relative_se", "bounces", "accuracy"):
        assert dimmed.attrs[name] == fresh.attrs[name]

    light = light_of_run(run_file.with_suffix(".run"))  # and what is computed from a run is of the same light
    np.testing.assert_allclose(light.light.irradiance, dimmed["irradiance"], rtol=ROUND_OFF)
    relit = relight_run(run_file.with_suffix(".run"), [LampOrder(lamp=BULB, dim=0.0)])
    np.testing.assert_allclose(relit["irradiance"], 0.25 * panel, rtol=ROUND_OFF)


def test_an_edit_that_is_taken_back_leaves_the_first_map(edited: Callable[..., Path], finished: Path) -> None:
    run_file = edited(("luminous_flux_lm = 2000", "luminous_flux_lm = 2000\ndim = 0.25"))
    make(run_file)
    assert make(edited()).made == ["map"]
    xr.testing.assert_identical(map_of(run_file), map_of(finished))


def test_a_flux_makes_the_map_again(edited: Callable[..., Path], finished: Path) -> None:
    run_file = edited(("lm = 2000", "lm = 3000"))
    assert make(run_file).made == ["map"]
    panel, bulb = irradiance_by_lamp(finished)
    np.testing.assert_allclose(map_of(run_file)["irradiance"], 1.5 * panel + bulb, rtol=ROUND_OFF)


def test_a_spectrum_that_the_traced_slots_carry_makes_the_map_again_another_the_trace(
    edited: Callable[..., Path],
) -> None:
    run_file = edited(('"LED-B3"', '"LED-B2"'))
    assert make(run_file).made == ["map"]
    assert map_of(run_file).attrs["slot_error"] <= MAX_OWN_ERROR
    (run_file.parent / "laser.csv").write_text("wavelength_nm,W_nm\n564,0\n565,1\n566,0\n", encoding="utf-8")
    watch = make(edited(('"LED-B3"', '"laser.csv"')))
    assert watch.made == ["scene", "trace", "map"]
    assert any("The light is traced again" in note and "has another spectrum" in note for note in watch.notes)
    (run_file.parent / "laser.csv").write_text("wavelength_nm,W_nm\n564,0\n565,2\n566,0\n", encoding="utf-8")
    assert make(run_file).made == ["map"], "the same spectrum, and its lumens are given"
    assert verify_run(run_file.with_suffix(".run")).differences == ()


def test_a_trace_that_is_made_again_is_that_of_the_present_lamps(edited: Callable[..., Path]) -> None:
    run_file = edited(("lm = 2000", "lm = 2000\ndim = 0.25"), ("height = 0.5", "height = 0.6"))
    assert list(plan(run_file).values()) == ["up to date"] * 3 + ["to be made"] * 4
    run_file = edited(("height = 0.5", "height = 0.6"))
    assert list(plan(run_file).values()) == ["up to date"] * 4 + ["to be made"] * 3
    run_file = edited(("lm = 2000", "lm = 2000\ndim = 0.25"))
    assert list(plan(run_file).values()) == ["up to date"] * 5 + ["to be made"] * 2
    assert list(plan(run_file, first="trace").values()) == ["up to date"] * 3 + ["to be made"] * 4


def test_a_lamp_that_is_switched_off_is_no_obstacle_either_and_has_to_be_traced(edited: Callable[..., Path]) -> None:
    off = ("lm = 2000", "lm = 2000\ndim = 0")
    assert list(plan(edited(off)).values()) == ["up to date"] * 3 + ["to be made"] * 4
