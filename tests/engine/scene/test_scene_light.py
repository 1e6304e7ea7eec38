"""What a written scene's lamps and surfaces do with light, asked of Radiance itself."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from lidarspectra.errors import SceneError
from lidarspectra.geometry.scan import Appearance, Scan, ScanRecord
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import shape_of
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.radiance.engine.bands import WRITTEN_PER_WATT
from lidarspectra.radiance.engine.engine import Engine, find_engine, float_rows
from lidarspectra.radiance.scene.scene import RadianceScene, load_scene, write_scene
from lidarspectra.spectra.spectrum import Spectrum, sensor_bands, uniform_bands

BY_PATHS = pytest.mark.chance(
    "the engine draws its paths by the clock; the tolerance is three times their noise or more"
)

SIDE_M = 2.0
WHITE = Spectrum(wavelengths_nm=[300.0, 1000.0], values=[1.0, 1.0])
PATHS = ("-ab", "40", "-ad", "4", "-lw", "0.1")  # Russian roulette ends them: unbiased, and quick with many sensors
PLAIN = ("-h", "-fff", "-I+", "-aa", "0", "-as", "0", "-dt", "0", "-dj", "1", "-u+", "-lr", "-40")


@pytest.fixture(scope="module")
def engine() -> Engine:
    return find_engine()


def scan_of(mesh: trimesh.Trimesh) -> Scan:
    count = len(mesh.faces)
    return Scan(
        vertices=mesh.vertices,
        faces=mesh.faces,
        appearance=Appearance(
            images=(),
            face_image=np.full(count, -1),
            corner_uv=np.zeros((count, 3, 2)),
            corner_color=np.full((count, 3, 3), 0.5),
        ),
        record=ScanRecord(
            file="room", unit="m", unit_confidence=1, up_axis="+z", up_confidence=1, faces_read=1, faces_kept=1
        ),
    )


def cube(side_m: float = SIDE_M) -> trimesh.Trimesh:
    """Cube around the origin, seen from inside."""
    box = trimesh.creation.box(extents=(side_m,) * 3)
    box.invert()
    return box


def surface(reflectance: float | Spectrum, kind: str = "plastic", **settings: float) -> Material:
    if not isinstance(reflectance, Spectrum):
        reflectance = WHITE.scaled(reflectance)
    return Material(
        name="wall",
        category="unknown",
        reflectance=reflectance,
        kind=kind,
        source="default",
        provenance="default",
        confidence=1.0,
        measured_range_nm=(300, 1000),
        color=(0.5, 0.5, 0.5),
        **settings,
    )


def material_map(scan: Scan, *materials: Material, faces: np.ndarray | None = None) -> MaterialMap:
    count = len(scan.faces)
    return MaterialMap(
        materials=materials,
        face_material=np.zeros(count, dtype=int) if faces is None else faces,
        face_color=np.full((count, 3), 0.5),
        face_seen=np.ones(count),
    )


def lamp(shape: str = "bulb", size: tuple[float, ...] = (0.1,), **settings: object) -> Lamp:
    fields = {"name": "lamp", "center": np.zeros(3), "normal": np.array([0.0, 0.0, -1.0]), "flux": WHITE} | settings
    options = {name: fields.pop(name) for name in ("beam_angle_deg", "candela_text") if name in fields}
    return Lamp(shape=shape_of(shape, size, **options), **fields)


def on_walls(count: int, seed: int) -> np.ndarray:
    """(6 count, 6) sensors spread evenly over the cube's walls, looking inward: a jittered grid on each."""
    generator = np.random.default_rng(seed)
    per_side = int(np.sqrt(count))
    cells = np.stack(np.meshgrid(np.arange(per_side), np.arange(per_side)), axis=-1).reshape(-1, 2)
    rows = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            spots = ((cells + generator.uniform(size=cells.shape)) / per_side - 0.5) * (SIDE_M - 2e-3)
            position = np.insert(spots, axis, sign * (SIDE_M / 2 - 1e-4), axis=1)
            normal = np.zeros_like(position)
            normal[:, axis] = -sign
            rows.append(np.concatenate([position, normal], axis=1))
    return np.concatenate(rows)


