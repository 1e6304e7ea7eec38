"""Frames of 3D Scanner App, its export "All data": `frame_N.jpg`, `frame_N.json`, `depth_N.png`, `conf_N.png`.

The pose is ARKit's (`cameraPoseARFrame`, row-major, camera to world, y up, looking along -z). The app writes up to
three meshes in the same axes: ARKit's own without colours (`export.obj`), a finer one without (`export_refined.obj`),
and, of a scan that it processed, one with its texture (`textured_output.obj`). Poses, depth and confidence are exported
many times a second, pictures for every sixth of them or so. `exposureDuration` is exported, the ISO is not, so that the
exposure is not known.
"""

import re
from collections.abc import Sequence

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
TEXTURED = "textured_output.obj"
MESHES = (TEXTURED, "export.obj", "export_refined.obj")  # the first that there is, if it has what it is preferred for
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
    """The textured mesh, whose colours stand where no frame looked; else one that has none."""
    names = [each for each in MESHES if each in files.names]
    for name in names:
        mesh = read_obj(files.read_whole(name), folder=files.beside(name))
        if name == TEXTURED and not mesh.images and len(names) > 1:
            continue
        return RawMesh(parts=mesh.parts, images=mesh.images, unit="m", up="+y", notes=_choice(name, names))
    return None


def _choice(name: str, names: Sequence[str]) -> tuple[str, ...]:
    """A note on which of several meshes was taken, and why."""
    others = " and ".join(each for each in names if each != name)
    if not others:
        return ()
    why = "it is the one that the phone made"
    if name == TEXTURED:
        why = "it has the app's texture, which colours what no frame saw"
    elif TEXTURED in names:
        why = f"the picture of {TEXTURED} is missing"
    return (f"Of the meshes of this scan {name} was taken, and not {others}, since {why}.",)
