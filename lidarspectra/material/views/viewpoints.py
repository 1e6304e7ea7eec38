"""Choice of viewpoints: Algorithm 1 of the paper, its loop over viewpoints until the scan is covered.

    V = {v0}, coverage = {}
    while |coverage| / N < T:
        capture the images of the viewpoint              -> views.capture_image
        MS and DM give their pixels materials            -> material.estimate, on the views that are chosen here
        RPP takes the pixels back to the scan            -> projection, and here: which samples of it the images show
        append them to the coverage
        Viewpoint Update: add the candidate in free space that sees the most uncovered area in one direction

Coverage is docs/concepts.md, Eq. 6. It depends on where the camera stands and not on what the materials are, so the
loop chooses the views first and the materials are estimated on all of them together. All six directions are taken from
v0; later one at a time, wherever that is, which shows as much in fewer views. The paper counts points; here the loop
stops by area (points are reported too), because a scan's points are dense where it has detail.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.sparse import csr_array

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.errors import MaterialError
from lidarspectra.geometry.rays import RayCaster, caster_of
from lidarspectra.geometry.scan import Scan
from lidarspectra.geometry.surface_samples import SurfaceSamples, coarse_cells, surface_samples
from lidarspectra.material.views.projection import DIRECTIONS, Camera, camera_towards, project
from lidarspectra.material.views.views import View, ViewSet, capture_image
from lidarspectra.progress import Progress, silent
from lidarspectra.room.free_space import FreeSpace
from lidarspectra.room.hidden_layers import covered_places
from lidarspectra.room.room import Room, find_room
from lidarspectra.threads import cores_for

CANDIDATE_HEIGHTS = (0.15, 0.35, 0.6, 0.85)  # [1] of the room's height: below tables, above them, over all
CLEARANCE_M = 0.15  # [m] a camera so close to a surface sees little else
MAX_CANDIDATES = 240  # bounds the time of the search
FIRST_SHARE = 0.5  # of the time: the search made ready, and all six views of the first viewpoint
SEARCH_SPACING_M = 0.12  # [m] of the places by which candidates are compared; coverage itself is counted by all samples
SIGHT_LINES_AT_ONCE = 500_000  # bounds memory
SURFACE_GAP = 1e-3  # [1] of a sight line, left out at the surface so that a sample does not hide itself


@dataclass(frozen=True, kw_only=True)
class ViewSettings:
    """How views are taken.

    Parameters
    ----------
    width, height : int
        Of each image. [pixel]
    field_of_view_deg : float
        Across the width; six square images of 90 degrees see all around. [deg]
    samples : int
        Rays a pixel along each side.
    sample_spacing_m : float
        Of the points on the surface by which coverage is counted. [m]
    min_cosine : float
        Least cosine between a surface's normal and the sight line for it to count as seen. [1]
    farthest_m : float
        Largest distance for a surface to count as seen; beyond it a pixel covers several centimetres. [m]
    max_viewpoints : int
        The loop ends there; from all but the first one view is taken.
    min_gain : float
        It also ends where the best view would add less than this share of the area. [1]
    """

    width: int = 384
    height: int = 384
    field_of_view_deg: float = 90.0
    samples: int = 2
    sample_spacing_m: float = 0.06
    min_cosine: float = 0.17
    farthest_m: float = 12.0
    max_viewpoints: int = 32
    min_gain: float = 0.001


def render_views(
    scan: Scan,
    room: Room | None = None,
    *,
    coverage: float = 0.95,
    settings: ViewSettings | None = None,
    workers: int | None = None,
    progress: Progress = silent,
) -> ViewSet:
    """Choose viewpoints until the scan is covered and render their views (paper, Algorithm 1).

    Parameters
    ----------
    scan : Scan
        Normals towards the room.
    room : Room, optional
        Found from the scan where it is not given.
    coverage : float
        Completeness threshold T, of the surface area. [0-1]
    settings : ViewSettings, optional
    workers : int, optional
        Processor cores that may be used; all if left out. With more than one, views are rendered while the next
        viewpoint is looked for.
    progress : callable
        Receives the share that is done.

    Returns
    -------
    views : ViewSet
        All six directions of v0; of each later viewpoint the one that shows most that is new.

    Raises
    ------
    MaterialError
        If there is no free space in the room to look from.
    ArgumentError
        If fewer than one worker is asked for.
    """
    chosen, cores = settings or ViewSettings(), cores_for(workers)
    progress(0.0, "looking for viewpoints")
    caster = caster_of(scan)
    samples = surface_samples(scan, spacing_m=chosen.sample_spacing_m)
    samples = samples.some(np.flatnonzero(~covered_places(caster, samples.positions, samples.normals)))
    candidates = free_candidates(scan, room or find_room(scan, caster=caster), caster)
    search = _Search(samples, candidates, caster, chosen)
    covered = np.zeros(samples.area.size, dtype=np.bool_)
    viewpoints: list[FloatArray] = []
    views: list[Callable[[], View]] = []
    history: list[float] = []
    viewpoint, directions = candidates[0], tuple(DIRECTIONS)
    stopped = ""
    with _rendering(cores) as render:
        while not stopped:
            sees = visible(samples, viewpoint[None], caster, chosen)[0]
            for direction in directions:
                name, camera = f"v{len(viewpoints)} {direction}", _camera(viewpoint, direction, chosen)
                views.append(render(partial(_captured, scan, camera, name, caster, chosen)))
                covered |= _shown(camera, samples.positions, sees)
            viewpoints.append(viewpoint)
            history.append(search.share(covered))
            if history[-1] >= coverage:
                stopped = f"{coverage:.0%} of the area is seen"
            elif len(viewpoints) == chosen.max_viewpoints:
                stopped = f"{chosen.max_viewpoints} viewpoints were taken"
            else:
                viewpoint, best, gain = search.viewpoint_update(covered)
                directions = (best,)
                if gain < chosen.min_gain:
                    stopped = f"no other view shows {chosen.min_gain:.1%} more of the area"
            left, later = chosen.max_viewpoints - len(history), len(viewpoints) - 1
            missing = 0 if stopped else search.missing_viewpoints(covered, coverage, left)
            done = FIRST_SHARE + (1.0 - FIRST_SHARE) * later / max(later + missing, 1)
            progress(done, f"{history[-1]:.1%} of the area seen")
        taken = tuple(view() for view in views)
    progress(1.0, "views rendered")
    return ViewSet(
        views=taken,
        viewpoints=np.array(viewpoints),
        face_seen=_face_seen(samples, covered, faces=len(scan.faces)),
        area_coverage=history[-1],
        point_coverage=_point_coverage(scan, samples.face[covered]),
        threshold=coverage,
        history=np.array(history),
        stopped=stopped,
    )


def _captured(scan: Scan, camera: Camera, name: str, caster: RayCaster, settings: ViewSettings) -> View:
    return capture_image(scan, camera, name=name, caster=caster, samples=settings.samples)


@contextmanager
def _rendering(cores: int) -> Iterator[Callable[[Callable[[], View]], Callable[[], View]]]:
    """What starts to render a view in another thread (or does it at once, on one core) and gives what waits for it."""
    if cores < 2:

        def rendered(take: Callable[[], View]) -> Callable[[], View]:
            view = take()
            return lambda: view

        yield rendered
        return
    pool = ThreadPoolExecutor(max_workers=cores, thread_name_prefix="views")
    try:
        yield lambda take: pool.submit(take).result
    finally:
        pool.shutdown(cancel_futures=True)


class _Search:
    """What every candidate sees of what v0 left unseen, cast once and asked at every Viewpoint Update.

    Candidates are compared on a coarse mesh: a cell counts as shown where one place in it is.
    """

    def __init__(
        self, samples: SurfaceSamples, candidates: FloatArray, caster: RayCaster, settings: ViewSettings
    ) -> None:
        self._samples, self._candidates, self._caster, self._settings = samples, candidates, caster, settings
        self._total = float(samples.area.sum())
        self._open: IntArray | None = None
        self._cell: IntArray = np.zeros(0, dtype=np.int64)
        self._shows = csr_array((0, 0), dtype=np.float64)
        self._taken: list[int] = []
        self._missing: int | None = None

    def share(self, chosen: BoolArray) -> float:
        """Share of the scan's area that the chosen samples stand for [1]."""
        return float(self._samples.area[chosen].sum()) / self._total

    def viewpoint_update(self, covered: BoolArray) -> tuple[FloatArray, str, float]:
        """Candidate and direction that show the most uncovered area, and what share of all area that is."""
        if self._open is None:
            self._open = np.flatnonzero(~covered)
            unseen = self._samples.some(self._open)
            self._cell, first = coarse_cells(unseen, SEARCH_SPACING_M)
            self._shows = self._cells_shown(unseen.some(first))
        new_area = self._shows @ self._open_area(covered)
        new_area[self._taken] = 0.0  # of a cell that one of these showed, some may be hidden
        best = int(new_area.argmax())
        self._taken.append(best)
        place, direction = divmod(best, len(DIRECTIONS))
        return self._candidates[place], tuple(DIRECTIONS)[direction], float(new_area[best]) / self._total

    def _cells_shown(self, cells: SurfaceSamples) -> csr_array:
        """(candidate and direction, cell) 1 where a view shows it."""
        sees = visible(cells, self._candidates, self._caster, self._settings)
        cameras = [_camera(np.zeros(3), direction, self._settings) for direction in DIRECTIONS]
        shown = [
            np.flatnonzero(_shown(camera, cells.positions - place, seen))
            for place, seen in zip(self._candidates, sees, strict=True)
            for camera in cameras
        ]
        ends = np.cumsum([0, *(each.size for each in shown)])
        return csr_array((np.ones(ends[-1]), np.concatenate(shown), ends), shape=(len(shown), cells.area.size))

    def _open_area(self, covered: BoolArray) -> FloatArray:
        """(cell,) area of each that is not covered [m²]."""
        area = self._samples.area[self._open] * ~covered[self._open]
        return np.asarray(np.bincount(self._cell, weights=area, minlength=self._shows.shape[1]), dtype=np.float64)

    def missing_viewpoints(self, covered: BoolArray, coverage: float, most: int) -> int:
        """Viewpoints still to be taken, counted once as if every view showed all that can be seen from its place."""
        if self._missing is None:
            self._missing = self._count_viewpoints(covered, coverage, most)
        else:
            self._missing -= 1
        return max(1, self._missing)

    def _count_viewpoints(self, covered: BoolArray, coverage: float, most: int) -> int:
        left = self._open_area(covered)
        wanted = (coverage - self.share(covered)) * self._total
        for count in range(1, most + 1):
            gains = self._shows @ left
            best = int(gains.argmax())
            wanted -= float(gains[best])
            if wanted <= 0:
                return count
            if gains[best] < self._settings.min_gain * self._total:
                return count - 1
            left[self._shows.indices[self._shows.indptr[best] : self._shows.indptr[best + 1]]] = 0.0
        return most


