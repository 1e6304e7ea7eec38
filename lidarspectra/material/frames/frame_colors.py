"""Colours of a scan from its frames: one radiometry for all of them, and their radiance as the scan's texture.

A texture is what an app made of hundreds of pictures: blended, tone mapped, its exposure averaged, lamps cut at white.
Here the frames themselves are brought to one scale (`frame_gains`) and combined texel by texel (`frame_texels`), then
once more with poses that are mended by the first result (`frame_poses`). What no frame saw has the app's texture,
brought to the frames' scale (`frame_unseen`), if there is one.
"""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, SmallFloatArray
from lidarspectra.errors import ScanError
from lidarspectra.geometry.appearance import NEUTRAL_COLOR, NO_COLOR, PHOTOGRAPHED, Appearance, LinearLight
from lidarspectra.geometry.rays import caster_of
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.frames import Frame, FrameFault, LeftOut
from lidarspectra.hardware.phone.raw_mesh import NO_COLOR_NOTE
from lidarspectra.hardware.phone.texture_atlas import fill_from_nearest, unwrap
from lidarspectra.material.frames.frame_views import DARK, MeshView, linear_table, pictures, sampled
from lidarspectra.material.frames.fusion import Fused
from lidarspectra.material.frames.gains import CELL_M, Observations, Radiometry, solve_radiometry
from lidarspectra.material.frames.kept_pictures import KeptPictures
from lidarspectra.material.frames.records import FrameRecords, Recorder
from lidarspectra.material.frames.texels import Roll, Texels, fuse_frames, mend_poses
from lidarspectra.material.frames.unseen import FromTexture, Places, light_of_texture
from lidarspectra.progress import Progress, shares, silent

TEXEL_M = 0.01  # [m] of the texture; phones' poses are not better
ATLAS_FILL = 0.45  # [1] share of an atlas that is surface
ATLAS_PX = (256, 4096)  # [px]
POINTS = 20_000  # by which frames are tied to one another
POINT_SPACING_M = 0.05  # [m] least distance on average
BRIGHT = 0.9  # [1] of white, up to which a picture tells a ratio
MIN_VIEWS = 2  # frames that show a point, for it to tie them
UNTIED = "no other frame shows, neither too dark nor cut at white, a surface that it shows"
PAINT_SHARE, PAINT_LEVEL = 0.95, 0.6  # the radiance that this share of the surface does not pass is this much of white
TEXTURE_PLACES = 100_000  # that texture and frames are compared by, before dark and clipped ones are left out
LAMP_LEVEL = 1.2  # [1] of white, at least, of what all frames show cut in all channels
SHARES = (0.08, 0.05, 0.02, 0.08, 0.77)  # of the time: looking, solving, unwrapping, keeping pictures, colouring
COLORING_SHARES = (0.39, 0.22, 0.38, 0.01)  # of that: combining frames, mending poses, combining again, filling
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
        Those used, with mended poses, as the rows of `radiometry`; none if no two of them show the same surface.
    left_out : tuple of LeftOut
        Those that turned out damaged, whose pose does not fit the mesh, or whose exposure no other frame tells.
    face_seen : (face,) bool
        Which faces some frame saw.
    seen_share : float
        Share of the area that some frame saw. [0-1]
    texture_share : float
        Share of the area that no frame saw and that has the colour of the app's texture. [0-1]
    texture_spread : float
        Relative deviation of texture and frames where both show the surface. [1]
    recovered_m2 : float
        Area above white in a usual frame whose radiance a darker frame tells. [m²]
    cut_m2 : float
        Area that every frame shows cut at white. [m²]
    spread : float
        Median over the texels of their relative deviation. [1]
    records : FrameRecords or None
        What each frame shows of places all over the surface; None if no frame is used.
    scale : float
        Of the scan's colours over the radiometry's unit. [1]
    """

    scan: Scan
    radiometry: Radiometry | None
    frames: tuple[Frame, ...]
    left_out: tuple[LeftOut, ...]
    face_seen: BoolArray
    seen_share: float
    texture_share: float
    texture_spread: float
    recovered_m2: float
    cut_m2: float
    spread: float
    records: FrameRecords | None
    scale: float = 1.0


def color_from_frames(
    scan: Scan, frames: Sequence[Frame], *, texel_m: float = TEXEL_M, progress: Progress = silent
) -> FrameColors:
    """Give a scan the radiance that its frames show.

    Parameters
    ----------
    scan : Scan
        Its colours, if they are of an app's texture, are those of what no frame saw.
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
    looking, solving, unwrapping, keeping, coloring = shares(progress, SHARES)
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
            scan=scan, radiometry=None, frames=(), left_out=seen.left_out,
            face_seen=np.zeros(len(scan.faces), dtype=np.bool_), seen_share=0.0, texture_share=0.0, texture_spread=0.0,
            recovered_m2=0.0, cut_m2=0.0, spread=0.0, records=None,
        )  # fmt: skip
    solving(0.0, "one radiometry for all frames")
    radiometry = solve_radiometry(seen.observations, generator)
    unwrapping(0.0, "unwrapping the mesh")
    size = int(np.clip(np.sqrt(scan.areas.sum() / ATLAS_FILL) / texel_m, *ATLAS_PX))
    atlas = unwrap(scan.vertices, scan.faces, scan.normals, size)
    texels = Texels.of(scan, atlas)
    with closing(KeptPictures(seen.frames, radiometry.tone.light(linear_table()), keeping)) as kept:
        roll = Roll(frames=seen.frames, sharpness=seen.sharpness, radiometry=radiometry, pictures=kept)
        return _of_roll(texels, view, roll, seen.left_out, generator, coloring)


