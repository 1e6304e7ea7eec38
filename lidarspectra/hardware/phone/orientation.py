"""Which way is up in a scan's file, and in which unit it is.

Both are found together as a posterior: for every unit and axis, how plausible the room would be (2.6 m high, some
metres wide, with large level surfaces and furniture near the floor), times the prior that the format declares. The
distributions are heavy-tailed, so that an unusual room is doubted but not excluded.
"""

from dataclasses import dataclass
from typing import get_args

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.spatial.transform import Rotation

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.errors import ScanError
from lidarspectra.geometry.triangles import triangle_crosses
from lidarspectra.hardware.phone.raw_mesh import Axis, Unit

METRES_PER_UNIT: dict[Unit, float] = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
UNITS: tuple[Unit, ...] = get_args(Unit)
AXES: tuple[Axis, ...] = get_args(Axis)

ROOM_HEIGHT_M = 2.6  # [m] common ceiling height; the building codes of most countries ask for 2.3 to 2.5 m at least
ROOM_HEIGHT_SPREAD = 0.22  # spread of its logarithm: 1.8 m (a partial scan) to 4 m lie within two spreads
ROOM_WIDTH_M = 4.5  # [m] common side of a room
ROOM_WIDTH_SPREAD = 0.6  # spread of its logarithm: 1.4 m to 15 m lie within two spreads
TAIL_FREEDOM = 3.0  # degrees of freedom of Student's t, the heavy-tailed distribution used here
UNIT_LOG_PRIOR: dict[Unit, float] = {"m": 0.0, "cm": -1.5, "mm": -1.5, "in": -4.0, "ft": -4.0}  # phones write metres
AXIS_LOG_PRIOR: dict[Axis, float] = {"+y": 0.0, "+z": 0.0, "-y": -4.0, "-z": -4.0, "+x": -4.0, "-x": -6.0}
DECLARED_LOG_ODDS = 10.0  # a format's own definition is wrong once in some 20,000 files
AS_GIVEN_LOG_ODDS = 5.0  # the same by programs that write what they were given: that of apps mostly, of a PLY at times
USUAL_LOG_ODDS = 1.0  # a habit of programs: three files in four
LEVEL_COSINE = 0.966  # cos 15 degrees: steeper than any floor, finer than scan noise
LEVEL_WEIGHT = 8.0  # log odds per share of the area that is level
LOW_WEIGHT = 12.0  # log odds per share of the height by which furniture lies below the middle
TABLE_WEIGHT = 3.0  # log odds where all level surfaces between floor and ceiling face up
END_SHARE = 0.12  # share of the height taken as floor, and as ceiling, with their unevenness
EXTENT_QUANTILE = 0.005  # share of the area beyond the extent on either side, such as seen through a window
MIN_ROOM_M, LARGEST_ROOM_M = 0.3, 1000.0  # [m] longest side; neither a table-top object nor a landscape
LEAN_DEG = (1.5, 35.0)  # [deg] of a scan that is set upright; phones know the vertical better than the least
NEAR_AXIS_DEG = 10.0  # [deg] from floor and ceiling, within which faces belong to them: noise tilts small triangles far
AXIS_BIN, AXIS_STEPS = 0.02, 8  # [1] of the histogram of normals, about 1°; steps of the mean about its peak
MIN_LEVEL_SHARE = 0.1  # [1] of all area, that floor and ceiling must have
UPRIGHT_COSINE = 0.25  # |n_z| of what may be a wall, within 14° of upright
SURE = 0.8  # a lower confidence gives a note
UNIT_UNCERTAIN, AXIS_UNCERTAIN = "The unit of the file is uncertain", "The upward axis is uncertain"  # of notes
_MAX_FACES = 200_000  # a larger sample gives the same result


@dataclass(frozen=True, kw_only=True)
class Orientation:
    """Unit and upward axis of a file.

    Parameters
    ----------
    unit, up : str
        The most probable.
    unit_confidence, up_confidence : float
        Their probabilities; 1 where the user gave them. [0-1]
    notes : tuple of str
        What is uncertain, and where the geometry overruled the format.
    levelling : (3, 3) float, optional
        Rotation that sets a scan upright which leans about its upward axis. [1]
    """

    unit: Unit
    unit_confidence: float
    up: Axis
    up_confidence: float
    notes: tuple[str, ...] = ()
    levelling: FloatArray | None = None

    @property
    def rotation(self) -> FloatArray:
        """(3, 3) rotation of the file's axes to z up; one about the vertical is left as it is [1]."""
        turn = upright_rotation(self.up)
        return turn if self.levelling is None else self.levelling @ turn

    def apply(self, vertices: FloatArray) -> FloatArray:
        """Bring positions of the file, (n, 3), to metres and z up."""
        return np.asarray(vertices @ self.rotation.T * METRES_PER_UNIT[self.unit], dtype=np.float64)


