"""The furnished room of `damaged_rooms` with glass, mirrors and screens in it, as a scanner leaves them in a mesh.

And with what looks like them and is none: passages, niches, boards, another room of the same plan. All is fixed: the
same room makes the same mesh each time.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.room.panes.pane import Pane, PaneKind
from research.virtual_rooms import damaged_rooms as rooms
from research.virtual_rooms.damaged_rooms import SIZE_M, WALL, Mesh, box, joined, sheet

STEP_M = 0.05  # [m] of the mesh's squares: a bulge is rough on that scale
IN_WALL_M = 0.03  # [m] from the wall, of faces that are its own and no furniture's
BULGE_M, PATCH_M = 0.6, 0.25  # [m] deepest of a bulge behind glass; width of its lumps
LUMP_M = 0.2  # [m] of places of an image that are lost together
CORRIDOR_M = 2.0  # [m] wide
SEED = 17

Change = Callable[[Mesh, np.random.Generator], Mesh]


@dataclass(frozen=True, kw_only=True)
class PaneRoom:
    """A room in which something is glass, a mirror or a screen, or looks like it.

    Parameters
    ----------
    name : str
    change : callable
        Makes what a scanner sees of the whole room's mesh.
    true : Pane or None
        What is truly there; None where nothing is to be found.
    """

    name: str
    change: Change
    true: Pane | None = None

    def scanned(self) -> Mesh:
        """The mesh that a scanner makes."""
        return self.change(rooms.furnished(step_m=STEP_M), np.random.default_rng(SEED))

    def whole(self) -> Mesh:
        """The mesh of the true room without its pane."""
        return rooms.furnished(step_m=STEP_M)


def east_pane(kind: PaneKind, middle_m: tuple[float, float], size_m: tuple[float, float]) -> Pane:
    """A pane in the east wall, by the y and z of its middle."""
    return Pane(kind=kind, center=np.array([SIZE_M[0], *middle_m]), size_m=size_m, normal=np.array([-1.0, 0.0, 0.0]))


def in_pane(mesh: Mesh, pane: Pane) -> BoolArray:
    """(face,) which lie in a pane's rectangle in its wall."""
    return pane.covers(mesh.centers) & (np.abs(pane.heights(mesh.centers)) < IN_WALL_M)


def bulging(pane: Pane, *, patches: float) -> Change:
    """Glass where a scanner gets few returns: a rough surface behind it, and some of it in its plane."""

    def change(mesh: Mesh, random: np.random.Generator) -> Mesh:
        lumps = gaussian_filter(random.normal(size=(64, 64)), PATCH_M / STEP_M, mode="wrap")
        lumps = (lumps - np.quantile(lumps, patches)) / np.ptp(lumps)
        wall = in_pane(mesh, pane)
        used, renamed = np.unique(mesh.faces[wall], return_inverse=True)
        places = mesh.vertices[used]
        at = np.stack([(places - pane.center) @ pane.along, places[:, 2] - pane.center[2]]) / STEP_M + 32.0
        depth = BULGE_M * np.clip(2.0 * map_coordinates(lumps, at, order=1, mode="wrap"), 0.0, 1.0)
        rim = 0.5 * np.array(pane.size_m)[:, None] - np.abs((at - 32.0) * STEP_M)
        depth *= np.clip(rim.min(axis=0) / STEP_M, 0.0, 1.0)
        bulge = Mesh(
            vertices=places - depth[:, None] * pane.normal,
            faces=renamed.reshape(-1, 3),
            colors=np.clip(mesh.colors[used] * random.uniform(0.3, 1.2, (len(used), 1)), 0.0, 0.9),
        )
        return joined(mesh.some(~wall), bulge)

    return change


def hole(pane: Pane) -> Change:
    """Glass that a scanner looks through, at nothing."""
    return lambda mesh, random: mesh.some(~in_pane(mesh, pane))


