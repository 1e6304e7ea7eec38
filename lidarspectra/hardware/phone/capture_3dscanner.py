"""Frames of 3D Scanner App, its export "All data": `frame_N.jpg`, `frame_N.json`, `depth_N.png`, `conf_N.png`.

The pose is ARKit's (`cameraPoseARFrame`, row-major, camera to world, y up, looking along -z), the mesh `export.obj` in
the same axes. Poses, depth and confidence are exported many times a second, pictures for every sixth of them or so.
`exposureDuration` is exported, the ISO is not, so that the exposure is not known.
"""

import re

from lidarspectra.hardware.phone.capture_files import CaptureFiles
from lidarspectra.hardware.phone.frames import (
    Capture,
    DepthMap,
    Frame,
    checked_frame,
    decode_depth,
    decode_picture,
    gathered,
    image_size,
)
from lidarspectra.hardware.phone.obj import read_obj
from lidarspectra.hardware.phone.raw_mesh import RawMesh

APP = "3D Scanner App"
MESHES = ("export.obj", "textured_output.obj")  # the first that there is; both in the axes of the poses
_POSE, _PICTURE = re.compile(r"frame_(\d+)\.json"), re.compile(r"frame_(\d+)\.jpg")
_BETWEEN = (
    "Of the {poses} poses that the app exported, {pictures} have a picture, as it keeps one of several; they are the "
    "frames."
)


def is_3dscanner(files: CaptureFiles) -> bool:
    """Whether a folder has this app's layout."""
    return any(_POSE.fullmatch(name) for name in files.names)


def read_3dscanner(files: CaptureFiles) -> Capture:
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
        If the mesh is damaged.
    """
    posed, pictured = _numbers(files, _POSE), _numbers(files, _PICTURE)
    # A pose without a picture is none that is lost, but one between two pictures; if there are none at all, all are.
    frames, left_out = gathered(sorted(pictured or posed, key=int), lambda number: _frame(files, number))
    between = len(posed - pictured) if pictured else 0
    notes = (_BETWEEN.format(poses=len(posed), pictures=len(posed) - between),) if between else ()
    return Capture(app=APP, where=files.where, frames=frames, left_out=left_out, mesh=_mesh(files), notes=notes)


def _numbers(files: CaptureFiles, pattern: re.Pattern[str]) -> set[str]:
    return {match[1] for name in files.names if (match := pattern.fullmatch(name))}


def _frame(files: CaptureFiles, number: str) -> Frame:
    about = files.read_json(f"frame_{number}.json")
    picture = f"frame_{number}.jpg"
    size = image_size(files.read(picture))

    def depth() -> DepthMap | None:
        name, sure = f"depth_{number}.png", f"conf_{number}.png"
        if name not in files.names:
            return None
        return decode_depth(files.read(name), files.read(sure) if sure in files.names else None, size)

    return checked_frame(
        name=number,
        camera_to_world=about.get("cameraPoseARFrame"),
        intrinsics=about.get("intrinsics"),
        size_px=size,
        time_s=about.get("time"),
        exposure_s=about.get("exposureDuration"),
        read_image=lambda least_px: decode_picture(files.read(picture), size, least_px),
        read_depth=depth,
    )


def _mesh(files: CaptureFiles) -> RawMesh | None:
    name = next((each for each in MESHES if each in files.names), None)
    if name is None:
        return None
    mesh = read_obj(files.read_whole(name), folder=files.beside(name))
    return RawMesh(parts=mesh.parts, images=mesh.images, unit="m", up="+y")
