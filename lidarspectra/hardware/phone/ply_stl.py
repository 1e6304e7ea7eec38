"""PLY and STL files, by trimesh."""

import io
import logging
import re
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from trimesh.visual.color import ColorVisuals
from trimesh.visual.texture import TextureVisuals

from lidarspectra.arrays import ByteArray, FloatArray, IntArray
from lidarspectra.errors import ScanError
from lidarspectra.hardware.phone.polygons import polygon_triangles
from lidarspectra.hardware.phone.raw_mesh import (
    MOST_FLOAT_COLOR,
    PARSER_FAULTS,
    FileFolder,
    MeshPart,
    RawMesh,
    malformed,
    missing_file_notes,
)

_COLOR_NAMES = (("red", "green", "blue"), ("diffuse_red", "diffuse_green", "diffuse_blue"), ("r", "g", "b"))
_TEXTURE_FILE = re.compile(r"(?i)comment\s+texturefile\s+(.+)")


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


def read_ply_or_stl(data: bytes, kind: str, folder: FileFolder) -> RawMesh:
    """Read a mesh of one part.

    Parameters
    ----------
    data : bytes
        Of the file.
    kind : str
        'ply' or 'stl'.
    folder : FileFolder
        The file's, for a texture.

    Returns
    -------
    mesh : RawMesh

    Raises
    ------
    ScanError
        If it is malformed.
    """
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
            found = tuple(_of_polygons(mesh) or (_part(mesh), _picture_numbers(mesh)) for mesh in meshes)
    except (*PARSER_FAULTS, ImportError, Warning) as cause:  # it imports decoders for odd text when it meets it
        if "unexpected length" in str(cause):  # trimesh takes all lists of a binary file to be as long as the first
            raise ScanError(
                expected="a binary PLY of triangles alone",
                found="one that is cut off, or has polygons of different sizes",
                where=folder.where,
                todo="Make all its faces triangles in the program that wrote it, or export it as text or GLB.",
            ) from cause
        raise malformed(cause, kind=kind.upper(), where=folder.where) from cause
    finally:
        trimesh_log.removeHandler(kept)
    names = _texture_names(data) or resolver.names if kind == "ply" and resolver.names else []
    images, parts, more = _with_images(found, names, folder)
    # trimesh warns about images because the resolver above returns none.
    warned = [
        f"The reader of this format warned: '{text}'. Check that the scan is complete."
        for text in kept.messages
        if text != "unable to load image!"
    ]
    notes = missing_file_notes(folder.missing) + more + tuple(warned)
    # These formats come from 3D printing and point clouds, where programs use z up.
    return RawMesh(parts=parts, images=images, usual_up="+z", notes=notes)


def _texture_names(data: bytes) -> list[str]:
    """Names of pictures in the comments of a PLY's header, in order."""
    header = data[: max(data.find(b"end_header"), 0)].decode("utf-8", errors="replace")
    found = (_TEXTURE_FILE.match(line.strip()) for line in header.splitlines())
    return [match[1].strip() for match in found if match]


def _picture_numbers(mesh: trimesh.Trimesh) -> IntArray | None:
    """(face,) which of a PLY's pictures each face is from ('texnumber'); None where it does not say."""
    numbers = _column(mesh, "face", "texnumber")
    if numbers is None or numbers.size != len(mesh.faces):
        return None
    return np.asarray(numbers, dtype=np.int64).ravel()


def _column(mesh: trimesh.Trimesh, element: str, *names: str) -> Any:
    """The first of a PLY's properties of these names, a row each; None where it has none."""
    data = mesh.metadata.get("_ply_raw", {}).get(element, {}).get("data")
    for name in names:
        try:
            column = data[name]
        except (KeyError, ValueError, TypeError, IndexError):
            continue
        return column["f1"] if column.dtype.names else column  # of a list of a fixed length: its length, and it
    return None


def _of_polygons(mesh: trimesh.Trimesh) -> tuple[MeshPart, IntArray | None] | None:
    """A PLY some of whose faces have more than three corners, and the pictures that they name; None for others.

    trimesh makes fans of them, which cover more than a hollow polygon, and leaves their colours as they are.
    """
    rows = _corners(mesh)
    if rows is None or rows.shape[1:] == (3,) or all(len(row) == 3 for row in rows):
        return None
    sizes = np.array([len(row) for row in rows], dtype=np.int64)
    numbers = np.concatenate(list(rows)).astype(np.int64)
    vertices = np.column_stack([_column(mesh, "vertex", axis) for axis in "xyz"]).astype(np.float64)
    if numbers.size and (numbers.min() < 0 or numbers.max() >= len(vertices)):
        raise ValueError(f"a corner number {numbers.max()} among {len(vertices)} vertices")
    places, polygon = polygon_triangles(vertices, numbers, sizes)
    faces = numbers[places]
    uv = _polygon_uv(mesh, faces, places)
    pictures = _column(mesh, "face", "texnumber")
    told = None if pictures is None else np.asarray(pictures, dtype=np.int64).ravel()[polygon]
    return MeshPart(
        vertices=vertices,
        faces=faces,
        image=-1 if uv is None else 0,
        corner_uv=uv,
        corner_color=_file_colors(mesh, faces, polygon),
    ), told


