"""The JSON of a glTF 2.0 file, checked as it is read: every number and list is of the kind that the format asks for.

References
----------
Khronos Group, glTF 2.0 Specification, version 2.0.1: 4.4 (GLB layout), 5 (properties).
"""

import json
import struct
from collections.abc import Sequence
from typing import Annotated, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.alias_generators import to_camel

from lidarspectra.errors import ScanError

GLB_MAGIC = b"glTF"
TRIANGLES, STRIP, FAN = 4, 5, 6  # 5.24.4, mesh.primitive.mode
REPEAT, CLAMP, MIRROR = 10497, 33071, 33648  # sampler.wrapS and wrapT
_JSON_CHUNK = 0x4E4F534A  # "JSON"
_BINARY_CHUNK = 0x004E4942  # "BIN"
_UNDERSTOOD_EXTENSIONS = ("KHR_texture_transform", "KHR_mesh_quantization", "EXT_texture_webp", "KHR_lights_punctual")

Item = TypeVar("Item")
Index = Annotated[int, Field(ge=0, strict=True)]
Size = Annotated[int, Field(ge=0, le=2**40, strict=True)]


class Part(BaseModel):
    """A part of a glTF file; properties that are not needed are ignored."""

    model_config = ConfigDict(extra="ignore", frozen=True, alias_generator=to_camel, allow_inf_nan=False)


class Buffer(Part):
    """Bytes that views look into (5.3)."""

    byte_length: Size
    uri: str | None = None


class View(Part):
    """A slice of a buffer (5.5)."""

    buffer: Index
    byte_offset: Size = 0
    byte_length: Size
    byte_stride: Annotated[int, Field(ge=4, le=252)] | None = None


class Accessor(Part):
    """How a view holds numbers (5.1)."""

    buffer_view: Index | None = None
    byte_offset: Size = 0
    component_type: Literal[5120, 5121, 5122, 5123, 5125, 5126]
    count: Annotated[int, Field(ge=1, le=2**32, strict=True)]
    type: Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]
    normalized: bool = False
    sparse: dict[str, object] | None = None


class TextureTransform(Part):
    """Extension KHR_texture_transform."""

    offset: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)
    tex_coord: Index | None = None


class TextureInfoExtensions(Part):
    """Extensions of a texture reference."""

    transform: TextureTransform | None = Field(default=None, alias="KHR_texture_transform")


class TextureInfo(Part):
    """Reference to a texture (5.30)."""

    index: Index
    tex_coord: Index = 0
    extensions: TextureInfoExtensions = TextureInfoExtensions()


class Pbr(Part):
    """Base colour of a material (5.22)."""

    base_color_factor: tuple[float, float, float, float] | None = None
    base_color_texture: TextureInfo | None = None


class SpecularGlossiness(Part):
    """Extension KHR_materials_pbrSpecularGlossiness."""

    diffuse_factor: tuple[float, float, float, float] | None = None
    diffuse_texture: TextureInfo | None = None


class MaterialExtensions(Part):
    """Extensions of a material."""

    specular_glossiness: SpecularGlossiness | None = Field(default=None, alias="KHR_materials_pbrSpecularGlossiness")


class Material(Part):
    """A material (5.19)."""

    name: str | None = None
    pbr_metallic_roughness: Pbr = Pbr()
    emissive_texture: TextureInfo | None = None
    extensions: MaterialExtensions = MaterialExtensions()


class WebpSource(Part):
    """Extension EXT_texture_webp."""

    source: Index


class TextureExtensions(Part):
    """Extensions of a texture."""

    webp: WebpSource | None = Field(default=None, alias="EXT_texture_webp")


class Sampler(Part):
    """What a texture shows outside of its picture (5.26)."""

    wrap_s: int = REPEAT
    wrap_t: int = REPEAT


class Texture(Part):
    """A texture (5.29)."""

    sampler: Index | None = None
    source: Index | None = None
    extensions: TextureExtensions = TextureExtensions()


class Image(Part):
    """An image (5.17)."""

    uri: str | None = None
    buffer_view: Index | None = None


