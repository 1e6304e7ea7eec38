"""The room from above, and where its pictures stand on a page."""

import math
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
from matplotlib.figure import Figure

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, float_array
from lidarspectra.errors import MapError
from lidarspectra.geometry.scan import Scan
from lidarspectra.mapping.figures.figure_style import PAGE_WIDTH_IN, new_figure
from lidarspectra.mapping.maps.walls_between import Between
from lidarspectra.room.free_space import FreeSpace
from lidarspectra.room.furniture import furniture_outlines
from lidarspectra.room.partitions import Partitions
from lidarspectra.room.plan_cells import edge_distance, within_polygon
from lidarspectra.room.room import Room

AIR_ACROSS = 100  # cells on the longer side in which air and solids are distinguished


@dataclass(frozen=True, kw_only=True, eq=False)
class AirOnLevel:
    """Where a level of the room is air, and where it is inside furniture or walls.

    Parameters
    ----------
    height_m : float
        Of the level above the floor. [m]
    lowest : (2,) float
        Centre of the first cell. [m]
    cell_m : float
        [m]
    is_air : (row, column) bool
        Rows along y.
    """

    height_m: float
    lowest: FloatArray
    cell_m: float
    is_air: BoolArray

    def at(self, places: FloatArray) -> BoolArray:
        """(place,) whether each of (place, 2) positions [m] is in the air; the nearest cell counts."""
        rows, columns = self.is_air.shape
        cell = np.rint((places - self.lowest) / self.cell_m).astype(np.int64)
        return np.asarray(self.is_air[np.clip(cell[:, 1], 0, rows - 1), np.clip(cell[:, 0], 0, columns - 1)])


@dataclass(frozen=True, kw_only=True, eq=False)
class FloorPlan:
    """The room from above.

    Parameters
    ----------
    outline : (corner, 2) float
        Walls. [m]
    furniture : tuple of (corner, 2) float
        Silhouettes of what stands in the room. [m]
    other_outlines : tuple of (corner, 2) float
        Walls of further rooms in the same scan. [m]
    air : AirOnLevel, optional
        Of the maps' level: nothing is drawn inside what is solid there.
    partitions : Partitions, optional
        No map goes on behind them.
    """

    outline: FloatArray
    furniture: tuple[FloatArray, ...] = ()
    other_outlines: tuple[FloatArray, ...] = ()
    air: AirOnLevel | None = None
    partitions: Partitions | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "outline", float_array(self.outline, name="FloorPlan.outline", shape=(None, 2)))
        if self.outline.shape[0] < 3:
            raise MapError(
                expected="an outline of three or more corners", found=f"{self.outline.shape[0]}", where="floor plan"
            )
        shapes = tuple(float_array(shape, name="FloorPlan.furniture", shape=(None, 2)) for shape in self.furniture)
        object.__setattr__(self, "furniture", tuple(shape for shape in shapes if shape.shape[0] >= 3))
        others = [float_array(shape, name="FloorPlan.other_outlines", shape=(None, 2)) for shape in self.other_outlines]
        object.__setattr__(self, "other_outlines", tuple(shape for shape in others if shape.shape[0] >= 3))

    @property
    def outlines(self) -> tuple[FloatArray, ...]:
        """Walls of all rooms, the main one's first [m]."""
        return (self.outline, *self.other_outlines)

    def room_of(self, places: FloatArray) -> IntArray:
        """(place,) number of the outline around each of (place, 2) positions [m], or else of the nearest."""
        if not self.other_outlines:
            return np.zeros(len(places), dtype=np.int64)
        away = np.stack([edge_distance(places, outline) for outline in self.outlines])
        away[[within_polygon(places, outline) for outline in self.outlines]] = 0.0
        return np.asarray(away.argmin(axis=0), dtype=np.int64)

    def between_at(self, level_m: float) -> Between | None:
        """Whether a wall stands between places on a level [m, in the scan's coordinates]; None if not known."""
        if self.partitions is None:
            return None
        return partial(self.partitions.between, level_m=level_m)

    def is_inside(self, places: FloatArray) -> BoolArray:
        """(place,) whether each of (place, 2) positions [m] lies in a room."""
        return np.asarray(
            np.any([within_polygon(places, outline) for outline in self.outlines], axis=0), dtype=np.bool_
        )


def floor_plan(scan: Scan, room: Room, *, level_m: float | None = None, floor_z: float | None = None) -> FloorPlan:
    """A scanned room from above, with what stands in it.

    Parameters
    ----------
    scan : Scan
    room : Room
    level_m : float, optional
        Height of the maps in the scan's coordinates, for `FloorPlan.air`. [m]
    floor_z : float, optional
        Height of the floor below them; the main one's by default. [m]
    """
    return FloorPlan(
        outline=room.outline,
        furniture=furniture_outlines(scan, room),
        other_outlines=room.other_outlines,
        air=None if level_m is None else air_on_level(scan, room, level_m, floor_z),
        partitions=Partitions(scan, room.ceiling_z),
    )


