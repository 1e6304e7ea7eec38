"""Read scan files: detect the format, read it, and convert it to metres with z up."""

import io
import logging
import warnings
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh
from trimesh.visual.color import ColorVisuals
from trimesh.visual.texture import TextureVisuals

from lidarspectra.arguments import path_of
from lidarspectra.arrays import FloatArray
from lidarspectra.errors import ScanError
from lidarspectra.geometry.scan import Scan, ScanRecord
from lidarspectra.geometry.triangles import triangle_areas
from lidarspectra.hardware.phone.gltf import read_gltf
from lidarspectra.hardware.phone.obj import read_obj
from lidarspectra.hardware.phone.orientation import Orientation, find_orientation
from lidarspectra.hardware.phone.raw_mesh import (
    PARSER_FAULTS,
    FileFolder,
    JoinedMesh,
    MeshPart,
    RawMesh,
    join_parts,
    malformed,
    missing_file_notes,
    read_bytes,
)
from lidarspectra.progress import Progress, silent

FORMATS = (".glb", ".gltf", ".obj", ".ply", ".stl", ".usdz", ".usda", ".usd")
_POINT_CLOUDS = (".las", ".laz", ".e57", ".pcd", ".pts", ".ptx", ".xyz")
_ZIP_MAGIC = b"PK\x03\x04"

UnitChoice = Literal["auto", "m", "cm", "mm", "in", "ft"]
UpChoice = Literal["auto", "+x", "-x", "+y", "-y", "+z", "-z"]

_log = logging.getLogger(__name__)


def read_scan(
    path: str | PathLike[str], *, unit: UnitChoice = "auto", up: UpChoice = "auto", progress: Progress = silent
) -> Scan:
    """Read a phone's scan of a room.

    Parameters
    ----------
    path : str or path
        GLB or glTF, OBJ with MTL and textures, PLY with vertex colours or a texture, STL, or (extra 'usd') USDZ.
    unit, up : str
        Unit and upward axis of the file's coordinates; 'auto' takes them from the format and the room's geometry.
    progress : callable
        Called with the fraction done and what is being done.

    Returns
    -------
    scan : Scan
        In metres, z up; rotated only as far as the file's upward axis requires. Nothing is repaired.

    Raises
    ------
    ScanError
        If the file is missing, cut off, malformed, too large, of no known format, or holds no usable mesh.
    """
    path = path_of(path, name="path", meaning="the name of a scan's file, as a str or a Path")
    where = path.name
    progress(0.0, f"reading {where}")
    if not path.is_file():
        raise ScanError(
            expected="a scan file",
            found="a folder" if path.is_dir() else "nothing there",
            where=str(path),
            todo="Check the path.",
        )
    suffix = path.suffix.lower()
    _check_suffix(suffix, where=where)
    raw = _read_raw(path, suffix)
    progress(0.6, "joining meshes")
    mesh = join_parts(raw, where=where)
    progress(0.8, "finding unit and upward axis")
    orientation = find_orientation(
        mesh.vertices,
        mesh.faces,
        declared_unit=raw.unit,
        declared_up=raw.up,
        usual_up=raw.usual_up,
        unit=None if unit == "auto" else unit,
        up=None if up == "auto" else up,
        where=where,
    )
    scan = _oriented(mesh, orientation, where=where)
    progress(1.0, "scan read")
    return scan


def _check_suffix(suffix: str, *, where: str) -> None:
    if suffix in FORMATS:
        return
    if suffix in _POINT_CLOUDS:
        found, todo = "a point cloud", "Export the scan as a textured mesh (GLB is best)."
    elif suffix == ".zip":
        found, todo = "a ZIP archive", "Unpack it and give the mesh file in it."
    else:
        found, todo = f"'{suffix}'", "Export the scan in one of these formats (GLB is best)."
    raise ScanError(expected=f"one of {', '.join(FORMATS)}", found=found, where=where, todo=todo)


