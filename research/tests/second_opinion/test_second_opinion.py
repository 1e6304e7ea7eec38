"""Mitsuba's second opinion: it is exported rightly, and both engines agree."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

pytest.importorskip("mitsuba", reason="the extra 'validate' is not installed")

from lidarspectra.errors import EngineError, LampError, MaterialError
from lidarspectra.geometry.scan import Appearance, Scan, ScanRecord
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.patterns import beam_exponent
from lidarspectra.lamps.shapes import shape_of
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.scene.scene import write_scene
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.spectrum import Spectrum, uniform_bands
from research.second_opinion import reference_irradiance, variants
from research.second_opinion.variants import find_mitsuba

BY_ITS_ERROR = pytest.mark.chance(
    "held to a standard error that, known from eight batches, has the long tails of a t of seven degrees"
)

BANDS = uniform_bands(400.0, 700.0, 4)  # two of Mitsuba's passes, the second of one band
RANGE_NM = np.array([380.0, 780.0])
FLAT = Spectrum(wavelengths_nm=RANGE_NM, values=np.ones(2))
SLOPE = Spectrum(wavelengths_nm=RANGE_NM, values=np.array([0.2, 0.8]))

needs_llvm = pytest.mark.skipif(
    not find_mitsuba().is_fast, reason=f"Mitsuba's fast variant does not run here: {find_mitsuba().note}"
)


def scan_of(mesh: trimesh.Trimesh) -> Scan:
    count = len(mesh.faces)
    return Scan(
        vertices=np.array(mesh.vertices),
        faces=np.array(mesh.faces),
        appearance=Appearance(
            images=(),
            face_image=np.full(count, -1),
            corner_uv=np.zeros((count, 3, 2)),
            corner_color=np.full((count, 3, 3), 0.5),
        ),
        record=ScanRecord(
            file="test", unit="m", unit_confidence=1, up_axis="+z", up_confidence=1, faces_read=count, faces_kept=count
        ),
    )


def surface(reflectance: Spectrum | float, **settings: object) -> Material:
    return Material(
        name="wall",
        category="test",
        reflectance=reflectance if isinstance(reflectance, Spectrum) else FLAT.scaled(reflectance),
        source="test",
        provenance="modelled",
        confidence=1.0,
        measured_range_nm=(380.0, 780.0),
        color=(0.5, 0.5, 0.5),
        **settings,
    )


def materials(scan: Scan, *kinds: Material, faces: np.ndarray | None = None) -> MaterialMap:
    count = len(scan.faces)
    return MaterialMap(
        materials=kinds,
        face_material=np.zeros(count, dtype=int) if faces is None else faces,
        face_color=np.full((count, 3), 0.5),
        face_seen=np.ones(count),
    )


DOWNLIGHT = "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 2 1 1 2 1 1 0\n1 1 0\n0 90\n0\n100 0\n"


def lamp(shape: str, size: tuple[float, ...], **settings: object) -> Lamp:
    fields = {"name": "lamp", "center": (0.0, 0.0, 2.0), "normal": (0.0, 0.0, -1.0), "flux": FLAT} | settings
    options = {name: fields.pop(name) for name in ("beam_angle_deg", "candela_text") if name in fields}
    return Lamp(shape=shape_of(shape, size, **options), **fields)


def sensors(positions: object) -> SensorPoints:
    places = np.atleast_2d(np.asarray(positions, dtype=float))
    up = np.tile([0.0, 0.0, 1.0], (len(places), 1))
    return SensorPoints(positions=places, normals=up, buried=np.zeros(len(places), dtype=bool))


BLACK = scan_of(trimesh.Trimesh(vertices=[[0, 0, -9], [0.1, 0, -9], [0, 0.1, -9]], faces=[[0, 1, 2]]))


def room(*, jitter_m: float = 0.0) -> tuple[Scan, MaterialMap, list[Lamp], SensorPoints]:
    """A furnished cube of 2 m under two unlike lamps: penumbras, colour, and on request a scan's uneven surface."""
    shell = trimesh.creation.box(bounds=[[-1, -1, 0], [1, 1, 2]]).subdivide_to_size(0.25)
    shell.invert()
    if jitter_m:
        shell.vertices += np.random.default_rng(1).normal(0, jitter_m, shell.vertices.shape)
    table = trimesh.creation.box(bounds=[[-0.8, -0.7, 0.6], [0.2, 0.1, 0.64]])
    scan = scan_of(trimesh.util.concatenate([shell, table]))
    faces = np.repeat([0, 1], [len(shell.faces), len(table.faces)])
    lamps = [
        lamp("panel", (0.5, 0.3), name="a", center=(-0.4, 0.2, 1.9), rotation_deg=30.0),
        lamp("spot", (0.2,), name="b", center=(0.5, -0.3, 1.9), beam_angle_deg=80.0, flux=SLOPE),
    ]
    x, y = np.meshgrid(np.linspace(-0.8, 0.8, 5), np.linspace(-0.8, 0.8, 5))
    points = sensors(np.stack([x.ravel(), y.ravel(), np.full(25, 0.3)], axis=1))
    return scan, materials(scan, surface(SLOPE), surface(0.5), faces=faces), lamps, points


