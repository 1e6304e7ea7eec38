"""Colours of a scan from its frames: one radiometry for all of them, and their radiance as the scan's texture.

A texture is what an app made of hundreds of pictures: blended, tone mapped, its exposure averaged, lamps cut at white.
Here the frames themselves are brought to one scale (`frame_gains`) and combined texel by texel (`frame_fusion`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.errors import ScanError
from lidarspectra.geometry.appearance import NO_COLOR, PHOTOGRAPHED, Appearance, LinearLight
from lidarspectra.geometry.rays import caster_of
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.frames import Frame, FrameFault, LeftOut
from lidarspectra.hardware.phone.raw_mesh import NO_COLOR_NOTE
from lidarspectra.hardware.phone.texture_atlas import Atlas, unwrap
from lidarspectra.material.frame_fusion import BestViews, Fused
from lidarspectra.material.frame_gains import CELL_M, Observations, Radiometry, solve_radiometry
from lidarspectra.material.frame_views import MeshView, Picture, linear_table, pictures, sampled
from lidarspectra.progress import Progress, shares, silent

TEXEL_M = 0.01  # [m] of the texture; phones' poses are not better
ATLAS_FILL = 0.45  # [1] share of an atlas that is surface
ATLAS_PX = (256, 4096)  # [px]
POINTS = 20_000  # by which frames are tied to one another
POINT_SPACING_M = 0.05  # [m] least distance on average
DARK, BRIGHT = 0.004, 0.9  # [1] of white, between which a picture tells a ratio
MIN_VIEWS = 2  # frames that show a point, for it to tie them
UNTIED = "no other frame shows, neither too dark nor cut at white, a surface that it shows"
TEXEL_BLUR = 3.0  # [1] weight falls by this power of a frame's sharpness over its neighbours'
NEIGHBOURS = 5  # frames before and after
EVEN = 1e-3  # [1] sharpness of a picture of an even wall, which is not blurred
PAINT_SHARE, PAINT_LEVEL = 0.95, 0.6  # the radiance that this share of the surface does not pass is this much of white
CUT_SHARE = 0.5  # [1] of white, above which a channel of a pixel with a clipped part is taken for cut
LAMP_LEVEL = 1.2  # [1] of white, at least, of what all frames are cut at
SHARES = (0.3, 0.2, 0.05, 0.4, 0.05)  # of the time: looking, solving, unwrapping, fusing, filling
SEED = 20240911  # of points and of what is held out


@dataclass(frozen=True, kw_only=True, eq=False)
class FrameColors:
    """A scan coloured by its frames.

    Parameters
    ----------
    scan : Scan
        With the frames' radiance as its texture; as it was if no frame is used.
    radiometry : Radiometry or None
        None if no frame is used.
    frames : tuple of Frame
        Those used, as the rows of `radiometry`; none if no two of them show the same surface.
    left_out : tuple of LeftOut
        Those that turned out damaged, whose pose does not fit the mesh, or whose exposure no other frame tells.
    seen_share : float
        Share of the area that some frame saw. [0-1]
    recovered_m2 : float
        Area above white in a usual frame whose radiance a darker frame tells. [m²]
    cut_m2 : float
        Area that every frame shows cut at white. [m²]
    spread : float
        Median over the texels of their relative deviation. [1]
    """

    scan: Scan
    radiometry: Radiometry | None
    frames: tuple[Frame, ...]
    left_out: tuple[LeftOut, ...]
    seen_share: float
    recovered_m2: float
    cut_m2: float
    spread: float


def color_from_frames(
    scan: Scan, frames: Sequence[Frame], *, texel_m: float = TEXEL_M, progress: Progress = silent
) -> FrameColors:
    """Give a scan the radiance that its frames show.

    Parameters
    ----------
    scan : Scan
        Its geometry is used, its colours are not.
    frames : sequence of Frame
        With poses in the scan's axes, in metres.
    texel_m : float
        Of the texture, if its largest size allows. [m]
    progress : callable
        Receives the share that is done.

    Returns
    -------
    colors : FrameColors

    Raises
    ------
    ScanError
        If no frame shows the mesh.
    """
    looking, solving, unwrapping, fusing, filling = shares(progress, SHARES)
    generator = np.random.default_rng(SEED)
    view = MeshView(caster_of(scan))
    seen = _observe(scan, view, frames, generator, looking)
    if not seen.shows_mesh:
        reason = seen.left_out[0].reason if seen.left_out else "none shows it"
        raise ScanError(
            expected="frames that show the mesh", found=f"{len(frames)} that do not ({reason})",
            where=scan.record.file,
            todo="Check that mesh and frames are of one scan, or set frames = false in [scan] for the mesh's colours.",
        )  # fmt: skip
    if not seen.frames:
        return FrameColors(
            scan=scan, radiometry=None, frames=(), left_out=seen.left_out, seen_share=0.0, recovered_m2=0.0,
            cut_m2=0.0, spread=0.0,
        )  # fmt: skip
    solving(0.0, "one radiometry for all frames")
    radiometry = solve_radiometry(seen.observations, generator)
    unwrapping(0.0, "unwrapping the mesh")
    size = int(np.clip(np.sqrt(scan.areas.sum() / ATLAS_FILL) / texel_m, *ATLAS_PX))
    atlas = unwrap(scan.vertices, scan.faces, scan.normals, size)
    rows, columns = np.nonzero(atlas.covered)
    fused = _fuse(scan, view, seen, radiometry, (atlas, rows, columns), fusing)
    filling(0.0, "filling what no frame saw")
    return _colored(scan, seen, radiometry, (atlas, rows, columns), fused)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Seen:
    """Frames that can be used, their sharpness [1], what they show, those that cannot; whether any shows the mesh."""

    frames: tuple[Frame, ...]
    sharpness: FloatArray
    observations: Observations
    left_out: tuple[LeftOut, ...]
    shows_mesh: bool


def _observe(
    scan: Scan, view: MeshView, frames: Sequence[Frame], generator: np.random.Generator, progress: Progress
) -> _Seen:
    """What each frame shows of points spread over the mesh."""
    points, normals = _points(scan, generator)
    cell = np.unique(np.floor(points / CELL_M), axis=0, return_inverse=True)[1].reshape(-1)
    usable: list[Frame] = []
    sharpness: list[float] = []
    left_out: list[LeftOut] = []
    parts: list[tuple[IntArray, IntArray, FloatArray, FloatArray, FloatArray]] = []
    for number, (frame, picture) in enumerate(zip(frames, pictures(frames, linear_table()), strict=True)):
        progress(number / len(frames), "reading frames")
        if isinstance(picture, FrameFault):
            left_out.append(LeftOut(name=frame.name, reason=str(picture)))
            continue
        depth = view.depth(frame)
        if view.is_lost(depth, picture.depth):
            left_out.append(LeftOut(name=frame.name, reason="its depth does not fit the mesh from its pose"))
            continue
        sight = view.sight(frame, depth, picture.depth, points, normals)
        light, uneven, clipped = sampled(picture, sight)
        good = ~clipped & (light.min(axis=1) > DARK) & (light.max(axis=1) < BRIGHT)
        which = np.full(int(good.sum()), len(usable), dtype=np.int64)
        parts.append((sight.index[good], which, light[good], uneven[good], sight.radius2[good]))
        usable.append(frame)
        sharpness.append(picture.sharpness)
    if not any(part[0].size for part in parts):
        return _Seen(
            frames=(), sharpness=np.zeros(0), observations=_none(), left_out=tuple(left_out), shows_mesh=False
        )  # fmt: skip
    point, which, light, uneven, radius2 = (np.concatenate(each) for each in zip(*parts, strict=True))
    tying = np.bincount(point, minlength=len(points))[point] >= MIN_VIEWS
    _, renumbered = np.unique(point[tying], return_inverse=True)
    tied, of_tied = np.unique(which[tying], return_inverse=True)
    left_out += [LeftOut(name=usable[each].name, reason=UNTIED) for each in range(len(usable)) if each not in tied]
    kept = tuple(usable[each] for each in tied)
    observations = Observations(
        point=renumbered.astype(np.int64), frame=of_tied.astype(np.int64), shown=light[tying], uneven=uneven[tying],
        radius2=radius2[tying], cell=cell[point[tying]], frames=len(kept),
        points=int(renumbered.max(initial=-1)) + 1, exposure=_exposures(kept),
    )  # fmt: skip
    return _Seen(
        frames=kept, sharpness=np.array(sharpness)[tied], observations=observations, left_out=tuple(left_out),
        shows_mesh=True,
    )  # fmt: skip


def _none() -> Observations:
    empty, nowhere = np.zeros(0), np.zeros(0, dtype=np.int64)
    return Observations(
        point=nowhere, frame=nowhere, shown=np.zeros((0, 3)), uneven=empty, radius2=empty, cell=nowhere,
        frames=0, points=0, exposure=empty,
    )  # fmt: skip


def _points(scan: Scan, generator: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Points spread evenly by area, and the normals there."""
    total = float(scan.areas.sum())
    count = int(np.clip(total / POINT_SPACING_M**2, 100, POINTS))
    edges = np.cumsum(scan.areas) / total
    face = np.searchsorted(edges, (np.arange(count) + generator.random(count)) / count).clip(0, len(scan.faces) - 1)
    root, turn = np.sqrt(generator.random(count)), generator.random(count)
    weights = np.stack([1.0 - root, root * (1.0 - turn), root * turn], axis=1)
    return np.einsum("nk,nkc->nc", weights, scan.corners[face]), scan.normals[face]