def irradiance(engine: Engine, scene: RadianceScene, sensors: np.ndarray, *options: str) -> np.ndarray:
    """(sensor, band) irradiance of all passes by one plain rtrace each."""
    total = np.zeros((len(sensors), len(scene.slots)))
    rays = sensors.astype("<f4").tobytes()
    for scene_pass in scene.passes:
        slots = [*scene_pass.group.options, "-co+"] if scene.mode == "native" else []
        run = engine.run("rtrace", [*PLAIN, *options, *slots, scene_pass.octree], folder=scene.folder, stdin=rays)
        rows = float_rows(run, rows=len(sensors), columns=scene_pass.slot_count)
        total[:, list(scene_pass.slots)] += scene_pass.group.from_engine(rows) / WRITTEN_PER_WATT
    return scene.slots.fold(total)


@pytest.mark.parametrize(
    ("shape", "size", "more"),
    [
        ("panel", (0.4, 0.4), {}),
        ("panel", (0.3, 0.2), {"normal": np.array([1.0, 2.0, -3.0]), "rotation_deg": 20.0}),
        ("strip", (1.0, 0.05), {}),
        ("window", (0.5, 0.7), {"normal": np.array([1.0, 0.0, 0.0])}),
        ("disc", (0.2,), {}),
        ("bulb", (0.06,), {}),
        ("point", (0.01,), {}),
        ("spot", (0.08,), {"beam_angle_deg": 36.0}),
        ("spot", (0.08,), {"beam_angle_deg": 100.0, "normal": np.array([1.0, 1.0, 1.0])}),
    ],
)
def test_a_lamps_flux_arrives_on_the_walls_of_a_black_room(
    engine: Engine, tmp_path: Path, shape: str, size: tuple[float, ...], more: dict[str, object]
) -> None:
    room = scan_of(cube())
    scene = write_scene(
        room, material_map(room, surface(0.0)), [lamp(shape, size, **more)], uniform_bands(400, 700, 3), tmp_path,
        engine=engine,
    )  # fmt: skip
    sensors = on_walls(2500, seed=1)
    received = irradiance(engine, scene, sensors, "-ab", "0", "-ds", "0.02").mean(axis=0) * 6 * SIDE_M**2
    # Two thousand sensors a wall, jittered: 0.3 %; Radiance takes a disc for a square of equal area: 0.1 %.
    np.testing.assert_allclose(received, 1.0, rtol=5e-3)


@BY_PATHS
@pytest.mark.slow
@pytest.mark.parametrize(
    ("material", "tolerance"),
    [
        (surface(0.7), 0.02),
        (surface(0.7, specularity=0.05), 0.02),
        (surface(0.7, specularity=0.3, roughness=0.1), 0.02),
        (surface(0.7, "metal", specularity=0.9), 0.03),
        (surface(0.7, "mirror"), 0.05),  # mirrors all around: 0.982 ± 0.009 of it, for lamps of any size
        (surface(0.7, "metal", specularity=0.9, roughness=0.2), 0.05),  # Ward's model loses light at grazing angles
    ],
)
def test_walls_of_every_kind_absorb_just_what_the_lamp_sends(
    engine: Engine, tmp_path: Path, material: Material, tolerance: float
) -> None:
    """In a closed room, (1 - ρ) times the light that falls on the walls is the flux of the lamp.

    The tolerance holds three times the noise of 31,000 paths (0.6 %) and what the lamp itself absorbs (0.3 %).
    """
    room = scan_of(cube())
    scene = write_scene(
        room, material_map(room, material), [lamp(size=(0.05,))], uniform_bands(400, 700, 3), tmp_path, engine=engine
    )
    sensors = on_walls(1300, seed=2)
    falling = irradiance(engine, scene, sensors, *PATHS).mean() * 6 * SIDE_M**2
    assert (1 - 0.7) * falling == pytest.approx(1.0, rel=tolerance)