def _of_roll(
    texels: Texels,
    view: MeshView,
    roll: Roll,
    left_out: tuple[LeftOut, ...],
    generator: np.random.Generator,
    progress: Progress,
) -> FrameColors:
    """The scan's colours by frames of one radiometry, whose poses are mended."""
    fusing, mending, fusing_again, filling = shares(progress, COLORING_SHARES)
    roll = mend_poses(texels, view, roll, fuse_frames(texels, view, roll, fusing), mending)
    recorder = Recorder(len(texels.face), float(texels.scan.areas.sum()), generator)
    fused = fuse_frames(texels, view, roll, fusing_again, recorder)
    filling(0.0, "filling what no frame saw")
    places = recorder.texels
    records = recorder.records(
        points=texels.points(places),
        normals=texels.scan.normals[texels.face[places]],
        camera=np.array([frame.position for frame in roll.frames]),
    )
    return _colored(texels, roll, left_out, fused, records, generator)


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
    shows_mesh = False
    for number, (frame, picture) in enumerate(zip(frames, pictures(frames, linear_table()), strict=True)):
        progress(number / len(frames), "reading frames")
        if isinstance(picture, FrameFault):
            left_out.append(frame.left_out(str(picture)))
            continue
        depth = view.depth(frame)
        if view.is_lost(depth, picture.depth):
            left_out.append(frame.left_out("its depth does not fit the mesh from its pose"))
            continue
        sight = view.sight(frame, depth, picture.depth, points, normals)
        shows_mesh |= sight.index.size > 0
        light, uneven, clipped = sampled(picture, sight)
        good = ~clipped & (light.min(axis=1) > DARK) & (light.max(axis=1) < BRIGHT)
        which = np.full(int(good.sum()), len(usable), dtype=np.int64)
        parts.append((sight.index[good], which, light[good], uneven[good], sight.radius2[good]))
        usable.append(frame)
        sharpness.append(picture.sharpness)
    if not shows_mesh:
        return _Seen(
            frames=(), sharpness=np.zeros(0), observations=_none(), left_out=tuple(left_out), shows_mesh=False
        )  # fmt: skip
    point, which, light, uneven, radius2 = (np.concatenate(each) for each in zip(*parts, strict=True))
    tying = np.bincount(point, minlength=len(points))[point] >= MIN_VIEWS
    _, renumbered = np.unique(point[tying], return_inverse=True)
    tied, of_tied = np.unique(which[tying], return_inverse=True)
    left_out += [usable[each].left_out(UNTIED) for each in range(len(usable)) if each not in tied]
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


