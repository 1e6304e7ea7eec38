"""OBJ files with their MTL materials and textures.

This module does not use trimesh's reader, because that one silently ignores a missing material, a missing texture and a
damaged line. Here each is an error with its line, or a note.
"""

import itertools
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from lidarspectra.arrays import ByteArray, FloatArray
from lidarspectra.errors import ScanError
from lidarspectra.geometry.textures import check_texture_total
from lidarspectra.hardware.phone.part_names import part_kind
from lidarspectra.hardware.phone.polygons import polygon_triangles
from lidarspectra.hardware.phone.raw_mesh import MOST_FLOAT_COLOR, FileFolder, MeshPart, RawMesh, missing_file_notes
from lidarspectra.spectra.colorimetry import encode_srgb

_FULL_PATH = re.compile(r"/|\\|[A-Za-z]:[/\\]")  # of the machine that wrote the file
_MAX_NUMBERS = 2**40  # larger indices than any file can hold
_NO_INDEX = -1
_VECTOR_OPTIONS = ("-o", "-s", "-t")  # of map_Kd, of one to three numbers; whose others have their default
_IMAGE_OPTION_ARGUMENTS = {
    "-mm": 2, "-blendu": 1, "-blendv": 1, "-boost": 1, "-texres": 1, "-clamp": 1,
    "-bm": 1, "-imfchan": 1, "-type": 1, "-cc": 1,
}  # fmt: skip  # options of map_Kd and how many words follow each (OBJ/MTL specification, B5)


_Group = tuple[str | None, str, int]
"""Material, kind of the named part, and its number; 0 for all without a kind: scans may have thousands of groups."""


@dataclass(kw_only=True)
class _Material:
    """A material of an MTL file: diffuse colour [0-1], texture's name, and scale and offset of its coordinates [1]."""

    color: tuple[float, float, float] | None = None
    texture: str | None = None
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)


@dataclass(kw_only=True)
class _Faces:
    """Polygons of one material: their sizes, and their corners' places among positions and texture coordinates."""

    sizes: list[int] = field(default_factory=list)
    positions: list[int] = field(default_factory=list)
    textures: list[int] = field(default_factory=list)


@dataclass(kw_only=True)
class _Content:
    """An OBJ file's lines, sorted by what they are."""

    positions: list[list[float]] = field(default_factory=list)
    textures: list[list[float]] = field(default_factory=list)
    groups: dict[_Group, _Faces] = field(default_factory=dict)
    libraries: list[str] = field(default_factory=list)


def read_obj(data: bytes, *, folder: FileFolder) -> RawMesh:
    """Read an OBJ file.

    Polygons become triangles; positions may carry colours (x y z r g b, taken as sRGB-encoded).

    Parameters
    ----------
    data : bytes
        The file's content.
    folder : FileFolder
        Where its MTL files and textures are.

    Returns
    -------
    raw : RawMesh
        One part per material, and per object or group whose name says what it is.

    Raises
    ------
    ScanError
        If a line is malformed, a face names what is not there, or a texture cannot be decoded.
    """
    content = _parse(data, where=folder.where)
    materials: dict[str, _Material] = {}
    for library in _file_names(content.libraries, folder):
        text = folder.read(library)
        if text is not None:
            materials.update(_parse_materials(text, where=f"{library} of {folder.where}"))
    numbers, images = _read_images(materials.values(), folder)
    vertices, colors = _vertex_arrays(content.positions)
    uv = np.array(content.textures, dtype=np.float64).reshape(-1, 2)
    parts: list[MeshPart] = []
    for (name, kind, shape), faces in content.groups.items():
        material = materials.get(name, _Material()) if name is not None else _Material()
        image = numbers.get(material.texture, -1) if material.texture is not None else -1
        found = _parts(faces, material, image, vertices, colors, uv)
        parts.extend(replace(part, kind=kind, shape=shape) for part in found)
    notes = missing_file_notes(folder.missing)
    return RawMesh(parts=tuple(parts), images=tuple(images), notes=notes)


def _file_names(lines: Iterable[str], folder: FileFolder) -> Iterator[str]:
    """Names in `mtllib` lines, of which one may hold several; a name may have spaces."""
    for line in lines:
        words = line.split()
        several = len(words) > 1 and all(word.lower().endswith(".mtl") for word in words)
        names = words if several and not folder.holds(_beside(line, folder)) else [line]
        yield from (_beside(name, folder) for name in names)


