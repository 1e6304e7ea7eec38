"""Registration of the robot's frame to the scan's: the rigid motion between named points known in both.

Least squares over pairs p -> q: R, t that minimise Σ|R p + t - q|² (Kabsch 1976; Umeyama 1991 for the scale that is
only used as a check of units). In two dimensions R turns about the vertical axis; t may have a vertical component.

References
----------
W. Kabsch, Acta Cryst. A32, 922 (1976). S. Umeyama, IEEE PAMI 13, 376 (1991), Eq. 34 to 43.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.errors import ReadingError
from lidarspectra.io.csv_cells import csv_records, csv_rows

SCALE_TOLERANCE = 0.1  # a larger relative difference in scale means different units, or different points
DEGENERATE = 1e-6  # relative extent below which points on a line (3D) or in a spot do not define a frame


@dataclass(frozen=True, kw_only=True, eq=False)
class Alignment:
    """A rigid motion, q = R p + t.

    Parameters
    ----------
    rotation : (3, 3) float
        R. [1]
    translation : (3,) float
        t. [m]
    names : tuple of str
        Of the points that it was fitted to.
    residuals : (point,) float
        Distance left between each pair. [m]
    scale : float
        Size of the second set over that of the first; 1 for equal units. [1]
    dimensions : int
        2 or 3.
    """

    rotation: FloatArray
    translation: FloatArray
    names: tuple[str, ...]
    residuals: FloatArray
    scale: float
    dimensions: int

    @property
    def rms(self) -> float:
        """Root mean square of the residuals [m]; zero for the fewest points that determine the motion."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    def apply(self, positions: ArrayLike) -> FloatArray:
        """(n, 3) positions in the other frame [m]."""
        return np.asarray(np.asarray(positions, dtype=np.float64) @ self.rotation.T + self.translation)

    def words(self) -> str:
        """The fitted motion in words, for a log."""
        turn = np.degrees(np.arctan2(self.rotation[1, 0], self.rotation[0, 0]))
        parts = ", ".join(
            f"{name} {residual * 100:.1f} cm" for name, residual in zip(self.names, self.residuals, strict=True)
        )
        return (
            f"{self.dimensions}D alignment on {len(self.names)} points: turned {turn:.1f} deg, moved "
            f"({', '.join(f'{t:.3f}' for t in self.translation)}) m; residual {self.rms * 100:.1f} cm rms ({parts}); "
            f"scale {self.scale:.4f}"
        )


def align(source: ArrayLike, target: ArrayLike, *, names: tuple[str, ...] = (), dimensions: int = 2) -> Alignment:
    """Fit the rigid motion of named points.

    Parameters
    ----------
    source, target : (point, 3) float
        The same points in the first and in the second frame. [m]
    names : tuple of str
        Of the points.
    dimensions : int
        2: a turn about the vertical axis (a robot on a floor), two points or more; 3: any turn, three or more.

    Returns
    -------
    alignment : Alignment

    Raises
    ------
    ReadingError
        If there are too few points, they lie in one spot or line, or their sizes differ by more than 10 %.
    """
    p = float_array(source, name="points in the robot's frame", shape=(None, 3))
    q = float_array(target, name="points in the scan's frame", shape=(p.shape[0], 3))
    if dimensions not in (2, 3):
        raise ReadingError(expected="2 or 3 dimensions", found=f"{dimensions}", where="alignment")
    least = dimensions
    if p.shape[0] < least:
        raise ReadingError(
            expected=f"{least} points or more for a {dimensions}D alignment",
            found=f"{p.shape[0]}",
            where="alignment",
            todo="Name points that lie far apart, such as the corners of the room.",
        )
    centers = p.mean(axis=0), q.mean(axis=0)
    a, b = p - centers[0], q - centers[1]
    if dimensions == 2:
        a, b = a * (1.0, 1.0, 0.0), b * (1.0, 1.0, 0.0)
    spread = np.linalg.svd(a, compute_uv=False)
    if spread[dimensions - 2] <= DEGENERATE * max(spread[0], 1e-12) or spread[0] < 1e-3:
        raise ReadingError(
            expected="points apart from one another" if dimensions == 2 else "points that do not lie on one line",
            found=f"extents of {', '.join(f'{s:.3g}' for s in spread)} m",
            where="alignment",
            todo="Name points that lie far apart.",
        )
    scale = float(np.sqrt((b**2).sum() / (a**2).sum()))
    if abs(scale - 1.0) > SCALE_TOLERANCE:
        raise ReadingError(
            expected="the same points in the same unit (metres)",
            found=f"the second set {scale:.3g} times the size of the first",
            where="alignment",
            todo="Check the units, and that each name stands for the same point in both frames.",
        )
    rotation = _rotation(a, b)
    translation = centers[1] - rotation @ centers[0]
    left = p @ rotation.T + translation - q
    if dimensions == 2:
        left = left * (1.0, 1.0, 0.0)
    return Alignment(
        rotation=rotation,
        translation=translation,
        names=names or tuple(str(i + 1) for i in range(p.shape[0])),
        residuals=np.linalg.norm(left, axis=1),
        scale=scale,
        dimensions=dimensions,
    )


def _rotation(a: FloatArray, b: FloatArray) -> FloatArray:
    """Rotation R that best maps a onto b, without mirroring; plane sets turn about the vertical axis."""
    if not a[:, 2].any() and not b[:, 2].any():
        angle = np.arctan2((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum(), (a[:, :2] * b[:, :2]).sum())
        c, s = np.cos(angle), np.sin(angle)
        return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    u, _, vt = np.linalg.svd(b.T @ a)
    mirror = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    return np.asarray(u @ mirror @ vt)


def read_point_pairs(path: Path) -> tuple[tuple[str, ...], FloatArray, FloatArray]:
    """Read named points in both frames.

    Parameters
    ----------
    path : Path
        CSV with columns name, robot_x, robot_y, [robot_z,] scan_x, scan_y, [scan_z]. [m]

    Returns
    -------
    names : tuple of str
    robot, scan : (point, 3) float
        [m]

    Raises
    ------
    ReadingError
        If a column is missing, or a cell is not a number; the message names the row.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines = [line for line in file if line.strip() and not line.startswith("#")]
            wanted = {"name", "robot_x", "robot_y", "scan_x", "scan_y"}
            missing = sorted(wanted - {name.strip() for name in next(csv_rows(lines), [])})
            if missing:
                raise ReadingError(
                    expected=f"columns {', '.join(sorted(wanted))}",
                    found=f"none named {', '.join(missing)}",
                    where=str(path),
                    todo="Write one line for each point that you know in both frames.",
                )
            names, robot, scan = [], [], []
            for number, row in enumerate(csv_records(lines), start=1):
                try:
                    robot.append([float(row[f"robot_{axis}"]) for axis in "xy"] + [float(row.get("robot_z") or 0.0)])
                    scan.append([float(row[f"scan_{axis}"]) for axis in "xy"] + [float(row.get("scan_z") or 0.0)])
                except ValueError as cause:
                    raise ReadingError(
                        expected="numbers [m]", found=str(cause), where=f"{path}, row {number} below the header"
                    ) from cause
                names.append(row["name"])
    except (OSError, UnicodeDecodeError) as cause:
        raise ReadingError(expected="a readable table of points", found=str(cause), where=str(path)) from cause
    return tuple(names), np.array(robot).reshape(-1, 3), np.array(scan).reshape(-1, 3)
