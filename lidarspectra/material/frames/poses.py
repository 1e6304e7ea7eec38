"""Poses mended by what frames show: each frame is laid on the radiance that all of them together gave the mesh.

Poses of phones are off by a centimetre and half a degree, so that edges of colours lie beside one another in different
frames and bleed into their surroundings when they are combined. From the surface points that a frame shows and the
radiance L that all frames gave them, its pose follows by least squares over six small motions xi and a factor c,

    log I(pi(exp(-xi) X)) = log L(X) + c,                                                                          (1)

with I the frame's light, its gain and vignetting taken out, and pi the projection: Gauss and Newton's method with a
robust loss, from a blurred picture to a sharp one, held to the pose that was told by how far phones' poses are off.
What no edge tells stays as it was told.

References
----------
Zhou, Koltun (2014) Color map optimization for 3D reconstruction with consumer depth cameras, ACM TOG 33, 155.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, SmallFloatArray
from lidarspectra.hardware.phone.frames import Frame
from lidarspectra.material.frames.frame_views import Picture

STEPS = ((6.0, 0.5), (3.0, 0.4), (1.5, 0.3), (1.5, 0.2), (1.0, 0.1), (0.7, 0.1))
"""Blur of the small picture [px], from 1° to .1°, and scale of Cauchy's loss [1]: where a pose is off, edges lie beside
one another by all of their contrast; gloss and the person's shadow are to be left out in the end alone."""
SHIFT_DEVIATION_M, TURN_DEVIATION_DEG = 0.01, 0.5  # [m], [deg] of a phone's pose about the true one
MAX_SHIFT_M, MAX_TURN_DEG = 0.05, 2.5  # [m], [deg] beyond which a fit is not believed
LIGHT_DEVIATION = 0.1  # [1] of the log of light beside its blend: noise, the blend's own blur
WITNESS_POINTS = 6  # neighbouring points whose errors are alike
DARK = 0.01  # [1] of white, below which noise has edges of its own
MIN_POINTS = 500  # that a frame shows, below which its pose stays
FACTOR_DEVIATION = 0.1  # [1] of c


@dataclass(frozen=True, kw_only=True, eq=False)
class ShownPoints:
    """Points of the mesh that a frame shows, and what all frames together saw there.

    Parameters
    ----------
    points : (point, 3) float
        [m]
    light : (point,) float
        Mean of the channels' radiance. [1]
    """

    points: FloatArray
    light: FloatArray


def mended_pose(frame: Frame, picture: Picture, exposed: SmallFloatArray, shown: ShownPoints) -> Frame:
    """Lay a frame on what all frames saw.

    Parameters
    ----------
    frame : Frame
    picture : Picture
        Of the frame.
    exposed : (row, column) float32
        Mean of the channels of the picture's light, gain and vignetting taken out. [1]
    shown : ShownPoints

    Returns
    -------
    frame : Frame
        With the pose that fits best; as it was if too few points tell, or if it would be moved too far.
    """
    pose = frame.camera_to_world
    usable = (~picture.clipped & (picture.light.mean(axis=2) > DARK)).astype(np.float32)
    motion = np.zeros(7)
    prior = np.concatenate([np.full(3, np.radians(TURN_DEVIATION_DEG)), np.full(3, SHIFT_DEVIATION_M)])
    stiffness = np.concatenate([prior / np.sqrt(3.0), [FACTOR_DEVIATION]]) ** -2.0
    log = np.log(np.maximum(exposed, 1e-6))
    for blur_px, scale in STEPS:
        smooth = np.asarray(cv2.GaussianBlur(log, (0, 0), blur_px), dtype=np.float32)
        step = _step(frame, pose, _Layer.of(smooth, usable), shown, (motion, stiffness, scale))
        if step is None:
            return frame
        motion = motion + step
        pose = _moved(frame.camera_to_world, motion)
    turn, shift = float(np.linalg.norm(motion[:3])), float(np.linalg.norm(motion[3:6]))
    if turn > np.radians(MAX_TURN_DEG) or shift > MAX_SHIFT_M:
        return frame
    return replace(frame, camera_to_world=pose)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Layer:
    """A blurred picture, its slopes [1/px], and where it can be used; (row, column) float32."""

    value: SmallFloatArray
    across: SmallFloatArray
    down: SmallFloatArray
    usable: SmallFloatArray

    @staticmethod
    def of(value: SmallFloatArray, usable: SmallFloatArray) -> "_Layer":
        across, down = (
            np.asarray(cv2.Sobel(value, cv2.CV_32F, *way, scale=1 / 8), dtype=np.float32) for way in ((1, 0), (0, 1))
        )
        return _Layer(value=value, across=across, down=down, usable=usable)

    def at(self, pixel: SmallFloatArray) -> tuple[FloatArray, FloatArray, FloatArray, BoolArray]:
        """Value, slopes, and whether they can be used, at (point, 2) columns and rows."""
        columns, rows = (np.ascontiguousarray(pixel[None, :, each], dtype=np.float32) for each in (0, 1))
        value, across, down, usable = (
            cv2.remap(each, columns, rows, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0)[0]
            for each in (self.value, self.across, self.down, self.usable)
        )
        return value.astype(np.float64), across.astype(np.float64), down.astype(np.float64), usable > 0.99


