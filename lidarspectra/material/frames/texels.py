"""The radiance of texels from all frames, and poses mended by it."""

from dataclasses import dataclass, replace

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.frames import Frame
from lidarspectra.hardware.phone.texture_atlas import Atlas
from lidarspectra.material.frames.frame_views import (
    CLIPPED_BYTE,
    DARK,
    MeshView,
    Picture,
    linear_table,
    pictures,
    radius2_of,
    sampled,
)
from lidarspectra.material.frames.fusion import BestViews, Fused
from lidarspectra.material.frames.gains import DARK_NOISE, Radiometry
from lidarspectra.material.frames.poses import ShownPoints, mended_pose
from lidarspectra.material.frames.records import Recorder
from lidarspectra.progress import Progress

TEXEL_BLUR = 3.0  # [1] weight falls by this power of a frame's sharpness over its neighbours'
NEIGHBOURS = 5  # frames before and after
EVEN = 1e-3  # [1] sharpness of a picture of an even wall, which is not blurred
NO_TEXEL = -1


@dataclass(frozen=True, kw_only=True, eq=False)
class Texels:
    """Texels of a scan's surface.

    Parameters
    ----------
    scan : Scan
    atlas : Atlas
        Of its faces.
    rows, columns, face : (texel,) int
        Of those that show a face.
    points : (texel, 3) float
        [m]
    number : (size, size) int32
        Of each pixel's texel; NO_TEXEL for none.
    """

    scan: Scan
    atlas: Atlas
    rows: IntArray
    columns: IntArray
    face: IntArray
    points: FloatArray
    number: "np.ndarray[tuple[int, ...], np.dtype[np.int32]]"

    @staticmethod
    def of(scan: Scan, atlas: Atlas) -> "Texels":
        """All texels of an atlas."""
        rows, columns = np.nonzero(atlas.covered)
        face = atlas.texel_face[rows, columns]
        number = np.full(atlas.covered.shape, NO_TEXEL, dtype=np.int32)
        number[rows, columns] = np.arange(rows.size)
        points = np.einsum("nk,nkc->nc", atlas.barycentric(rows, columns), scan.vertices[scan.faces[face]])
        return Texels(scan=scan, atlas=atlas, rows=rows, columns=columns, face=face, points=points, number=number)

    def at(self, face: IntArray, barycentric: FloatArray) -> IntArray:
        """(n,) texel at points of faces; NO_TEXEL between charts."""
        uv = np.einsum("nk,nkc->nc", barycentric, self.atlas.corner_uv[face])
        size = self.atlas.size_px
        place = np.clip(np.stack([1.0 - uv[:, 1], uv[:, 0]]) * size, 0, size - 1).astype(np.int64)
        return np.asarray(self.number[place[0], place[1]], dtype=np.int64)


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
    """

    frames: tuple[Frame, ...]
    sharpness: FloatArray
    radiometry: Radiometry


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
    scan, radiometry = texels.scan, roll.radiometry
    best = BestViews(len(texels.points))
    table = radiometry.tone.light(linear_table())
    white = float(table[CLIPPED_BYTE].max())
    sharp = _relative_sharpness(roll.sharpness)
    reach = float(np.sqrt(scan.areas.max())) * 2.0
    for number, (frame, picture) in enumerate(zip(roll.frames, pictures(roll.frames, table), strict=True)):
        progress(number / len(roll.frames), "combining frames")
        if not isinstance(picture, Picture):
            continue
        some = np.flatnonzero(_may_show(frame, scan.centers, scan.normals, reach)[texels.face])
        sight = view.sight(
            frame, view.depth(frame), picture.depth, texels.points[some], scan.normals[texels.face[some]]
        )
        light, uneven, clipped = sampled(picture, sight)
        gain = np.exp(radiometry.log_gain[number]) * radiometry.fall(sight.radius2)[:, None]
        cut = clipped[:, None] & (light >= white)
        dark = 1.0 / (1.0 + DARK / np.maximum(light.mean(axis=1), 1e-6))  # not its darkest channel, which is noise
        weight = sight.weight * dark * sharp[number] ** TEXEL_BLUR
        light /= gain
        noise = DARK_NOISE / float(np.exp(radiometry.log_gain[number, 1]))
        best.add(some[sight.index], light, weight, clipped, cut=cut, noise=noise)
        if recorder is not None:
            recorder.add(frame.position, some[sight.index], light, uneven, clipped)
    return best.fused()


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
    table = roll.radiometry.tone.light(linear_table())
    told = np.append(np.where(fused.at_least | (fused.views == 0), np.nan, fused.light.mean(axis=1)), np.nan)
    frames: list[Frame] = []
    for number, (frame, picture) in enumerate(zip(roll.frames, pictures(roll.frames, table), strict=True)):
        progress(number / len(roll.frames), "mending poses")
        if not isinstance(picture, Picture):
            frames.append(frame)
            continue
        seen = view.shown(frame)
        light = told[texels.at(seen.face, seen.barycentric)]
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
