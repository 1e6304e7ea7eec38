"""The glossy lobe is that of Radiance's plastic: what rtrace sees in a glossy floor under a panel."""

from pathlib import Path

import numpy as np
import pytest

from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Panel
from lidarspectra.material.frames.gloss_lobe import LampPieces, highlight
from lidarspectra.radiance.engine.engine import find_engine, float_rows
from lidarspectra.spectra.spectrum import Spectrum

SPECULARITY, RADIANCE, HEIGHT_M = 0.05, 100.0, 2.0
PANEL = Lamp(
    name="panel", shape=Panel(0.6, 0.4), center=np.array([0.2, -0.1, HEIGHT_M]),
    flux=Spectrum(wavelengths_nm=[380.0, 780.0], values=[1.0, 1.0]),
)  # fmt: skip


@pytest.mark.parametrize("roughness", [0.05, 0.1, 0.2])
def test_a_panels_highlight_is_that_of_radiance(tmp_path: Path, roughness: float) -> None:
    (x0, x1), (y0, y1) = (-0.1, 0.5), (-0.3, 0.1)
    (tmp_path / "room.rad").write_text(
        f"void light lit 0 0 3 {RADIANCE} {RADIANCE} {RADIANCE}\n"
        f"lit polygon panel 0 0 12 {x0} {y0} 2 {x0} {y1} 2 {x1} {y1} 2 {x1} {y0} 2\n"
        f"void plastic floor 0 0 5 0 0 0 {SPECULARITY} {roughness}\n"
        "floor polygon ground 0 0 12 -5 -5 0 5 -5 0 5 5 0 -5 5 0\n",
        encoding="utf-8",
    )
    engine = find_engine()
    (tmp_path / "room.oct").write_bytes(engine.run("oconv", ["room.rad"], folder=tmp_path).output)
    generator = np.random.default_rng(5)
    eye = np.column_stack([generator.uniform(-2, 2, (6000, 2)), generator.uniform(0.8, 2.0, 6000)])
    points = np.column_stack([generator.uniform(-1, 1, (6000, 2)), np.zeros(6000)])
    toward = eye - points
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    normals = np.tile([0.0, 0.0, 1.0], (6000, 1))
    (ours,) = SPECULARITY * RADIANCE * highlight(points, normals, toward, np.array([[roughness]]), LampPieces.of(PANEL))
    options = ["-h", "-fff", "-ab", "0", "-dj", "0", "-ds", "0.02", "-st", "0", "-ss", "0", "-lr", "1", "room.oct"]
    rays = np.concatenate([eye, -toward], axis=1).astype("<f4").tobytes()
    theirs = float_rows(engine.run("rtrace", options, folder=tmp_path, stdin=rays), rows=6000, columns=3)
    seen = theirs[:, 1] > 0.02 * theirs[:, 1].max()
    assert seen.sum() > 150
    # Pieces of both are of some 3°, which blurs the edge of a sharp highlight by a few per cent.
    assert np.abs(ours[seen] - theirs[seen, 1]).mean() < 0.03 * theirs[seen, 1].mean()
    assert abs(ours[seen].sum() / theirs[seen, 1].sum() - 1.0) < 0.01
