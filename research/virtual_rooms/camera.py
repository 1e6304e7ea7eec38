"""The colour side of a virtual phone: light times reflectance, through the phone's processing, into a texture.

What a pixel of the texture shows is the light that its bit of surface sends, reflectance times irradiance (all
surfaces taken as matt), white balanced, exposed, tone mapped, and cut at white, where the lamps are. That is why a
phone's texture is no reflectance.

Light straight from the lamps is asked for at every corner of the scan, since shadows have edges; light from the other
surfaces changes slowly, and a plane is fitted to it at points around. Means of all light over points 10 to 20 cm apart
would show shadows and corners too bright, which no camera does, and which misleads whoever takes the light out again.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, ByteArray, FloatArray, IntArray, float_array
from lidarspectra.errors import ScanError
from lidarspectra.hardware.phone.texture_atlas import Atlas, split_at_charts
from lidarspectra.spectra.colorimetry import BRADFORD, SRGB_FROM_XYZ, SRGB_WHITE_XYZ, encode_srgb
from lidarspectra.spectra.databases import color_matching_functions
from research.virtual_rooms.phone import ScannedShape
from research.virtual_rooms.room_plan import CameraSection
from research.virtual_rooms.true_room import TrueRoom

NEIGHBOURS = 12  # light points that a plane is fitted to, against the noise of traced light
SIDE_WEIGHT_M = 1.0  # [m] that a normal turned by a radian counts for: a board's two sides have nothing in common
STEADINESS = 1e-2  # [1] of a plane's slopes, which neighbours in a row do not tell
PLANE_RANGE = (0.5, 2.0)  # [1] of the least and the most light around, beyond which a plane is not believed
GRAIN_WAVES = 14  # plane waves that make up a pattern
LAMP_RADIANCE = 20.0  # [1] over the exposure's white: a panel of 3000 cd/m² over a white wall of 100
TEXELS_AT_ONCE = 1_000_000  # bounds memory

DirectLight = Callable[[FloatArray, FloatArray], FloatArray]
"""From (n, 3) positions on the true surface [m] and normals there to (n, wavelength) light straight from the lamps."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceLight:
    """Irradiance at points of the true surface, in any one unit: exposure takes it out.

    Parameters
    ----------
    positions, normals : (point, 3) float
        [m], [1]
    wavelengths_nm : (wavelength,) float
        Evenly spaced, over the visible range. [nm]
    direct : (point, wavelength) float
        Straight from the lamps. [W/m²/nm]
    reflected : (point, wavelength) float
        From other surfaces. [W/m²/nm]
    """

    positions: FloatArray
    normals: FloatArray
    wavelengths_nm: FloatArray
    direct: FloatArray
    reflected: FloatArray

    def __post_init__(self) -> None:
        positions = float_array(self.positions, name="SurfaceLight.positions", shape=(None, 3))
        wavelengths = float_array(self.wavelengths_nm, name="SurfaceLight.wavelengths_nm", shape=(None,))
        shape = (len(positions), wavelengths.size)
        direct = float_array(self.direct, name="SurfaceLight.direct", shape=shape)
        reflected = float_array(self.reflected, name="SurfaceLight.reflected", shape=shape)
        least = min((float(part.min()) for part in (direct, reflected) if part.size), default=0.0)
        if len(positions) < NEIGHBOURS or least < 0 or not (direct.any() or reflected.any()):
            raise ScanError(
                expected=f"light at {NEIGHBOURS} or more points, nowhere negative and somewhere positive",
                found=f"{len(positions)} points, {least:g} at least",
                where="virtual phone",
            )
        object.__setattr__(self, "positions", positions)
        object.__setattr__(self, "normals", float_array(self.normals, name="normals", shape=positions.shape))
        object.__setattr__(self, "wavelengths_nm", wavelengths)
        object.__setattr__(self, "direct", direct)
        object.__setattr__(self, "reflected", reflected)

    @property
    def irradiance(self) -> FloatArray:
        """(point, wavelength) both together [W/m²/nm]."""
        return self.direct + self.reflected