def corridor_behind(pane: Pane, *, patches: int) -> Change:
    """A corridor behind the east wall, seen through an opening with so many patches of mesh in its plane."""

    def change(mesh: Mesh, random: np.random.Generator) -> Mesh:
        wall, (length, width, height) = in_pane(mesh, pane), SIZE_M
        side, along, up = length + CORRIDOR_M, (0.0, width, 0.0), (0.0, 0.0, height)
        beyond = joined(
            sheet((length, 0.0, 0.0), (CORRIDOR_M, 0.0, 0.0), along, rooms.FLOOR, STEP_M),
            sheet((length, 0.0, height), along, (CORRIDOR_M, 0.0, 0.0), rooms.CEILING, STEP_M),
            sheet((side, 0.0, 0.0), up, along, WALL, STEP_M),
            sheet((length, 0.0, 0.0), up, (CORRIDOR_M, 0.0, 0.0), WALL, STEP_M),
            sheet((length, width, 0.0), (CORRIDOR_M, 0.0, 0.0), up, WALL, STEP_M),
            box((side - 0.4, 1.0, 0.02), (side - 0.02, 1.8, 1.1), rooms.CABINET, STEP_M),
        )
        half = 0.5 * np.array(pane.size_m) - 0.3
        centers = random.uniform(-half, half, (patches, 2))
        from_middle = np.column_stack([(mesh.centers - pane.center) @ pane.along, mesh.centers[:, 2] - pane.center[2]])
        patched = np.zeros(len(mesh.faces), dtype=np.bool_)
        for center, radius in zip(centers, random.uniform(0.1, 0.2, patches), strict=True):
            patched |= np.linalg.norm(from_middle - center, axis=1) < radius
        return joined(mesh.some(~wall | patched), beyond)

    return change


def niche(opening: Pane, depth_m: float) -> Change:
    """A flat recess of the east wall, for shelves or before a window."""

    def change(mesh: Mesh, random: np.random.Generator) -> Mesh:
        (x, y, z), (width, height) = opening.center - 0.5 * np.array([0.0, *opening.size_m]), opening.size_m
        deep, along, up = (depth_m, 0.0, 0.0), (0.0, width, 0.0), (0.0, 0.0, height)
        recess = joined(
            sheet((x + depth_m, y, z), up, along, WALL, STEP_M),
            sheet((x, y, z), deep, along, WALL, STEP_M),
            sheet((x, y, z + height), along, deep, WALL, STEP_M),
            sheet((x, y, z), up, deep, WALL, STEP_M),
            sheet((x, y + width, z), deep, up, WALL, STEP_M),
        )
        return joined(mesh.some(~in_pane(mesh, opening)), recess)

    return change


def mirrored(pane: Pane, *, lost: float, furniture: bool = True) -> Change:
    """The room's image behind a mirror, of which some is lost; without its furniture it is another room."""

    def change(mesh: Mesh, random: np.random.Generator) -> Mesh:
        wall = np.abs(pane.heights(mesh.centers)) < IN_WALL_M
        lumps = gaussian_filter(random.normal(size=(64, 64, 64)), LUMP_M / STEP_M, mode="wrap")
        there = map_coordinates(lumps, mesh.centers.T / (2.0 * STEP_M), order=0, mode="wrap")
        seen = ~wall & (there >= np.quantile(there, lost))
        if not furniture:
            low, high = np.full(3, 0.06), np.array(SIZE_M) - 0.06
            seen &= ~((mesh.centers > low) & (mesh.centers < high)).all(axis=1)
        height = pane.heights(mesh.vertices)
        image = mesh.vertices - 2.0 * height[:, None] * pane.normal + 0.015 * random.normal(size=mesh.vertices.shape)
        ghost = replace(mesh.moved(image), faces=mesh.faces[:, ::-1]).some(seen)
        return joined(mesh.some(~in_pane(mesh, pane)), ghost)

    return change


def hung(low: rooms.Vector, high: rooms.Vector, color: Callable[[FloatArray], FloatArray]) -> Change:
    """A box on a wall, whose colour depends on the place."""

    def change(mesh: Mesh, random: np.random.Generator) -> Mesh:
        hangs = box(low, high, 0.0, 0.5 * STEP_M)
        return joined(mesh, replace(hangs, colors=color(hangs.vertices)))

    return change