def _colored(
    texels: Texels,
    roll: Roll,
    left_out: tuple[LeftOut, ...],
    fused: Fused,
    records: FrameRecords,
    generator: np.random.Generator,
) -> FrameColors:
    """The scan with the fused radiance as its texture."""
    scan, atlas, face, radiometry = texels.scan, texels.atlas, texels.face, roll.radiometry
    count = len(scan.faces)
    known = np.isfinite(fused.light[:, 0])
    per_face = np.maximum(np.bincount(face, minlength=count), 1)
    area = (scan.areas / per_face)[face]
    scale = np.float32(_scale(fused, area))
    light, deviation, cut, white = fused.light * scale, fused.deviation.copy(), fused.at_least, fused.white
    saw = np.bincount(face[known], minlength=count) > 0
    filled = _of_texture(texels, light, known & ~cut, generator)
    if filled is not None:
        told, found = filled
        light[told], deviation[told], cut[told], white[told] = found.light, found.spread, found.cut, found.cut
    light[white] *= np.maximum(LAMP_LEVEL / np.maximum(light[white].max(axis=1, keepdims=True), 1e-6), 1.0)
    shown = np.isfinite(light[:, 0])
    colored = np.bincount(face[shown], minlength=count) > 0
    total = np.bincount(face[shown], weights=deviation[shown].astype(np.float64), minlength=count)
    appearance = Appearance(
        images=(_spread_out(texels, light, shown),),
        face_image=np.where(colored, 0, -1),
        corner_uv=atlas.corner_uv,
        corner_color=np.full((count, 3, 3), NEUTRAL_COLOR),
        color_source=np.where(colored, PHOTOGRAPHED, NO_COLOR),
        linear=LinearLight(
            power_deviation=radiometry.power_deviation,
            shoulder_deviation=radiometry.shoulder_deviation,
            face_deviation=total / np.maximum(np.bincount(face[shown], minlength=count), 1),
            face_cut=np.bincount(face[cut], minlength=count) / per_face,
        ),
    )
    notes = tuple(note for note in scan.record.notes if not note.startswith(NO_COLOR_NOTE))
    above = known & ~fused.at_least & (fused.light.max(axis=1) > 1.0)
    whole = float(scan.areas.sum())
    return FrameColors(
        scan=replace(scan, appearance=appearance, record=replace(scan.record, notes=notes)),
        radiometry=radiometry,
        frames=roll.frames,
        left_out=left_out,
        face_seen=np.asarray(saw, dtype=np.bool_),
        seen_share=float(scan.areas[saw].sum()) / whole,
        texture_share=float(scan.areas[colored & ~saw].sum()) / whole,
        texture_spread=0.0 if filled is None else filled[1].spread,
        recovered_m2=float(area[above].sum()),
        cut_m2=float(area[fused.at_least].sum()),
        spread=float(np.median(fused.deviation[known])),
        records=records.scaled(float(scale)),
        scale=float(scale),
    )


def _of_texture(
    texels: Texels, light: SmallFloatArray, told: BoolArray, generator: np.random.Generator
) -> tuple[IntArray, FromTexture] | None:
    """Texels that no frame saw and their radiance by the scan's own texture; None without a texture that tells."""
    own = texels.scan.appearance
    pictured = own.photographed[texels.face] & (own.linear is None)
    unseen, both = np.flatnonzero(pictured & ~np.isfinite(light[:, 0])), np.flatnonzero(pictured & told)
    if not unseen.size or not both.size:
        return None
    if both.size > TEXTURE_PLACES:
        both = generator.choice(both, TEXTURE_PLACES, replace=False)

    def places(chosen: IntArray) -> Places:
        return Places(
            points=texels.points(chosen),
            normals=texels.scan.normals[texels.face[chosen]],
            texture=own.sample(texels.face[chosen].astype(np.int64), texels.weights(chosen)),
        )

    found = light_of_texture(places(both), light[both].astype(np.float64), places(unseen), generator)
    return None if found is None else (unseen, found)


def _spread_out(texels: Texels, light: SmallFloatArray, shown: BoolArray) -> SmallFloatArray:
    """(size, size, 3) texture of the texels' (texel, 3) light; where none is shown, it has that of the nearest one."""
    texture = np.zeros((*texels.atlas.covered.shape, 3), dtype=np.float32)
    there = np.zeros(texture.shape[:2], dtype=np.bool_)
    texture[texels.rows, texels.columns] = light
    there[texels.rows, texels.columns] = shown
    fill_from_nearest(texture, there)
    return texture


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
