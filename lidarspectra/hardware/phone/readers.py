"""Read scan files: detect the format, read it, and convert it to metres with z up."""

import logging
from dataclasses import replace
from os import PathLike
from pathlib import Path, PurePosixPath
from typing import Literal

import numpy as np

from lidarspectra.arguments import path_of
from lidarspectra.arrays import FloatArray
from lidarspectra.errors import ScanError
from lidarspectra.geometry.scan import Scan, ScanRecord
from lidarspectra.geometry.triangles import triangle_areas
from lidarspectra.hardware.phone.capture_files import open_capture
from lidarspectra.hardware.phone.captures import is_capture, packed_mesh, read_capture
from lidarspectra.hardware.phone.depth_fusion import fuse_depth
from lidarspectra.hardware.phone.frames import Capture
from lidarspectra.hardware.phone.gltf import read_gltf
from lidarspectra.hardware.phone.obj import read_obj
from lidarspectra.hardware.phone.orientation import METRES_PER_UNIT, Orientation, find_orientation
from lidarspectra.hardware.phone.raw_mesh import (
    FORMATS,
    FileFolder,
    JoinedMesh,
    RawMesh,
    join_parts,
    read_bytes,
)
from lidarspectra.progress import Progress, part_of, silent

_POINT_CLOUDS = (".las", ".laz", ".e57", ".pcd", ".pts", ".ptx", ".xyz")
FAR_M, DIGITS = 1e5, 9  # [m] from the origin, and digits of positions in the simulation, which are 1 mm there
MAX_STEP_M = 0.05  # [m] of a file's positions: coarser walls have more area, and faces have no size
_ZIP_MAGIC = b"PK\x03\x04"

UnitChoice = Literal["auto", "m", "cm", "mm", "in", "ft"]
UpChoice = Literal["auto", "+x", "-x", "+y", "-y", "+z", "-z"]

_log = logging.getLogger(__name__)


def read_scan(
    path: str | PathLike[str],
    *,
    unit: UnitChoice = "auto",
    up: UpChoice = "auto",
    level: bool = True,
    progress: Progress = silent,
) -> Scan:
    """Read a phone's scan of a room.

    Parameters
    ----------
    path : str or path
        GLB or glTF, OBJ with MTL and textures, PLY with vertex colours or a texture, STL, or (extra 'usd') USDZ; or a
        folder or zip archive of an app's raw data (3D Scanner App, Polycam), of which this takes the mesh; or a zip
        archive of one such file with its pictures.
    unit, up : str
        Unit and upward axis of the file's coordinates; 'auto' takes them from the format and the room's geometry.
    level : bool
        Set a scan upright whose floor, ceiling and walls lean by 1.5 to 35° about that axis.
    progress : callable
        Called with the fraction done and what is being done.

    Returns
    -------
    scan : Scan
        In metres, z up; rotated only as far as the file's upward axis requires, and a lean. Nothing is repaired.

    Raises
    ------
    ScanError
        If the file is missing, cut off, malformed, too large, of no known format, or holds no usable mesh.
    """
    path = path_of(path, name="path", meaning="the name of a scan's file, as a str or a Path")
    scan, capture = read_scan_and_frames(path, unit=unit, up=up, level=level, progress=progress)
    if capture is not None:
        capture.close()
    return scan


def read_scan_and_frames(
    path: Path, *, unit: UnitChoice = "auto", up: UpChoice = "auto", level: bool = True, progress: Progress = silent
) -> tuple[Scan, Capture | None]:
    """Read a scan and, where it is an app's raw data, its frames, whose poses are brought to the scan's axes.

    Parameters
    ----------
    path : Path
        As of `read_scan`.
    unit, up, level, progress
        As of `read_scan`.

    Returns
    -------
    scan : Scan
        With the colours that the app gave its mesh.
    capture : Capture or None
        To be closed when its pictures were read; None for a mesh's file.

    Raises
    ------
    ScanError
        As `read_scan` does.
    """
    where = path.name
    progress(0.0, f"reading {where}")
    if not path.exists():
        raise ScanError(expected="a scan file", found="nothing there", where=str(path), todo="Check the path.")
    packed = packed_mesh(path) if is_capture(path) else None
    capture = read_capture(path) if is_capture(path) and packed is None else None
    if capture is None:
        raw = _read_packed(path, packed) if packed is not None else _read_raw(path)
    else:
        try:
            raw = _captured_mesh(capture, part_of(progress, 0.0, 0.6))
        except ScanError:
            capture.close()
            raise
    progress(0.6, "joining meshes")
    mesh = join_parts(raw, where=where)
    progress(0.8, "finding unit and upward axis")
    orientation = find_orientation(
        mesh.vertices,
        mesh.faces,
        declared_unit=raw.unit,
        declared_up=raw.up,
        as_given=raw.as_given,
        usual_up=raw.usual_up,
        unit=None if unit == "auto" else unit,
        up=None if up == "auto" else up,
        level=level,
        where=where,
    )
    scan = _oriented(mesh, orientation, where=where)
    progress(1.0, "scan read")
    if capture is None:
        return scan, None
    turn, metres = orientation.rotation, METRES_PER_UNIT[orientation.unit]
    return scan, replace(capture, frames=tuple(frame.moved(turn, metres) for frame in capture.frames))


