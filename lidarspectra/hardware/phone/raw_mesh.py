"""What a reader hands on: the meshes of a file in the file's own unit and axes, joined into one."""

import re
import struct
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Literal
from urllib.parse import unquote

import numpy as np

from lidarspectra.arrays import ByteArray, FloatArray, IntArray
from lidarspectra.errors import ScanError
from lidarspectra.geometry.appearance import DRAWN, NEUTRAL_COLOR, NO_COLOR, PHOTOGRAPHED, Appearance
from lidarspectra.geometry.textures import check_texture_total, decode_image
from lidarspectra.hardware.phone.part_names import AIR, ROOM_KIND, counted_kinds

Unit = Literal["m", "cm", "mm", "in", "ft"]
Axis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]

FORMATS = (".glb", ".gltf", ".obj", ".ply", ".stl", ".usdz", ".usda", ".usd")  # of meshes
NO_COLOR_NOTE = "The file has no colour"  # beginning of a note, which does not hold once frames have coloured the mesh
MAX_FACES = 20_000_000  # about 6 GB as a Scan
MAX_FILE_BYTES = 2 * 1024**3  # [byte] a room with an 8k texture is below 0.2 GB
LONGEST_NAME = 255  # [byte] longest name of a file or folder on common file systems
MAX_COORDINATE = 1e9  # [unit of the file] beyond it the rounding of 32-bit floats exceeds any geometry
MOST_FLOAT_COLOR = 2.0  # [1] of colours at vertices: brighter ones are bytes, 0 to 255
MAX_PHOTOGRAPH = 1.05  # [1] widths of its picture that a photographed part spans; a pattern is repeated

_DEVICE = re.compile(r"(?i)\s*(con|prn|aux|nul|conin\$|conout\$|com[0-9¹²³]|lpt[0-9¹²³])\s*(\..*)?", re.DOTALL)
"""Names that Windows reserves for devices in every folder, with any suffix."""
PARSER_FAULTS = (
    ValueError, KeyError, IndexError, TypeError, AttributeError, AssertionError, OverflowError, EOFError, OSError,
    NotImplementedError, RecursionError, MemoryError, ZeroDivisionError, UnboundLocalError, struct.error,
)  # fmt: skip  # what parsers of libraries raise on malformed files


@dataclass(frozen=True, kw_only=True, eq=False)
class MeshPart:
    """One mesh with one material.

    Parameters
    ----------
    vertices : (vertex, 3) float
        In the file's unit and axes.
    faces : (face, 3) int
        Corners.
    image : int
        Number of its texture; -1 where it has none.
    corner_uv : (face, 3, 2) float or None
        Texture coordinates, v up. [1]
    corner_color : (face, 3, 3) float or None
        sRGB-encoded colours. [0-1]
    flat_color : bool
        Whether the colour is the one value of a material, rather than one measured at each corner.
    kind : str
        What its name in the file says that it is (`part_names.KIND_WORDS`); empty where it says nothing.
    shape : int
        Number of the shape in the file that it belongs to: a shape of several materials has several parts.
    """

    vertices: FloatArray
    faces: IntArray
    image: int = -1
    corner_uv: FloatArray | None = None
    corner_color: FloatArray | None = None
    flat_color: bool = False
    kind: str = ""
    shape: int = 0


