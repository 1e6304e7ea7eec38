"""What the trace says of its own error is true: repeats are independent, coverage is as stated, targets are kept."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
import xarray as xr

from lidarspectra.errors import EngineError
from lidarspectra.radiance.engine.engine import find_engine, float_rows
from lidarspectra.radiance.engine.options import NOISE_LEVELS
from lidarspectra.radiance.sampling import rounds
from lidarspectra.radiance.sampling import trace as trace_module
from lidarspectra.radiance.sampling.arrivals import load_surfaces
from lidarspectra.radiance.sampling.estimator import BATCHES, take_answer
from lidarspectra.radiance.sampling.receptors import cone_receptor, cosine_receptor
from lidarspectra.radiance.sampling.request import Log, Request
from lidarspectra.radiance.sampling.samplers import DIRECT
from lidarspectra.radiance.sampling.sensor_rays import Sensors
from lidarspectra.radiance.sampling.survey import survey
from lidarspectra.radiance.sampling.trace import trace, trace_irradiance
from lidarspectra.radiance.sampling.transport import load_transport, save_transport, standard_error_of_sum
from lidarspectra.radiance.scene.scene import RadianceScene
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.spectrum import Spectrum, sensor_bands

from .conftest import Rooms

BY_ITS_ERROR = pytest.mark.chance(
    "held to a standard error that, known from eight batches, has the long tails of a t of seven degrees"
)

UP = np.array([0.0, 0.0, 1.0])
WHITE = Spectrum(wavelengths_nm=np.array([380.0, 780.0]), values=np.array([1.0, 1.0]))


@pytest.fixture(scope="module")
def office(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., RadianceScene]:
    """A furnished room under two unlike panels, so that there are penumbras, bright and dark points and colour.

    Each of its modes is written once, and nobody may change it; `office(own=folder)` writes another.
    """
    rooms = Rooms(tmp_path_factory.mktemp("office"))
    table = trimesh.creation.box(bounds=[[0.3, 0.4, 0.7], [1.5, 1.1, 0.74]])
    chair = trimesh.creation.box(bounds=[[1.9, 1.8, 0.4], [2.4, 2.3, 0.45]])
    wall = Spectrum(wavelengths_nm=np.array([380.0, 480.0, 620.0, 780.0]), values=np.array([0.2, 0.2, 0.75, 0.75]))
    lamps = [
        rooms.lamp("panel", (0.8, 1.5, 2.9), (0.6, 0.6), name="one"),
        rooms.lamp("panel", (2.2, 1.5, 2.9), (0.6, 0.3), name="two", flux=wall),
    ]

    surfaces = [(rooms.room(3.0), wall), (table, 0.5), (chair, 0.1)]
    made: dict[str, RadianceScene] = {}

    def make(mode: str = "native", *, own: Path | None = None) -> RadianceScene:
        if own is not None:
            return Rooms(own).scene(lamps, surfaces, mode=mode)
        if mode not in made:
            made[mode] = rooms.scene(lamps, surfaces, mode=mode)
        return made[mode]

    return make


@pytest.fixture(scope="module")
def truth(office, places, section) -> xr.Dataset:
    """The office's light to a third of a draft's error: its share in what drafts are off is a twentieth."""
    return trace(office(), places, **section("medium", "standard"), seed=1)


@pytest.fixture(scope="module")
def places(sensors) -> SensorPoints:
    ticks = np.linspace(0.25, 2.75, 6)
    x, y = np.meshgrid(ticks, ticks)
    return sensors(np.stack([x.ravel(), y.ravel(), np.full(36, 0.3)], axis=1), UP)


def irradiance(transport: xr.Dataset) -> np.ndarray:
    return np.einsum("lpb,lb->pb", transport["coefficient"].to_numpy().astype(float), transport["flux"].to_numpy())


def relative_rms(error: np.ndarray, light: np.ndarray) -> float:
    return float((np.sqrt((error**2).mean(axis=0)) / light.mean(axis=0)).max())


@BY_ITS_ERROR
@pytest.mark.slow
def test_two_standard_errors_cover_the_truth_for_95_percent_of_point_channels(office, places, truth, section) -> None:
    scene = office()
    inside = []
    for seed in range(2, 14):
        drafted = trace(scene, places, **section("medium", "draft"), seed=seed)
        error = np.hypot(drafted["irradiance_se"].to_numpy(), truth["irradiance_se"].to_numpy())
        inside.append(np.abs(irradiance(drafted) - irradiance(truth)) < 2.0 * error)
    # Points of a run share paths and err together: 12 runs of some five that do not know a share of 0.95 to within
    # 0.03; five of that below.
    assert np.mean(inside) > 0.80


@BY_ITS_ERROR
@pytest.mark.slow
@pytest.mark.parametrize("noise", ["draft", "standard"])
def test_the_error_is_what_the_noise_setting_names(office, places, section, noise: str) -> None:
    scene = office()
    transport = trace(scene, places, **section("medium", noise), seed=1)
    target = NOISE_LEVELS[noise].relative_se
    light, error = irradiance(transport), transport["irradiance_se"].to_numpy()
    assert transport.attrs["achieved_relative_se"] <= target
    assert transport.attrs["achieved_relative_se"] == pytest.approx(relative_rms(error, light), rel=1e-3)
    # And against a second run: their difference has twice the variance, known from some five points that do not err
    # together: chi-square of 5 is 9 times its mean with a probability of 10^-8.
    again = irradiance(trace(scene, places, **section("medium", noise), seed=2))
    assert relative_rms(light - again, light) < np.sqrt(2.0) * target * 3.0


def test_a_lamp_that_all_but_misses_most_channels_gets_its_rays_all_the_same(rooms, sensors, section) -> None:
    # What a channel of 485 nm gets of 850 nm is 1e-320 W/m²/nm, whose square is 0.
    infrared = Spectrum(wavelengths_nm=np.array([830.0, 850.0, 870.0]), values=np.array([0.0, 1.0, 0.0]))
    lamp = rooms.lamp("panel", (0.5, 0.5, 2.9), (0.3, 0.3), flux=infrared)
    scene = rooms.scene([lamp], [(rooms.room(3.0), 0.6)], bands=sensor_bands("as7265x-18"))
    ticks = np.linspace(0.25, 2.75, 5)
    x, y = np.meshgrid(ticks, ticks)
    floor = sensors(np.stack([x.ravel(), y.ravel(), np.full(25, 0.3)], axis=1), UP)
    transport = trace(scene, floor, **section("medium", "standard"), seed=1)
    assert transport.attrs["achieved_relative_se"] <= 0.01


@BY_ITS_ERROR
def test_batches_are_independent(office, places, truth, section) -> None:
    # The sum over batches has as much variance as independent ones: correlations between the batches' deviations from
    # the truth, averaged over pairs and points, vanish. One point knows it to 0.2 by its 28 pairs; six runs of some
    # five points that do not err together, to 0.04; eight of that. If all batches were the same it would be 1.
    # What the truth is off itself adds its variance over a batch's, an eightieth.
    scene, light = office(), irradiance(truth)
    found = []
    for seed in range(2, 8):
        transport = trace(scene, places, **section("medium", "draft"), seed=seed)
        flux = transport["flux"].to_numpy()
        batches = np.einsum("klpb,lb->kpb", transport["coefficient_batches"].to_numpy().astype(float), flux)
        deviation = (batches - light)[..., 0]
        together = (deviation.sum(axis=0) ** 2 - (deviation**2).sum(axis=0)).sum() / 56.0
        found.append(together / (deviation**2).mean(axis=0).sum())
    assert abs(np.mean(found)) < 0.35


def test_rounds_of_shadow_rays_never_repeat_one_another(rooms, places, monkeypatch: pytest.MonkeyPatch) -> None:
    # Three lamps' light in single precision with a spread of some 0.3 %, 10^4 values each: that all three agree by
    # chance for one of 36 points and one of 276 pairs of batches has a probability of 10^-8.
    lamps = [rooms.lamp("panel", (x, 1.5, 2.9), (0.4, 0.4), name=f"lamp {x}") for x in (0.5, 1.5, 2.5)]
    scene = replace(rooms.scene(lamps, [(rooms.room(3.0), 0.5)]), shining=())  # all light by the engine
    seen = []
    take = take_answer

    def watch(task, run, sensors, **more) -> None:
        if task.component.sampler is DIRECT:
            values = float_rows(run, rows=task.burn + 36 * BATCHES, columns=3 * 3)[task.burn :]
            seen.append(values.reshape(36, BATCHES, 3, 3)[np.argsort(task.points), :, :, 0])
        take(task, run, sensors, **more)

    monkeypatch.setattr(rounds, "take_answer", watch)
    request = Request(
        bounces=2,
        target=0.01,
        workers=2,
        receptor=cosine_receptor(),
        engine=find_engine(),
        surfaces=load_surfaces(scene),
    )
    sensors = Sensors(positions=places.positions, normals=places.normals, receptor=request.receptor)
    log, generator = Log(), np.random.default_rng(1)
    surveyed = survey(scene, sensors, request, generator=generator, log=log)
    assert np.unique(surveyed.truncation, axis=1).shape == surveyed.truncation.shape  # each sensor has its own
    for _ in range(3):
        rounds.first_mean(scene, sensors, request, surveyed, generator=generator, log=log)
    for batches in np.concatenate(seen, axis=1):  # of a point, in all rounds
        assert len({tuple(batch) for batch in batches.tolist()}) == 3 * BATCHES


@BY_ITS_ERROR
@pytest.mark.slow
def test_both_modes_give_the_same_light(office, places, section) -> None:
    native, classic = (
        trace(office(mode=mode), places, **section("medium", "fine"), seed=1) for mode in ("native", "rgb")
    )
    error = np.hypot(native["irradiance_se"].to_numpy(), classic["irradiance_se"].to_numpy())
    difference = irradiance(native) - irradiance(classic)
    assert np.all(np.abs(difference) < 8.0 * error)
    assert np.sqrt(((difference / error) ** 2).mean()) < 3.0  # some five points that do not err together, as above
    assert relative_rms(error, irradiance(native)) < 0.01


@BY_ITS_ERROR
@pytest.mark.slow
def test_relighting_equals_a_new_trace_within_its_error(rooms, sensors, section) -> None:
    lamps = [
        rooms.lamp("panel", (x, 0.5, 0.95), (0.3, 0.3), name=name) for x, name in ((0.25, "left"), (0.75, "right"))
    ]
    dimmed = [
        rooms.lamp("panel", (x, 0.5, 0.95), (0.3, 0.3), name=name, flux=lamps[0].flux.scaled(factor))
        for x, name, factor in ((0.25, "left", 0.2), (0.75, "right", 3.0))
    ]
    ticks = np.linspace(0.1, 0.9, 5)
    x, y = np.meshgrid(ticks, ticks)
    points = sensors(np.stack([x.ravel(), y.ravel(), np.full(25, 0.1)], axis=1), UP)
    surfaces = [(rooms.room(), 0.6)]
    traced = trace(rooms.scene(lamps, surfaces), points, **section("medium", "standard"), seed=1)
    renewed = trace(rooms.scene(dimmed, surfaces), points, **section("medium", "standard"), seed=2)
    flux = renewed["flux"].to_numpy()
    relit = np.einsum("lpb,lb->pb", traced["coefficient"].to_numpy(), flux)
    error = np.hypot(standard_error_of_sum(traced, flux), renewed["irradiance_se"].to_numpy())
    deviation = (relit - irradiance(renewed)) / error
    assert np.abs(deviation).max() < 8.0
    assert np.sqrt((deviation[:, 0] ** 2).mean()) < 3.0  # some five points that do not err together, as above


@BY_ITS_ERROR
def test_errors_of_lamps_that_share_paths_do_not_add_like_independent_ones(office, places, section) -> None:
    transport = trace(office(), places, **section("medium", "draft"), seed=1)
    together = standard_error_of_sum(transport)
    assert together == pytest.approx(transport["irradiance_se"].to_numpy(), rel=1e-4)  # batches in single precision
    flux = transport["flux"].to_numpy()
    alone = np.einsum("lpb,lb->lpb", transport["coefficient_se"].to_numpy(), flux)
    assert np.all(together.mean(axis=0) < alone.sum(axis=0).mean(axis=0))
    without = transport.drop_vars("coefficient_batches")
    assert standard_error_of_sum(without) == pytest.approx(transport["irradiance_se"].to_numpy())
    assert standard_error_of_sum(without, 2.0 * flux) == pytest.approx(2.0 * alone.sum(axis=0), rel=1e-6)


def test_a_transport_survives_its_file(office, places, section, tmp_path) -> None:
    transport = trace(office(), places, **section("low", "draft"), seed=1)
    path = save_transport(transport, tmp_path / "transport.nc")
    xr.testing.assert_identical(load_transport(path), transport)
    assert [entry.name for entry in tmp_path.glob("transport*")] == ["transport.nc"]


@BY_ITS_ERROR
def test_blocks_of_points_give_what_one_block_gives(office, places, section, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = office()
    whole = trace(scene, places, **section("low", "standard"), seed=1)
    monkeypatch.setattr(trace_module, "MAX_BLOCK_POINTS", 10)
    parts = trace(scene, places, **section("low", "standard"), seed=2)
    error = np.hypot(whole["irradiance_se"].to_numpy(), parts["irradiance_se"].to_numpy())
    assert np.all(np.abs(irradiance(whole) - irradiance(parts)) < 8.0 * error)
    assert parts.attrs["achieved_relative_se"] <= parts.attrs["target_relative_se"]


def test_a_block_of_one_round_fills_its_share_of_the_progress_once_one_was_seen(
    office, places, section, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trace_module, "MAX_BLOCK_POINTS", 10)
    monkeypatch.setitem(
        NOISE_LEVELS, "draft", replace(NOISE_LEVELS["draft"], relative_se=0.2)
    )  # one round is surely enough
    told: list[tuple[float, str]] = []
    transport = trace(
        office(), places, **section("low", "draft"), seed=1, progress=lambda share, words: told.append((share, words))
    )
    assert transport.attrs["achieved_relative_se"] <= transport.attrs["target_relative_se"]
    blocks = sum(words == "traced" for _, words in told)
    assert blocks >= 3
    shares = np.array([share for share, _ in told])
    assert np.all(np.diff(shares) >= 0)
    before_end = [told[index - 1][0] * blocks % 1.0 for index, (_, words) in enumerate(told) if words == "traced"]
    assert before_end[0] == pytest.approx(rounds.FIRST_ROUND)
    assert before_end[1:] == pytest.approx([rounds.SECOND_ROUND] * (blocks - 1))


PANEL_CENTER, PANEL_SIZE_M = (0.8, 1.5, 2.9), (0.6, 0.6)
TABLE = trimesh.creation.box(bounds=[[0.3, 0.4, 0.7], [1.5, 1.1, 0.74]])


@pytest.fixture(scope="module")
def under_a_panel(places, section, tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    """A room's light under one panel."""
    rooms = Rooms(tmp_path_factory.mktemp("panel"))
    scene = rooms.scene(
        [rooms.lamp("panel", PANEL_CENTER, PANEL_SIZE_M, flux=WHITE)], [(rooms.room(3.0), 0.6), (TABLE, 0.5)]
    )
    return trace(scene, places, **section("high", "fine"), seed=1)