@BY_PATHS
@pytest.mark.parametrize(("reflectance", "transmittance"), [(0.3, 0.3), (0.6, 0.35), (0.05, 0.8)])
def test_a_closed_lampshade_lets_out_its_share(
    engine: Engine, tmp_path: Path, reflectance: float, transmittance: float
) -> None:
    """A shade around a lamp passes τ/(1 - ρ) of its flux, after all reflections inside."""
    shade = trimesh.creation.box(extents=(0.8, 0.8, 0.8))
    room = scan_of(trimesh.util.concatenate([cube(), shade]))
    materials = material_map(
        room,
        surface(0.0),
        surface(reflectance, "trans", transmittance=transmittance),
        faces=np.repeat([0, 1], 12),
    )
    scene = write_scene(room, materials, [lamp(size=(0.02,))], uniform_bands(400, 700, 3), tmp_path, engine=engine)
    sensors = on_walls(4900, seed=3)
    out = irradiance(engine, scene, sensors, *PATHS).mean() * 6 * SIDE_M**2
    assert out == pytest.approx(transmittance / (1 - reflectance), rel=0.02)  # noise 0.7 %


@BY_PATHS
@pytest.mark.slow
def test_slots_do_not_touch_one_another(engine: Engine, tmp_path: Path) -> None:
    """Bands of random reflectance and flux give, one by one, what a grey room of that reflectance gives."""
    generator = np.random.default_rng(4)
    bands = sensor_bands("as7265x-14")
    grid = np.arange(380.0, 801.0, 1.0)
    nearest = np.abs(grid[:, None] - bands.centers_nm).argmin(axis=1)
    rho, power = generator.uniform(0.05, 0.9, 14), generator.uniform(0.1, 1.0, 14)
    room = scan_of(cube())
    source = lamp(flux=Spectrum(wavelengths_nm=grid, values=power[nearest]))
    walls = surface(Spectrum(wavelengths_nm=grid, values=rho[nearest]))
    scene = write_scene(room, material_map(room, walls), [source], bands, tmp_path, engine=engine)
    seen = irradiance(engine, scene, on_walls(900, seed=5), *PATHS).mean(axis=0)
    # In a closed room each wavelength has its own closed form; where a channel sees its neighbour's walls, it is cut.
    inside = source.flux.at(bands.wavelengths_nm, outside="zero")
    inside = inside / (1 - walls.reflectance.at(bands.wavelengths_nm, outside="nearest"))
    expected = bands.weights @ inside / (6 * SIDE_M**2)
    np.testing.assert_allclose(seen, expected, rtol=0.03)  # noise 1 %; a neighbour's share would show as tens of %


@pytest.mark.parametrize("mode", ["native", "rgb"])
def test_lamps_of_every_group_reach_the_sensors_once(engine: Engine, tmp_path: Path, mode: str) -> None:
    """Passes of different lamps and bands, added up, give the sum of each lamp traced alone."""
    room = scan_of(cube())
    walls = material_map(room, surface(0.0))
    blue = Spectrum(wavelengths_nm=[380.0, 470.0, 500.0], values=[1.0, 2.0, 0.0])
    lamps = [
        lamp(name="a", size=(0.02,), center=np.array([0.5, 0.0, 0.0])),
        lamp(name="b", size=(0.02,), center=np.array([-0.5, 0.0, 0.2]), flux=blue),
        lamp(name="c", size=(0.02,), center=np.array([0.0, 0.5, 0.0]), flux=WHITE.scaled(3.0)),
    ]
    bands = sensor_bands("as7265x-18")
    sensors = np.array([[0.0, 0.0, -0.9, 0.0, 0.0, 1.0]])
    both = write_scene(room, walls, lamps, bands, tmp_path / "all", mode=mode, engine=engine)
    assert len({scene_pass.lamps for scene_pass in both.passes}) == 2  # a and c share their passes
    # No jitter and no bounce: the engine's answer has no noise but that of single precision.
    direct = ("-ab", "0", "-dj", "0")
    seen = irradiance(engine, both, sensors, *direct)
    alone = [
        irradiance(engine, write_scene(room, walls, [one], bands, tmp_path / one.name, engine=engine), sensors, *direct)
        for one in lamps
    ]
    np.testing.assert_allclose(seen, sum(alone), rtol=1e-4, atol=1e-5 * seen.max())  # atol: the floor of dark bands
    distances = [np.array([0, 0, -0.9]) - one.center for one in lamps]
    expected = sum(
        flux / (4 * np.pi * (line @ line)) * -line[2] / np.linalg.norm(line)
        for flux, line in zip(both.flux, distances, strict=True)
    )
    np.testing.assert_allclose(seen[0], expected, rtol=1e-3, atol=1e-5 * seen.max())  # spheres of 2 cm are points


