"""A luminaire's candela arrive at every angle, as its file says and as Radiance's own ies2rad has it."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from lidarspectra.geometry.scan import Appearance, Scan, ScanRecord
from lidarspectra.lamps.ies import read_ies
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Luminaire
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.radiance.engine.bands import WRITTEN_PER_WATT
from lidarspectra.radiance.engine.engine import Engine, find_engine, float_rows
from lidarspectra.radiance.scene.scene import write_scene
from lidarspectra.spectra.spectrum import Spectrum, uniform_bands

IES2RAD_EFFICACY = 179.0  # [lm/W] Radiance's convention for white
FAR_M = 20.0
WHITE = Spectrum(wavelengths_nm=[300.0, 1000.0], values=[1.0, 1.0])
DOWN = np.array([0.0, 0.0, -1.0])


def ies_text(*, upward: float, quadrant: bool) -> str:
    """A luminaire without any symmetry but the one that it declares, and with light upward if wanted."""
    theta = np.arange(0.0, 181.0, 7.5)
    phi = np.arange(0.0, 91.0, 22.5) if quadrant else np.arange(0.0, 361.0, 22.5)
    t, p = np.radians(theta)[None, :], np.radians(phi)[:, None]
    candela = 800 * np.cos(t).clip(0) ** 2 * (1 + 0.6 * np.sin(t) * np.cos(p + (0 if quadrant else 0.7)))
    candela = candela + upward * (-np.cos(t)).clip(0) ** 2 * (1 + 0.3 * np.sin(t) * np.sin(p))
    rows = "\n".join(" ".join(f"{value:.5f}" for value in row) for row in candela)
    return (
        "IESNA:LM-63-1995\n[LUMCAT] X\nTILT=NONE\n"
        f"1 1000 1 {theta.size} {phi.size} 1 2 0.2 0.4 0\n1 1 20\n"
        f"{' '.join(map(str, theta))}\n{' '.join(map(str, phi))}\n{rows}\n"
    )


@pytest.fixture(scope="module")
def engine() -> Engine:
    return find_engine()


def sphere_of_sensors(count: int) -> tuple[np.ndarray, np.ndarray]:
    """(count,) θ and φ [deg] all over, none within half a degree of the luminaire's own plane."""
    generator = np.random.default_rng(3)
    theta = np.degrees(np.arccos(generator.uniform(-1, 1, count)))
    phi = generator.uniform(0, 360, count)
    keep = np.abs(theta - 90) > 0.5
    return theta[keep], phi[keep]


def rays(directions: np.ndarray, center: np.ndarray) -> bytes:
    """Sensors far away in these directions, that look at the luminaire."""
    return np.concatenate([center + FAR_M * directions, -directions], axis=1).astype("<f4").tobytes()


def scene_intensity(engine: Engine, folder: Path, lamp: Lamp, directions: np.ndarray) -> np.ndarray:
    """(direction,) intensity per unit flux that the written scene sends [1/sr]."""
    speck = trimesh.creation.box(extents=(0.01, 0.01, 0.01)).apply_translation((0, 0, 3 * FAR_M))
    scan = Scan(
        vertices=speck.vertices,
        faces=speck.faces,
        appearance=Appearance(
            images=(), face_image=np.full(12, -1), corner_uv=np.zeros((12, 3, 2)), corner_color=np.ones((12, 3, 3))
        ),
        record=ScanRecord(
            file="s", unit="m", unit_confidence=1, up_axis="+z", up_confidence=1, faces_read=12, faces_kept=12
        ),
    )
    black = Material(
        name="black", category="unknown", reflectance=WHITE.scaled(0.0), source="default", provenance="default",
        confidence=1.0, measured_range_nm=(300, 1000), color=(0, 0, 0),
    )  # fmt: skip
    materials = MaterialMap(
        materials=(black,), face_material=np.zeros(12, dtype=int), face_color=np.zeros((12, 3)), face_seen=np.ones(12)
    )
    scene = write_scene(scan, materials, [lamp], uniform_bands(400, 700, 3), folder, engine=engine)
    (only,) = scene.passes
    options = ["-h", "-fff", "-I+", "-ab", "0", "-dj", "0", *only.group.options, "-co+", only.octree]
    run = engine.run("rtrace", options, folder=folder, stdin=rays(directions, lamp.center))
    return only.group.from_engine(float_rows(run, rows=len(directions), columns=3))[:, 1] / WRITTEN_PER_WATT * FAR_M**2


