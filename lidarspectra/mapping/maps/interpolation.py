"""Gridded maps: interpolation between the sensor points, inside the room, without extrapolation.

The paper draws its maps "using interpolation techniques" (Section 3.3.2) and names none; three are offered, and
`leave_one_out` measures the error of each by cross-validation on the points themselves.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import xarray as xr
from matplotlib.path import Path as Polygon
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, Delaunay, QhullError, cKDTree

from lidarspectra.arrays import FloatArray, IntArray, float_array
from lidarspectra.errors import MapError
from lidarspectra.mapping.maps.map_schema import DIRECTION, IRRADIANCE_UNIT, POSITION, check_map
from lidarspectra.mapping.maps.walls_between import Between, WallsBetween

Method = Literal["linear", "cubic", "rbf"]
Interpolant = Callable[[FloatArray], FloatArray]

PLANE_TOLERANCE_M = 0.05  # [m] a robot's sensor rides level within a few centimetres
DIRECTION_TOLERANCE = 1e-3  # [1] chord between unit vectors, 0.06 degrees
SAME_PLACE_M = 1e-3  # [m] readings closer than this are averaged: one place cannot have two values
CELLS_ACROSS = 120  # grid cells on the longer side of a map, finer than a printed panel can show
REACH_SPACINGS = 2.0  # [1] how far from the nearest point a map is drawn, in typical point spacings
NEIGHBOURS = 60  # points per local thin-plate spline; more change nothing, and the time grows with the cube
MAX_PAIRS = 100_000  # targets x triangles, up to which testing every triangle is faster than scipy's search
FLAT_AREA_M2 = 1e-14  # [m²] twice the area at or below which a triangle counts as degenerate
MAX_PLACES = 10_000  # more points are averaged in grid cells first: a map cannot show them one by one
THINNED_ACROSS = 100  # grid cells on the longer side when averaging
MIN_POINTS = 4  # three span a plane, a fourth can differ from it


@dataclass(frozen=True, kw_only=True, eq=False)
class InterpolationError:
    """Leave-one-out cross-validation: how well each point is predicted from its neighbours.

    Parameters
    ----------
    method : str
        Interpolation method.
    tested : int
        Points that were left out in turn; those on the convex hull would need extrapolation and are not tested.
    nrmse : (band,) float
        Root mean square error over the mean (paper, Eq. 8, over points); 0 in a band without light. [1]
    median_percent : float
        Median absolute percentage error over points and bands. [%]
    """

    method: Method
    tested: int
    nrmse: FloatArray
    median_percent: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Grid:
    """Values on a horizontal grid.

    Parameters
    ----------
    x, y : (column,), (row,) float
        Centres of the grid cells. [m]
    cells : (value, row, column) float
        Value in each grid cell, in the unit of the readings; NaN where no point is near.
    """

    x: FloatArray
    y: FloatArray
    cells: FloatArray


def map_planes(dataset: xr.Dataset) -> tuple[IntArray, ...]:
    """Points that lie on one level and face in one direction, buried ones left out; the largest group first.

    Only such points make one map: the light on a desk and on the floor below it must not be interpolated together.

    Returns
    -------
    groups : tuple of (n,) int
        Indices of points.
    """
    return point_planes(check_map(dataset, where="map to interpolate"))


def point_planes(places: xr.Dataset) -> tuple[IntArray, ...]:
    """The groups of `map_planes` for any values at points, as long as x, y, z, nx, ny, nz and buried are there.

    Raises
    ------
    MapError
        If a height or direction is not finite.
    """
    direction = np.stack([places[name].to_numpy() for name in DIRECTION], axis=1)
    height = places["z"].to_numpy()
    if not (np.isfinite(height).all() and np.isfinite(direction).all()):
        raise MapError(
            expected="points with a finite height and direction", found="NaN or infinity", where="planes of points"
        )
    rest = np.flatnonzero(~places["buried"].to_numpy())
    groups: list[IntArray] = []
    while rest.size:
        same_way = np.linalg.norm(direction[rest] - direction[rest[0]], axis=1) <= DIRECTION_TOLERANCE
        level = np.median(height[rest[same_way]])
        member = same_way & (np.abs(height[rest] - level) <= PLANE_TOLERANCE_M)
        if not member.any():  # the median falls between two levels
            member = same_way & (np.abs(height[rest] - height[rest[0]]) <= PLANE_TOLERANCE_M)
        groups.append(rest[member])
        rest = rest[~member]
    return tuple(sorted(groups, key=len, reverse=True))


def grid_map(
    dataset: xr.Dataset,
    outline: FloatArray | None = None,
    *,
    points: IntArray | None = None,
    method: Method = "linear",
    cell_m: float | None = None,
) -> xr.Dataset:
    """Interpolate a map onto a horizontal grid.

    Outside the convex hull of the points a grid cell takes the value of the nearest place on the hull. It is empty
    (NaN) outside the outline, and where no point is within `REACH_SPACINGS` typical spacings. Values are clipped to the
    smallest and largest reading of their band, so that a spline cannot overshoot below zero next to a shadow.

    Parameters
    ----------
    dataset : xarray.Dataset
        A spectral map.
    outline : (corner, 2) float, optional
        Plan of the room's walls; the hull of the points if left out. [m]
    points : (n,) int, optional
        Indices of points on one plane; the largest of `map_planes` if left out.
    method : 'linear', 'cubic' or 'rbf'
        On triangles, on triangles with continuous slopes (Clough-Tocher), or by thin-plate splines.
    cell_m : float, optional
        Edge of a grid cell; by default the longer side has `CELLS_ACROSS`. [m]

    Returns
    -------
    grid : xarray.Dataset
        irradiance (band, y, x) [W m-2 nm-1]; x, y are the centres of the grid cells. [m]

    Raises
    ------
    MapError
        If fewer than four points share a plane, they lie on one line, or the outline has fewer than three corners.
    """
    checked = check_map(dataset, where="map to interpolate")
    chosen = _largest_plane(checked) if points is None else points
    irradiance = checked["irradiance"].to_numpy()[chosen]
    grid = grid_values(plan_places(checked)[chosen], irradiance, outline, method=method, cell_m=cell_m)
    return _grid_dataset(checked, grid, method, chosen)


def grid_values(
    places: FloatArray,
    values: FloatArray,
    outline: FloatArray | None = None,
    *,
    method: Method = "linear",
    cell_m: float | None = None,
    cells_across: int = CELLS_ACROSS,
    between: Between | None = None,
) -> Grid:
    """Interpolate any readings onto a horizontal grid, by the rules of `grid_map`.

    Parameters
    ----------
    places : (n, 2) float
        Positions from above; readings of one place are averaged. [m]
    values : (n, value) float
        In any unit.
    outline, method, cell_m
        As in `grid_map`.
    cells_across : int
        Grid cells on the longer side where no `cell_m` is given.
    between : callable, optional
        As in `interpolant`.

    Returns
    -------
    grid : Grid
    """
    distinct, readings = _merged(places, values)
    if distinct.shape[0] > MAX_PLACES:
        distinct, readings = _merged(
            distinct, readings, within_m=float(np.ptp(distinct, axis=0).max()) / THINNED_ACROSS
        )
    corners = distinct[_hull(distinct).vertices] if outline is None else _polygon(outline)
    x, y = _cells(corners, cell_m, cells_across)
    targets = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    wanted = Polygon(corners).contains_points(targets) & (_distance(distinct, targets) <= _reach(distinct))
    cells = np.full((targets.shape[0], readings.shape[1]), np.nan)
    if wanted.any():
        cells[wanted] = interpolant(distinct, readings, method, between)(targets[wanted])
    return Grid(x=x, y=y, cells=cells.T.reshape(-1, y.size, x.size))


def plan_places(dataset: xr.Dataset) -> FloatArray:
    """(point, 2) positions from above [m]."""
    return np.stack([dataset["x"].to_numpy(), dataset["y"].to_numpy()], axis=1)


def positions(dataset: xr.Dataset) -> FloatArray:
    """(point, 3) positions [m]."""
    return np.stack([dataset[axis].to_numpy() for axis in POSITION], axis=1)


def interpolant(places: FloatArray, values: FloatArray, method: Method, between: Between | None = None) -> Interpolant:
    """A function of position through all readings (see `grid_map` for the rules).

    Parameters
    ----------
    places : (n, 2) float
        Distinct, not all on one line. [m]
    values : (n, band) float
        Readings, in any unit.
    method : str
        See `grid_map`.
    between : callable, optional
        Whether a wall stands between places and others. A position that does not see all corners of its triangle takes
        the value of the nearest place on a side of a triangle that it sees whole; NaN where it sees no point.

    Returns
    -------
    interpolant : callable
        (m, 2) positions to (m, band) values.
    """
    hull, triangles = _hull(places), Delaunay(places)
    lowest, highest = values.min(axis=0), values.max(axis=0)
    inner = _inner_interpolant(places, values, method, triangles)
    walls = None if between is None else WallsBetween(places, triangles, between)

    def evaluate(targets: FloatArray) -> FloatArray:
        inside = _onto_hull(hull, places, targets)
        result = np.asarray(np.clip(inner(inside), lowest, highest), dtype=np.float64)
        if walls is not None:
            moved = np.linalg.norm(inside - targets, axis=1) > SAME_PLACE_M
            cut = walls.cut(targets, _triangle_of(triangles, places, inside), moved)
            result[cut] = walls.value_beside(targets[cut], values)
        return result

    return evaluate


def leave_one_out(
    dataset: xr.Dataset,
    *,
    points: IntArray | None = None,
    method: Method = "linear",
    most: int = 400,
    random: np.random.Generator | None = None,
    between: Between | None = None,
) -> InterpolationError:
    """Leave-one-out cross-validation: predict points from the others and compare.

    Parameters
    ----------
    dataset : xarray.Dataset
        A spectral map.
    points : (n,) int, optional
        As in `grid_map`.
    method : str
        As in `grid_map`.
    most : int
        Test at most so many points, evenly through the list, or drawn by `random` where that is given.
    random : numpy.random.Generator, optional
        See `most`.
    between : callable, optional
        As in `interpolant`; a point that sees none of the others is not tested.

    Returns
    -------
    error : InterpolationError

    Raises
    ------
    MapError
        As `grid_map`, or if all points lie on the convex hull.
    """
    checked = check_map(dataset, where="map to interpolate")
    chosen = _largest_plane(checked) if points is None else points
    places, values = _merged(plan_places(checked)[chosen], checked["irradiance"].to_numpy()[chosen])
    inner = np.setdiff1d(np.arange(places.shape[0]), _on_hull(places))
    if inner.size == 0:
        raise MapError(
            expected="points with neighbours on all sides",
            found=f"{places.shape[0]} points, all on the convex hull",
            where="leave-one-out cross-validation",
            todo="Ask for a finer sensor grid: a larger count or a smaller spacing under [sensors] in the run file.",
        )
    if inner.size > most:
        even = np.linspace(0, inner.size - 1, most).round().astype(np.int64)
        inner = inner[even] if random is None else random.choice(inner, most, replace=False)
    _, near = cKDTree(places).query(places[inner], k=min(NEIGHBOURS + 1, places.shape[0]))
    others = [neighbours[neighbours != left_out] for left_out, neighbours in zip(inner, near, strict=True)]
    predicted = np.concatenate(
        [
            interpolant(places[rest], values[rest], method, between)(places[[left_out]])
            for left_out, rest in zip(inner, others, strict=True)
        ]
    )
    told = np.isfinite(predicted).all(axis=1)
    if not told.any():
        raise MapError(
            expected="points with neighbours that they see",
            found="walls around each of them",
            where="leave-one-out cross-validation",
        )
    predicted, real = predicted[told], values[inner[told]]
    lit = real > 0
    percent = 100.0 * np.abs(predicted - real)[lit] / real[lit]
    rms, mean = np.sqrt(((predicted - real) ** 2).mean(axis=0)), np.abs(real.mean(axis=0))
    return InterpolationError(
        method=method,
        tested=int(told.sum()),
        nrmse=np.divide(rms, mean, out=np.zeros_like(rms), where=mean > 0),
        median_percent=float(np.median(percent)) if percent.size else 0.0,
    )


def _largest_plane(dataset: xr.Dataset) -> IntArray:
    groups = map_planes(dataset)
    return groups[0] if groups else np.empty(0, dtype=np.int64)


def _merged(places: FloatArray, values: FloatArray, *, within_m: float = SAME_PLACE_M) -> tuple[FloatArray, FloatArray]:
    """Distinct places and the readings there, those within one square of side `within_m` averaged."""
    cells, place = np.unique(np.rint(places / within_m), axis=0, return_inverse=True)
    count = np.bincount(place.ravel(), minlength=cells.shape[0]).astype(np.float64)
    merged = [
        np.stack([np.bincount(place.ravel(), weights=column) / count for column in table.T], axis=1)
        if count.size
        else table
        for table in (places, values)
    ]
    if count.size < MIN_POINTS:
        raise MapError(
            expected=f"at least {MIN_POINTS} points on one level that face in one direction",
            found=f"{count.size}",
            where="interpolated map",
            todo="Give more points (a grid under [sensors] in the run file), or use the table of points.",
        )
    return merged[0], merged[1]


def _hull(places: FloatArray) -> ConvexHull:
    try:
        return ConvexHull(places)
    except QhullError as cause:
        raise MapError(
            expected="points that span an area",
            found=f"{places.shape[0]} points on one line",
            where="interpolated map",
            todo="Give points on a grid (under [sensors] in the run file), or use the table of points.",
        ) from cause


def _inner_interpolant(places: FloatArray, values: FloatArray, method: Method, triangles: Delaunay) -> Interpolant:
    if method == "linear":
        return _linear_interpolant(places, values, triangles)
    from scipy.interpolate import CloughTocher2DInterpolator, RBFInterpolator  # loads slowly, and maps are linear

    if method == "cubic":
        cubic = CloughTocher2DInterpolator(triangles, values)
        return lambda targets: np.asarray(cubic(targets), dtype=np.float64)
    neighbours = NEIGHBOURS if places.shape[0] > NEIGHBOURS else None
    spline = RBFInterpolator(places, values, kernel="thin_plate_spline", neighbors=neighbours)
    return lambda targets: np.asarray(spline(targets), dtype=np.float64)


def _linear_interpolant(places: FloatArray, values: FloatArray, triangles: Delaunay) -> Interpolant:
    """Linear on the Delaunay triangles, by barycentric weights."""

    def evaluate(targets: FloatArray) -> FloatArray:
        found = _triangle_of(triangles, places, targets)
        corners = np.asarray(triangles.simplices, dtype=np.int64)[found]
        weights = _barycentric(places[corners], targets)
        result = np.einsum("ni,nib->nb", weights, values[corners])
        lost = found < 0  # between two triangles, by rounding
        if lost.any():
            result[lost] = values[cKDTree(places).query(targets[lost])[1]]
        return np.asarray(result, dtype=np.float64)

    return evaluate


def _triangle_of(triangles: Delaunay, places: FloatArray, targets: FloatArray) -> IntArray:
    """(m,) the triangle around each of (m, 2) targets; -1 between two, by rounding."""
    corners = np.asarray(triangles.simplices, dtype=np.int64)
    if targets.shape[0] * corners.shape[0] <= MAX_PAIRS:
        weights = _barycentric(places[corners], targets[:, None])
        return np.asarray(weights.min(axis=-1).argmax(axis=1), dtype=np.int64)
    return np.asarray(triangles.find_simplex(targets), dtype=np.int64)


def _barycentric(corners: FloatArray, targets: FloatArray) -> FloatArray:
    """(..., 3) weights of a triangle's (..., 3, 2) corners at (..., 2) targets; -inf where it has no area."""
    a, b, c = corners[..., 0, :], corners[..., 1, :], corners[..., 2, :]
    whole = _cross(b - a, c - a)
    flat = np.abs(whole) <= FLAT_AREA_M2
    parts = np.stack([_cross(b - targets, c - targets), _cross(c - targets, a - targets)], axis=-1)
    parts = parts / np.where(flat, 1.0, whole)[..., None]
    weights = np.concatenate([parts, 1.0 - parts.sum(axis=-1, keepdims=True)], axis=-1)
    return np.asarray(np.where(flat[..., None], -np.inf, weights), dtype=np.float64)