def _exposures(frames: Sequence[Frame]) -> FloatArray:
    """(frame,) log of exposure time times ISO over its mean; NaN unless both are told."""
    both = np.array(
        [np.nan if frame.exposure_s is None or frame.iso is None else frame.exposure_s * frame.iso for frame in frames]
    )
    logs = np.log(both)
    return np.asarray(logs - np.nanmean(logs) if np.isfinite(logs).any() else logs, dtype=np.float64)


_Texels = tuple[Atlas, IntArray, IntArray]


def _fuse(
    scan: Scan, view: MeshView, seen: _Seen, radiometry: Radiometry, texels: _Texels, progress: Progress
) -> Fused:
    """Radiance of each texel."""
    atlas, rows, columns = texels
    face = atlas.texel_face[rows, columns]
    points = np.einsum("nk,nkc->nc", atlas.barycentric(rows, columns), scan.vertices[scan.faces[face]])
    normals = scan.normals
    best = BestViews(len(points))
    table = radiometry.tone.light(linear_table())
    white = float(radiometry.tone.light(np.ones(1))[0])
    sharp = _relative_sharpness(seen.sharpness)
    centers = scan.centers
    reach = float(np.sqrt(scan.areas.max())) * 2.0
    for number, (frame, picture) in enumerate(zip(seen.frames, pictures(seen.frames, table), strict=True)):
        progress(number / len(seen.frames), "combining frames")
        if not isinstance(picture, Picture):
            continue
        some = np.flatnonzero(_may_show(frame, centers, normals, reach)[face])
        sight = view.sight(frame, view.depth(frame), picture.depth, points[some], normals[face[some]])
        light, _, clipped = sampled(picture, sight)
        fall = np.exp(np.stack([sight.radius2, sight.radius2**2], axis=1) @ radiometry.vignetting)[:, None]
        gain = np.exp(radiometry.log_gain[number]) * fall
        cut = clipped[:, None] & (light > CUT_SHARE * white)  # the other channels are told
        light[cut] = white
        dark = 1.0 / (1.0 + DARK / np.maximum(light.min(axis=1), 1e-6))
        weight = sight.weight * dark * sharp[number] ** TEXEL_BLUR
        best.add(some[sight.index], light / gain, weight, clipped)
    return best.fused()