@pytest.mark.parametrize("quadrant", [True, False])
@pytest.mark.parametrize("upward", [0.0, 300.0])
@pytest.mark.parametrize(
    ("normal", "rotation"),
    [(DOWN, 0.0), (DOWN, 35.0), (np.array([0.5, -0.3, -0.8]), -100.0), (np.array([1.0, 0, 0]), 0.0)],
)
def test_candela_arrive_at_every_angle(
    engine: Engine, tmp_path: Path, quadrant: bool, upward: float, normal: np.ndarray, rotation: float
) -> None:
    text = ies_text(upward=upward, quadrant=quadrant)
    table = read_ies(text, where="test")
    lamp = Lamp(
        name="l", shape=Luminaire(text, (0.02, 0.01)), center=np.array([1.0, 2.0, 3.0]), normal=normal, flux=WHITE,
        rotation_deg=rotation,
    )  # fmt: skip
    theta, phi = sphere_of_sensors(200)
    # The luminaire's own axes, from its definition: z against the normal, x the turned length, y = z × x.
    up = -lamp.normal
    reference = np.array([0.0, 1.0, 0.0]) if abs(lamp.normal[0]) > 0.999 else np.array([1.0, 0.0, 0.0])
    x = reference - (reference @ up) * up
    x /= np.linalg.norm(x)
    turn = np.radians(rotation)
    x = np.cos(turn) * x + np.sin(turn) * np.cross(lamp.normal, x)  # about the normal
    y = np.cross(up, x)
    t, p = np.radians(theta)[:, None], np.radians(phi)[:, None]
    directions = np.sin(t) * np.cos(p) * x + np.sin(t) * np.sin(p) * y - np.cos(t) * up
    seen = scene_intensity(engine, tmp_path, lamp, directions)
    expected = table.at(theta, phi) / table.luminous_flux_lm()
    # 0.2 %: single precision of the angles, and a lamp of 2 cm seen from 20 m.
    np.testing.assert_allclose(seen, expected, rtol=2e-3, atol=1e-3 * expected.max())


def test_ies2rad_gives_the_same_light(engine: Engine, tmp_path: Path) -> None:
    """Another reader of the same file, in candela: ours times its lumens."""
    text = ies_text(upward=0.0, quadrant=True)
    table = read_ies(text, where="test")
    (tmp_path / "lum.ies").write_text(text, encoding="utf-8", newline="\n")
    engine.run("ies2rad", ["-dm", "-o", "lum", "lum.ies"], folder=tmp_path)
    (tmp_path / "lum.oct").write_bytes(engine.run("oconv", ["lum.rad"], folder=tmp_path).output)
    theta, phi = sphere_of_sensors(200)
    below = theta < 85
    t, p = np.radians(theta[below])[:, None], np.radians(phi[below])[:, None]
    directions = np.concatenate([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), -np.cos(t)], axis=1)
    options = ["-h", "-fff", "-I+", "-ab", "0", "-dj", "0", "-ds", "0.01", "lum.oct"]
    run = engine.run("rtrace", options, folder=tmp_path, stdin=rays(directions, np.zeros(3)))
    theirs = float_rows(run, rows=len(directions), columns=3)[:, 1] * FAR_M**2 * IES2RAD_EFFICACY
    lamp = Lamp(name="l", shape=Luminaire(text, (0.4, 0.2)), center=np.zeros(3), normal=DOWN, flux=WHITE)
    ours = scene_intensity(engine, tmp_path / "ours", lamp, directions) * table.luminous_flux_lm()
    np.testing.assert_allclose(ours, theirs, rtol=5e-3, atol=1e-3 * theirs.max())