def upright_rotation(up: Axis) -> FloatArray:
    """Proper rotation by a right angle (or two) that brings an axis of the file to +z.

    Parameters
    ----------
    up : str
        The file's upward axis.

    Returns
    -------
    rotation : (3, 3) float
        z-up position = rotation @ position; its elements are 0, 1 and -1. [1]
    """
    rows: dict[Axis, list[list[float]]] = {
        "+x": [[0, 0, -1], [0, 1, 0], [1, 0, 0]],
        "-x": [[0, 0, 1], [0, 1, 0], [-1, 0, 0]],
        "+y": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
        "-y": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
        "+z": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
        "-z": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
    }
    return np.array(rows[up], dtype=np.float64)


def find_orientation(
    vertices: FloatArray,
    faces: IntArray,
    *,
    declared_unit: Unit | None = None,
    declared_up: Axis | None = None,
    as_given: bool = False,
    usual_up: Axis | None = None,
    unit: Unit | None = None,
    up: Axis | None = None,
    level: bool = True,
    where: str = "scan",
) -> Orientation:
    """Find unit and upward axis of a room's mesh.

    Parameters
    ----------
    vertices : (vertex, 3) float
        In the file's unit and axes.
    faces : (face, 3) int
        Corners.
    declared_unit, declared_up : str, optional
        What the format says; overruled only by a room that is absurd otherwise.
    as_given : bool
        Whether the file's program is known to write coordinates as it has them: the axis is overruled sooner then.
    usual_up : str, optional
        What most files of the format have; decides only where the geometry is ambiguous.
    unit, up : str, optional
        What the user states; used as given, with confidence 1.
    level : bool
        Set a mesh upright that leans about its upward axis.
    where : str
        Name of the file, for errors.

    Returns
    -------
    orientation : Orientation

    Raises
    ------
    ScanError
        If the room would be no larger than `MIN_ROOM_M`, or larger than `LARGEST_ROOM_M`, in that unit.
    """
    surface = _Surface.of(vertices, faces, where=where)
    log_odds = np.array([[_log_odds(surface, u, a, declared_unit) for a in AXES] for u in UNITS])
    log_odds += _axis_log_priors(declared_up, AS_GIVEN_LOG_ODDS if as_given else DECLARED_LOG_ODDS)
    if usual_up is not None and declared_up is None:
        log_odds[:, AXES.index(usual_up)] += USUAL_LOG_ODDS
    if unit is not None:
        log_odds[[u != unit for u in UNITS]] = -np.inf
    if up is not None:
        log_odds[:, [a != up for a in AXES]] = -np.inf
    odds = np.exp(log_odds - log_odds.max())
    probability = odds / odds.sum()
    of_unit, of_axis = probability.sum(axis=1), probability.sum(axis=0)
    found_unit, found_up = UNITS[int(of_unit.argmax())], AXES[int(of_axis.argmax())]
    notes = _notes(found_unit, of_unit.max(), found_up, of_axis.max(), unit or declared_unit, up or declared_up)
    if unit is None and declared_unit is None and found_unit != "m" and of_unit.max() >= SURE:
        notes += (_unit_note(surface, found_unit, found_up),)
    levelling = _levelling(surface.normals @ upright_rotation(found_up).T, surface.weights) if level else None
    if levelling is not None:
        notes += (_leaning_note(levelling),)
    orientation = Orientation(
        unit=found_unit,
        unit_confidence=float(min(1.0, of_unit.max())),
        up=found_up,
        up_confidence=float(min(1.0, of_axis.max())),
        notes=notes,
        levelling=levelling,
    )
    _check_size(surface, found_unit, where=where)
    return orientation