@BY_ITS_ERROR
@pytest.mark.slow
@pytest.mark.parametrize("noise", ["draft", "standard"])
def test_a_panel_cut_into_24_lamps_gives_the_light_of_the_whole(
    rooms, places, under_a_panel, section, noise: str
) -> None:
    """Six passes add up, each of which may send single rays where one pass alone sends sets of five."""
    size, cuts, reference = np.array(PANEL_SIZE_M), np.array([4, 6]), under_a_panel
    corner = PANEL_CENTER[:2] - 0.5 * size
    parts = [
        rooms.lamp(
            "panel", (*(corner + (np.array(place) + 0.5) * size / cuts), 2.9), tuple(size / cuts), name=f"part {place}",
            flux=WHITE.scaled(1.0 / cuts.prod()),
        )
        for place in np.ndindex(*cuts)
    ]  # fmt: skip
    surfaces = [(rooms.room(3.0), 0.6), (TABLE, 0.5)]
    transport = trace(rooms.scene(parts, surfaces), places, **section("high", noise), seed=2)
    light, error = irradiance(transport), transport["irradiance_se"].to_numpy()
    difference = light - irradiance(reference)
    both = np.hypot(error, reference["irradiance_se"].to_numpy())
    assert transport.attrs["achieved_relative_se"] <= transport.attrs["target_relative_se"]
    assert np.all(np.abs(difference) < 8.0 * both)  # as for blocks: the tails of a t of seven degrees are long
    assert np.mean(np.abs(difference) < 2.0 * both) > 0.7  # 92 to 100 % in sixteen repeats
    assert np.abs(difference.mean(axis=0) / light.mean(axis=0)).max() < 2.0 * NOISE_LEVELS[noise].relative_se


