"""Rooms of rectangles, photographed in light that a radiosity solution computes from what falls there straight."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.delighting.light_exchange import exchange_matrix
from lidarspectra.radiance.sampling.direct_light import direct_coefficients
from lidarspectra.spectra.colorimetry import encode_srgb

Part = tuple[float, tuple[FloatArray, IntArray]]
"""Reflectance, and vertices and faces, of a surface."""
OFF_M = 1e-3  # [m] light is asked for just off the surface
REFLECTIONS = 40


def plane(corner: FloatArray, along: FloatArray, across: FloatArray, edge_m: float) -> tuple[FloatArray, IntArray]:
    """Vertices and faces of a rectangle, facing along x across; triangles of this size."""
    n, m = (max(1, round(float(np.linalg.norm(side)) / edge_m)) for side in (along, across))
    u, v = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, m + 1), indexing="ij")
    points = corner + u[..., None] * along + v[..., None] * across
    index = np.arange((n + 1) * (m + 1)).reshape(n + 1, m + 1)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]).reshape(-1, 3)
    return points.reshape(-1, 3), faces


def joined(parts: list[Part]) -> tuple[Scan, IntArray, FloatArray]:
    """The surfaces as one scan, the part of each face, and its reflectance."""
    starts = np.cumsum([0, *(len(vertices) for _, (vertices, _) in parts)])
    faces = np.concatenate([mesh + start for (_, (_, mesh)), start in zip(parts, starts, strict=False)])
    member = np.repeat(np.arange(len(parts)), [len(mesh) for _, (_, mesh) in parts])
    scan = bare_scan(np.concatenate([vertices for _, (vertices, _) in parts]), faces)
    return scan, member, np.array([value for value, _ in parts])[member]


def lamp_light(scan: Scan, lamps: list[Lamp], folder: Path) -> FloatArray:
    """(face,) light straight from lamps of one lumen each [m⁻²]."""
    return direct_coefficients(scan, lamps, scan.centers + OFF_M * scan.normals, scan.normals, folder).sum(axis=0)


def exchange(scan: Scan) -> FloatArray:
    """(face, face) share of what a face gets that comes from each: the radiosity of what is there."""
    return exchange_matrix(
        RayCaster(scan), len(scan.faces), scan.centers + OFF_M * scan.normals, scan.normals,
        rays=512, generator=np.random.default_rng(1),
    )[:, :-1]  # fmt: skip


def all_light(shares: FloatArray, reflectance: FloatArray, direct: FloatArray) -> FloatArray:
    """(face,) light, straight and from other faces by their shares (`exchange`)."""
    light = direct
    for _ in range(REFLECTIONS):
        light = direct + shares @ (reflectance * light)
    return light


def painted(scan: Scan, shown: FloatArray, white: BoolArray | None = None) -> Scan:
    """The scan in (face,) grey of linear light, cut at 1; some faces white."""
    color = encode_srgb(np.clip(shown, 0.0, 1.0))
    if white is not None:
        color[white] = 1.0
    corner_color = np.repeat(np.repeat(color[:, None, None], 3, axis=1), 3, axis=2)
    return replace(scan, appearance=replace(scan.appearance, corner_color=corner_color, known=True, color_source=None))