def check_agreement(scan: Scan, surfaces: MaterialMap, lamps: list[Lamp], points: SensorPoints, folder: Path) -> None:
    """Hold both engines to their own standard errors."""
    scene = write_scene(scan, surfaces, lamps, BANDS, folder)
    transport = trace(scene, points, accuracy="ultra", noise="standard", workers=2, seed=1)
    found = np.einsum("lpb,lb->pb", transport["coefficient"].to_numpy().astype(float), transport["flux"].to_numpy())
    reference = reference_irradiance(scan, surfaces, lamps, BANDS, points, cells=32, seed=1)
    # Sensors share paths, so that the error of their mean is told by its batches; twelve of it, of so few, is what
    # ten values pass by chance once in 15,000 runs.
    error = np.hypot(reference.standard_error, transport["irradiance_se"].to_numpy())
    difference = found - reference.irradiance
    batches = np.einsum(
        "klpb,lb->kb", transport["coefficient_batches"].to_numpy().astype(float), transport["flux"].to_numpy()
    ) / len(points)
    of_mean = np.hypot(
        batches.std(axis=0, ddof=1) / np.sqrt(len(batches)),
        np.sqrt((reference.standard_error**2).sum(axis=0)) / len(points),
    )
    assert np.all(np.abs(difference.mean(axis=0)) < 12.0 * of_mean)
    # Single errors are estimated from 8 repeats; 8 of them is what 100 values do not reach by chance.
    assert np.all(np.abs(difference) < 8.0 * error)
    assert np.all(of_mean < 0.01 * reference.irradiance.mean(axis=0))  # else the above would hold of anything


def panel_factor(half_m: float, distance_m: float) -> float:
    """Configuration factor of a square to a parallel element below its middle: four times that of a quarter."""
    x = half_m / distance_m
    root = np.hypot(1.0, x)
    return float(4.0 * (x / root * np.arctan(x / root)) / np.pi)


def spot_on_axis(radius_m: float, distance_m: float, beam_deg: float) -> float:
    """Irradiance under a spot of 1 W/nm: ∫ L0 cosⁿ⁻¹θ cosθ dω over the disc."""
    exponent = beam_exponent(beam_deg)
    on_axis = (exponent + 1.0) / (2.0 * np.pi * np.pi * radius_m**2)
    edge = distance_m / np.hypot(radius_m, distance_m)
    return float(2.0 * np.pi * on_axis * (1.0 - edge ** (exponent + 1.0)) / (exponent + 1.0))


@needs_llvm
@pytest.mark.parametrize(
    ("source", "expected"),
    [
        (lamp("panel", (1.0, 1.0), rotation_deg=20.0), panel_factor(0.5, 2.0)),
        (lamp("disc", (1.0,)), 0.25 / 4.25 / (np.pi * 0.25)),
        (lamp("bulb", (0.2,)), 0.01 / 4.0 / (4.0 * np.pi * 0.01)),
        (lamp("spot", (0.4,), beam_angle_deg=50.0), spot_on_axis(0.2, 2.0, 50.0)),
    ],
    ids=["panel", "disc", "bulb", "spot"],
)
def test_a_lamp_lights_the_point_below_it_as_its_closed_form_says(source: Lamp, expected: float) -> None:
    reference = reference_irradiance(BLACK, materials(BLACK, surface(0.0)), [source], BANDS, sensors((0, 0, 0)))
    # Four standard errors; and rays start 0.1 mm above the sensor, which is 1e-4 of the light, plus round-off.
    assert np.all(np.abs(reference.irradiance - expected) < 8.0 * reference.standard_error + 2e-4 * expected)
    assert np.all(reference.standard_error < 2e-3 * expected)


