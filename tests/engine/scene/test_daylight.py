"""Daylight: its unit chain, its way through windows, and the dark of night."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest
import trimesh

from lidarspectra.errors import LampError
from lidarspectra.geometry.scan import Appearance, Scan, ScanRecord
from lidarspectra.lamps.lamp_file import load_lamps, save_lamps
from lidarspectra.lamps.lamp_spectra import luminous_flux_lm
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.radiance.engine.bands import WRITTEN_PER_WATT
from lidarspectra.radiance.engine.engine import Engine, find_engine, float_rows
from lidarspectra.radiance.scene.clear_sky import spectrl2_light
from lidarspectra.radiance.scene.daylight import Window, daylight_lamps, window_shape
from lidarspectra.radiance.scene.scene import RadianceScene, load_scene, write_scene
from lidarspectra.radiance.scene.sky import (
    ALTITUDES_DEG,
    AZIMUTHS_DEG,
    SKY_WAVELENGTHS_NM,
    Daylight,
    Sky,
    compute_sky,
    pane_transmittance,
    sky_spectrum,
    sun_altitude_deg,
)
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.spectrum import Spectrum, sensor_bands
from lidarspectra.workflow.room_model import RoomModel

GENSKY_EFFICACY = 179.0  # [lm/W] Radiance's convention for white
CET = timezone(timedelta(hours=1))
ROOM_M = np.array([3.0, 4.0, 2.5])


@pytest.fixture(scope="module")
def engine() -> Engine:
    return find_engine()


def day(hour: int, **settings: float) -> Daylight:
    """A summer's day at 48 north, 11 east."""
    time = datetime(2024, 6, 21, hour, 0, tzinfo=CET)
    return Daylight(latitude_deg=48.0, longitude_deg=11.0, time=time, **settings)


def even_sky(sun: tuple[float, float, float] | None = None) -> Sky:
    """A sky of the same radiance everywhere above the horizon, and nothing below; 1 W/m²/sr/nm."""
    radiance = np.zeros((AZIMUTHS_DEG.size, ALTITUDES_DEG.size, SKY_WAVELENGTHS_NM.size))
    radiance[:, ALTITUDES_DEG > 0] = 1.0
    slope = 1.0 + np.arange(SKY_WAVELENGTHS_NM.size) / 10.0
    if sun is None:
        return Sky(radiance=radiance, sun_direction=None, sun_irradiance=0 * slope)
    direction = np.array(sun) / np.linalg.norm(sun)
    return Sky(radiance=0 * radiance, sun_direction=direction, sun_irradiance=slope)


def room_scene(lamps: tuple[Lamp, ...], folder: Path, engine: Engine, mode: str = "native") -> RadianceScene:
    """A black room of ROOM_M, from the origin."""
    box = trimesh.creation.box(extents=ROOM_M)
    box.invert()
    scan = Scan(
        vertices=box.vertices + ROOM_M / 2,
        faces=box.faces,
        appearance=Appearance(
            images=(), face_image=np.full(12, -1), corner_uv=np.zeros((12, 3, 2)), corner_color=np.ones((12, 3, 3))
        ),
        record=ScanRecord(
            file="s", unit="m", unit_confidence=1, up_axis="+z", up_confidence=1, faces_read=12, faces_kept=12
        ),
    )
    black = Material(
        name="black", category="unknown", reflectance=Spectrum(wavelengths_nm=[300, 1000], values=[0, 0]),
        source="default", provenance="default", confidence=1.0, measured_range_nm=(300, 1000), color=(0, 0, 0),
    )  # fmt: skip
    materials = MaterialMap(
        materials=(black,), face_material=np.zeros(12, dtype=int), face_color=np.zeros((12, 3)), face_seen=np.ones(12)
    )
    return write_scene(scan, materials, lamps, sensor_bands("as7265x-14"), folder, mode=mode, engine=engine)