def _picture(places: FloatArray) -> FloatArray:
    """A bright picture in a black frame of 5 cm, on the north wall."""
    x, z = places[:, 0], places[:, 2]
    inside = (np.abs(x - 2.5) < 0.55) & (np.abs(z - 1.6) < 0.29) & (places[:, 1] < SIZE_M[1] - 0.05)
    pattern = 0.15 + 0.4 * (np.sin(9.0 * x) * np.sin(11.0 * z) > 0.0)
    return np.where(inside[:, None], pattern[:, None] * np.array([0.6, 0.8, 1.0]), 0.02)


def _canvas(places: FloatArray) -> FloatArray:
    """A bright picture up to its edges, as on a canvas."""
    pattern = 0.35 + 0.4 * (np.sin(9.0 * places[:, 0]) * np.sin(11.0 * places[:, 2]) > 0.0)
    return np.asarray(pattern[:, None] * np.array([1.0, 0.9, 0.8]), dtype=np.float64)


def _grey(value: float) -> Callable[[FloatArray], FloatArray]:
    return lambda places: np.full((len(places), 3), value)


GLASS_WALL = east_pane("glass", (2.0, 1.25), (3.4, 2.2))
WINDOW = east_pane("glass", (2.0, 1.5), (1.6, 1.2))
PARTITION = east_pane("glass", (2.0, 1.3), (3.0, 2.5))
MIRROR, SMALL_MIRROR = east_pane("mirror", (2.0, 1.3), (2.0, 2.0)), east_pane("mirror", (2.0, 1.5), (0.9, 1.2))
NICHE = east_pane("glass", (2.0, 1.5), (1.2, 1.2))  # no glass in truth
DOOR = east_pane("glass", (2.0, 1.0), (0.9, 2.0))  # a passage, in truth
SCREEN = Pane(kind="screen", center=np.array([2.5, 3.94, 1.6]), size_m=(1.2, 0.68), normal=np.array([0.0, -1.0, 0.0]))
SCREEN_BOX = ((1.9, 3.94, 1.26), (3.1, 4.0, 1.94))

ROOMS = (
    PaneRoom(name="nothing", change=lambda mesh, random: mesh),
    PaneRoom(name="glass wall, bulges", change=bulging(GLASS_WALL, patches=0.25), true=GLASS_WALL),
    PaneRoom(name="glass wall, mostly in its plane", change=bulging(GLASS_WALL, patches=0.75), true=GLASS_WALL),
    PaneRoom(name="window, a hole", change=hole(WINDOW), true=WINDOW),
    PaneRoom(name="glass before a corridor, 8 patches", change=corridor_behind(PARTITION, patches=8), true=PARTITION),
    PaneRoom(name="glass before a corridor, clean", change=corridor_behind(PARTITION, patches=0), true=PARTITION),
    PaneRoom(name="mirror of 2 m", change=mirrored(MIRROR, lost=0.0), true=MIRROR),
    PaneRoom(name="mirror, half of its image lost", change=mirrored(SMALL_MIRROR, lost=0.5), true=SMALL_MIRROR),
    PaneRoom(name="screen, off", change=hung(*SCREEN_BOX, _grey(0.03)), true=SCREEN),
    PaneRoom(name="screen, on", change=hung(*SCREEN_BOX, _picture), true=SCREEN),
    PaneRoom(name="door to a corridor", change=corridor_behind(DOOR, patches=0)),
    PaneRoom(name="door to a room of the same plan", change=mirrored(DOOR, lost=0.0, furniture=False)),
    PaneRoom(name="niche, .3 m deep", change=niche(NICHE, 0.3)),
    PaneRoom(name="picture on a canvas", change=hung(*SCREEN_BOX, _canvas)),
    PaneRoom(name="grey board", change=hung(*SCREEN_BOX, _grey(0.15))),
    PaneRoom(name="blackboard", change=hung((1.5, 3.96, 0.9), (3.5, 4.0, 2.0), _grey(0.05))),
)