def _may_show(frame: Frame, centers: FloatArray, normals: FloatArray, reach_m: float) -> BoolArray:
    """(face,) faces that look at the camera and lie before it, within its field of view or `reach_m` beside it."""
    relative = (centers - frame.position) @ frame.camera_to_world[:3, :3]
    depth = -relative[:, 2]
    matrix, (width, height) = frame.intrinsics, frame.size_px
    half = np.array([max(matrix[0, 2], width - matrix[0, 2]), max(matrix[1, 2], height - matrix[1, 2])])
    slope = half / np.array([matrix[0, 0], matrix[1, 1]])
    inside = (np.abs(relative[:, :2]) < slope * np.maximum(depth, 0.0)[:, None] + 2.0 * reach_m).all(axis=1)
    facing = np.einsum("nc,nc->n", frame.position - centers, normals) > -reach_m
    return np.asarray(inside & facing & (depth > -reach_m), dtype=np.bool_)


def _relative_sharpness(sharpness: FloatArray) -> FloatArray:
    """Over the median of the frames around, which show about the same; at most 1."""
    reach = min(NEIGHBOURS, sharpness.size - 1)
    padded = np.pad(sharpness, reach, mode="reflect")
    around = np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1), axis=1)
    return np.asarray(np.minimum((sharpness + EVEN) / (around + EVEN), 1.0), dtype=np.float64)