@dataclass(frozen=True, kw_only=True, eq=False)
class RawMesh:
    """What a reader found in a file.

    Parameters
    ----------
    parts : tuple of MeshPart
        With the scene's transforms applied.
    images : tuple of (height, width, 3) uint8
        sRGB-encoded textures that the parts' `image` counts.
    unit : str or None
        Unit that the format or the file declares; None if it declares none.
    up : str or None
        The same for the upward axis.
    usual_up : str or None
        Upward axis that most programs write in a format that does not define it.
    as_given : bool
        Whether the program that wrote the file writes coordinates as it has them, whatever the format defines.
    notes : tuple of str
        What the user should know about the file.
    """

    parts: tuple[MeshPart, ...]
    images: tuple[ByteArray, ...] = ()
    unit: Unit | None = None
    up: Axis | None = None
    usual_up: Axis | None = None
    as_given: bool = False
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True, eq=False)
class JoinedMesh:
    """A raw mesh joined into one: all that `Scan` needs except orientation and unit.

    Parameters
    ----------
    vertices : (vertex, 3) float
        In the file's unit and axes; every vertex belongs to a face.
    faces : (face, 3) int
        Corners.
    appearance : Appearance
        Colour of every face.
    notes : tuple of str
        What the user should know about the mesh.
    """

    vertices: FloatArray
    faces: IntArray
    appearance: Appearance
    notes: tuple[str, ...]


@dataclass(kw_only=True)
class FileFolder:
    """The folder of a scan's file; its textures and buffers are read from here and from nowhere else.

    Parameters
    ----------
    root : Path
        The folder.
    where : str
        Name of the scan's file, for errors.
    missing : list of str
        Names that the scan refers to and that do not exist.
    """

    root: Path
    where: str
    missing: list[str] = field(default_factory=list)

    def read(self, name: str) -> bytes | None:
        """Content of a file that the scan names; None where there is none.

        Parameters
        ----------
        name : str
            Relative path as the scan's file writes it; backslashes and percent codes are understood.

        Raises
        ------
        ScanError
            If the name is a URL, absolute, or leads out of the folder, or the file is too large or unreadable.
        """
        for candidate in dict.fromkeys((name, unquote(name))):
            data = self._content(self._inside(candidate))
            if data is not None:
                return data
        self.missing.append(name)
        return None

    def holds(self, name: str) -> bool:
        """Whether there is a file of that name, as `read` would read it."""
        names = dict.fromkeys((name, unquote(name)))
        return any(self._content(self._inside(candidate)) is not None for candidate in names)

    def read_image(self, name: str) -> ByteArray | None:
        """Decode a texture that the scan names; None where there is no such file (see `read`)."""
        data = self.read(name)
        return None if data is None else decode_image(data, name=f"texture '{name}' of {self.where}")

    def _content(self, name: PurePosixPath) -> bytes | None:
        path = self.root / name
        return read_bytes(path) if path.is_file() else None

    def _inside(self, name: str) -> PurePosixPath:
        parts = PurePosixPath(name.replace("\\", "/"))
        outside = not name.strip() or "\0" in name or ":" in name or parts.is_absolute() or ".." in parts.parts
        outside = outside or any(not _is_file_name(part) for part in parts.parts)
        root = self.root.resolve()
        if outside or not (root / parts).resolve().is_relative_to(root):
            raise ScanError(
                expected="references to files within the scan's own folder",
                found=f"{name[:200]!r}",
                where=self.where,
                todo="Put the textures beside the scan and name them without a path.",
            )
        return parts


def _is_file_name(name: str) -> bool:
    """Whether the name is valid for a file on every operating system."""
    try:
        return len(name.encode()) <= LONGEST_NAME and not _DEVICE.fullmatch(name)
    except UnicodeEncodeError:  # half a character, as JSON may write it
        return False


def read_bytes(path: Path) -> bytes:
    """Content of a file, refused (ScanError) if it cannot be read or is larger than `MAX_FILE_BYTES`."""
    try:
        size = path.stat().st_size
        if size > MAX_FILE_BYTES:
            raise ScanError(
                expected=f"a file of at most {MAX_FILE_BYTES} bytes",
                found=f"{size} bytes",
                where=str(path),
                todo="Export the scan with fewer triangles or a smaller texture.",
            )
        return path.read_bytes()
    except OSError as cause:
        raise ScanError(
            expected="a file that can be read",
            found=str(cause),
            where=str(path),
            todo="Check the path and the file's permissions.",
        ) from cause