def air_on_level(scan: Scan, room: Room, level_m: float, floor_z: float | None = None) -> AirOnLevel:
    """Where a level of a room over a floor [m, in the scan's coordinates] is air; see `FreeSpace.inside`."""
    corners = np.concatenate(room.outlines)
    low, high = corners.min(axis=0), corners.max(axis=0)
    cell_m = float((high - low).max()) / AIR_ACROSS
    x, y = (np.arange(first + 0.5 * cell_m, last, cell_m) for first, last in zip(low, high, strict=True))
    places = np.stack(np.meshgrid(x, y), axis=-1)
    points = np.concatenate([places, np.full((*places.shape[:2], 1), level_m)], axis=-1)
    is_air = FreeSpace(scan, room).inside(points.reshape(-1, 3)).reshape(y.size, x.size)
    return AirOnLevel(
        height_m=level_m - (room.floor_z if floor_z is None else floor_z),
        lowest=np.array([x[0], y[0]]),
        cell_m=cell_m,
        is_air=is_air,
    )


@dataclass(frozen=True, kw_only=True)
class PanelLayout:
    """Where the panels of a figure of maps stand, in inches."""

    panels: int
    columns: int
    width_in: float
    height_of_panel_in: float
    gap_x_in: float
    gap_y_in: float

    LEFT: ClassVar[float] = 0.55
    TOP: ClassVar[float] = 0.3

    @property
    def rows(self) -> int:
        """Rows of panels."""
        return math.ceil(self.panels / self.columns)

    @property
    def has_empty_place(self) -> bool:
        """Whether the last row has a place left for the legend."""
        return self.panels % self.columns != 0

    @property
    def bottom_in(self) -> float:
        """Below the last row: axis labels, and the legend if it has no other place [in]."""
        return 0.5 if self.has_empty_place else 0.85

    @classmethod
    def of(cls, plan: FloorPlan, panels: int, *, colorbars: bool) -> "PanelLayout":
        """Columns and sizes for so many panels of a plan, each with its colour bar or all with one."""
        low, high = plan_extent(plan)
        aspect = float((high - low)[1] / (high - low)[0])
        columns = min(panels, 5 if aspect <= 1.6 else 7, 5 if panels <= 15 else 6)
        if aspect < 0.5:
            columns = min(panels, 3)
        gap_x = 0.56 if colorbars else 0.16
        right = 0.05 if colorbars else 0.95
        width = (PAGE_WIDTH_IN - cls.LEFT - right - gap_x * (columns if colorbars else columns - 1)) / columns
        return cls(
            panels=panels,
            columns=columns,
            width_in=width,
            height_of_panel_in=min(width * aspect, 4.0),
            gap_x_in=gap_x,
            gap_y_in=0.34,
        )

    @property
    def height_in(self) -> float:
        """Height of the whole figure [in]."""
        return self.bottom_in + self.TOP + self.rows * self.height_of_panel_in + (self.rows - 1) * self.gap_y_in

    def box(self, number: int) -> tuple[float, float, float, float]:
        """Left, bottom, width, height of a panel [in]."""
        row, column = divmod(number, self.columns)
        left = self.LEFT + column * (self.width_in + self.gap_x_in)
        bottom = self.bottom_in + (self.rows - 1 - row) * (self.height_of_panel_in + self.gap_y_in)
        return left, bottom, self.width_in, self.height_of_panel_in

    def colorbar_box(self, number: int) -> tuple[float, float, float, float]:
        """The same of the panel's colour bar."""
        left, bottom, width, height = self.box(number)
        return left + width + 0.05, bottom + 0.06 * height, 0.07, 0.88 * height

    def shared_box(self) -> tuple[float, float, float, float]:
        """The same of the one colour bar of all panels."""
        height = self.height_in - self.bottom_in - self.TOP
        return PAGE_WIDTH_IN - 0.85, self.bottom_in + 0.1 * height, 0.13, 0.8 * height


def single_plan(
    plan: FloorPlan, legend_in: float = 0.95, title_in: float = 0.0, below_in: float = 0.0
) -> tuple[Figure, tuple[float, float, float, float], tuple[float, float, float, float]]:
    """A figure of one plan: itself, and the places of the plan and of a colour bar [in]."""
    low, high = plan_extent(plan)
    across, deep = (float(size) for size in high - low)
    scale = min(6.4 / across, 5.2 / deep)
    width, height = across * scale, deep * scale
    figure = new_figure(0.7 + width + legend_in, 0.6 + height + 0.15 + title_in + below_in)
    up = 0.55 + below_in
    return figure, (0.6, up, width, height), (0.6 + width + 0.1, up + 0.05 * height, 0.13, 0.9 * height)


def plan_extent(plan: FloorPlan) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest (2,) corner of what a plan shows, walls and a narrow rim [m]."""
    corners = np.concatenate(plan.outlines)
    low, high = corners.min(axis=0), corners.max(axis=0)
    pad = 0.02 * float((high - low).max())
    return low - pad, high + pad