def _cross(first: FloatArray, second: FloatArray) -> FloatArray:
    """Twice the signed area between (..., 2) vectors."""
    return np.asarray(first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0], dtype=np.float64)


def _onto_hull(hull: ConvexHull, places: FloatArray, targets: FloatArray) -> FloatArray:
    """The targets, those outside the hull moved to the nearest place on it, inside by a share of 1e-9."""
    outside = np.flatnonzero((targets @ hull.equations[:, :2].T + hull.equations[:, 2]).max(axis=1) > 0)
    moved = targets.copy()
    if outside.size:
        start, stop = places[hull.simplices[:, 0]], places[hull.simplices[:, 1]]
        along = stop - start
        share = np.einsum("tkd,kd->tk", targets[outside, None] - start, along) / (along**2).sum(axis=1)
        nearest = start + np.clip(share, 0.0, 1.0)[..., None] * along
        best = ((nearest - targets[outside, None]) ** 2).sum(axis=-1).argmin(axis=1)
        moved[outside] = nearest[np.arange(outside.size), best]
    middle = places[hull.vertices].mean(axis=0)
    margin = 1e-9  # [1] keeps points of the hull inside despite the rounding errors of the triangle search
    inside: FloatArray = middle + (1.0 - margin) * (moved - middle)
    return inside


