"""PLY and STL files, by trimesh."""

import io
import logging
import re
import warnings
from dataclasses import replace

import numpy as np
import trimesh
from trimesh.visual.color import ColorVisuals
from trimesh.visual.texture import TextureVisuals

from lidarspectra.arrays import ByteArray, FloatArray, IntArray
from lidarspectra.hardware.phone.raw_mesh import (
    PARSER_FAULTS,
    FileFolder,
    MeshPart,
    RawMesh,
    malformed,
    missing_file_notes,
)

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
            found = tuple((_part(mesh), _picture_numbers(mesh)) for mesh in meshes)
    except (*PARSER_FAULTS, ImportError, Warning) as cause:  # it imports decoders for odd text when it meets it
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
    try:
        numbers = np.asarray(mesh.metadata["_ply_raw"]["face"]["data"]["texnumber"], dtype=np.int64).ravel()
    except (KeyError, ValueError, TypeError, IndexError):
        return None
    return numbers if numbers.size == len(mesh.faces) else None


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
            cut.append(replace(part, faces=part.faces[those], image=place.get(number, -1), corner_uv=uv))
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