def irradiance(engine: Engine, scene: RadianceScene, sensors: np.ndarray) -> np.ndarray:
    """(sensor, band) straight from the windows and the sun."""
    total = np.zeros((len(sensors), len(scene.slots)))
    for one in scene.passes:
        slots = [*one.group.options, "-co+"] if scene.mode == "native" else []
        options = ["-h", "-fff", "-I+", "-ab", "0", "-dt", "0", "-dj", "0", "-ds", "0.01", *slots, one.octree]
        run = engine.run("rtrace", options, folder=scene.folder, stdin=sensors.astype("<f4").tobytes())
        values = one.group.from_engine(float_rows(run, rows=len(sensors), columns=one.slot_count)) / WRITTEN_PER_WATT
        total[:, list(one.slots)] += values
    return scene.slots.fold(total)


SOUTH = Window(name="south", center=(1.5, 0.06, 1.3), normal=(0, 1, 0), size=(1.2, 1.0), transmittance=0.7)


def direct_integral(window: Window, half: int, sensor: np.ndarray) -> float:
    """E = ∫ L T(θ) cosθ' cosθ/r² dA over a window, L = 1 above (half = 1) or below (-1) the horizon [W/m²/nm]."""
    shape = window_shape(window)
    first, second, _, fourth = shape.corners()
    steps = (np.arange(300) + 0.5) / 300
    along, across = (steps[:, None, None] * (second - first)), (steps[None, :, None] * (fourth - first))
    to_window = (first + along + across).reshape(-1, 3) - sensor[:3]
    distance = np.linalg.norm(to_window, axis=1)
    outward = to_window / distance[:, None]
    cosines = np.clip(-outward @ shape.normal, 0, None)
    radiance = pane_transmittance(cosines, window.transmittance) * (half * outward[:, 2] > 0)
    area = window.size[0] * window.size[1] / steps.size**2
    return float((radiance * cosines * np.clip(outward @ sensor[3:], 0, None) / distance**2).sum() * area)


@pytest.mark.parametrize("mode", ["native", "rgb"])
def test_an_even_skys_light_falls_as_its_configuration_factor(engine: Engine, tmp_path: Path, mode: str) -> None:
    (lamp,) = daylight_lamps(even_sky(), [SOUTH])
    scene = room_scene((lamp,), tmp_path, engine, mode)
    sensors = np.array([[1.5, 2.0, 0.5, 0, -0.6, 0.8], [0.5, 1.0, 0.3, 0, -1, 0], [1.5, 3.0, 0.8, 0, 0, 1.0]])
    for sensor, seen in zip(sensors, irradiance(engine, scene, sensors), strict=True):
        # 1 %: the window is cut into 64 parts, and the horizon's step crosses some of them.
        np.testing.assert_allclose(seen, direct_integral(SOUTH, 1, sensor), rtol=0.01)


def half_sky(half: int) -> Sky:
    """Radiance 1 W/m²/sr/nm above (half = 1) or below (-1) the horizon, 0 in the other half."""
    lit = np.where(half * ALTITUDES_DEG > 0, 1.0, 0.0)
    radiance = np.broadcast_to(
        lit[None, :, None], (AZIMUTHS_DEG.size, ALTITUDES_DEG.size, SKY_WAVELENGTHS_NM.size)
    ).copy()
    return Sky(radiance=radiance, sun_direction=None, sun_irradiance=np.zeros(SKY_WAVELENGTHS_NM.size))


def tilted(tilt_deg: float) -> Window:
    """A window in the middle of the room; its outer side faces `tilt_deg` above the horizon, to the south-west."""
    tilt = np.radians(tilt_deg)
    outward = np.array([-np.cos(tilt) * 0.6, -np.cos(tilt) * 0.8, np.sin(tilt)])
    return Window(name="tilted", center=(1.5, 2.0, 1.25), normal=tuple(-outward), size=(0.5, 0.4), transmittance=0.7)