def test_a_target_out_of_reach_is_said(office, places, section, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rounds, "MAX_ROUNDS", 1)
    transport = trace(office(), places, **section("low", "fine"), seed=1)
    assert transport.attrs["target_met"] == 0
    assert transport.attrs["achieved_relative_se"] > transport.attrs["target_relative_se"] == 0.005


def test_buried_points_do_not_count_for_the_target(office, places, section) -> None:
    buried = np.zeros(36, dtype=bool)
    buried[:35] = True
    only = SensorPoints(positions=places.positions, normals=places.normals, buried=buried)
    transport = trace(office(), only, **section("low", "draft"), seed=1)
    light, error = irradiance(transport)[35:], transport["irradiance_se"].to_numpy()[35:]
    assert transport.attrs["achieved_relative_se"] == pytest.approx(relative_rms(error, light), rel=1e-3)


def test_a_room_where_no_light_arrives_is_dark_and_finite(rooms, sensors, section) -> None:
    scene = rooms.scene([rooms.lamp("panel", (0, 0, 5), (0.1, 0.1))], [(rooms.room(), 0.5)])
    transport = trace(scene, sensors((0.5, 0.5, 0.1), UP), **section("low", "draft"), seed=1)
    assert np.all(irradiance(transport) == 0.0)
    assert np.all(transport["irradiance_se"].to_numpy() == 0.0)
    assert transport.attrs["achieved_relative_se"] == 0.0


