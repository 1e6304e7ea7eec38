"""The radiance of texels from all frames, and poses mended by it.

Texels are combined tile by tile, each tile by all frames, so that what is held at once of single views does not grow
with the texture (`TILE_TEXELS`), and pictures come from a temporary file, so that it does not grow with the frames.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, SmallFloatArray, SmallIntArray
from lidarspectra.errors import ScanError
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.frames import Frame
from lidarspectra.hardware.phone.texture_atlas import Atlas
from lidarspectra.io.scratch import ScratchFile
from lidarspectra.material.frames.frame_views import (
    CLIPPED_BYTE,
    DARK,
    FARTHEST_M,
    NEAREST_M,
    MeshView,
    linear_table,
    radius2_of,
    sampled,
)
from lidarspectra.material.frames.fusion import BestViews, Fused
from lidarspectra.material.frames.gains import DARK_NOISE, Radiometry
from lidarspectra.material.frames.kept_pictures import KeptPictures
from lidarspectra.material.frames.poses import ShownPoints, mended_pose
from lidarspectra.material.frames.records import Recorder
from lidarspectra.progress import Progress

TEXEL_BLUR = 3.0  # [1] weight falls by this power of a frame's sharpness over its neighbours'
NEIGHBOURS = 5  # frames before and after
EVEN = 1e-3  # [1] sharpness of a picture of an even wall, which is not blurred
TILE_TEXELS = 250_000  # combined at once: 180 bytes each for their best views, 45 MB


@dataclass(frozen=True, kw_only=True, eq=False)
class Tile:
    """Some of the texels, next to one another in the texture.

    Parameters
    ----------
    start : int
        Number of the first.
    faces : (face,) int
        That they show.
    face : (texel,) int
        Of those, which each of them shows.
    points : (texel, 3) float
        [m]
    """

    start: int
    faces: IntArray
    face: IntArray
    points: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Texels:
    """Texels of a scan's surface.

    Parameters
    ----------
    scan : Scan
    atlas : Atlas
        Of its faces.
    rows, columns, face : (texel,) int32
        Of those that show a face, row by row.
    """

    scan: Scan
    atlas: Atlas
    rows: SmallIntArray
    columns: SmallIntArray
    face: SmallIntArray

    @staticmethod
    def of(scan: Scan, atlas: Atlas) -> "Texels":
        """All texels of an atlas."""
        rows, columns = (each.astype(np.int32) for each in np.nonzero(atlas.covered))
        face = atlas.texel_face[atlas.covered].astype(np.int32)
        return Texels(scan=scan, atlas=atlas, rows=rows, columns=columns, face=face)

    def points(self, chosen: slice | IntArray) -> FloatArray:
        """(chosen, 3) where some of them lie [m]."""
        corners = self.scan.vertices[self.scan.faces[self.face[chosen]]]
        return np.asarray(np.einsum("nk,nkc->nc", self.weights(chosen), corners), dtype=np.float64)

    def weights(self, chosen: slice | IntArray) -> FloatArray:
        """(chosen, 3) weights of the corners of the faces that some of them show [1]."""
        rows, columns = (each[chosen].astype(np.int64) for each in (self.rows, self.columns))
        return self.atlas.barycentric(rows, columns)

    def tiles(self) -> Iterator[Tile]:
        """All of them, at most `TILE_TEXELS` at a time."""
        for start in range(0, len(self.face), TILE_TEXELS):
            part = slice(start, start + TILE_TEXELS)
            faces, face = np.unique(self.face[part], return_inverse=True)
            yield Tile(start=start, faces=faces.astype(np.int64), face=face, points=self.points(part))

    def image(self, values: SmallFloatArray) -> SmallFloatArray:
        """(size, size) texture of one value a texel; NaN between charts."""
        image = np.full(self.atlas.covered.shape, np.nan, dtype=np.float32)
        image[self.rows, self.columns] = values
        return image

    def at(self, image: SmallFloatArray, face: IntArray, barycentric: FloatArray) -> FloatArray:
        """(n,) values of a (size, size) texture at points of faces."""
        uv = np.einsum("nk,nkc->nc", barycentric, self.atlas.corner_uv[face])
        size = self.atlas.size_px
        place = np.clip(np.stack([1.0 - uv[:, 1], uv[:, 0]]) * size, 0, size - 1).astype(np.int64)
        return np.asarray(image[place[0], place[1]], dtype=np.float64)


@dataclass(frozen=True, kw_only=True, eq=False)
class Roll:
    """Frames of one radiometry.

    Parameters
    ----------
    frames : tuple of Frame
    sharpness : (frame,) float
        [1]
    radiometry : Radiometry
        Its rows are the frames.
    pictures : KeptPictures
        Of the frames, by the radiometry's curve.
    """

    frames: tuple[Frame, ...]
    sharpness: FloatArray
    radiometry: Radiometry
    pictures: KeptPictures


def fuse_frames(
    texels: Texels, view: MeshView, roll: Roll, progress: Progress, recorder: Recorder | None = None
) -> Fused:
    """Radiance of each texel.

    Parameters
    ----------
    texels : Texels
    view : MeshView
        Of their scan.
    roll : Roll
    progress : callable
    recorder : Recorder, optional
        Is told what each frame shows.

    Returns
    -------
    fused : Fused
    """
    tiles = -(-len(texels.face) // TILE_TEXELS)
    parts: list[Fused] = []
    with ScratchFile(error=ScanError) as scratch:
        shown = _Shown(texels.scan, view, roll, scratch)
        for tile in texels.tiles():
            best = BestViews(len(tile.points))
            for number in range(len(roll.frames)):
                progress((len(parts) + number / len(roll.frames)) / tiles, "combining frames")
                views = shown.of_tile(tile, number)
                if views is None:
                    continue
                best.add(views.texel, views.light, views.weight, views.clipped, cut=views.cut, noise=views.noise)
                if recorder is not None:
                    recorder.add(number, tile.start + views.texel, views.light, views.uneven, views.clipped)
            parts.append(best.fused())
    return Fused.joined(parts)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Views:
    """What a frame shows of a tile: (seen,) texels in it, (seen, 3) radiance and where that is cut at white, and more.

    `weight` says how well each is shown, `uneven` and `clipped` are those of `sampled`, and `noise` is the deviation of
    the radiance where the frame is dark [1].
    """

    texel: IntArray
    light: FloatArray
    cut: BoolArray
    weight: FloatArray
    uneven: FloatArray
    clipped: BoolArray
    noise: float


class _Shown:
    """What the frames of a roll show of tiles; the mesh's depths as of their poses are kept in a scratch file."""

    def __init__(self, scan: Scan, view: MeshView, roll: Roll, scratch: ScratchFile) -> None:
        self._scan, self._view, self._roll, self._scratch = scan, view, roll, scratch
        self._depths = [scratch.keep(view.depth(frame)) for frame in roll.frames]
        self._white = float(roll.radiometry.tone.light(linear_table())[CLIPPED_BYTE].max())
        self._sharpness = _relative_sharpness(roll.sharpness)
        self._reach_m = np.linalg.norm(scan.corners - scan.centers[:, None], axis=2).max(axis=1)

    def of_tile(self, tile: Tile, number: int) -> _Views | None:
        """What a frame shows of a tile; None of one that it does not look at, or if it is damaged."""
        frame, radiometry, normals = self._roll.frames[number], self._roll.radiometry, self._scan.normals[tile.faces]
        may_show = _may_show(frame, self._scan.centers[tile.faces], normals, self._reach_m[tile.faces])
        some = np.flatnonzero(may_show[tile.face])
        picture = self._roll.pictures[number] if some.size else None
        if picture is None:
            return None
        depth = cast("FloatArray", self._scratch.read(self._depths[number]))
        sight = self._view.sight(frame, depth, picture.depth, tile.points[some], normals[tile.face[some]])
        light, uneven, clipped = sampled(picture, sight)
        dark = 1.0 / (1.0 + DARK / np.maximum(light.mean(axis=1), 1e-6))  # not its darkest channel, which is noise
        gain = np.exp(radiometry.log_gain[number])
        return _Views(
            texel=some[sight.index],
            light=light / (gain * radiometry.fall(sight.radius2)[:, None]),
            cut=clipped[:, None] & (light >= self._white),
            weight=sight.weight * dark * self._sharpness[number] ** TEXEL_BLUR,
            uneven=uneven,
            clipped=clipped,
            noise=DARK_NOISE / float(gain[1]),
        )