TILTS_DEG = (-90.0, -45.0, -10.0, 0.0, 30.0, 60.0, 90.0)


@pytest.mark.parametrize("half", [-1, 1])
@pytest.mark.parametrize("tilt_deg", TILTS_DEG)
def test_ground_and_sky_send_through_a_window_of_any_tilt_what_a_direct_integral_has(
    half: int, tilt_deg: float
) -> None:
    """Φ = A ∫ T(θ) cosθ dω over the half of the directions, as a sum over a million of them, spread evenly."""
    window = tilted(tilt_deg)
    count = np.arange(1_000_000) + 0.5
    height, turn = 1 - 2 * count / count.size, count * np.pi * (3 - np.sqrt(5))  # Fibonacci's spiral on the sphere
    radius = np.sqrt(1 - height**2)
    directions = np.stack([radius * np.cos(turn), radius * np.sin(turn), height], axis=1)
    cosines = np.clip(-directions @ np.array(window.normal), 0, None)
    passed = pane_transmittance(cosines, 0.7) * cosines * (half * directions[:, 2] > 0)
    expected = 4 * np.pi * passed.mean() * 0.5 * 0.4
    lamps = daylight_lamps(half_sky(half), [window])
    flux = lamps[0].flux.values if lamps else np.zeros(1)
    # .5 %: sums over a degree's grid; 1e-9: a window that faces the other half alone.
    np.testing.assert_allclose(flux, expected, rtol=0.005, atol=1e-9)


@pytest.mark.parametrize("half", [-1, 1])
@pytest.mark.parametrize("tilt_deg", TILTS_DEG[1:-1])
def test_a_sensor_gets_from_ground_or_sky_through_a_tilted_window_what_a_direct_integral_has(
    engine: Engine, tmp_path: Path, half: int, tilt_deg: float
) -> None:
    """Sensors on the inner side that see the one half alone through the window, at up to 80 degrees from its normal."""
    window = tilted(tilt_deg)
    normal, center = np.array(window.normal), np.array(window.center)
    scene = room_scene(daylight_lamps(half_sky(half), [window]), tmp_path, engine)
    places = np.random.default_rng(2).uniform(0.1, ROOM_M - 0.1, (4000, 3))
    toward = center - places
    distance = np.linalg.norm(toward, axis=1)
    rise = half * toward[:, 2] - 0.33  # the window's corners are within .33 m of its middle
    cosines = -(toward @ normal) / distance
    places = places[(cosines > 0.15) & (rise > 0) & (distance > 0.8)][:20]
    assert len(places) >= 8
    facing = center - places
    sensors = np.concatenate([places, facing / np.linalg.norm(facing, axis=1)[:, None]], axis=1)
    for sensor, seen in zip(sensors, irradiance(engine, scene, sensors), strict=True):
        # .5 %: the window is cut into at most 64 parts, each with the angle of its middle.
        np.testing.assert_allclose(seen, direct_integral(window, half, sensor), rtol=0.005)


@pytest.mark.parametrize("mode", ["native", "rgb"])
def test_the_sun_falls_where_its_rays_through_the_window_go_and_nowhere_else(
    engine: Engine, tmp_path: Path, mode: str
) -> None:
    (lamp,) = daylight_lamps(even_sky((0.2, -0.7, 0.8)), [SOUTH])
    scene = room_scene((lamp,), tmp_path, engine, mode)
    generator = np.random.default_rng(1)
    floor = np.concatenate(
        [generator.uniform((0, 0), (3, 4), (3000, 2)), np.full((3000, 1), 1e-3), np.tile([0, 0, 1.0], (3000, 1))],
        axis=1,
    )
    toward = -lamp.normal
    met = floor[:, :3] + ((0.06 - floor[:, 1]) / toward[1])[:, None] * toward
    off = np.abs(met[:, [0, 2]] - [1.5, 1.3]) - [0.6, 0.5]
    seen = irradiance(engine, scene, floor)
    bands = scene.bands.band_values(sky_spectrum(even_sky((0.2, -0.7, 0.8)).sun_irradiance, "sun"), outside="zero")
    expected = bands * toward[2] * float(pane_transmittance(np.array(-toward[1]), 0.7))
    well_inside, well_outside = off.max(axis=1) < -0.04, off.max(axis=1) > 0.02  # the cut mesh has teeth of 5 cm
    assert well_inside.sum() > 50
    np.testing.assert_allclose(seen[well_inside], np.broadcast_to(expected, (well_inside.sum(), 14)), rtol=2e-3)
    assert seen[well_outside].max() == 0.0