def missing_file_notes(names: Iterable[str]) -> tuple[str, ...]:
    """One note for each file that a scan refers to and that does not exist."""
    return tuple(
        f"The scan refers to the file '{name}', which is missing, so the surfaces that need it have no colour from it."
        " Put the file beside the scan, and begin again with 'lidarspectra init SCAN --force'."
        for name in dict.fromkeys(names)
    )


def malformed(cause: BaseException, *, kind: str, where: str) -> ScanError:
    """The error for a file that a parser failed on."""
    try:
        reason = " ".join(str(cause).split())
    except UnicodeDecodeError:  # a library of C++ quotes the damaged bytes
        reason = "its message is not text"
    return ScanError(
        expected=f"a well-formed {kind} file",
        found=f"one that cannot be parsed ({type(cause).__name__}: {reason[:300]})",
        where=where,
        todo="Export or copy the scan again; the file may be cut off.",
    )


def join_parts(raw: RawMesh, *, where: str) -> JoinedMesh:
    """Join the parts of a file into one mesh, and refuse what is no mesh.

    Parameters
    ----------
    raw : RawMesh
        What a reader found.
    where : str
        Name of the file, for errors.

    Returns
    -------
    mesh : JoinedMesh

    Raises
    ------
    ScanError
        If there is no triangle, there are too many, a corner names no vertex, or a used position is not finite.
    """
    named, part_notes = _named_parts(raw.parts)
    parts = [part for part in named if part.faces.size]
    count = sum(part.faces.shape[0] for part in parts)
    _check_face_count(count, where=where)
    for part in parts:
        _check_geometry(part, where=where)
    check_texture_total(raw.images, name=where)
    blocks = {id(part.vertices): part.vertices for part in parts}  # parts of one shape share theirs
    starts = dict(zip(blocks, np.cumsum([0, *(block.shape[0] for block in blocks.values())]).tolist(), strict=False))
    faces = np.concatenate([part.faces + starts[id(part.vertices)] for part in parts]).astype(np.int64)
    used, numbered = np.unique(faces, return_inverse=True)
    appearance, notes = _join_appearance(parts, raw.images)
    return JoinedMesh(
        vertices=np.concatenate([*blocks.values()])[used].astype(np.float64),
        faces=numbered.reshape(-1, 3).astype(np.int64),
        appearance=appearance,
        notes=raw.notes + part_notes + notes,
    )


def _named_parts(parts: tuple[MeshPart, ...]) -> tuple[tuple[MeshPart, ...], tuple[str, ...]]:
    """Parts with the kinds that their names say, if the file is a room model, without those that are air; and notes."""
    if not any(part.kind == ROOM_KIND for part in parts):
        return tuple(replace(part, kind="") for part in parts), ()
    solid = tuple(part for part in parts if part.kind != AIR)
    shapes = {part.shape: part.kind or "unnamed part" for part in solid}
    notes = [
        f"The file is a room model with named parts: {counted_kinds(shapes.values())}."
        " Names count as evidence of materials. Where a named part has no photographed colour it gets the typical"
        " reflectance of such things; write names = false under [materials] to use the file's own colours."
    ]
    openings = len({part.shape for part in parts if part.kind == AIR})
    if openings:
        notes.append(
            f"{openings} openings in walls are drawn as shapes of their own; they were left out, because"
            " they are air. If the wall behind one is drawn whole, no light passes there."
        )
    return solid, tuple(notes)


def _check_face_count(count: int, *, where: str) -> None:
    if count == 0:
        raise ScanError(
            expected="a mesh with at least one triangle",
            found="none",
            where=where,
            todo="Export the scan as a mesh, not as a point cloud.",
        )
    if count > MAX_FACES:
        raise ScanError(
            expected=f"at most {MAX_FACES} triangles",
            found=f"{count}",
            where=where,
            todo="Export the scan with less detail; some 100,000 triangles describe a room.",
        )


