"""The texture that an app would make of frames: their pictures as they are, blended, whatever their exposures.

The texture that the virtual phone writes has one exposure for the whole room, which no app's has that blends pictures
whose exposure and white balance moved. This one is made of the same frames as `color_from_frames` uses, by the same
views and weights, and differs in what a solve for gains gives alone: none is made, the tone curve is left in, and what
a picture cuts at white is white.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import distance_transform_edt

from lidarspectra.geometry.appearance import NEUTRAL_COLOR, NO_COLOR, PHOTOGRAPHED, Appearance
from lidarspectra.geometry.rays import caster_of
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.frames import Frame
from lidarspectra.hardware.phone.texture_atlas import unwrap
from lidarspectra.material.delighting.tone_curve import ToneCurve
from lidarspectra.material.frames.frame_views import MeshView
from lidarspectra.material.frames.gains import Radiometry
from lidarspectra.material.frames.texels import Roll, Texels, fuse_frames
from lidarspectra.progress import silent
from lidarspectra.spectra.colorimetry import encode_srgb

TEXTURE_PX = 2048  # [px] of the office: a texel of 6 mm


def blended(scan: Scan, frames: Sequence[Frame]) -> Scan:
    """A scan with the texture that an app would blend from frames.

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
    count = len(frames)
    as_shown = Radiometry(
        tone=ToneCurve(), shoulder_deviation=0.0, power_deviation=0.0, log_gain=np.zeros((count, 3)),
        deviation=np.zeros(count), vignetting=np.zeros(2), before=0.0, after=0.0,
    )  # fmt: skip
    atlas = unwrap(scan.vertices, scan.faces, scan.normals, TEXTURE_PX)
    texels = Texels.of(scan, atlas)
    roll = Roll(frames=tuple(frames), sharpness=np.ones(count), radiometry=as_shown)
    fused = fuse_frames(texels, MeshView(caster_of(scan)), roll, silent)
    seen = np.isfinite(fused.light[:, 0])
    texture = np.zeros((TEXTURE_PX, TEXTURE_PX, 3))
    shown = np.zeros(texture.shape[:2], dtype=np.bool_)
    rows, columns = texels.rows[seen], texels.columns[seen]
    texture[rows, columns], shown[rows, columns] = np.clip(fused.light[seen], 0.0, 1.0), True
    nearest = distance_transform_edt(~shown, return_distances=False, return_indices=True)
    colored = np.bincount(texels.face[seen], minlength=len(scan.faces)) > 0
    appearance = Appearance(
        images=(np.rint(255.0 * encode_srgb(texture[tuple(nearest)])).astype(np.uint8),),
        face_image=np.where(colored, 0, -1),
        corner_uv=atlas.corner_uv,
        corner_color=np.full((len(scan.faces), 3, 3), NEUTRAL_COLOR),
        color_source=np.where(colored, PHOTOGRAPHED, NO_COLOR),
    )
    return replace(scan, appearance=appearance)
