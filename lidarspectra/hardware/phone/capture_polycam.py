"""Frames of Polycam, its raw data: `keyframes/images`, `cameras`, `depth`, `confidence`, and `raw.glb`.

Poses are ARKit's (rows `t_00` ... `t_23`), after loop closure in `corrected_cameras`, whose pictures are undistorted
in `corrected_images`; frames without one, where others have one, stand where they were thought to be before, decimetres
away, and are left out. Exposure time and ISO, where they are exported, stand in `cameras` alone. The mesh `raw.glb` is
turned by `alignmentTransform` of `mesh_info.json` (column-major); here the poses are turned with it, so that the scan
has the axes of the GLB export.

References
----------
Polycam, polyform (github.com/PolyCam/polyform), README, "Polycam's data format".
"""

from collections.abc import Set
from typing import Any

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import ScanError
from lidarspectra.hardware.phone.capture_files import CaptureFiles
from lidarspectra.hardware.phone.frames import (
    ROTATION_TOLERANCE,
    Capture,
    DepthMap,
    Frame,
    FrameFault,
    checked_frame,
    decode_depth,
    decode_picture,
    gathered,
    image_size,
)
from lidarspectra.hardware.phone.gltf import read_gltf
from lidarspectra.hardware.phone.raw_mesh import RawMesh

APP = "Polycam"
MESH, MESH_INFO = "raw.glb", "mesh_info.json"
CAMERAS = ("keyframes/corrected_cameras/", "keyframes/cameras/")  # the better first
IMAGES = ("keyframes/corrected_images/", "keyframes/images/")
CONFIDENCE_SCALE = 127.5  # [1] of the file's 0, 127 and 255 over 0, 1 and 2
MICROSECONDS = 1e6  # [1/s] names of files are times in microseconds


def is_polycam(files: CaptureFiles) -> bool:
    """Whether a folder has this app's layout."""
    return any(name.startswith(CAMERAS) and name.endswith(".json") for name in files.names)


def read_polycam(files: CaptureFiles) -> Capture:
    """Read the frames and the mesh.

    Parameters
    ----------
    files : CaptureFiles

    Returns
    -------
    capture : Capture

    Raises
    ------
    ScanError
        If the mesh or its alignment is damaged.
    """
    stems = {
        name.rsplit("/", 1)[1].rsplit(".", 1)[0]
        for name in files.names
        if name.startswith((*CAMERAS, *IMAGES)) and name.endswith((".json", ".jpg"))
    }
    turn = _alignment(files)
    corrected = {stem for stem in stems if {f"{CAMERAS[0]}{stem}.json", f"{IMAGES[0]}{stem}.jpg"} <= files.names}
    in_order = sorted(stems, key=lambda each: (len(each), each))
    frames, left_out = gathered(in_order, lambda stem: _frame(files, stem, turn, corrected))
    return Capture(app=APP, where=files.where, frames=frames, left_out=left_out, mesh=_mesh(files))


def _frame(files: CaptureFiles, stem: str, turn: FloatArray, corrected: Set[str]) -> Frame:
    if corrected and stem not in corrected:
        raise FrameFault("the app did not correct its pose as it did others'")
    place = 0 if corrected else 1
    about, picture = files.read_json(f"{CAMERAS[place]}{stem}.json"), f"{IMAGES[place]}{stem}.jpg"
    plain = f"{CAMERAS[1]}{stem}.json"
    exposure = files.read_json(plain) if corrected and plain in files.names else about
    size = image_size(files.read(picture))
    rows = [[about.get(f"t_{row}{column}") for column in range(4)] for row in range(3)]

    def depth() -> DepthMap | None:
        name, sure = f"keyframes/depth/{stem}.png", f"keyframes/confidence/{stem}.png"
        if name not in files.names:
            return None
        confidence = files.read(sure) if sure in files.names else None
        return decode_depth(files.read(name), confidence, size, confidence_scale=CONFIDENCE_SCALE)

    frame = checked_frame(
        name=stem,
        camera_to_world=[*rows, [0.0, 0.0, 0.0, 1.0]],
        intrinsics=_intrinsics(about, size),
        size_px=size,
        time_s=int(stem) / MICROSECONDS if stem.isdecimal() and stem.isascii() else None,
        exposure_s=exposure.get("exposure_time"),
        iso=exposure.get("iso"),
        read_image=lambda least_px: decode_picture(files.read(picture), size, least_px),
        read_depth=depth,
    )
    moved = frame.moved(turn[:3, :3])
    moved.camera_to_world[:3, 3] += turn[:3, 3]
    return moved


def _intrinsics(about: dict[str, Any], size_px: tuple[int, int]) -> list[list[float]]:
    """Of the picture as it is stored, which may be smaller than the one that the file describes."""
    try:
        fx, fy, cx, cy, width, height = (float(about[key]) for key in ("fx", "fy", "cx", "cy", "width", "height"))
        across, down = size_px[0] / width, size_px[1] / height
    except (KeyError, TypeError, ValueError, ZeroDivisionError) as cause:
        raise FrameFault("its intrinsics are missing") from cause
    return [[fx * across, 0.0, cx * across], [0.0, fy * down, cy * down], [0.0, 0.0, 1.0]]


def _alignment(files: CaptureFiles) -> FloatArray:
    """(4, 4) rigid motion from the axes of the poses to those of the mesh."""
    if MESH_INFO not in files.names or MESH not in files.names:
        return np.eye(4)
    try:
        about = files.read_json(MESH_INFO)
        turn = np.array(about.get("alignmentTransform", np.eye(4)), dtype=np.float64).reshape(4, 4).T
        apart = np.abs(turn[:3, :3].T @ turn[:3, :3] - np.eye(3)).max()
    except (FrameFault, ValueError, TypeError, OverflowError):
        apart = np.inf
    if not apart < ROTATION_TOLERANCE or not np.isfinite(turn).all():
        raise ScanError(
            expected="'alignmentTransform', a rotation and shift of 16 numbers",
            found="none that can be used",
            where=f"{files.where}/{MESH_INFO}",
            todo="Export the raw data again; without it the pictures do not fit the mesh.",
        )
    return turn


def _mesh(files: CaptureFiles) -> RawMesh | None:
    if MESH not in files.names:
        return None
    return read_gltf(files.read_whole(MESH), folder=files.beside(MESH))
