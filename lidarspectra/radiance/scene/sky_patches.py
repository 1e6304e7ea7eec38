"""Patches of the sky: Tregenza's 145 and Reinhart's subdivisions of them, numbered as Radiance's gendaymtx does.

The sky above the horizon is cut in rows of equal height, 90/(7 M + .5) degrees, and each row in patches of equal width,
their number that of Tregenza's row times the subdivision M; a cap closes the zenith. Patch 0 is the ground, 1 the first
of the lowest row, in the north, and they go on clockwise seen from above: north, east, south, west.

A window sends from patch p the flux Φ_p = L_p G_p, with L_p its radiance, and

    G_p = Σ_windows A ∫_p T(θ) cosθ dω   [m² sr].

So a patch is a lamp to the transport: its coefficient is irradiance per flux [m⁻²], as any lamp's.

References
----------
Tregenza, Subdivision of the sky hemisphere for luminance measurements, Lighting Research and Technology 19, 1987.
Reinhart and Walkenhorst, Validation of dynamic RADIANCE-based daylight simulations for a test office with external
blinds, Energy and Buildings 33, 2001. Ward, reinsrc.cal and reinhartb.cal of Radiance, 2013 (the numbers).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import ArgumentError
from lidarspectra.radiance.engine.options import BIN
from lidarspectra.radiance.scene.daylight import Window, outward_of
from lidarspectra.radiance.scene.sky import directions, pane_transmittance

TREGENZA_ROWS = (30, 30, 24, 24, 18, 12, 6)  # patches of each row, from the horizon up
SUBDIVISIONS = (1, 2, 4)  # 145, 577 and 2305 patches
GROUND = 0  # the patch of all that lies below the horizon
FLUX_STEP_DEG = 0.25  # [deg] of the integrals over patches: 48 steps of Tregenza's 12 degrees


@dataclass(frozen=True)
class SkyPatches:
    """A subdivision of the sky, the ground included as patch 0.

    Parameters
    ----------
    subdivision : int
        M: 1 for Tregenza's 145 patches, 2 for 577, 4 for 2305.
    """

    subdivision: int = 1

    def __post_init__(self) -> None:
        if self.subdivision not in SUBDIVISIONS:
            raise ArgumentError(
                expected=f"one of {', '.join(map(str, SUBDIVISIONS))}",
                found=str(self.subdivision),
                where="subdivision of the sky",
            )

    @property
    def row_deg(self) -> float:
        """Height of a row [deg]."""
        return 90.0 / (7 * self.subdivision + 0.5)

    @cached_property
    def rows(self) -> IntArray:
        """(row,) patches of each row from the horizon up, the zenith's one last."""
        counts = np.repeat(TREGENZA_ROWS, self.subdivision) * self.subdivision
        return np.append(counts, 1).astype(np.int64)

    @cached_property
    def firsts(self) -> IntArray:
        """(row,) number of the first patch of each row."""
        return (1 + np.cumsum(self.rows) - self.rows).astype(np.int64)

    def __len__(self) -> int:
        return 1 + int(self.rows.sum())

    @cached_property
    def solid_angles(self) -> FloatArray:
        """(patch,) [sr]; the ground's is 2π, and so is that of all others together."""
        edges = np.radians(np.append(self.row_deg * np.arange(self.rows.size), 90.0))
        each = 2.0 * math.pi * np.diff(np.sin(edges)) / self.rows
        return np.concatenate([[2.0 * math.pi], np.repeat(each, self.rows)])

    @cached_property
    def centers(self) -> FloatArray:
        """(patch, 3) unit vectors to the middles, x east, y north, z up; the ground's points down."""
        row = np.repeat(np.arange(self.rows.size), self.rows)
        column = np.concatenate([np.arange(count) for count in self.rows])
        altitude = np.radians(np.where(row == self.rows.size - 1, 90.0, self.row_deg * (row + 0.5)))
        azimuth = 2.0 * math.pi * column / self.rows[row]
        level = np.cos(altitude)
        above = np.stack([level * np.sin(azimuth), level * np.cos(azimuth), np.sin(altitude)], axis=1)
        return np.concatenate([[[0.0, 0.0, -1.0]], above])

    def patch_of(self, outward: FloatArray) -> IntArray:
        """Patch of each direction.

        Parameters
        ----------
        outward : (..., 3) float
            Unit vectors, x east, y north, z up.

        Returns
        -------
        patch : (...) int
        """
        altitude = np.degrees(np.arcsin(np.clip(outward[..., 2], -1.0, 1.0)))
        row = np.clip(np.floor(altitude / self.row_deg), 0, self.rows.size - 1).astype(np.int64)
        azimuth = np.degrees(np.arctan2(outward[..., 0], outward[..., 1]))
        column = np.floor(azimuth / 360.0 * self.rows[row] + 0.5).astype(np.int64) % self.rows[row]
        return np.where(outward[..., 2] > 0, self.firsts[row] + column, GROUND).astype(np.int64)

    def function_text(self, north_deg: float, lit: IntArray) -> str:
        """Radiance function file: where among some patches that of a ray's direction stands, -1 for all others.

        Parameters
        ----------
        north_deg : float
            The ray's direction is in the scan's axes; see `to_sky_axes`. [deg]
        lit : (some,) int
            The patches.
        """
        place = np.full(len(self), -1)
        place[lit] = np.arange(len(lit))
        turn = math.radians(north_deg)
        last = self.rows.size - 1
        counts, firsts = (",".join(map(str, values)) for values in (self.rows, self.firsts))
        return (
            f"skyalt = Asin(max(-1,min(1,Dz)))/DEGREE;\n"
            f"skyrow = max(0,min({last},floor(skyalt/{self.row_deg:.12g})));\n"
            f"skycount = select(skyrow+1,{counts});\n"
            f"skyeast = {math.cos(turn):.12g}*Dx+({math.sin(turn):.12g})*Dy;\n"
            f"skynorth = ({-math.sin(turn):.12g})*Dx+{math.cos(turn):.12g}*Dy;\n"
            f"skycol = mod(floor(Atan2(skyeast,skynorth)/(2*PI)*skycount+.5),skycount);\n"
            f"skybin = if(Dz,select(skyrow+1,{firsts})+skycol,{GROUND});\n"
            f"{BIN} = select(skybin+1,{','.join(map(str, place))});\n"
        )