class Primitive(Part):
    """Triangles of one material (5.24)."""

    attributes: dict[str, Index]
    indices: Index | None = None
    material: Index | None = None
    mode: int = TRIANGLES
    extensions: dict[str, object] = {}


class Mesh(Part):
    """A mesh (5.23)."""

    name: str | None = None
    primitives: tuple[Primitive, ...]


class Node(Part):
    """A node of the scene graph (5.25)."""

    name: str | None = None
    children: tuple[Index, ...] = ()
    mesh: Index | None = None
    matrix: Annotated[tuple[float, ...], Field(min_length=16, max_length=16)] | None = None
    translation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


class Scene(Part):
    """Roots of a scene graph (5.26)."""

    nodes: tuple[Index, ...] = ()


class Asset(Part):
    """About the file (5.2)."""

    version: str
    generator: str = ""


class Document(Part):
    """The whole JSON (5.16)."""

    asset: Asset
    extensions_required: tuple[str, ...] = ()
    accessors: tuple[Accessor, ...] = ()
    buffers: tuple[Buffer, ...] = ()
    buffer_views: tuple[View, ...] = ()
    images: tuple[Image, ...] = ()
    materials: tuple[Material, ...] = ()
    meshes: tuple[Mesh, ...] = ()
    nodes: tuple[Node, ...] = ()
    samplers: tuple[Sampler, ...] = ()
    scene: Index | None = None
    scenes: tuple[Scene, ...] = ()
    textures: tuple[Texture, ...] = ()


def split_glb(data: bytes, *, where: str) -> tuple[bytes, bytes | None]:
    """JSON text and binary chunk of a GLB (4.4); ScanError where it is cut off."""
    if len(data) < 20:
        raise damaged("a GLB header of 20 bytes", f"{len(data)} bytes", where)
    version, length, json_length, json_kind = struct.unpack_from("<IIII", data, 4)
    if version != 2:
        raise damaged("glTF version 2", f"version {version}", where)
    if length > len(data):
        raise damaged(f"{length} bytes as its header says", f"{len(data)} bytes", where)
    if json_kind != _JSON_CHUNK or 20 + json_length > len(data):
        raise damaged("a whole JSON chunk first", "none", where)
    text, start = data[20 : 20 + json_length], 20 + json_length
    while start + 8 <= length:
        chunk_length, kind = struct.unpack_from("<II", data, start)
        if start + 8 + chunk_length > len(data):
            raise damaged("whole chunks", "one that is cut off", where)
        if kind == _BINARY_CHUNK:
            return text, data[start + 8 : start + 8 + chunk_length]
        start += 8 + chunk_length
    return text, None


def parse_document(text: bytes, *, where: str) -> Document:
    """The document of a JSON text; ScanError where it is malformed or needs an extension that is not read here."""
    try:
        # The text goes through json, whose nesting limit is an exception and not a crash.
        document = Document.model_validate(json.loads(text.decode("utf-8-sig")))
    except ValidationError as cause:
        faults = "; ".join(f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in cause.errors()[:3])
        raise damaged("a glTF 2.0 document", faults, where) from cause
    except (ValueError, RecursionError) as cause:
        raise damaged("a glTF 2.0 document (JSON)", str(cause)[:200], where) from cause
    if not document.asset.version.startswith("2"):
        raise damaged("glTF version 2", f"version {document.asset.version[:20]}", where)
    unknown = [
        name
        for name in document.extensions_required
        if name not in _UNDERSTOOD_EXTENSIONS and not name.startswith("KHR_materials_")
    ]
    if unknown:
        raise ScanError(
            expected="a glTF file without compressed meshes or textures",
            found=f"one that needs {', '.join(unknown)[:200]}",
            where=where,
            todo="Export it without compression (no Draco, meshopt or KTX2).",
        )
    return document


def damaged(expected: str, found: str, where: str) -> ScanError:
    """The error for a file that contradicts itself or the format."""
    return ScanError(
        expected=expected, found=found, where=where, todo="The file is damaged or cut off; export or copy it again."
    )


def item(items: Sequence[Item], index: int, kind: str, where: str) -> Item:
    """Element of a list that another element names by number."""
    if index >= len(items):
        raise damaged(f"one of {len(items)} {kind}s", f"number {index}", where)
    return items[index]