def _colored(scan: Scan, seen: _Seen, radiometry: Radiometry, texels: _Texels, fused: Fused) -> FrameColors:
    """The scan with the fused radiance as its texture."""
    atlas, rows, columns = texels
    face = atlas.texel_face[rows, columns]
    known = np.isfinite(fused.light[:, 0])
    area = (scan.areas / np.maximum(np.bincount(face, minlength=len(scan.faces)), 1))[face]
    scale = _scale(fused, area)
    light = fused.light * np.float32(scale)
    bound = light[fused.at_least]
    light[fused.at_least] = bound * np.maximum(LAMP_LEVEL / np.maximum(bound.max(axis=1, keepdims=True), 1e-6), 1.0)
    texture = np.zeros((atlas.size_px, atlas.size_px, 3), dtype=np.float32)
    shown = np.zeros(texture.shape[:2], dtype=np.bool_)
    shown[rows[known], columns[known]] = True
    texture[rows[known], columns[known]] = light[known]
    from scipy.ndimage import distance_transform_edt  # loads slowly

    nearest = distance_transform_edt(~shown, return_distances=False, return_indices=True)
    texture = texture[tuple(nearest)]
    saw = np.bincount(face[known], minlength=len(scan.faces)) > 0
    total = np.bincount(face[known], weights=fused.deviation[known].astype(np.float64), minlength=len(scan.faces))
    deviation = total / np.maximum(np.bincount(face[known], minlength=len(scan.faces)), 1)
    appearance = Appearance(
        images=(texture,),
        face_image=np.where(saw, 0, -1),
        corner_uv=atlas.corner_uv,
        corner_color=np.full((len(scan.faces), 3, 3), 0.735),
        color_source=np.where(saw, PHOTOGRAPHED, NO_COLOR),
        linear=LinearLight(
            power_deviation=radiometry.power_deviation,
            shoulder_deviation=radiometry.shoulder_deviation,
            face_deviation=deviation,
            face_cut=np.bincount(face[fused.at_least], minlength=len(scan.faces))
            / np.maximum(np.bincount(face, minlength=len(scan.faces)), 1),
        ),
    )
    notes = tuple(note for note in scan.record.notes if not note.startswith(NO_COLOR_NOTE))
    above = known & ~fused.at_least & (fused.light.max(axis=1) > 1.0)
    return FrameColors(
        scan=replace(scan, appearance=appearance, record=replace(scan.record, notes=notes)),
        radiometry=radiometry,
        frames=seen.frames,
        left_out=seen.left_out,
        seen_share=float(scan.areas[saw].sum() / scan.areas.sum()),
        recovered_m2=float(area[above].sum()),
        cut_m2=float(area[fused.at_least].sum()),
        spread=float(np.median(fused.deviation[known])),
    )


def _scale(fused: Fused, area: FloatArray) -> float:
    """Factor that brings surfaces below white, if a usual frame is cut at white on some of them; at most 1."""
    told = (fused.views > 0) & ~fused.at_least
    if not told.any():
        return 1.0
    level = fused.light[told].max(axis=1)
    order = np.argsort(level)
    mass = np.cumsum(area[told][order])
    high = float(level[order[np.searchsorted(mass, PAINT_SHARE * mass[-1])]])
    return min(1.0, PAINT_LEVEL / max(high, 1e-6))