def free_candidates(scan: Scan, room: Room, caster: RayCaster) -> FloatArray:
    """Places in free space to look from: v0 first, nearest to the room's centre; then a grid at several heights.

    Parameters
    ----------
    scan : Scan
    room : Room
    caster : RayCaster
        Loaded with the scan.

    Returns
    -------
    candidates : (candidate, 3) float
        [m]

    Raises
    ------
    MaterialError
        If no place in the room is free.
    """
    plan = np.concatenate(room.outlines)
    low, high = plan.min(axis=0), plan.max(axis=0)
    heights = room.floor_z + np.array(CANDIDATE_HEIGHTS) * room.height_m
    step = max(0.3, float(np.sqrt(np.prod(high - low) * len(heights) / MAX_CANDIDATES)))
    x, y = (np.linspace(a, b, int(np.ceil((b - a) / step)) + 1) for a, b in zip(low, high, strict=True))
    points = np.stack(np.meshgrid(x, y, heights, indexing="ij"), axis=-1).reshape(-1, 3)
    center = np.append(_centroid(room.outline), room.floor_z + 0.5 * room.height_m)
    points = np.vstack([center, points])
    space = FreeSpace(scan, room, caster=caster)
    free = points[space.inside(points)]
    free = free[space.is_farther(free, CLEARANCE_M)]
    if not len(free):
        raise MaterialError(
            expected="a place in the room from which its surfaces can be seen",
            found=f"none free among {len(points)}",
            where="viewpoints",
            todo="Check that the scan's normals face the room, and its unit.",
        )
    return np.asarray(free[np.argsort(np.linalg.norm(free - center, axis=1), kind="stable")], dtype=np.float64)