def mend_poses(texels: Texels, view: MeshView, roll: Roll, fused: Fused, progress: Progress) -> Roll:
    """Lay each frame on what all frames saw.

    Parameters
    ----------
    texels : Texels
    view : MeshView
        Of their scan.
    roll : Roll
    fused : Fused
        Radiance of the texels by the frames as their poses were told.
    progress : callable

    Returns
    -------
    roll : Roll
        With mended poses.
    """
    told = texels.image(np.where(fused.at_least | (fused.views == 0), np.float32(np.nan), fused.light.mean(axis=1)))
    frames: list[Frame] = []
    for number, frame in enumerate(roll.frames):
        progress(number / len(roll.frames), "mending poses")
        picture = roll.pictures[number]
        if picture is None:
            frames.append(frame)
            continue
        seen = view.shown(frame)
        light = texels.at(told, seen.face, seen.barycentric)
        good = np.flatnonzero(np.isfinite(light) & (light > 0))
        points = np.einsum(
            "nk,nkc->nc", seen.barycentric[good], texels.scan.vertices[texels.scan.faces[seen.face[good]]]
        )
        fall = roll.radiometry.fall(radius2_of(frame, picture.light.shape[:2]))
        exposed = (picture.light / np.exp(roll.radiometry.log_gain[number])).mean(axis=2) / fall
        frames.append(
            mended_pose(frame, picture, exposed.astype(np.float32), ShownPoints(points=points, light=light[good]))
        )
    return replace(roll, frames=tuple(frames))