def test_lamps_of_other_groups_stand_in_the_way(engine: Engine, tmp_path: Path) -> None:
    room = scan_of(cube())
    blue = Spectrum(wavelengths_nm=[380.0, 470.0, 500.0], values=[1.0, 2.0, 0.0])
    shown = lamp(name="shown", size=(0.02,), center=np.array([0.0, 0.0, 0.8]))
    before = lamp("panel", (0.5, 0.5), name="before", normal=np.array([0.0, 0.0, 1.0]), flux=blue)
    scene = write_scene(
        room, material_map(room, surface(0.0)), [shown, before], sensor_bands("as7265x-14"), tmp_path, engine=engine
    )
    seen = irradiance(engine, scene, np.array([[0.0, 0.0, -0.9, 0.0, 0.0, 1.0]]), "-ab", "0")
    assert len(scene.passes) == 2
    assert seen.max() == 0.0


def test_the_users_words_reach_no_file_that_radiance_reads(engine: Engine, tmp_path: Path) -> None:
    words = "!touch x\nvoid ; $(boom) é"
    room = scan_of(cube())
    walls = Material(**{**vars(surface(0.5)), "name": words, "category": words, "source": words})
    folder = tmp_path / "a b (é) '$x"
    scene = write_scene(
        room, material_map(room, walls), [lamp(name=words)], sensor_bands("as7265x-14"), folder, engine=engine
    )
    for path in [*folder.glob("*.rad"), *folder.glob("*.obj"), *folder.glob("*.rtm"), *folder.glob("*.oct")]:
        assert b"touch" not in path.read_bytes()
        assert "boom" not in path.name
    assert irradiance(engine, scene, on_walls(1, seed=6), "-ab", "0").min() > 0  # any folder name works


def test_a_scene_comes_back_as_it_was_saved_even_when_moved(engine: Engine, tmp_path: Path) -> None:
    room = scan_of(cube())
    scene = write_scene(
        room, material_map(room, surface(0.5)), [lamp(name="Lampe é")], sensor_bands("as7265x-18"), tmp_path / "one",
        mode="rgb", engine=engine,
    )  # fmt: skip
    moved = scene.folder.rename(tmp_path / "two")
    back = load_scene(moved)
    assert back.passes == scene.passes
    assert back.lamp_names == ("Lampe é",)
    np.testing.assert_array_equal(back.flux, scene.flux)
    np.testing.assert_array_equal(back.bands.responses, scene.bands.responses)
    assert irradiance(engine, back, on_walls(1, seed=6), "-ab", "0").min() > 0


def test_a_scene_whose_octree_or_mesh_was_cut_off_or_lost_is_refused(engine: Engine, tmp_path: Path) -> None:
    scene = write_scene(
        scan_of(cube()), material_map(scan_of(cube()), surface(0.5)), [lamp()], sensor_bands("as7265x-18"), tmp_path,
        engine=engine,
    )  # fmt: skip
    for name in (scene.passes[0].octree, scene.passes[0].mesh_file):
        whole = (tmp_path / name).read_bytes()
        (tmp_path / name).write_bytes(whole[:-1])
        with pytest.raises(SceneError, match=f"{name} of {len(whole) - 1} bytes, of which {len(whole)} were written"):
            load_scene(tmp_path)
        (tmp_path / name).unlink()
        with pytest.raises(SceneError, match=f"no {name}"):
            load_scene(tmp_path)
        (tmp_path / name).write_bytes(whole)
    assert load_scene(tmp_path).passes == scene.passes
