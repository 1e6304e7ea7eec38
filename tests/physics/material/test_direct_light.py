"""Direct light on surfaces by ray casting is the engine's."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import lidarspectra as ls
from lidarspectra.geometry.scan import bare_scan
from lidarspectra.progress import silent
from lidarspectra.radiance.engine.engine import find_engine
from lidarspectra.radiance.sampling import direct_light
from lidarspectra.radiance.sampling.direct_light import direct_coefficients

LIFT_M = 0.02


def _box(bounds: list[list[float]], *, cuts: int) -> Any:
    mesh: Any = trimesh.creation.box(bounds=bounds)
    for _ in range(cuts):
        mesh = mesh.subdivide()
    return mesh


def test_cast_light_is_the_engines_lamp_by_lamp_and_in_shadows(tmp_path: Path) -> None:
    parts = [_box([[-1.5, -1.5, 0.0], [1.5, 1.5, 2.6]], cuts=3), _box([[0.7, -0.4, 0.0], [1.3, 0.4, 1.2]], cuts=2)]
    parts[0].invert()
    faces = np.concatenate([parts[0].faces, parts[1].faces + len(parts[0].vertices)])
    scan = bare_scan(np.concatenate([part.vertices for part in parts]), faces)
    lamps = [
        ls.make_lamp("panel", (-0.6, 0.2, 2.5), name="panel", size=(0.6, 0.6), luminous_flux_lm=2000, cct_k=4000),
        ls.make_lamp("bulb", (0.4, -0.7, 1.9), name="bulb", size=0.08, luminous_flux_lm=800, spectrum="A"),
        ls.make_lamp("disc", (0.5, 0.9, 2.5), name="disc", size=0.3, luminous_flux_lm=900, cct_k=3000),
    ]
    places = scan.centers + LIFT_M * scan.normals
    cast = direct_coefficients(scan, lamps, places, scan.normals, tmp_path / "unused")
    traced = direct_light._traced(
        scan, lamps, places, scan.normals, tmp_path, engine=find_engine(), workers=2, progress=silent
    )
    assert not (tmp_path / "unused").exists()  # none of these lamps is asked of the engine
    # The engine cuts a panel into parts and sends 6 rays to each: 2 % where it is whole, 1/24 of it in a penumbra.
    assert cast.mean(axis=1) == pytest.approx(traced.mean(axis=1), rel=0.01)
    lit = traced > 0.05 * traced.mean(axis=1, keepdims=True)
    apart = np.abs(cast[lit] / traced[lit] - 1.0)
    assert np.median(apart) < 0.02
    assert (apart < 0.2).mean() > 0.97
    dark = traced == 0
    assert dark.mean() > 0.05
    assert (cast[dark] > 0.05 * cast.mean()).mean() < 0.02  # lamps cast no shadows here
