"""glTF 2.0 files, binary (GLB) and text: meshes, scene transforms, base colour.

This module does not use trimesh's reader, because that one silently ignores textures that it cannot decode, sparse
data, texture transforms and further sets of texture coordinates. Here each becomes an error or a note.

References
----------
Khronos Group, glTF 2.0 Specification, version 2.0.1: 3.6 (buffers and accessors), 3.5.3 (transformations),
3.7.2 (meshes), 3.9 (materials).
"""

import base64
import binascii
from dataclasses import dataclass, field, replace

import numpy as np

from lidarspectra.arrays import ByteArray, FloatArray, IntArray
from lidarspectra.errors import ScanError
from lidarspectra.geometry.textures import check_texture_total, decode_image, tint_image
from lidarspectra.hardware.phone.gltf_document import (
    CLAMP,
    FAN,
    GLB_MAGIC,
    MIRROR,
    STRIP,
    TRIANGLES,
    Document,
    Node,
    Primitive,
    TextureInfo,
    View,
    damaged,
    item,
    parse_document,
    split_glb,
)
from lidarspectra.hardware.phone.part_names import part_kind
from lidarspectra.hardware.phone.raw_mesh import FileFolder, MeshPart, RawMesh, missing_file_notes
from lidarspectra.hardware.phone.wrapping import REPEATING, Wrap, Wraps, with_mirror_image, wrapped
from lidarspectra.spectra.colorimetry import encode_srgb

UNSIGNED_BYTE = 5121  # 3.6.2.2
_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}  # 3.6.2.2
MAX_NAMES = 4  # names above a mesh that may say what it is
AS_GIVEN = ("github.com/mikedh/trimesh", "Open3D", "Open Asset Import Library")
"""In the names of generators that write coordinates as they were given, those of a PLY with z up too."""
_WRAPS: dict[int, Wrap] = {CLAMP: "clamp", MIRROR: "mirror"}
_COLUMNS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}  # 3.6.2.2

Factor = tuple[float, float, float]
_ImageKey = tuple[int, Factor | None, Wraps]  # number in the file, tint, what it shows outside


@dataclass(frozen=True, kw_only=True)
class _Surface:
    """The part of a material used here: linear colour factor, and the index of its texture image."""

    factor: Factor | None
    image: int
    info: TextureInfo | None


def read_gltf(data: bytes, *, folder: FileFolder) -> RawMesh:
    """Read a glTF or GLB file.

    Transforms of the scene graph are applied; a mirroring one also turns its triangles round (3.7.4). The colour is
    the base colour texture times its factor; without a texture, vertex colours (linear, as the format has them) times
    the factor; base colour of the specular-glossiness extension, and an emissive texture where it is the only one,
    stand in for it.

    Parameters
    ----------
    data : bytes
        The file's content.
    folder : FileFolder
        Where its buffers and images are.

    Returns
    -------
    raw : RawMesh
        In metres with y up, as the format defines.

    Raises
    ------
    ScanError
        If the file is malformed, cut off, or needs an extension (Draco, meshopt, Basis) that is not read here.
    """
    text, binary = split_glb(data, where=folder.where) if data[:4] == GLB_MAGIC else (data, None)
    document = parse_document(text, where=folder.where)
    return _read_document(_Reading(document=document, binary=binary, folder=folder))


@dataclass(kw_only=True)
class _Reading:
    """A document being read, with the images and buffers decoded so far, which its parts share."""

    document: Document
    binary: bytes | None
    folder: FileFolder
    buffers: dict[int, bytes] = field(default_factory=dict)
    images: list[ByteArray] = field(default_factory=list)
    image_numbers: dict[_ImageKey, int] = field(default_factory=dict)
    notes: dict[str, None] = field(default_factory=dict)  # a set that keeps its order

    @property
    def where(self) -> str:
        return self.folder.where


def _read_document(reading: _Reading) -> RawMesh:
    cached: dict[int, list[MeshPart]] = {}
    parts: list[MeshPart] = []
    for shape, (mesh, matrix, names) in enumerate(_instances(reading)):
        described = item(reading.document.meshes, mesh, "mesh", reading.where)
        if mesh not in cached:
            cached[mesh] = [part for primitive in described.primitives for part in _primitive(reading, primitive)]
        kind = part_kind((names[0], described.name, *names[1:]))
        parts.extend(replace(_transformed(part, matrix), kind=kind, shape=shape) for part in cached[mesh])
    missing = missing_file_notes(reading.folder.missing)
    return RawMesh(
        parts=tuple(parts),
        images=tuple(reading.images),
        unit="m",
        up="+y",
        as_given=any(name in reading.document.asset.generator for name in AS_GIVEN),
        notes=tuple(reading.notes) + missing,
    )


# --- scene graph