def _captured_mesh(capture: Capture, progress: Progress) -> RawMesh:
    """The app's mesh, or one made of the frames' depth."""
    mesh = capture.mesh
    if mesh is None:
        mesh = fuse_depth(capture.frames, f"{capture.where} ({capture.app})", progress)
        mesh = replace(mesh, up=capture.up, usual_up="+y")
    return replace(mesh, notes=(*capture.notes, *mesh.notes))


def _check_suffix(suffix: str, *, where: str) -> None:
    if suffix in FORMATS:
        return
    if suffix in _POINT_CLOUDS:
        found, todo = "a point cloud", "Export the scan as a textured mesh (GLB is best)."
    else:
        found, todo = f"'{suffix}'", "Export the scan in one of these formats (GLB is best)."
    raise ScanError(expected=f"one of {', '.join(FORMATS)}", found=found, where=where, todo=todo)


def _read_raw(path: Path) -> RawMesh:
    suffix = path.suffix.lower()
    _check_suffix(suffix, where=path.name)
    if suffix.startswith(".usd"):
        return _read_usd(path)
    data = read_bytes(path)
    if data[:4] == _ZIP_MAGIC:
        raise ScanError(
            expected=f"a {suffix[1:].upper()} file",
            found="a ZIP archive under its name",
            where=path.name,
            todo="Unpack it and give the mesh file in it.",
        )
    return _parsed(data, suffix, FileFolder(root=path.parent, where=path.name))


def _read_packed(path: Path, name: str) -> RawMesh:
    """A mesh in an archive, with the files beside it there."""
    above, _, own = name.rpartition("/")
    files = open_capture(path)
    try:
        inside = files.below(f"{above}/" if above else "")
        raw = _parsed(inside.read_whole(own), PurePosixPath(own).suffix.lower(), inside.beside(own))
    finally:
        files.close()
    return replace(raw, notes=(f"The archive has no raw data of an app: its mesh was read, {name}.", *raw.notes))


def _parsed(data: bytes, suffix: str, folder: FileFolder) -> RawMesh:
    if suffix in (".glb", ".gltf"):
        return read_gltf(data, folder=folder)
    if suffix == ".obj":
        return read_obj(data, folder=folder)
    from lidarspectra.hardware.phone.ply_stl import read_ply_or_stl  # loads trimesh, which the others do without

    return read_ply_or_stl(data, suffix[1:], folder)


def _read_usd(path: Path) -> RawMesh:
    try:
        # Imported where it is needed: its library is an extra.
        from lidarspectra.hardware.phone.usd import read_usd
    except ImportError as cause:
        raise ScanError(
            expected="the library that reads USD files (usd-core)",
            found="none",
            where=path.name,
            todo="Install it with 'pip install lidarspectra[usd]', or export the scan as GLB.",
        ) from cause
    return read_usd(path)


def _oriented(mesh: JoinedMesh, orientation: Orientation, *, where: str) -> Scan:
    vertices = orientation.apply(mesh.vertices)
    step_m = METRES_PER_UNIT[orientation.unit] * _step_of_file(mesh.vertices)
    notes = mesh.notes + orientation.notes + _far_note(vertices, step_m, where)
    for note in notes:
        _log.info("%s: %s", where, note)
    faces = mesh.faces
    record = ScanRecord(
        file=where,
        unit=orientation.unit,
        unit_confidence=orientation.unit_confidence,
        up_axis=orientation.up,
        up_confidence=orientation.up_confidence,
        faces_read=faces.shape[0],
        faces_kept=faces.shape[0],
        area_m2=float(triangle_areas(vertices[faces]).sum()),
        notes=notes,
    )
    return Scan(vertices=vertices, faces=faces, appearance=mesh.appearance, record=record)


def _step_of_file(vertices: FloatArray) -> float:
    """Coarsest step of a file's positions, if all of them are numbers of 32 bits, in the file's unit; 0 otherwise."""
    short = vertices.astype(np.float32)
    return float(np.spacing(np.abs(short).max())) if (short == vertices).all() else 0.0


def _far_note(vertices: FloatArray, step_m: float, where: str) -> tuple[str, ...]:
    """What becomes of a scan in the coordinates of a map, whose file has positions in some steps [m]."""
    farthest = float(np.abs(vertices).max())
    if farthest < FAR_M:
        return ()
    lies = f"The scan lies {farthest / 1000:.0f} km from the origin of its coordinates, as on a map."
    if step_m > MAX_STEP_M:
        raise ScanError(
            expected=f"positions to {1000.0 * MAX_STEP_M:.0f} mm",
            found=f"steps of {1000.0 * step_m:.0f} mm: 32-bit numbers, {farthest / 1000:.0f} km from the origin",
            where=where,
            todo="Export the scan in coordinates whose origin is in the room or near it (local, not georeferenced).",
        )
    steps_mm = 1000.0 * max(10.0 ** (np.floor(np.log10(farthest)) - DIGITS + 1), step_m)
    if step_m > 0:
        return (
            f"{lies} Its file has positions in steps of {steps_mm:.0f} mm there, which nothing mends. Export it in"
            " coordinates whose origin is in the room or near it for the best results.",
        )
    return (
        f"{lies} The simulation has positions to {DIGITS} digits, there to {steps_mm:.0f} mm, and files for viewers"
        " have 7. Move the scan to its origin in a mesh editor for the best results.",
    )