def photograph(
    room: TrueRoom,
    shape: ScannedShape,
    atlas: Atlas,
    light: SurfaceLight,
    direct: DirectLight,
    settings: CameraSection,
    generator: np.random.Generator,
    *,
    shining: BoolArray | None = None,
) -> ByteArray:
    """Paint the texture of a scanned shape.

    Parameters
    ----------
    room : TrueRoom
        What is truly there.
    shape : ScannedShape
        What the phone took it for.
    atlas : Atlas
        Of the shape.
    light : SurfaceLight
    direct : DirectLight
        At the light's wavelengths, in its unit.
    settings : CameraSection
    generator : Generator
        Exposure, grain and noise.
    shining : (surface,) bool, optional
        Which of the room's surfaces are cut at white because they shine; the lamps' if left out.

    Returns
    -------
    texture : (texture_px, texture_px, 3) uint8
        sRGB encoded.
    """
    if shining is None:
        shining = np.array([surface.lamp is not None for surface in room.surfaces])
    linear, surface = seen_light(room, shape, atlas, light, direct, settings, generator)
    lit = (surface >= 0) & shining[surface]
    shown = atlas.covered & ~lit
    bright = np.quantile(linear[shown].max(axis=1), 1.0 - settings.bright_share)
    exposed = linear * (settings.bright_level / bright)
    exposed[lit] = LAMP_RADIANCE
    exposed += generator.normal(scale=settings.noise, size=exposed.shape)
    lit_up = np.maximum(exposed, 0.0)
    toned = filmic_curve(lit_up) if settings.curve == "filmic" else tone_curve(lit_up, settings.tone)
    return np.rint(255.0 * encode_srgb(toned)).astype(np.uint8)


def tone_curve(linear: FloatArray, strength: float) -> FloatArray:
    """(1 + k)x / (1 + kx), cut at 1: 0 to 0, 1 to 1, shadows lifted by up to 1 + k; its inverse is y / (1 + k - ky)."""
    curve: FloatArray = np.minimum((1.0 + strength) * linear / (1.0 + strength * linear), 1.0)
    return curve


def filmic_curve(linear: FloatArray) -> FloatArray:
    """Narkowicz's fit to the ACES film curve, 1 to 1 and cut there: a toe below .02, then a shoulder.

    A power of 1.6 and a shoulder of 6 make it within 3 % (`research.benchmarks.tone_curves`).

    References
    ----------
    Narkowicz (2015) ACES filmic tone mapping curve, y = x(2.51x + .03) / (x(2.43x + .59) + .14).
    """
    cut = np.minimum(linear, 1.0)
    value: FloatArray = cut * (2.51 * cut + 0.03) / (cut * (2.43 * cut + 0.59) + 0.14)
    white = (2.51 + 0.03) / (2.43 + 0.59 + 0.14)
    return value / white


def seen_light(
    room: TrueRoom,
    shape: ScannedShape,
    atlas: Atlas,
    light: SurfaceLight,
    direct: DirectLight,
    settings: CameraSection,
    generator: np.random.Generator,
) -> tuple[FloatArray, IntArray]:
    """White-balanced linear colour of every pixel, and the room's surface that it shows, -1 for none.

    Between the colours of the corners, with the patterns of exposure and materials; parameters as in `photograph`.
    """
    corner_color = _corner_colors(room, shape, atlas, light, direct, settings)
    size = atlas.size_px
    linear = np.empty((size * size, 3), dtype=np.float64)
    surface = np.full(size * size, -1, dtype=np.int64)
    exposure = _Pattern(generator, settings.exposure_spread, (1.0, 1.0, 1.0))
    grains = [_Pattern(generator, material.grain, material.grain_size) for material in room.materials]
    # Seen along the chart's own direction, so that a step shows as a clean edge and not as its own slope.
    directions = atlas.chart_normal[atlas.face_chart]
    for first in range(0, size * size, TEXELS_AT_ONCE):
        texel = np.arange(first, min(first + TEXELS_AT_ONCE, size * size))
        rows, columns = texel // size, texel % size
        face = atlas.texel_face[rows, columns]
        weights = atlas.barycentric(rows, columns)
        points = np.einsum("nk,nkc->nc", weights, shape.vertices[shape.faces[face]])
        true_face = room.nearest_faces(points, directions[face])
        material = room.face_material[true_face]
        linear[texel] = np.einsum("nk,nkc->nc", weights, corner_color[face[:, None], np.arange(3), material[:, None]])
        factor = 1.0 + exposure(points)
        for number, grain in enumerate(grains):
            chosen = material == number
            if room.materials[number].grain > 0:
                factor[chosen] *= 1.0 + np.clip(grain(points[chosen]), -0.9, None)
        linear[texel] *= factor[:, None]
        surface[texel] = room.face_surface[true_face]
    return linear.reshape(size, size, 3), surface.reshape(size, size)


def _corner_colors(
    room: TrueRoom,
    shape: ScannedShape,
    atlas: Atlas,
    light: SurfaceLight,
    direct: DirectLight,
    settings: CameraSection,
) -> FloatArray:
    """(face, 3, material, 3) linear sRGB that each material would show at each corner."""
    origin, faces, _ = split_at_charts(shape.faces, atlas)
    corners = shape.vertices[origin]
    true_face = np.empty(len(origin), dtype=np.int64)
    true_face[faces] = shape.true_face[:, None]  # of a corner of many faces, one
    normals = room.normals[true_face]
    off = np.einsum("vc,vc->v", corners - room.scan.corners[true_face, 0], normals)
    there = direct(corners - off[:, None] * normals, normals) + _reflected(corners, normals, light, settings)
    return material_colors(room, light, there, settings)[faces]