def _step(
    frame: Frame, pose: FloatArray, layer: _Layer, shown: ShownPoints, fit: tuple[FloatArray, FloatArray, float]
) -> FloatArray | None:
    """(7,) step of turn [rad], shift [m] and log factor, from those so far, their stiffness and the loss' scale.

    None if too few points tell.
    """
    motion, stiffness, loss = fit
    height, width = layer.value.shape
    near = (shown.points - pose[:3, 3]) @ pose[:3, :3]
    depth = np.maximum(-near[:, 2], 1e-3)
    focal = np.array(
        [frame.intrinsics[0, 0] * width / frame.size_px[0], frame.intrinsics[1, 1] * height / frame.size_px[1]]
    )
    middle = np.array(
        [frame.intrinsics[0, 2] * width / frame.size_px[0], frame.intrinsics[1, 2] * height / frame.size_px[1]]
    )
    pixel = np.stack([focal[0] * near[:, 0] / depth, -focal[1] * near[:, 1] / depth], axis=1) + middle - 0.5
    value, across, down, usable = layer.at(pixel.astype(np.float32))
    if usable.sum() < MIN_POINTS:
        return None
    near, depth, across, down = near[usable], depth[usable], across[usable], down[usable]
    residual = value[usable] - np.log(shown.light[usable]) - motion[6]
    # Slopes over the point's place in the camera's axes, and by it over the camera's turn and shift.
    over_place = np.stack(
        [
            across * focal[0] / depth,
            -down * focal[1] / depth,
            (across * focal[0] * near[:, 0] - down * focal[1] * near[:, 1]) / depth**2,
        ],
        axis=1,
    )
    jacobian = np.hstack([np.cross(over_place, near), -over_place, -np.ones((len(near), 1))])
    weight = 1.0 / (1.0 + (residual / loss) ** 2) / (WITNESS_POINTS * LIGHT_DEVIATION**2)
    normal = jacobian.T @ (weight[:, None] * jacobian) + np.diag(stiffness)
    return np.asarray(-np.linalg.solve(normal, jacobian.T @ (weight * residual) + stiffness * motion), dtype=np.float64)


def _moved(pose: FloatArray, motion: FloatArray) -> FloatArray:
    """(4, 4) pose turned and shifted in the camera's own axes."""
    moved = pose.copy()
    moved[:3, :3] = pose[:3, :3] @ cv2.Rodrigues(np.asarray(motion[:3], dtype=np.float64))[0]
    moved[:3, 3] = pose[:3, 3] + pose[:3, :3] @ motion[3:6]
    return moved