def _read_raw(path: Path, suffix: str) -> RawMesh:
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
    folder = FileFolder(root=path.parent, where=path.name)
    if suffix in (".glb", ".gltf"):
        return read_gltf(data, folder=folder)
    if suffix == ".obj":
        return read_obj(data, folder=folder)
    return _read_with_trimesh(data, suffix[1:], folder)


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
    notes = mesh.notes + orientation.notes
    for note in notes:
        _log.info("%s: %s", where, note)
    vertices = orientation.apply(mesh.vertices)
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


# --- PLY and STL


class _NamesOnly(trimesh.resolvers.Resolver):
    """Records which files trimesh asks for and returns none: they are read here, from the scan's folder only."""

    def __init__(self) -> None:
        self.names: list[str] = []

    def get(self, key: str) -> bytes:
        self.names.append(key)
        raise FileNotFoundError(key)

    def write(self, name: str, data: bytes) -> None:
        raise NotImplementedError

    def namespaced(self, namespace: str) -> "_NamesOnly":
        raise NotImplementedError

    def keys(self) -> list[str]:
        return []


class _Kept(logging.Handler):
    """Collects the warnings of a library, for the notes."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.messages: dict[str, None] = {}

    def emit(self, record: logging.LogRecord) -> None:
        self.messages[record.getMessage()] = None


def _read_with_trimesh(data: bytes, kind: str, folder: FileFolder) -> RawMesh:
    resolver, kept = _NamesOnly(), _Kept()
    trimesh_log = logging.getLogger("trimesh")
    trimesh_log.addHandler(kept)
    try:
        with warnings.catch_warnings():
            # numpy only warns when it stops at a damaged number; its other warnings do not matter here.
            warnings.simplefilter("ignore")
            warnings.filterwarnings("error", message=".*(could not be read to its end|invalid value).*")
            loaded = trimesh.load_scene(io.BytesIO(data), file_type=kind, resolver=resolver, process=False)
            meshes = [item for item in loaded.geometry.values() if isinstance(item, trimesh.Trimesh)]
            parts = tuple(_part(mesh) for mesh in meshes)
    except (*PARSER_FAULTS, ImportError, Warning) as cause:  # it imports decoders for odd text when it meets it
        raise malformed(cause, kind=kind.upper(), where=folder.where) from cause
    finally:
        trimesh_log.removeHandler(kept)
    image = folder.read_image(resolver.names[0]) if resolver.names else None
    if image is None:
        parts = tuple(replace(part, image=-1, corner_uv=None) for part in parts)
    # trimesh warns about images because the resolver above returns none.
    warned = [
        f"The reader of this format warned: '{text}'. Check that the scan is complete."
        for text in kept.messages
        if text != "unable to load image!"
    ]
    notes = missing_file_notes(folder.missing) + tuple(warned)
    # These formats come from 3D printing and point clouds, where programs use z up.
    return RawMesh(parts=parts, images=() if image is None else (image,), usual_up="+z", notes=notes)


def _part(mesh: trimesh.Trimesh) -> MeshPart:
    vertices = np.array(mesh.vertices, dtype=np.float64)
    faces = np.array(mesh.faces, dtype=np.int64)
    visual = mesh.visual
    if isinstance(visual, TextureVisuals):
        uv = np.zeros((0, 2)) if visual.uv is None else np.asarray(visual.uv, dtype=np.float64)
        if uv.shape == (len(vertices), 2):
            return MeshPart(vertices=vertices, faces=faces, image=0, corner_uv=uv[faces])
        return MeshPart(vertices=vertices, faces=faces)
    color: FloatArray | None = None
    if isinstance(visual, ColorVisuals) and visual.kind == "vertex":
        color = np.asarray(visual.vertex_colors, dtype=np.float64)[faces, :3] / 255.0
    elif isinstance(visual, ColorVisuals) and visual.kind == "face":
        color = np.repeat(np.asarray(visual.face_colors, dtype=np.float64)[:, np.newaxis, :3], 3, axis=1) / 255.0
    return MeshPart(vertices=vertices, faces=faces, corner_color=color)
