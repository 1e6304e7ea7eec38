"""Textures that an app would make of frames: their pictures as they are, or their gains compensated, then blended.

The texture that the virtual phone writes has one exposure for the whole room, which no app's has that blends pictures
whose exposure and white balance moved. These are made of the same frames as `color_from_frames` uses, by the same views
and weights and with the same mended poses, and differ in the radiometry alone:

- `blended` takes pictures as they are, whatever their exposures: an app that averages what it is given.
- `compensated` first gives each picture a gain in three channels, so that the means of what two pictures show of the
  same surface agree (Brown and Lowe's compensation of a panorama). Without their prior on gains, which leaves a part
  of the exposures in: an app does no better than this. Pictures are not made linear first: the curve stays in.

Both are cut at white where the usual frame is and stored in 8 bits.

References
----------
Brown, Lowe (2007) Automatic panoramic image stitching using invariant features, Int. J. Comput. Vision 74, Eq. 29.
"""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace

import numpy as np
from scipy.ndimage import distance_transform_edt

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.appearance import NEUTRAL_COLOR, NO_COLOR, PHOTOGRAPHED, Appearance
from lidarspectra.geometry.rays import caster_of
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.frames import Frame
from lidarspectra.hardware.phone.texture_atlas import unwrap
from lidarspectra.material.delighting.tone_curve import ToneCurve
from lidarspectra.material.frames.frame_views import DARK, MeshView, Picture, linear_table, pictures, sampled
from lidarspectra.material.frames.gains import Radiometry
from lidarspectra.material.frames.kept_pictures import KeptPictures
from lidarspectra.material.frames.texels import Roll, Texels, fuse_frames
from lidarspectra.progress import silent
from lidarspectra.spectra.colorimetry import encode_srgb

TEXTURE_PX = 2048  # [px] a texel of 6 mm in the office, of 9 mm in the apartment
OVERLAP_TEXELS = 20_000  # by which pictures are compared


def blended(scan: Scan, frames: Sequence[Frame]) -> Scan:
    """A scan with the texture of an app that averages pictures as they are.

    Parameters
    ----------
    scan : Scan
    frames : sequence of Frame
        With poses in its axes, in metres.

    Returns
    -------
    scan : Scan
        What no frame saw has no colour.
    """
    return _Blender(scan, frames).with_gains(np.zeros((len(frames), 3)))


def compensated(scan: Scan, frames: Sequence[Frame]) -> Scan:
    """A scan with the texture of an app that compensates gains before it averages pictures.

    Parameters
    ----------
    scan : Scan
    frames : sequence of Frame
        With poses in its axes, in metres.

    Returns
    -------
    scan : Scan
        What no frame saw has no colour.
    """
    blender = _Blender(scan, frames)
    return blender.with_gains(pairwise_gains(blender.shown()))


def pairwise_gains(shown: FloatArray) -> FloatArray:
    """Gains by which the means of what each two pictures show of the same places agree.

    The sum over pairs of N_ij (d_ij - g_i + g_j)² is least, with d_ij the mean of the log of picture i over picture j
    on their N_ij common places: Brown and Lowe's Eq. 29 in logarithms, without a prior.

    Parameters
    ----------
    shown : (frame, place, 3) float
        What each shows in linear sRGB; NaN where it does not, or not well. [0-1]

    Returns
    -------
    log_gain : (frame, 3) float
        Mean 0 in each channel. [1]
    """
    gains = []
    for channel in np.moveaxis(np.log(shown), 2, 0):
        there = np.isfinite(channel).astype(np.float64)
        common, sums = there @ there.T, np.nan_to_num(channel) @ there.T
        normal = np.diag(common.sum(axis=1)) - common
        gains.append(np.linalg.lstsq(normal, (sums - sums.T).sum(axis=1), rcond=None)[0])
    return np.stack([each - each.mean() for each in gains], axis=1)


class _Blender:
    """Frames on a scan's texels."""

    def __init__(self, scan: Scan, frames: Sequence[Frame]) -> None:
        self._scan, self._frames = scan, tuple(frames)
        self._texels = Texels.of(scan, unwrap(scan.vertices, scan.faces, scan.normals, TEXTURE_PX))
        self._view = MeshView(caster_of(scan))

    def shown(self) -> FloatArray:
        """(frame, place, 3) what pictures show of some texels, in linear sRGB; NaN where dark, cut or not seen."""
        some = slice(None, None, max(1, len(self._texels.face) // OVERLAP_TEXELS))
        points, normals = self._texels.points(some), self._scan.normals[self._texels.face[some]]
        shown = np.full((len(self._frames), len(points), 3), np.nan)
        for number, picture in enumerate(pictures(self._frames, linear_table())):
            if not isinstance(picture, Picture):
                continue
            frame = self._frames[number]
            sight = self._view.sight(frame, self._view.depth(frame), picture.depth, points, normals)
            light, _, clipped = sampled(picture, sight)
            told = ~clipped & (light.min(axis=1) > DARK)
            shown[number, sight.index[told]] = light[told]
        return shown

    def with_gains(self, log_gain: FloatArray) -> Scan:
        """The scan with the mean of all pictures, each divided by its (3,) gain."""
        scan, texels, count = self._scan, self._texels, len(self._frames)
        as_shown = Radiometry(
            tone=ToneCurve(), shoulder_deviation=0.0, power_deviation=0.0, log_gain=log_gain,
            deviation=np.zeros(count), vignetting=np.zeros(2), before=0.0, after=0.0,
        )  # fmt: skip
        with closing(KeptPictures(self._frames, linear_table(), silent)) as kept:
            roll = Roll(frames=self._frames, sharpness=np.ones(count), radiometry=as_shown, pictures=kept)
            fused = fuse_frames(texels, self._view, roll, silent)
        seen = np.isfinite(fused.light[:, 0])
        texture = np.zeros((TEXTURE_PX, TEXTURE_PX, 3))
        there = np.zeros(texture.shape[:2], dtype=np.bool_)
        rows, columns = texels.rows[seen], texels.columns[seen]
        texture[rows, columns], there[rows, columns] = np.clip(fused.light[seen], 0.0, 1.0), True
        nearest = distance_transform_edt(~there, return_distances=False, return_indices=True)
        colored = np.bincount(texels.face[seen], minlength=len(scan.faces)) > 0
        appearance = Appearance(
            images=(np.rint(255.0 * encode_srgb(texture[tuple(nearest)])).astype(np.uint8),),
            face_image=np.where(colored, 0, -1),
            corner_uv=texels.atlas.corner_uv,
            corner_color=np.full((len(scan.faces), 3, 3), NEUTRAL_COLOR),
            color_source=np.where(colored, PHOTOGRAPHED, NO_COLOR),
        )
        return replace(scan, appearance=appearance)