def _check_geometry(part: MeshPart, *, where: str) -> None:
    count = part.vertices.shape[0]
    if part.faces.min() < 0 or part.faces.max() >= count:
        raise ScanError(
            expected=f"faces whose corners are among the {count} vertices",
            found=f"corner numbers from {part.faces.min()} to {part.faces.max()}",
            where=where,
            todo="The file is damaged; export the scan again.",
        )
    with np.errstate(invalid="ignore"):
        sound = np.all(np.abs(part.vertices) <= MAX_COORDINATE, axis=1)  # False for NaN, too
    bad = int((~sound[part.faces]).any(axis=1).sum())
    if bad:
        raise ScanError(
            expected="finite positions",
            found=f"{bad} of {part.faces.shape[0]} triangles with a corner that is NaN, infinite or absurdly far",
            where=where,
            todo="The file is damaged; export the scan again, or mend it in a mesh editor.",
        )


def _is_tiled(corner_uv: FloatArray) -> bool:
    """Whether a picture repeats over a part, as a pattern of a model does and a photograph never."""
    finite = corner_uv[np.isfinite(corner_uv).all(axis=(1, 2))].reshape(-1, 2)
    return bool(finite.size) and float(np.ptp(finite, axis=0).max()) > MAX_PHOTOGRAPH


def _join_appearance(parts: list[MeshPart], images: tuple[ByteArray, ...]) -> tuple[Appearance, tuple[str, ...]]:
    total = sum(part.faces.shape[0] for part in parts)
    face_image = np.full(total, -1, dtype=np.int64)
    corner_uv = np.zeros((total, 3, 2))
    corner_color = np.full((total, 3, 3), NEUTRAL_COLOR)
    source = np.full(total, PHOTOGRAPHED)
    kinds = tuple(dict.fromkeys(part.kind for part in parts if part.kind))
    face_kind = np.full(total, -1, dtype=np.int64)
    unnamed = uncolored = start = 0
    for part in parts:
        span = slice(start, start + part.faces.shape[0])
        start = span.stop
        if part.corner_color is not None:
            corner_color[span] = part.corner_color
        if part.image >= 0 and part.corner_uv is not None:
            face_image[span] = part.image
            corner_uv[span] = part.corner_uv
            if part.kind and _is_tiled(part.corner_uv):
                source[span] = DRAWN
        elif part.corner_color is None:
            source[span] = NO_COLOR
            uncolored += part.faces.shape[0]
            unnamed += part.faces.shape[0] if not part.kind else 0
        elif part.flat_color and part.kind:
            source[span] = DRAWN
        if part.kind:
            face_kind[span] = kinds.index(part.kind)
    sound = (np.abs(corner_uv) <= MAX_COORDINATE).all(axis=(1, 2))  # False for NaN, too
    broken = ~sound | ~np.isfinite(corner_color).all(axis=(1, 2))
    bad = int(broken.sum())
    face_image[broken], corner_uv[broken], corner_color[broken] = -1, 0.0, NEUTRAL_COLOR
    source[broken] = NO_COLOR
    notes = []
    if bad:
        notes.append(
            f"{bad} triangles have texture coordinates or colours that are not finite numbers, so a neutral gray was"
            " used for them. Export the scan again if this is a large part of the room."
        )
    if uncolored == total and unnamed:
        notes.append(
            f"{NO_COLOR_NOTE}, so all surfaces were given a neutral gray and their materials cannot be estimated"
            " from it. Export the scan with a texture or vertex colours, or assign materials in a file."
        )
    elif unnamed:
        notes.append(
            f"{unnamed} of {total} triangles have no colour and no name, so they get the default material; reflectances"
            " there are guesses. Export the scan with a complete texture if this is a large part of the room."
        )
    appearance = Appearance(
        images=images,
        face_image=face_image,
        corner_uv=corner_uv,
        corner_color=np.clip(corner_color, 0.0, 1.0),
        known=uncolored < total,
        color_source=source,
        kinds=kinds,
        face_kind=face_kind,
    )
    return appearance, tuple(notes)
