"""PLY and STL files, by trimesh."""

import io
import logging
import warnings
from dataclasses import replace

import numpy as np
import trimesh
from trimesh.visual.color import ColorVisuals
from trimesh.visual.texture import TextureVisuals

from lidarspectra.arrays import FloatArray
from lidarspectra.hardware.phone.raw_mesh import (
    PARSER_FAULTS,
    FileFolder,
    MeshPart,
    RawMesh,
    malformed,
    missing_file_notes,
)


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
