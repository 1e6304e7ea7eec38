r"""Ray trees: every segment of the paths that rtrace followed, with what it carries.

rtrace can output every ray that it traces, shadow rays included (`-oT`). It prints children before their parents,
each record behind as many tabs as the ray has ancestors. Records here are

    "~\t"  w  L  ox oy oz  dx dy dz  W..  V..        binary, single precision; W and V have a value a slot

    w   Radiance's weight of the ray, on which its Russian roulette depends. [1]
    L   length to where it arrived. [m]
    o d origin [m] and direction
    W   coefficient: throughput of the path from its first ray to this one, by which radiance along it counts. [1]
    V   contribution: W times that radiance, that of its descendants included.

Tabs stand before binary records too, so records are found by their "~\t", which data may hold by chance as well.
A shadow ray is recognized by its weight: Radiance gives it its parent's, while any other ray has its parent's times the
largest of its own coefficients (specular ones too, with one sample each: `-ss 1`). The continuation of
a shadow ray through glass is one as well.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lidarspectra.arrays import BoolArray, IntArray
from lidarspectra.errors import EngineError
from lidarspectra.radiance.engine.engine import EngineRun

FIELDS = "~wLodWV"
"""Output fields of rtrace for every ray (`-oT` and these)."""
_MARK = (0x7E, 0x09)  # "~\t"
_TAB = 0x09
_HEAD = 8  # numbers before W: w, L, o, d
WEIGHT_TOLERANCE = 1e-3  # [1] of single precision over a dozen factors; a shadow ray is as near to it once in 1000


@dataclass(frozen=True, kw_only=True, eq=False)
class RayTrees:
    """The rays that carry light, of all trees of a run. Shadow rays that were blocked are left out.

    Parameters
    ----------
    tree : (ray,) int
        Number of the first ray that each belongs to, in the order that the program was given them.
    parent : (ray,) int
        Index of the ray that it comes from; -1 for first rays.
    reflection : (ray,) int
        Ancestors, so reflections (and passages through glass) since the first ray: 0 for first rays. [1]
    shadow : (ray,) bool
        Whether it was sent to a lamp.
    origin, direction : (ray, 3) float
        Unit directions. [m, 1]
    length : (ray,) float
        [m]
    coefficient : (ray, slot) float
        W, in the engine's order of slots. [1]
    contribution : (ray, slot) float
        V, in the unit of the lamps' radiance.
    """

    tree: IntArray
    parent: IntArray
    reflection: IntArray
    shadow: BoolArray
    origin: NDArray[np.float32]
    direction: NDArray[np.float32]
    length: NDArray[np.float32]
    coefficient: NDArray[np.float32]
    contribution: NDArray[np.float32]

    def __len__(self) -> int:
        return int(self.tree.size)


def read_ray_trees(run: EngineRun, *, trees: int, slots: int) -> RayTrees:
    """The trees that a program wrote, counted and checked.

    Parameters
    ----------
    run : EngineRun
        Of rtrace asked for `-h- -f?f -oT` and `FIELDS`.
    trees : int
        First rays that it was given.
    slots : int
        Values of a colour.

    Returns
    -------
    rays : RayTrees

    Raises
    ------
    EngineError
        If the output is no such trees, their number differs, or a number is not finite.
    """
    depth, values = _records(run, slots)
    first = depth == 0
    if int(first.sum()) != trees or (depth.size and not first[-1]):
        raise _broken(run, expected=f"{trees} whole trees", found=f"{int(first.sum())}")
    tree = np.cumsum(first) - first  # children stand before their parent
    parent = _parents(depth)
    coefficient, contribution = values[:, _HEAD : _HEAD + slots], values[:, _HEAD + slots :]
    if not np.isfinite(contribution).all() or not np.isfinite(coefficient).all():
        raise _broken(run, expected="finite numbers", found="NaN or infinite ones")
    shadow = _are_shadows(values[:, 0], coefficient, parent)
    kept = ~shadow | (contribution > 0).any(axis=1)
    number = np.cumsum(kept) - 1
    return RayTrees(
        tree=tree[kept].astype(np.int64),
        # A parent is kept: it is no shadow ray, or one that brings all that its kept child brings.
        parent=np.where(first, -1, number[parent])[kept],
        reflection=depth[kept],
        shadow=shadow[kept],
        origin=values[kept, 2:5],
        direction=values[kept, 5:8],
        length=values[kept, 1],
        coefficient=coefficient[kept],
        contribution=contribution[kept],
    )


def _records(run: EngineRun, slots: int) -> tuple[IntArray, NDArray[np.float32]]:
    """(record,) number of ancestors of each ray, and its (record, number) fields."""
    output = np.frombuffer(run.output, dtype=np.uint8)
    size = 2 + 4 * (_HEAD + 2 * slots)
    starts = _starts(output, size)
    ends = np.concatenate([[0], starts + size])
    depth = starts - ends[:-1]
    if starts.size and (ends[-1] != output.size or depth.min() < 0):
        raise _broken(run, expected=f"records of {size} bytes", found=f"{output.size} bytes")
    body = np.ones(output.size, dtype=np.bool_)
    tabs = np.repeat(ends[:-1], depth) + _counts_up(depth)
    if not (output[tabs] == _TAB).all():
        raise _broken(run, expected="records behind tabs", found="other bytes")
    body[tabs] = False
    rows = output[body].reshape(-1, size)[:, 2:]
    return depth.astype(np.int64), np.ascontiguousarray(rows).view(np.float32)


def _starts(output: NDArray[np.uint8], size: int) -> IntArray:
    """(record,) where records begin; marks that lie within a record are numbers that look like one."""
    found = np.flatnonzero((output[:-1] == _MARK[0]) & (output[1:] == _MARK[1]))
    near = np.flatnonzero(np.diff(found) < size) + 1
    kept = np.ones(found.size, dtype=np.bool_)
    for index in near.tolist():  # rare: two given bytes in a row
        before = index - 1
        while not kept[before]:
            before -= 1
        kept[index] = found[index] - found[before] >= size
    return found[kept]


def _counts_up(counts: IntArray) -> IntArray:
    """0, 1, ... counts[0] - 1, 0, 1, ... counts[1] - 1, and so on."""
    return np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)


def _parents(depth: IntArray) -> IntArray:
    """(record,) the next record that has one ancestor less; its own index for first rays."""
    parent = np.arange(depth.size)
    above = np.flatnonzero(depth == 0)
    for level in range(1, int(depth.max(initial=0)) + 1):
        here = np.flatnonzero(depth == level)
        parent[here] = above[np.searchsorted(above, here)]
        above = here
    return parent


def _are_shadows(weight: NDArray[np.float32], coefficient: NDArray[np.float32], parent: IntArray) -> BoolArray:
    """(record,) whether the ray's weight is its parent's although its own coefficient is not 1."""
    before = coefficient[parent]
    own = (coefficient / np.where(before > 0, before, 1.0)).max(axis=1)
    followed = np.abs(weight - weight[parent] * own) <= WEIGHT_TOLERANCE * weight
    shadow = np.asarray(~followed & (parent != np.arange(parent.size)), dtype=np.bool_)
    while (behind := shadow[parent] & ~shadow).any():
        shadow |= behind
    return shadow


def _broken(run: EngineRun, *, expected: str, found: str) -> EngineError:
    said = run.stderr[-300:] or "nothing"
    return EngineError(
        expected=expected, found=f"{found}. It said: {said}", where=run.command,
        todo="Run 'lidarspectra doctor': the engine must write ray trees in the format of Radiance 6.0a.",
    )  # fmt: skip


def covered_by_ancestor(rays: RayTrees, chosen: BoolArray) -> BoolArray:
    """Whether an ancestor of each ray is among the chosen ones.

    Parameters
    ----------
    rays : RayTrees
    chosen : (ray,) bool

    Returns
    -------
    covered : (ray,) bool
        For chosen rays; False elsewhere.
    """
    covered = np.zeros(len(rays), dtype=np.bool_)
    members = np.flatnonzero(chosen)
    above = rays.parent[members]
    while True:
        open_ones = above >= 0
        members, above = members[open_ones], above[open_ones]
        if members.size == 0:
            return covered
        met = chosen[above]
        covered[members[met]] = True
        members, above = members[~met], rays.parent[above[~met]]