@dataclass(frozen=True, kw_only=True, eq=False)
class _Surface:
    """Faces as the weighing needs them: share of area, unit normal, centre; and the extents of the whole."""

    weights: FloatArray
    normals: FloatArray
    centers: FloatArray
    low: FloatArray
    high: FloatArray

    @property
    def extents(self) -> FloatArray:
        return self.high - self.low

    @classmethod
    def of(cls, vertices: FloatArray, faces: IntArray, *, where: str) -> "_Surface":
        step = -(-faces.shape[0] // _MAX_FACES)
        corners = vertices[faces[::step]]
        crosses = triangle_crosses(corners)
        doubled = np.linalg.norm(crosses, axis=1)
        if not doubled.sum() > 0:
            raise ScanError(
                expected="triangles that have an area",
                found=f"{faces.shape[0]} that have none",
                where=where,
                todo="Export the scan again as a mesh.",
            )
        bounds = np.array([_weighted_bounds(corners[:, :, axis], doubled) for axis in range(3)])
        return cls(
            weights=doubled / doubled.sum(),
            normals=crosses / np.where(doubled > 0, doubled, 1.0)[:, np.newaxis],
            centers=corners.mean(axis=1),
            low=bounds[:, 0],
            high=bounds[:, 1],
        )


def _weighted_bounds(values: FloatArray, weights: FloatArray) -> tuple[float, float]:
    """The (face, 3) values between which all of the area but twice `EXTENT_QUANTILE` lies."""
    spread = np.repeat(weights / 3.0, 3)
    order = np.argsort(values, axis=None)
    share = np.cumsum(spread[order]) / spread.sum()
    low, high = np.searchsorted(share, [EXTENT_QUANTILE, 1.0 - EXTENT_QUANTILE])
    sorted_values = values.ravel()[order]
    return float(sorted_values[low]), float(sorted_values[min(high, sorted_values.size - 1)])


def _axis_log_priors(declared: Axis | None, log_odds: float) -> FloatArray:
    """(axis,) of `AXES`; what a format declares replaces what is usual among files that declare nothing."""
    return np.array([AXIS_LOG_PRIOR[axis] if declared is None else -log_odds * (axis != declared) for axis in AXES])


def _log_odds(surface: _Surface, unit: Unit, up: Axis, declared_unit: Unit | None) -> float:
    """How well a unit and an upward axis explain a room, as the logarithm of an unnormalized probability."""
    axis = "xyz".index(up[1])
    sign = 1.0 if up[0] == "+" else -1.0
    extents_m = surface.extents * METRES_PER_UNIT[unit]
    height = _log_plausible(extents_m[axis], ROOM_HEIGHT_M, ROOM_HEIGHT_SPREAD)
    widths = sum(
        _log_plausible(extents_m[other], ROOM_WIDTH_M, ROOM_WIDTH_SPREAD) for other in range(3) if other != axis
    )
    # What a format declares of its unit replaces what is usual among files that declare nothing.
    unit_prior = UNIT_LOG_PRIOR[unit] if declared_unit is None else -DECLARED_LOG_ODDS * (unit != declared_unit)
    return float(unit_prior + height + widths + _level_log_odds(surface, axis, sign))


def _log_plausible(value: float, usual: float, spread: float) -> float:
    """Logarithm of Student's t density (up to a constant) of the logarithm of a length."""
    deviation = (np.log(max(value, 1e-12)) - np.log(usual)) / spread
    return float(-0.5 * (TAIL_FREEDOM + 1.0) * np.log1p(deviation**2 / TAIL_FREEDOM))


def _level_log_odds(surface: _Surface, axis: int, sign: float) -> float:
    """Evidence of the surfaces: much level area; what stands in the room stands low, and is seen from above."""
    along = surface.normals[:, axis] * sign
    level: BoolArray = np.abs(along) > LEVEL_COSINE
    span = max(float(surface.extents[axis]), 1e-300)
    height = (surface.centers[:, axis] - surface.low[axis]) / span
    if sign < 0:
        height = 1.0 - height
    between = (height > END_SHARE) & (height < 1.0 - END_SHARE)
    evidence = LEVEL_WEIGHT * float(surface.weights[level].sum())
    # Walls fill the height evenly and would only dilute what furniture says; they stand upright on this axis.
    standing = between & (np.abs(along) > 1.0 - LEVEL_COSINE)
    weight = surface.weights[standing]
    if weight.sum() > 0:
        mean = float((weight * height[standing]).sum() / weight.sum())
        share = min(1.0, 5.0 * float(weight.sum()))  # a few stray triangles say little
        evidence += LOW_WEIGHT * share * (0.5 - mean)
    tables = between & level
    if surface.weights[tables].sum() > 0:
        inward = np.sign(-float((surface.weights * along * (height - 0.5))[level & ~between].sum()) or 1.0)
        facing = float((surface.weights * np.sign(along))[tables].sum() / surface.weights[tables].sum())
        evidence += TABLE_WEIGHT * min(1.0, 20.0 * float(surface.weights[tables].sum())) * inward * facing
    return evidence


def _notes(
    unit: Unit, unit_sure: float, up: Axis, up_sure: float, said_unit: Unit | None, said_up: Axis | None
) -> tuple[str, ...]:
    notes = []
    if said_unit is not None and said_unit != unit:
        notes.append(
            f"The file declares {said_unit} as its unit, but the room would then have an impossible size, so {unit} was"
            " assumed. Check the room's dimensions, and set unit in [scan] if they are wrong."
        )
    if said_up is not None and said_up != up:
        notes.append(
            f"The file declares {said_up} as its upward axis, but its floor and furniture face {up}, so {up} was"
            " assumed. Check the floor plan, and set up in [scan] if it is wrong."
        )
    if unit_sure < SURE:
        notes.append(
            f"{UNIT_UNCERTAIN}: {unit} was assumed, with a probability of {unit_sure:.0%}. All lengths"
            " scale with it. Check the room's dimensions, and set unit in [scan] if they are wrong."
        )
    if up_sure < SURE:
        notes.append(
            f"{AXIS_UNCERTAIN}: {up} was assumed, with a probability of {up_sure:.0%}. Check the floor"
            " plan, and set up in [scan] if it is wrong."
        )
    return tuple(notes)


def _unit_note(surface: _Surface, unit: Unit, up: Axis) -> str:
    """What a unit that the room's size alone tells makes of it: a hall in metres has the size of a room in feet."""
    height = "xyz".index(up[1])
    length, width = sorted(np.delete(surface.extents, height), reverse=True)
    size = " x ".join(f"{METRES_PER_UNIT[unit] * side:.1f}" for side in (length, width, surface.extents[height]))
    meant = " x ".join(f"{side:.3g}" for side in (length, width, surface.extents[height]))
    return (
        f"The file does not say its unit. By the room's size {unit} was assumed, by which it is {size} m; in metres it"
        f" would be {meant} m. All lengths scale with it. If that is wrong, set unit in [scan]."
    )


def _levelling(normals: FloatArray, weights: FloatArray) -> FloatArray | None:
    """Rotation that sets floor and ceiling level, where they lean by `LEAN_DEG` and walls stand better for it.

    Parameters
    ----------
    normals : (face, 3) float
        Unit normals, z up.
    weights : (face,) float
        Shares of the area.

    Returns
    -------
    rotation : (3, 3) float or None
    """
    axis = _level_axis(normals, weights)
    share = float(weights[np.abs(normals @ axis) > np.cos(np.radians(NEAR_AXIS_DEG))].sum())
    lean_deg = float(np.degrees(np.arccos(np.clip(axis[2], -1.0, 1.0))))
    # What either takes for a wall: a ramp's walls stand worse on it than they do upright.
    off = np.abs(np.stack([normals[:, 2], normals @ axis]))
    walls = off.min(axis=0) < UPRIGHT_COSINE
    before, after = off[:, walls] @ weights[walls]
    if not LEAN_DEG[0] <= lean_deg <= LEAN_DEG[1] or share < MIN_LEVEL_SHARE or after >= before:
        return None
    # About the line in which both planes meet, so that nothing turns about the vertical.
    line = np.array([axis[1], -axis[0], 0.0]) / np.hypot(*axis[:2])
    return np.asarray(Rotation.from_rotvec(np.radians(lean_deg) * line).as_matrix(), dtype=np.float64)


def _level_axis(normals: FloatArray, weights: FloatArray) -> FloatArray:
    """(3,) unit vector, no farther from +z than a scan may lean, along which most area faces up or down."""
    facing_up = normals * np.sign(normals[:, 2:])
    chosen = facing_up[:, 2] > np.cos(np.radians(LEAN_DEG[1]))
    edges = np.linspace(-1.0, 1.0, int(np.ceil(2.0 / AXIS_BIN)) + 1)
    x, y = facing_up[chosen, 0], facing_up[chosen, 1]
    area, _, _ = np.histogram2d(x, y, bins=(edges, edges), weights=weights[chosen])
    place = np.unravel_index(gaussian_filter(area, 1.0).argmax(), area.shape)
    plan = np.array([0.5 * (edges[index] + edges[index + 1]) for index in place])
    axis = np.array([*plan, np.sqrt(max(0.0, 1.0 - float(plan @ plan)))])
    for _ in range(AXIS_STEPS):
        along = normals @ axis
        near = np.abs(along) > np.cos(np.radians(NEAR_AXIS_DEG))
        if not weights[near].sum() > 0:
            break
        mean = np.average(normals[near] * np.sign(along[near, None]), axis=0, weights=weights[near])
        axis = mean / np.linalg.norm(mean)
    return axis


def _leaning_note(levelling: FloatArray) -> str:
    lean_deg = np.degrees(np.arccos(np.clip(levelling[2, 2], -1.0, 1.0)))
    return (
        f"The scan leans by {lean_deg:.1f}°, by its floor, ceiling and walls: it was set upright. Coordinates here are "
        "those of the scan as it stands upright, not the file's. To keep the file's, set level = false in [scan] "
        "(init --as-it-leans)."
    )


def _check_size(surface: _Surface, unit: Unit, *, where: str) -> None:
    longest = float(surface.extents.max()) * METRES_PER_UNIT[unit]
    if not MIN_ROOM_M <= longest <= LARGEST_ROOM_M:
        raise ScanError(
            expected=f"a room between {MIN_ROOM_M} and {LARGEST_ROOM_M:.0f} m long",
            found=f"{longest:.3g} m (in {unit})",
            where=where,
            todo="Give the file's unit in [scan] (m, cm, mm, in or ft), or give a scan of a room.",
        )