def _polygon_uv(mesh: trimesh.Trimesh, faces: IntArray, places: IntArray) -> FloatArray | None:
    """(triangle, 3, 2) texture coordinates of corners, or of vertices."""
    rows = _column(mesh, "face", "texcoord")
    if rows is not None:
        return np.asarray(np.concatenate([np.asarray(row) for row in rows]).reshape(-1, 2)[places], dtype=np.float64)
    for names in (("texture_u", "texture_v"), ("u", "v"), ("s", "t")):
        across, up = (_column(mesh, "vertex", name) for name in names)
        if across is not None and up is not None:
            return np.asarray(np.column_stack([across, up])[faces], dtype=np.float64)
    return None


def _corners(mesh: trimesh.Trimesh) -> Any:
    """Corner numbers of each of a PLY's faces, a row each; None where it has none."""
    return _column(mesh, "face", "vertex_indices", "vertex_index")


def _file_colors(mesh: trimesh.Trimesh, faces: IntArray, polygon: IntArray) -> FloatArray | None:
    """(triangle, 3, 3) sRGB-encoded colours that a PLY has of vertices or of polygons; None where it has none.

    trimesh leaves colours out beside texture coordinates, knows one set of names, and takes all floats for 0 to 1.
    """
    for element, at in (("vertex", faces), ("face", polygon[:, np.newaxis].repeat(3, axis=1))):
        for names in _COLOR_NAMES:
            columns = [_column(mesh, element, name) for name in names]
            if all(column is not None for column in columns):
                values = np.column_stack(columns)
                return np.asarray(values[at] / _full_scale(values), dtype=np.float64)
    return None


def _full_scale(values: NDArray[np.generic]) -> float:
    """What stands for 1 in a file's colours."""
    if values.dtype.kind == "f":
        with np.errstate(invalid="ignore"):
            return 255.0 if np.nanmax(values, initial=0.0) > MOST_FLOAT_COLOR else 1.0
    return 255.0 if values.max(initial=0) <= 255 else float(np.iinfo("u2").max)


def _with_images(
    parts: tuple[tuple[MeshPart, IntArray | None], ...], names: list[str], folder: FileFolder
) -> tuple[tuple[ByteArray, ...], tuple[MeshPart, ...], tuple[str, ...]]:
    """Pictures of these names, the parts cut by the picture that they are from, and notes."""
    images: list[ByteArray] = []
    place: dict[int, int] = {}
    for number, name in enumerate(names):
        if (image := folder.read_image(name)) is not None:
            place[number] = len(images)
            images.append(image)
    cut: list[MeshPart] = []
    unknown = 0
    for part, told in parts:
        if part.corner_uv is None or not images:
            cut.append(replace(part, image=-1, corner_uv=None))
            continue
        numbers = np.zeros(len(part.faces), dtype=np.int64) if len(names) == 1 else told
        if numbers is None:
            numbers = np.full(len(part.faces), -1)
        unknown += int(((numbers < 0) | (numbers >= len(names))).sum())
        for number in np.unique(numbers).tolist():
            those = numbers == number
            uv = part.corner_uv[those] if number in place else None
            color = None if part.corner_color is None else part.corner_color[those]
            cut.append(
                replace(part, faces=part.faces[those], image=place.get(number, -1), corner_uv=uv, corner_color=color)
            )
    if not unknown:
        return tuple(images), tuple(cut), ()
    note = (
        f"The file has {len(names)} pictures and does not say which of them {unknown} triangles are from: those have no"
        " colour. Export the scan with one picture, or as GLB."
    )
    return tuple(images), tuple(cut), (note,)


def _part(mesh: trimesh.Trimesh) -> MeshPart:
    vertices = np.array(mesh.vertices, dtype=np.float64)
    faces = np.array(mesh.faces, dtype=np.int64)
    rows, color = _corners(mesh), None
    if rows is not None and len(rows) == len(faces):  # with coordinates of corners trimesh has vertices of its own
        color = _file_colors(mesh, np.array([*rows], dtype=np.int64), np.arange(len(faces)))
    visual = mesh.visual
    if isinstance(visual, TextureVisuals):
        uv = np.zeros((0, 2)) if visual.uv is None else np.asarray(visual.uv, dtype=np.float64)
        if uv.shape == (len(vertices), 2):
            return MeshPart(vertices=vertices, faces=faces, image=0, corner_uv=uv[faces], corner_color=color)
    elif color is None and isinstance(visual, ColorVisuals) and visual.kind == "face":  # of an STL
        color = np.repeat(np.asarray(visual.face_colors, dtype=np.float64)[:, np.newaxis, :3], 3, axis=1) / 255.0
    return MeshPart(vertices=vertices, faces=faces, corner_color=color)