def _reflected(positions: FloatArray, normals: FloatArray, light: SurfaceLight, settings: CameraSection) -> FloatArray:
    """(n, wavelength) light from other surfaces at positions, from planes fitted to that of the points around."""
    tree = cKDTree(np.hstack([light.positions, SIDE_WEIGHT_M * light.normals]))
    distance, index = tree.query(np.hstack([positions, SIDE_WEIGHT_M * normals]), k=NEIGHBOURS)
    offsets = light.positions[index] - positions[:, None]
    weights = _plane_weights(offsets / settings.light_spacing_m, distance / settings.light_spacing_m)
    around = light.reflected[index]
    low, high = PLANE_RANGE[0] * around.min(axis=1), PLANE_RANGE[1] * around.max(axis=1)
    return np.asarray(np.clip(np.einsum("nk,nkw->nw", weights, around), low, high), dtype=np.float64)


def _plane_weights(offsets: FloatArray, distance: FloatArray) -> FloatArray:
    """(n, k) weights that values at (n, k, 3) offsets have in a plane fitted to them, at the origin.

    A mean would show the light from beside where all neighbours lie on one side, as under a ceiling. Near neighbours
    count more, by their (n, k) distance; all lengths over the spacing.
    """
    # Relative to the nearest, so that a corner far from all points still has a weight that is not zero.
    near = np.exp(-0.5 * (distance**2 - distance[:, :1] ** 2))
    near /= near.sum(axis=1, keepdims=True)
    terms = np.concatenate([np.ones((*distance.shape, 1)), offsets], axis=2)
    weighted = np.einsum("nkt,nk->ntk", terms, near)
    normal = weighted @ terms + STEADINESS * np.diag([0.0, 1.0, 1.0, 1.0])
    return np.asarray(np.linalg.solve(normal, weighted)[:, 0], dtype=np.float64)


def material_colors(room: TrueRoom, light: SurfaceLight, irradiance: FloatArray, settings: CameraSection) -> FloatArray:
    """(n, material, 3) linear sRGB, balanced to the mean of the light, of each material under (n, wavelength) light.

    Nothing is below 0.
    """
    reflectance = np.stack([m.reflectance.at(light.wavelengths_nm, outside="nearest") for m in room.materials])
    return light_colors(reflectance, light, irradiance, settings)


def light_colors(
    reflectance: FloatArray, light: SurfaceLight, irradiance: FloatArray, settings: CameraSection
) -> FloatArray:
    """(n, material, 3) as `material_colors`, of (material, wavelength) reflectances."""
    observer = color_matching_functions(light.wavelengths_nm)
    per_material = reflectance[:, :, None] * observer
    xyz = np.einsum("pw,mwc->pmc", irradiance, per_material, optimize=True)
    white = light.irradiance.mean(axis=0) @ observer
    matrix = SRGB_FROM_XYZ @ white_balance_matrix(white / white[1], settings.white_balance)
    return np.asarray(np.maximum(xyz @ matrix.T, 0.0), dtype=np.float64)


def white_balance_matrix(white_xyz: FloatArray, degree: float) -> FloatArray:
    """(3, 3) matrix on XYZ that takes a white to D65, wholly (degree 1) or in part (von Kries on Bradford cones)."""
    gain = (BRADFORD @ SRGB_WHITE_XYZ / (BRADFORD @ white_xyz)) ** degree
    return np.asarray(np.linalg.solve(BRADFORD, gain[:, None] * BRADFORD), dtype=np.float64)


class _Pattern:
    """A random pattern in space: plane waves of about the given wavelengths along x, y and z."""

    def __init__(self, generator: np.random.Generator, deviation: float, lengths_m: tuple[float, ...]) -> None:
        turns = generator.normal(size=(GRAIN_WAVES, 3))
        turns /= np.linalg.norm(turns, axis=1, keepdims=True)
        self._waves = 2 * np.pi * turns / np.array(lengths_m)
        self._phases = generator.uniform(0, 2 * np.pi, size=GRAIN_WAVES)
        self._amplitude = deviation * np.sqrt(2.0 / GRAIN_WAVES)

    def __call__(self, points: FloatArray) -> FloatArray:
        """(n,) relative deviation at points [1]."""
        total = np.zeros(len(points))
        for wave, phase in zip(self._waves, self._phases, strict=True):
            total += np.sin(points @ wave + phase)
        return np.asarray(total * self._amplitude, dtype=np.float64)