def _beside(name: str, folder: FileFolder) -> str:
    """The last part of a full path, as some programs write it, if there is such a file beside the scan."""
    last = name.replace("\\", "/").rpartition("/")[2]
    return last if _FULL_PATH.match(name) and last and folder.holds(last) else name


def _read_images(materials: Iterable[_Material], folder: FileFolder) -> tuple[dict[str, int], list[ByteArray]]:
    """Textures of the materials, each once, and their numbers by name; a missing one has none."""
    numbers: dict[str, int] = {}
    images: list[ByteArray] = []
    for name in dict.fromkeys(material.texture for material in materials if material.texture):
        image = folder.read_image(_beside(name, folder))
        if image is not None:
            numbers[name] = len(images)
            images.append(image)
            check_texture_total(tuple(images), name=folder.where)
    return numbers, images


def _lines(data: bytes) -> Iterator[tuple[int, str, str]]:
    """Number, keyword and rest of every non-empty line; a backslash joins a line with the next."""
    # Latin-1 decodes any byte, and the words that matter are ASCII; only names could suffer, so UTF-8 goes first.
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    pending = ""
    for number, line in enumerate(text.split("\n"), start=1):
        joined = pending + line.strip()
        if joined.endswith("\\"):
            pending = joined[:-1] + " "
            continue
        pending = ""
        if joined and not joined.startswith("#"):
            keyword, _, rest = joined.replace("\t", " ").partition(" ")
            if keyword in ("v", "vt", "f"):
                rest = rest.partition("#")[0]  # a name may have that sign
            yield number, keyword, rest.strip()


def _parse(data: bytes, *, where: str) -> _Content:
    content = _Content()
    material: str | None = None
    names: dict[str, str] = {}  # of the object and the group that faces belong to
    kind, shape = "", 0
    for number, keyword, rest in _lines(data):
        try:
            if keyword == "v":
                content.positions.append([float(word) for word in rest.split()])
            elif keyword == "vt":
                first_two = [float(word) for word in rest.split()[:2]]
                content.textures.append(first_two if len(first_two) == 2 else [first_two[0], 0.0])
            elif keyword == "f":
                group = content.groups.setdefault((material, kind, shape if kind else 0), _Faces())
                _add_face(group, rest.split(), len(content.positions), len(content.textures))
            elif keyword == "usemtl":
                material = rest
            elif keyword in ("o", "g"):
                names = {"o": rest} if keyword == "o" else names | {"g": rest}
                kind, shape = part_kind((names.get("g"), names.get("o"))), shape + 1
            elif keyword == "mtllib":
                content.libraries.append(rest)
        except (ValueError, IndexError) as cause:
            raise ScanError(
                expected=f"numbers after '{keyword}' that fit",
                found=f"{rest[:80]!r} ({cause})",
                where=f"{where}, line {number}",
                todo="The file is damaged or cut off; export the scan again.",
            ) from cause
    return content


def _add_face(group: _Faces, words: list[str], positions: int, textures: int) -> None:
    """Add a polygon. Numbers count from 1, or back from the latest where negative."""
    if len(words) < 3:
        raise ValueError(f"a face of {len(words)} corners")
    group.sizes.append(len(words))
    for word in words:
        position, _, rest = word.partition("/")
        texture = rest.partition("/")[0]
        group.positions.append(_number(position, positions))
        group.textures.append(_number(texture, textures) if texture else _NO_INDEX)


def _number(word: str, count: int) -> int:
    """Number from 0 of what a face's word names.

    A positive number may point ahead in the file, so that only its lower bound can be tested here.
    """
    value = int(word)
    index = value - 1 if value > 0 else count + value
    if value == 0 or not 0 <= index < _MAX_NUMBERS:
        raise ValueError(f"index {value} is 0 or points before the first element")
    return index