def test_windows_do_not_shade_the_sun_and_the_sky_is_dark_in_its_pass(engine: Engine, tmp_path: Path) -> None:
    clear = even_sky((0.2, -0.7, 0.8))
    both = Sky(radiance=even_sky().radiance, sun_direction=clear.sun_direction, sun_irradiance=clear.sun_irradiance)
    lamps = daylight_lamps(both, [SOUTH])
    assert [lamp.shape.word for lamp in lamps] == ["window", "sun"]
    scene = room_scene(lamps, tmp_path, engine)
    sensors = np.array([[1.2, 0.7, 0.3, 0.0, 0.0, 1.0]])
    parts = [irradiance(engine, room_scene((lamp,), tmp_path / lamp.shape.word, engine), sensors) for lamp in lamps]
    assert parts[1].min() > 0
    np.testing.assert_allclose(irradiance(engine, scene, sensors), sum(parts), rtol=1e-4)
    assert load_scene(tmp_path).passes == scene.passes


def test_turning_the_room_turns_the_sun(engine: Engine, tmp_path: Path) -> None:
    """With north along the scan's +x, what is south of the room lies at -x."""
    sky = even_sky((0.0, -1.0, 1.0))
    assert daylight_lamps(sky, [SOUTH])[0].shape.word == "sun"
    north = Window(name="north", center=(1.5, 3.94, 1.3), normal=(0, -1, 0), size=(1.2, 1.0))
    assert daylight_lamps(sky, [north]) == ()


def test_night_is_dark_and_makes_no_lamp(engine: Engine, tmp_path: Path) -> None:
    night = compute_sky(day(1), tmp_path, engine, atmosphere=tmp_path)
    assert night.sun_direction is None
    assert not night.radiance.any()
    assert not night.horizontal_irradiance.any()
    assert daylight_lamps(night, [SOUTH]) == ()


@pytest.mark.parametrize(
    ("time", "latitude", "longitude", "altitude"),
    [
        (datetime(2024, 3, 20, 12, 7, tzinfo=UTC), 0.0, 0.0, 90.0),
        (datetime(2024, 6, 20, 12, 2, tzinfo=UTC), 48.0, 0.0, 65.4),
        (datetime(2024, 12, 21, 11, 58, tzinfo=UTC), 48.0, 0.0, 18.6),
        (datetime(2024, 6, 21, 0, 2, tzinfo=UTC), 66.56, 0.0, 0.0),
        (datetime(2024, 6, 21, 13, 0, tzinfo=CET), 48.0, 11.25, 64.0),
        (datetime(2024, 3, 20, 0, 7, tzinfo=UTC), 0.0, 180.0, 90.0),
    ],
)
def test_the_sun_stands_where_almanacs_have_it(
    time: datetime, latitude: float, longitude: float, altitude: float
) -> None:
    assert sun_altitude_deg(time, latitude, longitude) == pytest.approx(altitude, abs=0.3)