def _on_hull(places: FloatArray) -> IntArray:
    """Points on the border of the convex hull, those on its straight edges included."""
    hull = _hull(places)
    gap = (places @ hull.equations[:, :2].T + hull.equations[:, 2]).max(axis=1)
    return np.flatnonzero(gap > -SAME_PLACE_M)


def _distance(places: FloatArray, targets: FloatArray) -> FloatArray:
    return np.asarray(cKDTree(places).query(targets)[0], dtype=np.float64)


def _reach(places: FloatArray) -> float:
    """How far from a point the map is still drawn [m]."""
    return REACH_SPACINGS * float(np.median(cKDTree(places).query(places, k=2)[0][:, 1]))


def _polygon(outline: FloatArray) -> FloatArray:
    corners = float_array(outline, name="outline", shape=(None, 2))
    if corners.shape[0] < 3:
        raise MapError(expected="an outline of three or more corners", found=f"{corners.shape[0]}", where="outline")
    return corners


def _cells(corners: FloatArray, cell_m: float | None, across: int) -> tuple[FloatArray, FloatArray]:
    low, high = corners.min(axis=0), corners.max(axis=0)
    size = float((high - low).max()) / across if cell_m is None else cell_m
    if not size > 0:
        raise MapError(expected="grid cells larger than 0 m", found=f"{size} m", where="interpolated map")
    counts = np.maximum(np.ceil((high - low) / size - 1e-9).astype(int), 1)
    x, y = (low[axis] + size * (np.arange(counts[axis]) + 0.5) for axis in (0, 1))
    return x, y


def _grid_dataset(source: xr.Dataset, grid: Grid, method: Method, chosen: IntArray) -> xr.Dataset:
    axis = {"x": grid.x, "y": grid.y}
    coords: dict[str, tuple[str, NDArray[np.generic], dict[str, str]]] = {
        name: (name, values, {"units": "m", "long_name": f"{name} coordinate of the cell's centre"})
        for name, values in axis.items()
    }
    for name in ("band", "band_width", "band_label"):
        coords[name] = ("band", source[name].to_numpy(), dict(source[name].attrs))
    attrs = {"units": IRRADIANCE_UNIT, "long_name": "interpolated spectral irradiance; NaN where no point is near"}
    return xr.Dataset(
        {"irradiance": (("band", "y", "x"), grid.cells, attrs)},
        coords,
        {
            **source.attrs,
            "schema": "lidarspectra gridded map 1",
            "interpolation": method,
            "points": int(chosen.size),
            "height_m": float(np.median(source["z"].to_numpy()[chosen])),
        },
    )