@BY_ITS_ERROR
def test_quick_irradiance_agrees_with_a_trace(office, places, section) -> None:
    scene = office()
    transport = trace(scene, places, **section("high", "standard"), seed=1)
    light, error = trace_irradiance(scene, places.positions, places.normals, seed=2, workers=2)
    both = np.hypot(error, transport["irradiance_se"].to_numpy())
    assert np.all(np.abs(light - irradiance(transport)) < 8.0 * both)
    assert relative_rms(error, light) < 0.05


@BY_ITS_ERROR
@pytest.mark.parametrize("half_angle_deg", [20.5, 60.0])
def test_a_restricted_view_of_a_luminous_plane_reads_its_part(rooms, sensors, section, half_angle_deg: float) -> None:
    # Under a panel that fills the cone the reading is M sin²θ; half the panel off centre fills half of the cone.
    scene = rooms.scene(
        [rooms.lamp("panel", (0, 0, 0.1), (1.0, 1.0)), rooms.lamp("panel", (5, 0, 9), (1, 1), name="b")]
    )
    places = sensors([(0, 0, 0), (0.5, 0, 0)], UP)
    receptor = cone_receptor(half_angle_deg)
    transport = trace(scene, places, **section("low", "fine"), seed=1, receptor=receptor)
    expected = np.sin(np.radians(half_angle_deg)) ** 2 * np.array([[1.0], [0.5]])
    light, error = transport["coefficient"].to_numpy()[0], transport["irradiance_se"].to_numpy()
    assert np.all(np.abs(light - expected) < 8.0 * error + 1e-3 * expected)
    assert np.all(error < 0.02 * expected)