def to_sky_axes(vectors: FloatArray, north_deg: float) -> FloatArray:
    """(..., 3) vectors in the scan's axes, turned to x east, y north.

    Parameters
    ----------
    vectors : (..., 3) float
    north_deg : float
        Turn of north from the scan's y axis, counter-clockwise seen from above. [deg]
    """
    turn = math.radians(north_deg)
    east = math.cos(turn) * vectors[..., 0] + math.sin(turn) * vectors[..., 1]
    north = math.cos(turn) * vectors[..., 1] - math.sin(turn) * vectors[..., 0]
    return np.stack([east, north, vectors[..., 2]], axis=-1)


def to_scan_axes(vectors: FloatArray, north_deg: float) -> FloatArray:
    """(..., 3) vectors, x east and y north, turned to the scan's axes; see `to_sky_axes`."""
    return to_sky_axes(vectors, -north_deg)


def patch_geometry(patches: SkyPatches, windows: Sequence[Window], north_deg: float) -> FloatArray:
    """G_p: what each patch sends through the windows per unit of its radiance (see the module's text).

    Parameters
    ----------
    patches : SkyPatches
    windows : sequence of Window
    north_deg : float
        As `to_sky_axes`. [deg]

    Returns
    -------
    geometry : (patch,) float
        0 for patches behind all windows. [m² sr]
    """
    azimuths = np.arange(0.5 * FLUX_STEP_DEG, 360.0, FLUX_STEP_DEG)
    altitudes = np.arange(-90.0 + 0.5 * FLUX_STEP_DEG, 90.0, FLUX_STEP_DEG)
    outward = directions(azimuths, altitudes)  # of the scan's axes
    patch = patches.patch_of(to_sky_axes(outward, north_deg))
    solid_angle = np.cos(np.radians(altitudes)) * math.radians(FLUX_STEP_DEG) ** 2
    geometry = np.zeros(len(patches))
    for window in windows:
        cosine = np.clip(outward @ outward_of(window), 0.0, None)
        passed = window.size[0] * window.size[1] * cosine * pane_transmittance(cosine, window.passes)
        geometry += np.bincount(patch.ravel(), weights=(passed * solid_angle).ravel(), minlength=len(patches))
    return geometry


