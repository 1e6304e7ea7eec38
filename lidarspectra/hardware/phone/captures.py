"""Read an app's raw data, whichever app's it is: frames with poses, depth, and the mesh.

Layouts are recognised by their files' names. A frame that cannot be used is left out with its reason; nothing else is.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from lidarspectra.errors import ScanError
from lidarspectra.hardware.phone.capture_3dscanner import is_3dscanner, read_3dscanner
from lidarspectra.hardware.phone.capture_files import ARCHIVE_SUFFIXES, CaptureFiles, open_capture
from lidarspectra.hardware.phone.capture_polycam import is_polycam, read_polycam
from lidarspectra.hardware.phone.capture_record3d import is_record3d, read_record3d
from lidarspectra.hardware.phone.capture_stray import is_stray, read_stray
from lidarspectra.hardware.phone.frames import MAX_NAMED, Capture, key_frames, without_jumps
from lidarspectra.hardware.phone.raw_mesh import FORMATS

APPS: tuple[tuple[Callable[[CaptureFiles], bool], Callable[[CaptureFiles], Capture]], ...] = (
    (is_3dscanner, read_3dscanner),
    (is_polycam, read_polycam),
    (is_record3d, read_record3d),
    (is_stray, read_stray),
)
READABLE = tuple(each for each in FORMATS if not each.startswith(".usd"))  # in an archive: USD's library wants files
WITH_PICTURES = (".glb", ".gltf", ".usdz")  # formats in which apps write meshes with their pictures
LAYOUTS = "3D Scanner App's 'All data', Polycam's raw data, a recording of Record3D or of Stray Scanner"


def is_capture(path: Path) -> bool:
    """Whether a path is a folder or archive, which may hold raw data, rather than a mesh's file."""
    return path.is_dir() or path.suffix.lower() in ARCHIVE_SUFFIXES


def read_capture(path: Path) -> Capture:
    """Read an app's raw data.

    Parameters
    ----------
    path : Path
        Its folder, or a zip archive of it.

    Returns
    -------
    capture : Capture
        Pictures are decoded later, one by one; to be closed when they have been.

    Raises
    ------
    ScanError
        If it is no app's layout, its mesh is damaged, or no frame can be used.
    """
    files = open_capture(path)
    try:
        capture = _read(files)
    except ScanError:
        files.close()
        raise

    def close() -> None:
        capture.close()
        files.close()

    return replace(capture, close=close)


def _read(files: CaptureFiles) -> Capture:
    scans = _scans(files)
    if not scans:
        raise _no_scan(files)
    if len(scans) > 1:
        raise _several_scans(files, [*scans])
    ((base, read),) = scans.items()
    return _checked(read(files.below(base)))


def packed_mesh(path: Path) -> str | None:
    """Name of the mesh in an archive that is no raw data, as apps pack an OBJ with its picture.

    Parameters
    ----------
    path : Path
        Of a folder or archive.

    Returns
    -------
    name : str or None
        Of the only mesh, or of the only one with a picture; None of folders, whose files can be given themselves.

    Raises
    ------
    ScanError
        If the archive is damaged.
    """
    if path.is_dir():
        return None
    files = open_capture(path)
    try:
        meshes = [] if _scans(files) else _meshes(files, READABLE)
    finally:
        files.close()
    pictured = [mesh for mesh in meshes if _has_picture(files, mesh)]
    (name,) = next((each for each in (meshes, pictured) if len(each) == 1), (None,))
    return name


def _no_scan(files: CaptureFiles) -> ScanError:
    kind = "a folder" if files.archive is None else "an archive"
    meshes = _meshes(files, FORMATS)
    todo = "Export the app's raw data, or give the mesh's file itself (GLB is best)."
    if meshes:
        what = "a mesh" if len(meshes) == 1 else f"{len(meshes)} meshes"
        todo = f"It holds {what}: {'give' if files.archive is None else 'unpack it all, and give'} {meshes[0]} itself."
    return ScanError(
        expected=f"raw data of an app ({LAYOUTS})",
        found=f"{kind} in no such layout (files: {len(files.names)})",
        where=str(files.path),
        todo=todo,
    )


def _meshes(files: CaptureFiles, formats: tuple[str, ...]) -> list[str]:
    """Files of some formats, those that probably have a picture first: `export.obj` of some apps has no colour."""
    found = (name for name in files.names if name.lower().endswith(formats))
    return sorted(found, key=lambda name: (not _has_picture(files, name), name))


def _has_picture(files: CaptureFiles, mesh: str) -> bool:
    return f"{mesh[: mesh.rindex('.')]}.mtl" in files.names or mesh.lower().endswith(WITH_PICTURES)


def _several_scans(files: CaptureFiles, bases: list[str]) -> ScanError:
    """Of several, the first by name would be taken for the room that is meant."""
    named = ", ".join(base.rstrip("/") for base in bases[:MAX_NAMED]) + (", ..." if len(bases) > MAX_NAMED else "")
    return ScanError(
        expected="raw data of one scan",
        found=f"that of {len(bases)}: {named}",
        where=str(files.path),
        todo=f"{'Give' if files.archive is None else 'Unpack it, and give'} the folder of one of them.",
    )


def _scans(files: CaptureFiles) -> dict[str, Callable[[CaptureFiles], Capture]]:
    """Folders in which a layout begins, with its reader; what lies in the folder of a scan belongs to that scan."""
    scans: dict[str, Callable[[CaptureFiles], Capture]] = {}
    for base in _bases(files):
        if base.startswith(tuple(scans)):
            continue
        inside = files.below(base)
        read = next((read for is_layout, read in APPS if is_layout(inside)), None)
        if read is not None:
            scans[base] = read
    return scans


def _bases(files: CaptureFiles) -> list[str]:
    """Folders in which a layout may begin, the outermost first."""
    bases = {""}
    for name in files.names:
        parts = name.split("/")[:-1]
        bases |= {"/".join(parts[: count + 1]) + "/" for count in range(min(len(parts), 2))}
    return sorted(bases, key=lambda each: (each.count("/"), each))


def _checked(capture: Capture) -> Capture:
    frames, jumped = without_jumps(capture.frames)
    if not frames:
        capture.close()
        reason = f", the first because {capture.left_out[0].reason}" if capture.left_out else ""
        raise ScanError(
            expected="frames with picture and pose",
            found=f"{len(capture.left_out)} that cannot be used{reason}",
            where=f"{capture.where} ({capture.app})",
            todo="Export the raw data again.",
        )
    kept = key_frames(frames)
    notes = capture.notes
    if len(kept) < len(frames):
        notes = (*notes, f"Of {len(frames)} frames, {len(kept)} are used, which differ in where they look from.")
    return replace(capture, frames=kept, left_out=(*capture.left_out, *jumped), notes=notes)
