"""Light straight through windows, by ray casting: from every patch of the sky, and from the sun.

It is a geometric quantity without noise, the same at all wavelengths. A window is cut into small cells; each sends
the point the light of the patch of sky that lies behind it,

    C_p = 1/G_p Σ_cells T(θ) cosθ cosθ_s ΔA/r²   over the cells of patch p that the point sees,

θ at the pane, θ_s at the sensor. The sun's light comes from where it really stands: T(θ) cosθ_s where the way
from the point to the sun passes through a window and meets nothing else.
"""

from collections.abc import Sequence

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.radiance.sampling.sensor_rays import SENSOR_OFFSET_M
from lidarspectra.radiance.scene.daylight import Window, window_shape
from lidarspectra.radiance.scene.openings import CURTAIN_M, REVEAL_M
from lidarspectra.radiance.scene.sky import pane_transmittance
from lidarspectra.radiance.scene.sky_patches import to_scan_axes, to_sky_axes
from lidarspectra.radiance.scene.sky_scene import SkyScene
from lidarspectra.room.sensor_points import SensorPoints

CELLS = 64  # along each side of a window: 2 cm of one of 1.3 m; right within .6 % at .3 m from it
FEWER_CELLS = (1000, 32)  # with more points than this: so many
POINTS_AT_ONCE = 64  # bounds the memory to some 100 MB
CLEAR_SHARE = 1.0 - 1e-3  # [1] of the way to a window that has to be clear; the window itself is at its end


def direct_sky(sky_scene: SkyScene, points: SensorPoints, caster: RayCaster) -> FloatArray:
    """Coefficient of the light straight from each patch of the sky (see the module's text).

    Parameters
    ----------
    sky_scene : SkyScene
    points : SensorPoints
    caster : RayCaster
        The room's surfaces, and lamps that stand in the way.

    Returns
    -------
    coefficient : (lamp, point) float
        [m⁻²]
    """
    lamp_of: IntArray = np.full(len(sky_scene.patches), -1, dtype=np.int64)
    lamp_of[sky_scene.lit] = np.arange(sky_scene.lit.size)
    count = CELLS if len(points) <= FEWER_CELLS[0] else FEWER_CELLS[1]
    found = np.zeros((len(points), sky_scene.lit.size))
    for window in sky_scene.windows:
        cells = _cells(window, count)
        for first in range(0, len(points), POINTS_AT_ONCE):
            part = slice(first, first + POINTS_AT_ONCE)
            found[part] += _from_window(sky_scene, window, cells, points, part, caster, lamp_of)
    return np.asarray((found / sky_scene.geometry).T)


def sunlit(
    windows: Sequence[Window], points: SensorPoints, caster: RayCaster, suns: FloatArray, north_deg: float
) -> FloatArray:
    """Irradiance straight from the sun over that on a plane facing it outside, T(θ) cosθ_s.

    Parameters
    ----------
    windows : sequence of Window
    points : SensorPoints
    caster : RayCaster
    suns : (sun, 3) float
        Unit vectors towards the sun, x east, y north, z up.
    north_deg : float
        Turn of north from the scan's y axis. [deg]

    Returns
    -------
    share : (sun, point) float
        0 in the shade. [1]
    """
    towards = to_scan_axes(suns, north_deg)
    at_sensor = np.clip(towards @ points.normals.T, 0.0, None)
    share = np.zeros_like(at_sensor)
    starts = points.positions + SENSOR_OFFSET_M * points.normals
    for window in windows:
        glass = window_shape(window)
        cosine = -(towards @ glass.normal)  # outward is against the window's normal
        facing = np.flatnonzero(cosine > 1e-6)
        for sun in facing:
            way = ((glass.place.center - starts) @ glass.normal) / -cosine[sun]  # [m] along the ray
            offset = starts + way[:, None] * towards[sun] - glass.place.center
            through = (np.abs(offset @ glass.place.length) < 0.5 * glass.length) & (
                np.abs(offset @ glass.place.width) < 0.5 * glass.width
            )
            lit = np.flatnonzero(through & (way > 0) & (at_sensor[sun] > 0))
            if lit.size:
                free = _sun_is_free(caster, starts[lit], towards[sun], way[lit], float(cosine[sun]))
                passed = float(pane_transmittance(cosine[sun], window.passes))
                share[sun, lit[free]] = passed * at_sensor[sun, lit[free]]
    return share


def _sun_is_free(
    caster: RayCaster, starts: FloatArray, towards: FloatArray, way: FloatArray, cosine: float
) -> BoolArray:
    """(ray,) whether nothing stands in the sun's way but what a window's own pane, frame and reveal are.

    As in `openings`, the mesh counts as open from `REVEAL_M` outside a window's plane to `CURTAIN_M` inside.
    """
    inside = np.maximum(way - CURTAIN_M / cosine, 1e-6)
    outside = starts + (way + REVEAL_M / cosine)[:, None] * towards
    blocked = caster.blocked(starts, inside[:, None] * towards, max_distance=1.0)
    return ~(blocked | caster.blocked(outside, towards))


def _cells(window: Window, count: int) -> FloatArray:
    """(cell, 3) middles of count x count cells of a window [m]."""
    glass = window_shape(window)
    middle = (np.arange(count) + 0.5) / count - 0.5
    along, across = (each.ravel() for each in np.meshgrid(middle, middle, indexing="ij"))
    return glass.place.points(along * glass.length, across * glass.width)


def _from_window(
    sky_scene: SkyScene,
    window: Window,
    cells: FloatArray,
    points: SensorPoints,
    part: slice,
    caster: RayCaster,
    lamp_of: IntArray,
) -> FloatArray:
    """(point, lamp) Σ T(θ) cosθ cosθ_s ΔA/r² through one window [sr]."""
    normals = points.normals[part]
    starts = points.positions[part] + SENSOR_OFFSET_M * normals
    ways = cells - starts[:, None]
    distance = np.linalg.norm(ways, axis=-1)
    outward = ways / distance[..., None]
    at_sensor = np.einsum("pcx,px->pc", outward, normals)
    at_pane = outward @ -window_shape(window).normal
    area = window.size[0] * window.size[1] / len(cells)
    value = pane_transmittance(at_pane, window.passes) * at_pane * at_sensor * area / distance**2
    lamp = lamp_of[sky_scene.patches.patch_of(to_sky_axes(outward, sky_scene.north_deg))]
    point, cell = np.nonzero((at_sensor > 0) & (at_pane > 0) & (lamp >= 0))
    clear = ~caster.blocked(starts[point], ways[point, cell], max_distance=CLEAR_SHARE)
    point, cell = point[clear], cell[clear]
    shape = (len(starts), sky_scene.lit.size)
    where = np.ravel_multi_index((point, lamp[point, cell]), shape)
    found = np.bincount(where, weights=value[point, cell], minlength=shape[0] * shape[1])
    return np.asarray(found.reshape(shape), dtype=np.float64)