@pytest.mark.parametrize(
    "wrong",
    [
        {"latitude_deg": 91.0},
        {"longitude_deg": 200.0},
        {"cloud_cover": 1.1},
        {"aerosol_optical_depth": -0.1},
        {"ground_reflectance": 1.0},
        {"north_deg": np.nan},
        {"time": datetime(2024, 6, 21, 12, 0)},
    ],
)
def test_a_day_that_cannot_be_is_refused(wrong: dict[str, object]) -> None:
    fields = {"latitude_deg": 48.0, "longitude_deg": 11.0, "time": datetime(2024, 6, 21, 12, 0, tzinfo=CET)}
    with pytest.raises(LampError, match="daylight"):
        Daylight(**(fields | wrong))


def gensky(engine: Engine, folder: Path, altitude_deg: float, kind: str) -> tuple[float, float]:
    """Horizontal illuminance of a CIE sky, and normal illuminance of its sun [lx]."""
    text = engine.run("gensky", ["-ang", f"{altitude_deg:.3f}", "0", kind], folder=folder).output.decode()
    glow = "\nskyfunc glow skyglow\n0\n0\n4 1 1 1 0\nskyglow source sky\n0\n0\n4 0 0 1 180\n"
    sun = 0.0
    if "light solar" in text:
        head, _, tail = text.partition("light solar")
        sun = float(tail.split()[3]) * 2 * np.pi * (1 - np.cos(np.radians(0.5 / 2))) * GENSKY_EFFICACY
        text = head.rpartition("void")[0] + tail[tail.index("void brightfunc") :]
    (folder / "cie.rad").write_text(text + glow, encoding="utf-8", newline="\n")
    (folder / "cie.oct").write_bytes(engine.run("oconv", ["cie.rad"], folder=folder).output)
    sines = np.sqrt((np.arange(60) + 0.5) / 60)  # rays spread evenly in projected solid angle
    turns = 2 * np.pi * (np.arange(240) + 0.5) / 240
    grid = [(np.sqrt(1 - s * s) * np.cos(t), np.sqrt(1 - s * s) * np.sin(t), s) for s in sines for t in turns]
    rays = np.concatenate([np.zeros((len(grid), 3)), grid], axis=1).astype("<f4").tobytes()
    run = engine.run("rtrace", ["-h", "-fff", "-ab", "0", "cie.oct"], folder=folder, stdin=rays)
    return float(float_rows(run, rows=len(grid), columns=3)[:, 1].mean() * np.pi * GENSKY_EFFICACY), sun