def visible(samples: SurfaceSamples, places: FloatArray, caster: RayCaster, settings: ViewSettings) -> BoolArray:
    """Which samples are seen from which places: from the front, not too aslant or far, with nothing between.

    Parameters
    ----------
    samples : SurfaceSamples
    places : (place, 3) float
        [m]
    caster : RayCaster
    settings : ViewSettings

    Returns
    -------
    sees : (place, sample) bool
    """
    if not samples.area.size:
        return np.zeros((len(places), 0), dtype=np.bool_)
    at_once = max(1, SIGHT_LINES_AT_ONCE // samples.area.size)
    parts = [
        _visible(samples, places[start : start + at_once], caster, settings) for start in range(0, len(places), at_once)
    ]
    return np.concatenate(parts)


def _visible(samples: SurfaceSamples, places: FloatArray, caster: RayCaster, settings: ViewSettings) -> BoolArray:
    """As `visible`, all sight lines in one batch."""
    sight = places[:, None] - samples.positions
    distance = np.sqrt(np.einsum("psc,psc->ps", sight, sight))
    facing = np.einsum("psc,sc->ps", sight, samples.normals)
    sees = (facing > settings.min_cosine * distance) & (distance < settings.farthest_m)
    place, sample = np.nonzero(sees)
    # From the place outwards, so that a sample's own face, met at the very end, does not hide it.
    between = caster.blocked(places[place], -sight[place, sample] * (1.0 - SURFACE_GAP), max_distance=1.0)
    sees[place[between], sample[between]] = False
    return np.asarray(sees, dtype=np.bool_)


def in_image(camera: Camera, positions: FloatArray) -> BoolArray:
    """Which of (n, 3) positions [m] fall within a camera's image, whatever stands between."""
    pixels, depth = project(camera, positions)
    with np.errstate(invalid="ignore"):
        within = (pixels >= 0).all(axis=1) & (pixels[:, 0] < camera.width) & (pixels[:, 1] < camera.height)
    return np.asarray(within & (depth > 0))


def _shown(camera: Camera, positions: FloatArray, sees: BoolArray) -> BoolArray:
    """Which of the (sample,) positions [m] that are seen from a camera's place fall within its image."""
    shown = np.zeros_like(sees)
    shown[sees] = in_image(camera, positions[sees])
    return shown


def _camera(viewpoint: FloatArray, direction: str, settings: ViewSettings) -> Camera:
    """Camera at a viewpoint that looks in one of the six directions."""
    return camera_towards(
        viewpoint,
        np.array(DIRECTIONS[direction]),
        width=settings.width,
        height=settings.height,
        field_of_view_deg=settings.field_of_view_deg,
    )


def _face_seen(samples: SurfaceSamples, covered: BoolArray, *, faces: int) -> FloatArray:
    """(face,) share of each face's samples that were seen; 0 for a face without area."""
    total = np.bincount(samples.face, minlength=faces)
    seen = np.bincount(samples.face[covered], minlength=faces)
    return np.asarray(seen / np.maximum(total, 1), dtype=np.float64)


def _point_coverage(scan: Scan, seen_faces: IntArray) -> float:
    """Share of the vertices of which a face was seen: the paper's |coverage| / N."""
    used = np.unique(scan.faces).size
    return float(np.unique(scan.faces[np.unique(seen_faces)]).size / used)


def _centroid(outline: FloatArray) -> FloatArray:
    """Centroid of a polygon's area, from (corner, 2) [m]."""
    following = np.roll(outline, -1, axis=0)
    cross = outline[:, 0] * following[:, 1] - following[:, 0] * outline[:, 1]
    if abs(cross.sum()) < 1e-12:
        return np.asarray(outline.mean(axis=0), dtype=np.float64)
    return np.asarray(((outline + following) * cross[:, None]).sum(axis=0) / (3.0 * cross.sum()), dtype=np.float64)