def test_a_damaged_octree_is_an_error_of_ours(office, places, section, tmp_path: Path) -> None:
    scene = office(own=tmp_path)
    (scene.folder / scene.passes[0].octree).write_bytes(b"#?RADIANCE\n\nnothing")
    with pytest.raises(EngineError, match="rcontrib"):
        trace(scene, places, **section("low", "draft"), seed=1, engine=find_engine())


@BY_ITS_ERROR
def test_where_batches_are_not_kept_their_moments_tell_the_same(
    office, places, section, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = office()
    whole = trace(scene, places, **section("medium", "draft"), seed=1)
    monkeypatch.setattr(trace_module, "KEPT_BATCH_VALUES", 0)
    monkeypatch.setattr(trace_module, "MAX_BLOCK_POINTS", 20)  # two blocks
    parts = trace(scene, places, **section("medium", "draft"), seed=2)
    assert "coefficient_batches" not in parts
    for name in ("coefficient", "slot_coefficient", "truncation_coefficient"):
        assert parts[name].shape == whole[name].shape
    error = {name: transport["irradiance_se"].to_numpy() for name, transport in (("whole", whole), ("parts", parts))}
    both = np.hypot(error["whole"], error["parts"])
    difference = irradiance(parts) - irradiance(whole)
    assert np.sqrt(((difference / both) ** 2).mean()) < 3.0  # some five points that do not err together, as above
    assert relative_rms(error["parts"], irradiance(parts)) < 1.2 * NOISE_LEVELS["draft"].relative_se
    # Of each lamp: errors as large as those that its batches tell, within what eight batches know of a spread.
    of_lamps = [np.sqrt((each["coefficient_se"].to_numpy() ** 2).mean(axis=1)) for each in (whole, parts)]
    assert np.all(np.abs(np.log2(of_lamps[1] / of_lamps[0])) < 1.0)