def _may_show(frame: Frame, centers: FloatArray, normals: FloatArray, reach_m: FloatArray) -> BoolArray:
    """(face,) faces that look at the camera and have a part before it within its field of view.

    Of a face whose corners lie `reach_m` from its centre, none is further out of the picture than its centre is, or
    further before the camera, by more than that.
    """
    relative = (centers - frame.position) @ frame.camera_to_world[:3, :3]
    nearest, farthest = -relative[:, 2] - reach_m, -relative[:, 2] + reach_m
    matrix, (width, height) = frame.intrinsics, frame.size_px
    half = np.array([max(matrix[0, 2], width - matrix[0, 2]), max(matrix[1, 2], height - matrix[1, 2])])
    slope = half / np.array([matrix[0, 0], matrix[1, 1]])
    inside = (np.abs(relative[:, :2]) - reach_m[:, None] < slope * farthest[:, None]).all(axis=1)
    facing = np.einsum("nc,nc->n", frame.position - centers, normals) > 0
    return np.asarray(inside & facing & (farthest > NEAREST_M) & (nearest < FARTHEST_M), dtype=np.bool_)


def _relative_sharpness(sharpness: FloatArray) -> FloatArray:
    """Over the median of the frames around, which show about the same; at most 1."""
    reach = min(NEIGHBOURS, sharpness.size - 1)
    padded = np.pad(sharpness, reach, mode="reflect")
    around = np.median(np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1), axis=1)
    return np.asarray(np.minimum((sharpness + EVEN) / (around + EVEN), 1.0), dtype=np.float64)
