"""Receptors: how a sensor weighs the directions that light comes from, and directions drawn in that proportion.

A receptor of response R(θ) reads ∫ L R dω. The cosine receptor, R = cosθ, reads irradiance. Directions are drawn
with density R/∫R dω, so that the reading is ∫R dω times the mean of L over them. They lie on a lattice, shifted by a
random vector (Cranley and Patterson 1976): every shift gives an unbiased estimate of its own, with a sixth of the
variance of as many independent directions.

References
----------
Cranley R, Patterson T N L (1976), Randomization of number theoretic methods for multiple integration, SIAM Journal
on Numerical Analysis 13(6), 904-914. Sloan I H, Joe S (1994), Lattice methods for multiple integration (Fibonacci
lattices, Section 4).
"""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.errors import ArrayError, SensorError
from lidarspectra.io.csv_cells import csv_rows

FIBONACCI = (5, 8, 13, 21, 34, 55, 89, 144, 233, 377, 610, 987, 1597, 2584, 4181, 6765)
"""Directions in a set: the numbers for which a two-dimensional lattice is best."""
_CURVE_STEPS = 4096  # intervals of the inverted response curve; the error of a sine between them is below 1e-7


@dataclass(frozen=True, kw_only=True, eq=False)
class Receptor:
    """A response that depends on the angle to the sensor's axis alone.

    Parameters
    ----------
    angles_deg : (n,) float
        From 0, ascending, at most 90. [deg]
    response : (n,) float
        R at these angles, linear between them, zero beyond the last; not negative. [1]
    is_cosine : bool
        True for R = cosθ over the whole hemisphere: such a sensor's direct light can be aimed at the lamps.
    """

    angles_deg: FloatArray
    response: FloatArray
    is_cosine: bool = False

    def __post_init__(self) -> None:
        angles = float_array(self.angles_deg, name="Receptor.angles_deg", shape=(None,))
        response = float_array(self.response, name="Receptor.response", shape=angles.shape)
        ascending = angles.size > 1 and angles[0] == 0 and angles[-1] <= 90 and bool(np.all(np.diff(angles) > 0))
        if not ascending or response.min() < 0 or response.max() <= 0:
            words = f"responses {response.min():g} to {response.max():g}" if response.size else "no response"
            raise SensorError(
                expected="responses of 0 or more at ascending angles from 0 to at most 90 degrees",
                found=f"{angles.size} angles, {words}",
                where="receptor",
            )
        object.__setattr__(self, "angles_deg", angles)
        object.__setattr__(self, "response", response)

    @property
    def measure_sr(self) -> float:
        """∫ R dω, π for the cosine receptor [sr]."""
        return float(self._curve[2])

    def polar_angle(self, share: FloatArray) -> FloatArray:
        """Angle [rad] within which the given share [0-1] of ∫R dω lies."""
        angles, cumulative, _ = self._curve
        return np.interp(share, cumulative, angles)

    def over_cosine(self, cosine: FloatArray) -> FloatArray:
        """R(θ)/cos θ [1] for some cosines; 0 behind the sensor and beyond the last angle."""
        angle = np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))
        response = np.interp(angle, self.angles_deg, self.response, right=0.0)
        return np.where(cosine > 0, response / np.where(cosine > 0, cosine, 1.0), 0.0)

    @property
    def share_of_even_light(self) -> float:
        """What it reads of light that comes evenly from all sides, over its irradiance: ∫R dω / π [1]."""
        return self._curve[2] / float(np.pi)

    @cached_property
    def _curve(self) -> tuple[FloatArray, FloatArray, float]:
        """Angles [rad], the share of ∫R dω within each, and ∫R dω [sr]."""
        if self.is_cosine:
            cumulative = np.linspace(0.0, 1.0, _CURVE_STEPS + 1)
            return np.arcsin(np.sqrt(cumulative)), cumulative, np.pi
        edges = np.radians(self.angles_deg)
        angles = np.unique(np.concatenate([np.linspace(0.0, edges[-1], _CURVE_STEPS + 1), edges]))
        density = np.interp(angles, edges, self.response) * np.sin(angles)
        total = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(angles))])
        return angles, total / total[-1], float(2.0 * np.pi * total[-1])


def cosine_receptor() -> Receptor:
    """R = cosθ: irradiance."""
    angles = np.linspace(0.0, 90.0, 91)
    return Receptor(angles_deg=angles, response=np.maximum(np.cos(np.radians(angles)), 0.0), is_cosine=True)