def _vertex_arrays(rows: list[list[float]]) -> tuple[FloatArray, FloatArray]:
    """Positions and colours; NaN for those of rows of fewer than six numbers, as of parts that were added later."""
    if any(len(row) < 3 for row in rows):
        raise ScanError(
            expected="three numbers after every 'v'",
            found="fewer",
            where="OBJ positions",
            todo="The file is damaged; export the scan again.",
        )
    vertices = np.array([row[:3] for row in rows], dtype=np.float64).reshape(-1, 3)
    colors = np.full(vertices.shape, np.nan)
    colored = [number for number, row in enumerate(rows) if len(row) >= 6]
    if colored:
        colors[colored] = [rows[number][3:6] for number in colored]
    # Some programs write bytes, others colours that rounding or light left a little above 1.
    scale = 255.0 if np.max(colors, initial=0.0, where=np.isfinite(colors)) > MOST_FLOAT_COLOR else 1.0
    return vertices, colors / scale


def _parts(
    faces: _Faces,
    material: _Material,
    image: int,
    vertices: FloatArray,
    colors: FloatArray,
    uv: FloatArray,
) -> Iterator[MeshPart]:
    """The triangles of a material: those with texture coordinates, and those without."""
    numbers = np.array(faces.positions, dtype=np.int64)
    if numbers.size and numbers.max() >= vertices.shape[0]:
        raise ScanError(
            expected=f"faces of the {vertices.shape[0]} positions",
            found=f"one that names number {numbers.max() + 1}",
            where="OBJ faces",
            todo="The file is damaged or cut off; export the scan again.",
        )
    places, _ = polygon_triangles(vertices, numbers, np.array(faces.sizes, dtype=np.int64))
    corners, coordinates = numbers[places], np.array(faces.textures, dtype=np.int64)[places]
    textured = ((coordinates >= 0) & (coordinates < uv.shape[0])).all(axis=1) & (image >= 0)
    if textured.any():
        corner_uv = uv[coordinates[textured]] * material.scale + material.offset
        yield MeshPart(vertices=vertices, faces=corners[textured], image=image, corner_uv=corner_uv)
    has_color = np.asarray(np.isfinite(colors).all(axis=1), dtype=np.bool_)
    painted = ~textured & has_color[corners].all(axis=1)
    if painted.any():
        yield MeshPart(vertices=vertices, faces=corners[painted], corner_color=colors[corners[painted]])
    plain = corners[~textured & ~painted]
    if plain.size:
        color: FloatArray | None = None
        if material.color is not None and material.texture is None:
            # Kd is linear light; where the texture is missing, its white is not the surface's colour.
            color = np.broadcast_to(encode_srgb(np.array(material.color)), (plain.shape[0], 3, 3))
        yield MeshPart(vertices=vertices, faces=plain, corner_color=color, flat_color=True)


def _parse_materials(data: bytes, *, where: str) -> dict[str, _Material]:
    materials: dict[str, _Material] = {}
    current = _Material()
    for number, keyword, rest in _lines(data):
        key = keyword.lower()
        if key == "newmtl":
            current = materials.setdefault(rest, _Material())
        elif key == "map_kd":
            current.texture, current.scale, current.offset = _texture_of(rest)
        elif key == "kd":
            try:
                red, green, blue = (
                    float(word) for word in (rest.split() * 3 if len(rest.split()) == 1 else rest.split())[:3]
                )
            except ValueError as cause:
                raise ScanError(
                    expected="a colour of three numbers after 'Kd'",
                    found=f"{rest[:80]!r}",
                    where=f"{where}, line {number}",
                    todo="Mend that line of the material file.",
                ) from cause
            current.color = (red, green, blue)
    return materials


def _texture_of(rest: str) -> tuple[str, tuple[float, float], tuple[float, float]]:
    """The file name of a `map_Kd` line, which may follow options, and the scale and offset among these."""
    words = rest.split(" ")
    vectors = {"-s": (1.0, 1.0), "-o": (0.0, 0.0)}
    while words and (words[0] in _VECTOR_OPTIONS or words[0] in _IMAGE_OPTION_ARGUMENTS):
        option, words = words[0], words[1:]
        if option in _VECTOR_OPTIONS:
            numbers = [float(word) for word in itertools.takewhile(_is_number, words[:3])]
            words = words[len(numbers) :]
            usual = vectors.get(option, (0.0, 0.0))
            vectors[option] = (numbers[0] if numbers else usual[0], numbers[1] if len(numbers) > 1 else usual[1])
        else:
            words = words[_IMAGE_OPTION_ARGUMENTS[option] :]
    return " ".join(words).strip('"'), vectors["-s"], vectors["-o"]


def _is_number(word: str) -> bool:
    try:
        return bool(np.isfinite(float(word)))
    except ValueError:
        return False