def around(patches: SkyPatches, directions_up: FloatArray) -> tuple[IntArray, FloatArray]:
    """The four patches around each direction, and the weights by which their values are interpolated there.

    Linear in altitude between two rows and in azimuth between two patches of each, so that what changes evenly over
    the sky is interpolated exactly. Below the middle of the lowest row its own two patches count alone.

    Parameters
    ----------
    patches : SkyPatches
    directions_up : (direction, 3) float
        Unit vectors above the horizon: x east, y north, z up.

    Returns
    -------
    patch : (direction, 4) int
    weight : (direction, 4) float
        They add up to 1.
    """
    altitude = np.degrees(np.arcsin(np.clip(directions_up[:, 2], 0.0, 1.0)))
    turn = np.arctan2(directions_up[:, 0], directions_up[:, 1]) / (2.0 * math.pi)
    top = patches.rows.size - 1
    middles = np.append(patches.row_deg * (np.arange(top) + 0.5), 90.0)
    lower = np.clip(np.searchsorted(middles, altitude, side="right") - 1, 0, top - 1)
    share = np.clip((altitude - middles[lower]) / (middles[lower + 1] - middles[lower]), 0.0, 1.0)
    found, weights = [], []
    for row, of_row in ((lower, 1.0 - share), (lower + 1, share)):
        count = patches.rows[row]
        place = turn * count
        first = np.floor(place).astype(np.int64)
        for column, of_column in ((first, 1.0 - (place - first)), (first + 1, place - first)):
            found.append(patches.firsts[row] + column % count)
            weights.append(of_row * of_column)
    return np.stack(found, axis=1), np.stack(weights, axis=1)


def sun_areas(patches: SkyPatches, windows: Sequence[Window], north_deg: float, suns: FloatArray) -> FloatArray:
    """How the sun's light through the windows is spread over the patches around it, in square metres.

    The flux that the sun sends through the windows is E_n Σ A T(θ) cosθ; its reflected light is that of the same flux
    from the patches around it.

    Parameters
    ----------
    patches : SkyPatches
    windows : sequence of Window
    north_deg : float
        As `to_sky_axes`. [deg]
    suns : (sun, 3) float
        Unit vectors towards the sun: x east, y north, z up.

    Returns
    -------
    areas : (sun, patch) float
        Their sum is Σ A T(θ) cosθ, shared out to patches that shine through a window. [m²]
    """
    towards = to_scan_axes(suns, north_deg)
    areas = np.zeros((len(suns), len(patches)))
    rows = np.arange(len(suns))[:, None]
    for window in windows:
        cosine = np.clip(towards @ outward_of(window), 0.0, None)
        passed = window.size[0] * window.size[1] * cosine * pane_transmittance(cosine, window.passes)
        patch, weight = around(patches, suns)
        weight = weight * (patch_geometry(patches, (window,), north_deg)[patch] > 0)
        total = weight.sum(axis=1, keepdims=True)
        np.add.at(areas, (rows, patch), passed[:, None] * weight / np.where(total > 0, total, 1.0))
    return areas