def cone_receptor(half_angle_deg: float) -> Receptor:
    """R = cosθ up to an angle and nothing beyond: irradiance through a stop that restricts the view.

    Parameters
    ----------
    half_angle_deg : float
        20.5 for the AS7265x without a diffuser (its datasheet). [deg]
    """
    if not 0 < half_angle_deg <= 90:
        raise SensorError(
            expected="a half angle above 0 and up to 90 degrees", found=f"{half_angle_deg:g}", where="view"
        )
    if half_angle_deg == 90:
        return cosine_receptor()
    angles = np.linspace(0.0, half_angle_deg, 181)
    return Receptor(angles_deg=angles, response=np.cos(np.radians(angles)))


def draw_directions(
    receptor: Receptor, normals: FloatArray, *, sets: int, count: int, generator: np.random.Generator
) -> FloatArray:
    """Directions in proportion to a receptor's response, in independent sets.

    Parameters
    ----------
    receptor : Receptor
    normals : (point, 3) float
        Unit vectors along the sensors' axes.
    sets : int
        Independent sets a point.
    count : int
        Directions a set, one of `FIBONACCI`.
    generator : numpy.random.Generator

    Returns
    -------
    directions : (point, set, count, 3) float
        Unit vectors.
    """
    shifted = (lattice(count) + generator.random((normals.shape[0], sets, 1, 2))) % 1.0
    around = normals[:, None, None]
    if receptor.is_cosine:
        return cosine_directions(around, shifted)
    polar = receptor.polar_angle(shifted[..., 0])
    return _turned(around, np.sin(polar), np.cos(polar), shifted[..., 1])


def lattice(count: int) -> FloatArray:
    """(count, 2) points of a Fibonacci lattice in the unit square; `count` is one of `FIBONACCI`, or a poorer one."""
    number = np.arange(count)
    step = round(count / ((1 + 5**0.5) / 2))  # the Fibonacci number before `count`
    return np.stack([number / count, (number * step % count) / count], axis=-1)


def cosine_directions(normals: FloatArray, numbers: FloatArray) -> FloatArray:
    """Directions in proportion to the cosine to a normal (Malley's method: a disc's points, lifted to the sphere).

    Parameters
    ----------
    normals : (..., 3) float
        Unit vectors.
    numbers : (..., 2) float
        Uniform. [0-1]

    Returns
    -------
    directions : (..., 3) float
        Unit vectors.
    """
    share = numbers[..., 0]
    return _turned(normals, np.sqrt(share), np.sqrt(1.0 - share), numbers[..., 1])


def _turned(normals: FloatArray, sine: FloatArray, cosine: FloatArray, turn: FloatArray) -> FloatArray:
    """Unit vectors of given sine and cosine to normals (..., 3), turned about them by a share [0-1] of a circle."""
    azimuth = 2.0 * np.pi * turn
    across = tangents(normals)
    return np.asarray(
        (sine * np.cos(azimuth))[..., None] * across[..., 0, :]
        + (sine * np.sin(azimuth))[..., None] * across[..., 1, :]
        + cosine[..., None] * normals,
        dtype=np.float64,
    )


def tangents(normals: FloatArray) -> FloatArray:
    """(..., 2, 3) two unit vectors perpendicular to each normal (..., 3) and to one another."""
    helper = np.where(np.abs(normals[..., :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    along = np.cross(helper, normals)
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    return np.stack([along, np.cross(normals, along)], axis=-2)


def read_receptor(path: Path) -> Receptor:
    """A receptor from a CSV file with the columns angle_deg and response.

    Parameters
    ----------
    path : Path
        Angles ascending from 0, at most 90 [deg]; cosθ itself would be the response of an ideal irradiance sensor. [1]

    Raises
    ------
    SensorError
        If the file cannot be read or holds something else.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = list(csv_rows(line for line in file if line.strip() and not line.startswith("#")))
        if not rows or [name.strip() for name in rows[0]] != ["angle_deg", "response"]:
            raise ValueError(f"a header '{','.join(rows[0]) if rows else ''}'")
        numbers = np.array([(float(angle), float(response)) for angle, response in rows[1:]]).reshape(-1, 2)
    except (OSError, ValueError) as cause:
        raise SensorError(
            expected="a CSV file with the header 'angle_deg,response' and two numbers a row",
            found=str(cause),
            where=str(path),
            todo="docs/run-file.md shows one.",
        ) from cause
    try:
        return Receptor(angles_deg=numbers[:, 0], response=numbers[:, 1])
    except (ArrayError, SensorError) as cause:
        raise SensorError(expected=cause.expected, found=cause.found, where=str(path)) from cause