@pytest.mark.slow
def test_skies_have_the_strength_of_spectrl2_and_the_cie(engine: Engine, tmp_path: Path, clear_air: Path) -> None:
    """Clear and overcast noon, within the bounds that real skies vary by (a factor of 1.5; 2 for a clear sky's part).

    Measured: clear sky 16.0 klx against gensky's 8.9, sun 101 against 76, overcast 20 against 17.
    """
    clear = compute_sky(day(12), tmp_path / "clear", engine, atmosphere=clear_air)
    assert clear.sun_direction is not None
    altitude = np.degrees(np.arcsin(clear.sun_direction[2]))
    assert altitude == pytest.approx(sun_altitude_deg(day(12).time, 48.0, 11.0), abs=0.3)
    sun = luminous_flux_lm(sky_spectrum(clear.sun_irradiance, "sun"))
    whole = luminous_flux_lm(sky_spectrum(clear.horizontal_irradiance, "all"))
    cie_sky, cie_sun = gensky(engine, tmp_path, altitude, "+s")
    assert 1 / 1.5 < sun / cie_sun < 1.5
    assert 1 / 2 < (whole - sun * clear.sun_direction[2]) / cie_sky < 2

    # Sky and sun are as strong as SPECTRL2 has them, bin by bin; genssky's own sky is a quarter weaker.
    sun_only, sky_only, _ = spectrl2_light(day(12))
    np.testing.assert_allclose(clear.sun_irradiance, sun_only, rtol=1e-9)
    np.testing.assert_allclose(replace(clear, sun_direction=None).horizontal_irradiance, sky_only, rtol=1e-9)

    overcast = compute_sky(day(12, cloud_cover=1.0), tmp_path / "overcast", engine, atmosphere=clear_air)
    cie_overcast, _ = gensky(engine, tmp_path, altitude, "-c")
    lux = luminous_flux_lm(sky_spectrum(overcast.horizontal_irradiance, "all"))
    assert 1 / 1.5 < lux / cie_overcast < 1.5

    # The same moment told in another zone is the same sky; and north turned by 90 degrees turns it.
    utc = Daylight(latitude_deg=48.0, longitude_deg=11.0, time=datetime(2024, 6, 21, 11, 0, tzinfo=UTC))
    again = compute_sky(utc, tmp_path / "utc", engine, atmosphere=clear_air)
    np.testing.assert_allclose(again.sun_direction, clear.sun_direction, atol=1e-5)
    turned = compute_sky(day(12, north_deg=90.0), tmp_path / "turned", engine, atmosphere=clear_air)
    east, north, up = clear.sun_direction
    np.testing.assert_allclose(turned.sun_direction, [-north, east, up], atol=1e-5)
    quarter = int(np.argmin(np.abs(AZIMUTHS_DEG - 90.0)))
    np.testing.assert_allclose(turned.radiance[quarter], clear.radiance[0], rtol=1e-3, atol=1e-6)

    # Overcast: the CIE standard overcast sky (ISO 15469, type 16), a third of the zenith at the horizon, and no sun.
    assert overcast.sun_direction is None
    above = ALTITUDES_DEG > 0
    cie = (1 + 2 * np.sin(np.radians(ALTITUDES_DEG[above]))) / 3
    assert overcast.radiance[:, -1].min() > 0
    np.testing.assert_allclose(
        overcast.radiance[:, above] / overcast.radiance[:, -1:],
        np.broadcast_to(cie[None, :, None], (49, 21, 20)),
        rtol=1e-3,
    )
    # Half covered is half of each, sun included.
    half = compute_sky(day(12, cloud_cover=0.5), tmp_path / "half", engine, atmosphere=clear_air)
    np.testing.assert_allclose(half.radiance, (clear.radiance + overcast.radiance) / 2, rtol=1e-6)
    np.testing.assert_allclose(half.sun_irradiance, clear.sun_irradiance / 2, rtol=1e-6)


def test_windows_and_sun_that_were_saved_and_read_send_what_they_sent(tmp_path: Path) -> None:
    """A calibration, a design, a picture and a live sensor's place are traced with the lamps that a run kept."""
    above = np.where(ALTITUDES_DEG > 0, 1.0, 0.05)  # bright sky, dark ground: a Lambertian window lights the ceiling
    towards = np.array([0.0, -0.6, 0.8])
    sky = Sky(
        radiance=np.ones((AZIMUTHS_DEG.size, 1, SKY_WAVELENGTHS_NM.size)) * above[:, None],
        sun_direction=towards,
        sun_irradiance=np.full(SKY_WAVELENGTHS_NM.size, 5.0),
    )
    window = Window(name="south", center=(1.5, 0.01, 1.5), normal=(0.0, 1.0, 0.0), size=(1.0, 1.0))
    lamps = daylight_lamps(sky, (window,))
    save_lamps(lamps, tmp_path)
    room = RoomModel.from_box(*ROOM_M, floor=0.0, walls=0.0, ceiling=0.0)
    points = SensorPoints(
        positions=np.array([[1.5, 0.6, 0.7], [1.5, 2.0, 0.8], [1.5, 2.0, 1.7]]),
        normals=np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]),
    )
    before, after = (room.light(each, points)["irradiance"].to_numpy() for each in (lamps, load_lamps(tmp_path)))
    assert before.min() > 0
    assert before[0].mean() > 1.0  # in the sun
    assert after == pytest.approx(before, rel=0.03)  # the noise of the window's direct light, six times