@needs_llvm
def test_two_equal_lamps_send_twice_the_light_of_one() -> None:
    one, two = (
        lamp("spot", (0.4,), beam_angle_deg=50.0, name=name, center=(x, 0, 2)) for name, x in (("1", -1), ("2", 1))
    )
    black = materials(BLACK, surface(0.0))
    alone, both = (
        reference_irradiance(BLACK, black, lamps, BANDS, sensors((0, 0, 0))) for lamps in ([one], [one, two])
    )
    error = np.hypot(2.0 * alone.standard_error, both.standard_error)
    assert np.all(np.abs(both.irradiance - 2.0 * alone.irradiance) < 8.0 * error)
    assert np.all(error < 0.01 * both.irradiance)


@needs_llvm
def test_a_black_back_of_a_lamp_sends_nothing() -> None:
    source = lamp("panel", (1.0, 1.0), normal=(0.0, 0.0, 1.0))
    reference = reference_irradiance(BLACK, materials(BLACK, surface(0.0)), [source], BANDS, sensors((0, 0, 0)))
    assert np.all(reference.irradiance == 0.0)


@needs_llvm
@pytest.mark.parametrize("custom", ["textbook", "radiance"])
def test_a_closed_room_keeps_its_light(custom: str) -> None:
    # Cube of reflectance ρ with a bulb: the walls' mean is Φ/(S(1 - ρ)); a grid of 6 x 6 points on each side has a mean
    # 0.7 % above it, known from the same grid under another engine and from finer ones.
    cube = trimesh.creation.box(extents=(2, 2, 2))
    cube.invert()
    scan = scan_of(cube)
    ticks = (np.arange(6) + 0.5) / 3.0 - 1.0
    u, v = (axis.ravel() for axis in np.meshgrid(ticks, ticks))
    places, normals = [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            places.append(np.insert(np.stack([u, v], axis=1), axis, 0.999 * sign, axis=1))
            normals.append(np.tile(-sign * np.eye(3)[axis], (36, 1)))
    points = SensorPoints(
        positions=np.concatenate(places), normals=np.concatenate(normals), buried=np.zeros(216, dtype=bool)
    )
    source = lamp("bulb", (0.1,), center=(0, 0, 0))
    walls = materials(scan, surface(SLOPE, specularity=0.1, roughness=0.15))
    reference = reference_irradiance(scan, walls, [source], BANDS, points, cells=12, custom=custom)
    rho = BANDS.reflected_values(SLOPE, FLAT)
    # 1.5 %: the grid's 0.7 %, and what the lobe loses at grazing angles, some per cent of its tenth.
    assert reference.irradiance.mean(axis=0) == pytest.approx(1.0 / (24.0 * (1.0 - rho)), rel=0.015)


@BY_ITS_ERROR
@needs_llvm
@pytest.mark.parametrize("custom", ["textbook", "radiance"])
def test_no_light_comes_into_a_closed_wardrobe_seen_from_behind(custom: str) -> None:
    """Its faces look inward, so that the room's light meets their backs."""
    shell, wardrobe = (
        trimesh.creation.box(bounds=[[-1, -1, 0], [1, 1, 2]]),
        trimesh.creation.box(bounds=[[-0.8, -0.8, 0.2], [-0.2, -0.2, 1.8]]),
    )
    shell.invert()
    wardrobe.invert()
    scan = scan_of(trimesh.util.concatenate([shell, wardrobe]))
    points = sensors([(-0.5, -0.5, 0.3), (-0.4, -0.6, 1.0), (0.5, 0.5, 0.3)])
    source = lamp("panel", (0.5, 0.3), center=(0.4, 0.2, 1.9))
    reference = reference_irradiance(scan, materials(scan, surface(0.7)), [source], BANDS, points, custom=custom)
    assert reference.irradiance[:2].max() == 0.0
    assert reference.irradiance[2].min() > 0.0


@needs_llvm
@pytest.mark.parametrize("custom", ["textbook", "radiance"])
def test_a_closed_room_of_back_faces_keeps_its_light(custom: str) -> None:
    """The cube's faces look outward; a wall's middle gets the same light as from faces that look inward."""
    found = []
    for turned in (False, True):
        cube = trimesh.creation.box(extents=(2, 2, 2))
        if turned:
            cube.invert()
        scan = scan_of(cube)
        source = lamp("bulb", (0.1,), center=(0, 0, 0))
        reference = reference_irradiance(
            scan, materials(scan, surface(0.6)), [source], BANDS, sensors((0, 0, -0.999)), custom=custom
        )
        found.append((reference.irradiance, reference.standard_error))
    (outward, error), (inward, other) = found
    assert np.all(np.abs(outward - inward) < 8.0 * np.hypot(error, other))
    assert np.all(error < 0.01 * outward)


@needs_llvm
def test_both_engines_agree_in_a_furnished_room(tmp_path: Path) -> None:
    check_agreement(*room(), tmp_path)


@BY_ITS_ERROR
@needs_llvm
@pytest.mark.slow
def test_both_engines_agree_on_a_scans_uneven_surface(tmp_path: Path) -> None:
    # Corner normals some 15 degrees off the faces' own: what they mean for reflected light must be the same in both.
    # Taken as Mitsuba does on its own, they would darken the red band by 2 %.
    check_agreement(*room(jitter_m=0.04), tmp_path)


@BY_ITS_ERROR
@needs_llvm
@pytest.mark.slow
def test_both_engines_agree_on_glossy_surfaces(tmp_path: Path) -> None:
    scan, matt, lamps, points = room()
    glossy = MaterialMap(
        materials=(surface(SLOPE, specularity=0.1, roughness=0.15), surface(0.6, kind="metal", specularity=0.5)),
        face_material=matt.face_material,
        face_color=matt.face_color,
        face_seen=matt.face_seen,
    )
    check_agreement(scan, glossy, lamps, points, tmp_path)


@needs_llvm
def test_the_plain_variant_says_what_the_fast_one_says() -> None:
    scan, surfaces, lamps, points = room()
    few = sensors(points.positions[[6, 12]])
    bands = uniform_bands(400.0, 700.0, 3)
    fast = reference_irradiance(scan, surfaces, lamps[:1], bands, few, cells=16)
    plain = reference_irradiance(scan, surfaces, lamps[:1], bands, few, cells=6, repeats=6, plain=True)
    assert (fast.variant, plain.variant) == ("llvm_ad_rgb", "scalar_rgb")
    error = np.hypot(fast.standard_error, plain.standard_error)
    assert np.all(np.abs(fast.irradiance - plain.irradiance) < 8.0 * error)
    assert np.all(error < 0.2 * fast.irradiance)


@needs_llvm
def test_what_is_not_exported_is_refused() -> None:
    glass = materials(BLACK, surface(0.1, kind="glass", transmittance=0.8))
    with pytest.raises(MaterialError, match="glass"):
        reference_irradiance(BLACK, glass, [lamp("disc", (1.0,))], BANDS, sensors((0, 0, 0)))
    matt = materials(BLACK, surface(0.1))
    with pytest.raises(LampError, match="candela"):
        reference_irradiance(BLACK, matt, [lamp("ies", (1.0,), candela_text=DOWNLIGHT)], BANDS, sensors((0, 0, 0)))
    glossy = materials(BLACK, surface(0.3, specularity=0.1))
    with pytest.raises(MaterialError, match="plain variant"):
        reference_irradiance(BLACK, glossy, [lamp("disc", (1.0,))], BANDS, sensors((0, 0, 0)), plain=True)


def backend(present: bool, major: int) -> SimpleNamespace:
    return SimpleNamespace(
        has_backend=lambda which: present,
        JitBackend=SimpleNamespace(LLVM=0),
        detail=SimpleNamespace(llvm_version=lambda: (major, 0, 0)),
    )


@pytest.mark.parametrize(
    ("present", "major", "words"),
    [(False, 0, "is not there"), (True, 16, "LLVM 16 is too old"), (True, 19, "")],
)
def test_a_missing_or_old_llvm_is_said(present: bool, major: int, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)
    fault = variants._fault_of_llvm(backend(present, major))
    assert words in fault
    assert bool(fault) == bool(words)


def test_a_missing_mitsuba_is_an_error_of_ours() -> None:
    with pytest.raises(EngineError, match=r"lidarspectra\[validate\]"):
        variants._load("a_module_that_is_not_there")