def _instances(reading: _Reading) -> list[tuple[int, FloatArray, tuple[str | None, ...]]]:
    """Meshes of the scene, each with its transform to the root, (4, 4), and the names of its node and those above."""
    document, where = reading.document, reading.where
    if document.scenes:
        roots = item(document.scenes, document.scene or 0, "scene", where).nodes
    else:
        inner = {child for node in document.nodes for child in node.children}
        roots = tuple(index for index in range(len(document.nodes)) if index not in inner)
    waiting: list[tuple[int, FloatArray, tuple[str | None, ...]]] = [(root, np.eye(4), ()) for root in roots]
    seen: set[int] = set()
    found: list[tuple[int, FloatArray, tuple[str | None, ...]]] = []
    while waiting:
        index, outer, above = waiting.pop()
        node = item(document.nodes, index, "node", where)
        if index in seen:
            raise damaged("nodes that form a tree", f"node {index} below two others", where)
        seen.add(index)
        matrix = outer @ _node_matrix(node)
        names = (node.name, *above[: MAX_NAMES - 1])
        if node.mesh is not None:
            found.append((node.mesh, matrix, names))
        waiting.extend((child, matrix, names) for child in reversed(node.children))
    return found


def _node_matrix(node: Node) -> FloatArray:
    """Local transform of a node (3.5.3)."""
    if node.matrix is not None:
        return np.array(node.matrix, dtype=np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    length = float(np.linalg.norm(node.rotation))
    if length > 0:
        x, y, z, w = np.array(node.rotation) / length
        matrix[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    matrix[:3, :3] *= np.array(node.scale)
    matrix[:3, 3] = node.translation
    return matrix


def _transformed(part: MeshPart, matrix: FloatArray) -> MeshPart:
    """A part moved; a mirroring transform would turn its triangles inside out, so their corners are swapped back."""
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows is refused with the other bad positions
        vertices = part.vertices @ matrix[:3, :3].T + matrix[:3, 3]
        mirrored = bool(np.linalg.det(matrix[:3, :3]) < 0)
    if not mirrored:
        return replace(part, vertices=vertices)
    return replace(
        part,
        vertices=vertices,
        faces=part.faces[:, ::-1],
        corner_uv=None if part.corner_uv is None else part.corner_uv[:, ::-1],
        corner_color=None if part.corner_color is None else part.corner_color[:, ::-1],
    )


# --- meshes


def _primitive(reading: _Reading, primitive: Primitive) -> list[MeshPart]:
    """The triangles of a primitive; none for points and lines."""
    if primitive.mode not in (TRIANGLES, STRIP, FAN):
        reading.notes["The points and lines in the file were ignored, because only triangles reflect light."] = None
        return []
    if "POSITION" not in primitive.attributes:
        raise damaged("a mesh with positions", "one without", reading.where)
    with np.errstate(invalid="ignore"):  # of a signalling NaN, which is refused with the others
        vertices = _accessor(reading, primitive.attributes["POSITION"], columns=(3,)).astype(np.float64)
    if primitive.indices is None:
        numbers = np.arange(vertices.shape[0])
    else:
        numbers = _accessor(reading, primitive.indices, columns=(1,)).astype(np.int64).ravel()
    faces = _triangles(numbers, primitive.mode, reading.where)
    if faces.size and faces.max() >= vertices.shape[0]:
        raise damaged(f"faces of {vertices.shape[0]} vertices", f"one that names {faces.max()}", reading.where)
    surface = _surface(reading, primitive.material)
    corner_uv = _corner_uv(reading, primitive, surface.info, faces, surface.image) if surface.image >= 0 else None
    if corner_uv is not None:
        if "COLOR_0" in primitive.attributes:
            reading.notes["Vertex colours were ignored where a surface also has a texture."] = None
        return [MeshPart(vertices=vertices, faces=faces, image=surface.image, corner_uv=corner_uv)]
    color = _corner_color(reading, primitive, surface, faces)
    flat = "COLOR_0" not in primitive.attributes
    return [MeshPart(vertices=vertices, faces=faces, corner_color=color, flat_color=flat)]


def _triangles(numbers: IntArray, mode: int, where: str) -> IntArray:
    """(face, 3) corners of a list, strip or fan of triangles (3.7.2.1)."""
    if mode == TRIANGLES:
        if numbers.size % 3:
            raise damaged("triangles of three corners", f"{numbers.size} corners", where)
        return numbers.reshape(-1, 3)
    if numbers.size < 3:
        return np.empty((0, 3), dtype=np.int64)
    if mode == FAN:
        return np.column_stack([np.full(numbers.size - 2, numbers[0]), numbers[1:-1], numbers[2:]])
    faces = np.column_stack([numbers[:-2], numbers[1:-1], numbers[2:]])
    faces[1::2] = faces[1::2][:, [1, 0, 2]]  # every other triangle of a strip runs the other way
    return faces


def _corner_uv(
    reading: _Reading, primitive: Primitive, info: TextureInfo | None, faces: IntArray, image: int
) -> FloatArray | None:
    """(face, 3, 2) texture coordinates, v up; None where the primitive has none of the number its material names."""
    if info is None:
        return None
    transform = info.extensions.transform
    channel = info.tex_coord if transform is None or transform.tex_coord is None else transform.tex_coord
    name = f"TEXCOORD_{channel}"
    if name not in primitive.attributes:
        reading.notes[
            "A textured mesh has no texture coordinates, so its texture was ignored and its colour is unknown."
            " Export the scan again with texture coordinates (UV)."
        ] = None
        return None
    uv = _accessor(reading, primitive.attributes[name], columns=(2,)).astype(np.float64)
    if transform is not None:
        # With v down, u' = u cos + v sin: as cesium-native turns it and the extension's words ("counter-clockwise")
        # have it; the matrix printed in the extension's text, read as GLSL, turns the other way.
        cosine, sine = np.cos(transform.rotation), np.sin(transform.rotation)
        uv = (uv * transform.scale) @ np.array([[cosine, -sine], [sine, cosine]]) + transform.offset
    uv = wrapped(uv, reading.images[image], _wraps(reading, info))
    return _at_corners(np.column_stack([uv[:, 0], 1.0 - uv[:, 1]]), faces, reading.where)


def _wraps(reading: _Reading, info: TextureInfo) -> Wraps:
    """What a texture shows outside of its picture."""
    texture = item(reading.document.textures, info.index, "texture", reading.where)
    samplers = reading.document.samplers
    if texture.sampler is None or texture.sampler >= len(samplers):
        return REPEATING
    sampler = samplers[texture.sampler]
    return _WRAPS.get(sampler.wrap_s, "repeat"), _WRAPS.get(sampler.wrap_t, "repeat")


def _corner_color(reading: _Reading, primitive: Primitive, surface: _Surface, faces: IntArray) -> FloatArray | None:
    """(face, 3, 3) sRGB-encoded colours: vertex colours times the material's factor; None where there is neither."""
    factor = np.ones(3) if surface.factor is None else np.array(surface.factor)
    if "COLOR_0" in primitive.attributes:
        stored = primitive.attributes["COLOR_0"]
        linear = _accessor(reading, stored, columns=(3, 4), always_normalized=True)[:, :3]
        if item(reading.document.accessors, stored, "accessor", reading.where).component_type == UNSIGNED_BYTE:
            reading.notes[
                "The colours of vertices were taken for linear light, as glTF defines them. They have 8 bits, as of "
                "programs that copy those of a PLY or a picture, which are sRGB (trimesh, Open3D): surfaces are then "
                "taken for too light. If the file looks pale in a viewer, give the scan as PLY or OBJ."
            ] = None
        return _at_corners(encode_srgb(linear * factor), faces, reading.where)
    # The colour factor of a material whose texture is missing is not the surface's colour.
    if surface.factor is None or surface.info is not None:
        return None
    return np.broadcast_to(encode_srgb(factor), (faces.shape[0], 3, 3))


def _at_corners(values: FloatArray, faces: IntArray, where: str) -> FloatArray:
    if faces.size and faces.max() >= values.shape[0]:
        raise damaged("as many texture coordinates or colours as positions", f"{values.shape[0]}", where)
    return np.asarray(values[faces], dtype=np.float64)


# --- materials and images


def _surface(reading: _Reading, index: int | None) -> _Surface:
    if index is None:
        return _Surface(factor=None, image=-1, info=None)
    material = item(reading.document.materials, index, "material", reading.where)
    glossy = material.extensions.specular_glossiness
    pbr = material.pbr_metallic_roughness
    factor, info = pbr.base_color_factor, pbr.base_color_texture
    if factor is None and info is None and glossy is not None:
        factor, info = glossy.diffuse_factor, glossy.diffuse_texture
    rgb = None if factor is None else factor[:3]
    if info is None and material.emissive_texture is not None:
        # Photogrammetry tools write their colour as emission to keep viewers from shading it.
        reading.notes["The surface colour was taken from an emissive texture, because there is no base colour."] = None
        rgb, info = None, material.emissive_texture
    return _Surface(factor=rgb, image=-1 if info is None else _image_number(reading, info, rgb), info=info)


def _image_number(reading: _Reading, info: TextureInfo, factor: Factor | None) -> int:
    """Number of a texture's image among those read, tinted by the factor; -1 where its file is missing."""
    document, where = reading.document, reading.where
    texture = item(document.textures, info.index, "texture", where)
    source = texture.source if texture.extensions.webp is None else texture.extensions.webp.source
    if source is None:
        reading.notes[
            "A texture is in an image format that cannot be read, so its surfaces have no colour."
            " Export the scan with JPEG or PNG textures."
        ] = None
        return -1
    tint = None if factor is None or all(value >= 1.0 for value in factor) else factor
    wraps = _wraps(reading, info)
    for key in ((source, None, REPEATING), (source, tint, wraps)):
        if key not in reading.image_numbers:
            plain = reading.image_numbers.get((source, None, REPEATING))
            image = _plain_image(reading, source) if plain is None else reading.images[plain]
            if image is None:
                return -1
            reading.image_numbers[key] = len(reading.images)
            reading.images.append(with_mirror_image(_tinted(image, key[1]), key[2]))
            check_texture_total(tuple(reading.images), name=where)
    return reading.image_numbers[(source, tint, wraps)]


def _tinted(image: ByteArray, factor: Factor | None) -> ByteArray:
    return image if factor is None else tint_image(image, np.array(factor))


def _plain_image(reading: _Reading, source: int) -> ByteArray | None:
    image = item(reading.document.images, source, "image", reading.where)
    name = f"image {source} of {reading.where}"
    if image.buffer_view is not None:
        view = item(reading.document.buffer_views, image.buffer_view, "buffer view", reading.where)
        return decode_image(_view_bytes(reading, view), name=name)
    if image.uri is None:
        raise damaged("an image with data", "one without", name)
    if image.uri.startswith("data:"):
        return decode_image(_data_uri(image.uri, reading.where), name=name)
    return reading.folder.read_image(image.uri)


# --- buffers


def _accessor(
    reading: _Reading, index: int, *, columns: tuple[int, ...], always_normalized: bool = False
) -> FloatArray | IntArray:
    """(count, columns) values of an accessor (3.6.2); normalized integers become 0 to 1 or -1 to 1."""
    accessor = item(reading.document.accessors, index, "accessor", reading.where)
    if accessor.sparse is not None or accessor.buffer_view is None:
        raise ScanError(
            expected="mesh data stored in full",
            found="sparse or compressed data",
            where=reading.where,
            todo="Export the scan without compression.",
        )
    width = _COLUMNS[accessor.type]
    if width not in columns:
        raise damaged(f"data of {' or '.join(map(str, columns))} columns", accessor.type, reading.where)
    view = item(reading.document.buffer_views, accessor.buffer_view, "buffer view", reading.where)
    data = _view_bytes(reading, view)
    kind = np.dtype(_COMPONENTS[accessor.component_type])
    row = width * kind.itemsize
    stride = view.byte_stride or row
    end = accessor.byte_offset + (accessor.count - 1) * stride + row
    if end > len(data) or stride < row:
        raise damaged(f"{end} bytes of mesh data", f"{len(data)}", reading.where)
    raw: FloatArray | IntArray = np.ndarray(
        (accessor.count, width), dtype=kind, buffer=data, offset=accessor.byte_offset, strides=(stride, kind.itemsize)
    )
    if kind.kind == "f" or not (accessor.normalized or always_normalized):
        return raw
    return np.maximum(raw / float(np.iinfo(kind).max), -1.0)


def _view_bytes(reading: _Reading, view: View) -> bytes:
    data = _buffer_bytes(reading, view.buffer)
    if view.byte_offset + view.byte_length > len(data):
        raise damaged(
            f"a buffer of at least {view.byte_offset + view.byte_length} bytes", f"{len(data)}", reading.where
        )
    return data[view.byte_offset : view.byte_offset + view.byte_length]


def _buffer_bytes(reading: _Reading, index: int) -> bytes:
    if index not in reading.buffers:
        buffer = item(reading.document.buffers, index, "buffer", reading.where)
        data: bytes | None
        if buffer.uri is None:
            data = reading.binary if index == 0 else None
        elif buffer.uri.startswith("data:"):
            data = _data_uri(buffer.uri, reading.where)
        else:
            data = reading.folder.read(buffer.uri)
        if data is None:
            raise ScanError(
                expected="the buffer that holds the mesh",
                found=f"no file {buffer.uri[:200]!r}" if buffer.uri else "no binary chunk",
                where=reading.where,
                todo="Keep the .bin and texture files beside the .gltf file.",
            )
        reading.buffers[index] = data
    return reading.buffers[index]


def _data_uri(uri: str, where: str) -> bytes:
    """Content of a data URI in base 64, the only form that the format allows (3.6.1.1)."""
    head, comma, text = uri.partition(",")
    try:
        if not comma or not head.endswith(";base64"):
            raise ValueError("no base 64")
        return base64.b64decode(text, validate=True)
    except (ValueError, binascii.Error) as cause:
        raise damaged("data in base 64", f"{uri[:60]!r} ({cause})", where) from cause
