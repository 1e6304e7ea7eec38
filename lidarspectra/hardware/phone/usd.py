"""USD files (USDZ packages and USD text), by the extra 'usd': meshes, transforms, preview-surface textures.

Imported only where such a file is read; without the extra the import fails, and `readers` says what to install.

References
----------
Pixar, "UsdGeomMesh" and "UsdPreviewSurface Specification" (OpenUSD documentation); Apple, "USDZ File Format
Specification".
"""

import itertools
import logging
import re
import zipfile
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from pxr import Sdf, Tf, Usd, UsdGeom, UsdShade, UsdUtils

from lidarspectra.arrays import ByteArray, FloatArray, IntArray
from lidarspectra.errors import ScanError
from lidarspectra.geometry.textures import check_texture_total, decode_image
from lidarspectra.hardware.phone.part_names import part_kind
from lidarspectra.hardware.phone.polygons import polygon_triangles
from lidarspectra.hardware.phone.raw_mesh import (
    MAX_FILE_BYTES,
    PARSER_FAULTS,
    Axis,
    FileFolder,
    MeshPart,
    RawMesh,
    Unit,
    malformed,
    missing_file_notes,
    read_bytes,
)
from lidarspectra.hardware.phone.wrapping import Wrap, Wraps, with_mirror_image, wrapped
from lidarspectra.spectra.colorimetry import decode_srgb, encode_srgb

METRES_OF_UNIT: tuple[tuple[float, Unit], ...] = (
    (1.0, "m"), (0.01, "cm"), (0.001, "mm"), (0.0254, "in"), (0.3048, "ft"),
)  # fmt: skip
BOX_CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))  # x slowest
BOX_FACES = np.array(
    [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4],
     [1, 5, 7], [1, 7, 3]]
)  # fmt: skip  # counter-clockwise from outside, two triangles a side
# RoomPlan's walls are .1 mm thick, its doors .5 mm and in the same plane: nothing tells their two sides apart.
WALL_THICKNESS_M, INSET_THICKNESS_M = 0.01, 0.016  # [m] least; what is set into a wall stands 3 mm before it
INSETS = ("door", "window")
MOST_METRES = 80.0  # [1] extent of a scene that declares no unit, beyond which that is USD's own, the centimetre
_log = logging.getLogger(__name__)
_UP: dict[str, Axis] = {"Y": "+y", "Z": "+z"}
# "black" has no more to tell than the edge; without a word of it, most programs repeat.
_WRAPS: dict[str, Wrap] = {"mirror": "mirror", "clamp": "clamp", "black": "clamp"}
_UV_NAMES = ("st", "st0", "UVMap", "map1", "uv")  # primvars that exporters use if the material names none
_BINARY_MAGIC = b"PXR-USDC"
_MAX_LAYERS = 200  # files that one scene may be composed of; a scan has one or two
_IN_PACKAGE = re.compile(r"^(?P<package>.*)\[(?P<name>[^\[\]]+)\]$", re.DOTALL)
_FAULTS = (*PARSER_FAULTS, RuntimeError, Tf.ErrorException)


@dataclass(frozen=True, kw_only=True)
class _OfPicture:
    """Linear colour of a picture's values: factor times what they stand for, plus a bias; raw ones are linear [1]."""

    factor: tuple[float, float, float]
    bias: tuple[float, float, float]
    raw: bool

    def of(self, image: ByteArray) -> ByteArray:
        """(height, width, 3) uint8, sRGB-encoded."""
        if self == AS_IT_IS:
            return image
        levels = np.arange(256) / 255.0
        linear = (levels if self.raw else decode_srgb(levels))[:, np.newaxis] * self.factor + np.array(self.bias)
        table = np.rint(255.0 * encode_srgb(np.clip(linear, 0.0, 1.0))).astype(np.uint8)
        return np.stack([table[image[:, :, channel], channel] for channel in range(3)], axis=2)


AS_IT_IS = _OfPicture(factor=(1.0, 1.0, 1.0), bias=(0.0, 0.0, 0.0), raw=False)


@dataclass(frozen=True, kw_only=True)
class _Texture:
    """A texture as a material uses it."""

    asset: Sdf.AssetPath
    light: "_OfPicture"
    wraps: Wraps
    primvar: str | None
    scale: tuple[float, float]
    rotation_deg: float
    translation: tuple[float, float]


@dataclass(kw_only=True)
class _Reading:
    """A stage being read, and the images decoded so far."""

    path: Path
    folder: FileFolder
    time: Usd.TimeCode
    metres_per_unit: float
    images: list[ByteArray] = field(default_factory=list)
    numbers: dict[tuple[str, _OfPicture, Wraps], int] = field(default_factory=dict)
    missing: dict[str, None] = field(default_factory=dict)
    left_out: Counter[str] = field(default_factory=Counter)


def read_usd(path: Path) -> RawMesh:
    """Read a USD file or package.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    raw : RawMesh
        With the unit and upward axis that the stage declares.

    Raises
    ------
    ScanError
        If the file is damaged, refers to files outside its folder, or holds a texture that cannot be decoded.
    """
    where = path.name
    _check_package(path)
    folder = FileFolder(root=path.parent, where=where)
    # As long as it lives, it takes what the library would otherwise print: one warning a shape in some exports.
    warnings = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        root = Sdf.Layer.FindOrOpen(str(path))
        if root is None:
            raise ValueError("no USD layer")
        _check_layers(root, path)
        stage = Usd.Stage.Open(root)
        # A scan is static; if positions are animated, the first ones are used.
        metres = _metres_per_unit(stage)
        reading = _Reading(path=path, folder=folder, time=Usd.TimeCode.EarliestTime(), metres_per_unit=metres)
        parts = tuple(
            part for number, prim in enumerate(_shapes(reading, stage)) for part in _parts(reading, prim, number)
        )
        declared_unit = _declared_unit(stage)
        odd_unit = declared_unit is None and UsdGeom.StageHasAuthoredMetersPerUnit(stage)  # decimetres, say
        if odd_unit:
            parts, declared_unit = tuple(replace(part, vertices=metres * part.vertices) for part in parts), "m"
        up = _UP.get(str(UsdGeom.GetStageUpAxis(stage)))
    except _FAULTS as cause:
        raise malformed(cause, kind="USD", where=where) from cause
    finally:
        _log_warnings(warnings, where)
    said = (f"The file's unit is {metres:g} m; its positions were multiplied by that.",) if odd_unit else ()
    notes = (*said, *missing_file_notes(reading.missing), *_left_out_notes(reading.left_out))
    return RawMesh(parts=parts, images=tuple(reading.images), unit=declared_unit, up=up, notes=notes)


def _check_package(path: Path) -> None:
    """Refuse a USDZ that is not a ZIP archive, is cut off, or would unpack to more than the largest file allowed.

    The library hangs or crashes on damaged binary layers. In a package, checksums reveal the damage; binary layers by
    themselves have none and are refused.
    """
    if path.suffix.lower() != ".usdz":
        if read_bytes(path)[: len(_BINARY_MAGIC)] == _BINARY_MAGIC:
            raise ScanError(
                expected="a USDZ package or a USD text file",
                found="a binary USD layer by itself",
                where=path.name,
                todo="Export the scan as USDZ or GLB.",
            )
        return
    try:
        with zipfile.ZipFile(path) as package:
            total = sum(entry.file_size for entry in package.infolist())
            if total > MAX_FILE_BYTES:
                raise ScanError(
                    expected=f"a package of at most {MAX_FILE_BYTES} bytes",
                    found=f"{total} bytes",
                    where=path.name,
                    todo="Export the scan with fewer triangles or a smaller texture.",
                )
            broken = package.testzip()
            if broken is not None:
                raise ValueError(f"'{broken}' is damaged")
    except (zipfile.BadZipFile, NotImplementedError, EOFError, OSError, ValueError, RuntimeError) as cause:
        raise malformed(cause, kind="USDZ", where=path.name) from cause


def _check_layers(root: Sdf.Layer, path: Path) -> None:
    """Refuse a scene that is composed of files outside the package or folder."""
    home = path.parent.resolve()
    waiting, seen = [root], {root.identifier}
    while waiting:
        layer = waiting.pop()
        for name in filter(None, layer.GetCompositionAssetDependencies()):  # '' is the layer itself
            identifier = layer.ComputeAbsolutePath(name)
            package = _IN_PACKAGE.match(identifier)
            file = Path(package["package"] if package else identifier)
            if "://" in name or not file.resolve().is_relative_to(home) or len(seen) > _MAX_LAYERS:
                raise ScanError(
                    expected="a scene in one file or folder",
                    found=f"a reference to {name[:200]!r}",
                    where=path.name,
                    todo="Export the scan as one USDZ or GLB file.",
                )
            if identifier not in seen:
                seen.add(identifier)
                further = Sdf.Layer.FindOrOpen(identifier)
                if further is not None:
                    waiting.append(further)


def _metres_per_unit(stage: Usd.Stage) -> float:
    """Length of the stage's unit [m]. Where none is declared, a metre, or a centimetre if the scene is large in it."""
    if UsdGeom.StageHasAuthoredMetersPerUnit(stage):
        metres = float(UsdGeom.GetStageMetersPerUnit(stage))
        if not 0.0 < metres < np.inf:
            raise ValueError(f"metersPerUnit of {metres}")
        return metres
    purposes = [UsdGeom.Tokens.default_, UsdGeom.Tokens.render]
    box = UsdGeom.BBoxCache(Usd.TimeCode.EarliestTime(), purposes).ComputeWorldBound(stage.GetPseudoRoot())
    return 0.01 if max(box.ComputeAlignedRange().GetSize()) > MOST_METRES else 1.0


def _declared_unit(stage: Usd.Stage) -> Unit | None:
    """Unit of the stage, if it declares a known one."""
    if not UsdGeom.StageHasAuthoredMetersPerUnit(stage):
        return None
    metres = UsdGeom.GetStageMetersPerUnit(stage)
    return next((unit for size, unit in METRES_OF_UNIT if abs(metres - size) < 1e-3 * size), None)


def _log_warnings(warnings: UsdUtils.CoalescingDiagnosticDelegate, where: str) -> None:
    """Log what the library warned of, each kind of warning once, with how often it came."""
    counts: Counter[str] = Counter()
    example: dict[str, str] = {}
    for warning in warnings.TakeUncoalescedDiagnostics():
        counts[warning.sourceFunction] += 1
        example.setdefault(warning.sourceFunction, warning.commentary)
    for function, count in counts.items():
        _log.info("%s: the USD library warned %d times like this: %s", where, count, example[function])


def _left_out_notes(left_out: Counter[str]) -> tuple[str, ...]:
    if not left_out:
        return ()
    words = ", ".join(f"{count} {name}" for name, count in sorted(left_out.items()))
    return (
        f"{left_out.total()} shapes in the file were left out ({words}), because only meshes and cubes that are shown"
        " are read. Convert them to meshes in the program that made the file if they reflect light.",
    )


def _shapes(reading: _Reading, stage: Usd.Stage) -> Iterator[Usd.Prim]:
    """Visible meshes and boxes; other shapes are counted."""
    aside = _purposes_aside(stage)
    shapes = iter(Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies()))
    for prim in shapes:
        if prim.IsA(UsdGeom.PointInstancer):
            reading.left_out["PointInstancer"] += 1
            shapes.PruneChildren()  # what it repeats stands there once, and is shown nowhere by itself
        if not prim.IsA(UsdGeom.Gprim):
            continue
        about = UsdGeom.Imageable(prim)
        if about.ComputeVisibility() == UsdGeom.Tokens.invisible:
            reading.left_out["invisible"] += 1
        elif about.ComputePurpose() in aside:
            reading.left_out[f"of purpose '{about.ComputePurpose()}'"] += 1
        elif prim.IsA(UsdGeom.Mesh) or prim.IsA(UsdGeom.Cube):
            yield prim
        else:
            reading.left_out[str(prim.GetTypeName())] += 1


def _purposes_aside(stage: Usd.Stage) -> tuple[str, ...]:
    """Purposes of shapes that a picture does not show: guides, and stand-ins for others that are there."""
    shapes = (prim for prim in stage.Traverse(Usd.TraverseInstanceProxies()) if prim.IsA(UsdGeom.Gprim))
    whole = any(UsdGeom.Imageable(prim).ComputePurpose() == UsdGeom.Tokens.render for prim in shapes)
    return (UsdGeom.Tokens.guide, UsdGeom.Tokens.proxy) if whole else (UsdGeom.Tokens.guide,)


def _parts(reading: _Reading, prim: Usd.Prim, number: int) -> Iterator[MeshPart]:
    """The triangles of a shape, with what its name and its groups' say that it is."""
    kind = part_kind(_names(prim))
    found = _box_part(reading, prim, kind) if prim.IsA(UsdGeom.Cube) else _mesh_parts(reading, prim)
    for part in found:
        yield replace(part, kind=kind, shape=number)


def _thickening(sides: FloatArray, least: float) -> FloatArray:
    """(3,) factors that make a box's sides at least so long; a side of no length at all stays, and makes a sheet."""
    return np.maximum(1.0, least / np.where(sides > 0, sides, np.inf))


def _names(prim: Usd.Prim) -> Iterator[str]:
    """A prim's name and those above it; the root's, which names the whole scene, is left out."""
    while prim and not prim.GetParent().IsPseudoRoot():
        yield prim.GetName()
        prim = prim.GetParent()


def _box_part(reading: _Reading, prim: Usd.Prim, kind: str) -> Iterator[MeshPart]:
    """The twelve triangles of a cube, scaled to a box by its transform, as RoomPlan writes walls and furniture."""
    least = (INSET_THICKNESS_M if kind in INSETS else WALL_THICKNESS_M) / reading.metres_per_unit
    size = UsdGeom.Cube(prim).GetSizeAttr().Get(reading.time)
    numbers, faces = BOX_FACES.ravel(), BOX_FACES
    matrix = _to_world(reading, prim)
    with np.errstate(invalid="ignore", over="ignore"):  # what is not finite then is refused with the whole mesh
        half = 0.5 * float(size) * _thickening(np.abs(float(size)) * np.linalg.norm(matrix[:3, :3], axis=1), least)
        vertices = (half * BOX_CORNERS) @ matrix[:3, :3] + matrix[3, :3]
    if np.linalg.det(matrix[:3, :3]) < 0:
        faces = faces[:, ::-1]
    corners = np.arange(numbers.size).reshape(-1, 3)
    material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
    color, _ = _color(reading, prim, material, corners, numbers, np.arange(len(faces)) // 2)
    yield MeshPart(vertices=vertices, faces=faces, corner_color=color, flat_color=True)


def _to_world(reading: _Reading, prim: Usd.Prim) -> FloatArray:
    """(4, 4) for row vectors: position times matrix, as the library has it."""
    return np.array(UsdGeom.XformCache(reading.time).GetLocalToWorldTransform(prim), dtype=np.float64)


def _mesh_parts(reading: _Reading, prim: Usd.Prim) -> Iterator[MeshPart]:
    """The triangles of a mesh, one part per material."""
    mesh = UsdGeom.Mesh(prim)
    points = np.array(mesh.GetPointsAttr().Get(reading.time) or [], dtype=np.float64).reshape(-1, 3)
    sizes = np.array(mesh.GetFaceVertexCountsAttr().Get(reading.time) or [], dtype=np.int64)
    numbers = np.array(mesh.GetFaceVertexIndicesAttr().Get(reading.time) or [], dtype=np.int64)
    if sizes.sum() != numbers.size or (sizes < 0).any():
        raise ValueError(f"faces of {sizes.sum()} corners, but {numbers.size} corner numbers")
    matrix = _to_world(reading, prim)
    with np.errstate(invalid="ignore", over="ignore"):  # what is not finite then is refused with the whole mesh
        vertices = points @ matrix[:3, :3] + matrix[3, :3]
    if numbers.size and (numbers.min() < 0 or numbers.max() >= points.shape[0]):
        raise ValueError(f"a corner number {numbers.max()} among {points.shape[0]} points")
    corners, polygon = polygon_triangles(points, numbers, sizes)
    holes = np.array(mesh.GetHoleIndicesAttr().Get(reading.time) or [], dtype=np.int64)
    corners, polygon = (rows[~np.isin(polygon, holes)] for rows in (corners, polygon))
    left_handed = mesh.GetOrientationAttr().Get(reading.time) == UsdGeom.Tokens.leftHanded
    if left_handed != bool(np.linalg.det(matrix[:3, :3]) < 0):
        corners = corners[:, ::-1]
    for material, chosen in _materials(prim, polygon, sizes.size):
        texture = _texture(material)
        image = -1 if texture is None else _image_number(reading, texture)
        uv = None
        if texture is not None and image >= 0:
            uv = _uv(reading, prim, texture, image, corners, numbers, polygon)
        color, flat = None, False
        if uv is None:
            color, flat = _color(reading, prim, material, corners, numbers, polygon, textured=texture is not None)
        yield MeshPart(
            vertices=vertices,
            faces=numbers[corners][chosen],
            image=image if uv is not None else -1,
            corner_uv=None if uv is None else uv[chosen],
            corner_color=None if color is None else color[chosen],
            flat_color=flat,
        )


def _materials(prim: Usd.Prim, polygon: IntArray, count: int) -> Iterator[tuple[UsdShade.Material | None, IntArray]]:
    """Materials of a mesh, each with the triangles that have it."""
    left = np.ones(count, dtype=np.bool_)
    for subset in UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
        polygons = np.array(subset.GetIndicesAttr().Get() or [], dtype=np.int64)
        polygons = polygons[(polygons >= 0) & (polygons < count)]
        mine = np.zeros(count, dtype=np.bool_)
        mine[polygons] = True
        mine &= left
        left &= ~mine
        yield UsdShade.MaterialBindingAPI(subset.GetPrim()).ComputeBoundMaterial()[0], np.flatnonzero(mine[polygon])
    if left.any():
        yield UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0], np.flatnonzero(left[polygon])


def _surface_input(material: UsdShade.Material | None) -> UsdShade.Input | None:
    """The diffuse colour input of a material's preview surface."""
    if not material:
        return None
    shader = material.ComputeSurfaceSource()[0]
    return shader.GetInput("diffuseColor") if shader else None


def _producer(shader_input: UsdShade.Input | None) -> Usd.Attribute | None:
    """The attribute that gives an input its value, through any number of connections."""
    if not shader_input:
        return None
    attributes = shader_input.GetValueProducingAttributes()
    return attributes[0] if attributes else None


def _value(shader: UsdShade.Shader, name: str, default: Any) -> Any:
    attribute = _producer(shader.GetInput(name))
    value = attribute.Get() if attribute else None
    return default if value is None else value


def _texture(material: UsdShade.Material | None) -> _Texture | None:
    attribute = _producer(_surface_input(material))
    shader = UsdShade.Shader(attribute.GetPrim()) if attribute else None
    if not shader or shader.GetIdAttr().Get() != "UsdUVTexture":
        return None
    asset = _value(shader, "file", None)
    if asset is None:
        return None
    factor, bias = (_value(shader, name, (usual,) * 4) for name, usual in (("scale", 1.0), ("bias", 0.0)))
    light = _OfPicture(
        factor=_color_of(factor), bias=_color_of(bias), raw=str(_value(shader, "sourceColorSpace", "auto")) == "raw"
    )
    wraps = tuple(_WRAPS.get(str(_value(shader, name, "")), "repeat") for name in ("wrapS", "wrapT"))
    coordinates = _producer(shader.GetInput("st"))
    reader = UsdShade.Shader(coordinates.GetPrim()) if coordinates else None
    scale, rotation, translation = (1.0, 1.0), 0.0, (0.0, 0.0)
    if reader and reader.GetIdAttr().Get() == "UsdTransform2d":
        scale, rotation = _value(reader, "scale", scale), _value(reader, "rotation", rotation)
        translation = _value(reader, "translation", translation)
        inner = _producer(reader.GetInput("in"))
        reader = UsdShade.Shader(inner.GetPrim()) if inner else None
    return _Texture(
        asset=asset,
        light=light,
        wraps=cast("Wraps", wraps),
        primvar=str(_value(reader, "varname", "")) or None if reader else None,
        scale=(float(scale[0]), float(scale[1])),
        rotation_deg=float(rotation),
        translation=(float(translation[0]), float(translation[1])),
    )


def _color_of(values: Iterable[float]) -> tuple[float, float, float]:
    red, green, blue, *_ = (float(value) for value in values)
    return red, green, blue


def _image_number(reading: _Reading, texture: _Texture) -> int:
    key = (texture.asset.resolvedPath or texture.asset.path, texture.light, texture.wraps)
    if key not in reading.numbers:
        image = _image(reading, texture.asset)
        if image is None:
            reading.missing[texture.asset.path] = None
            return -1
        reading.numbers[key] = len(reading.images)
        reading.images.append(with_mirror_image(texture.light.of(image), texture.wraps))
        check_texture_total(tuple(reading.images), name=reading.path.name)
    return reading.numbers[key]


def _image(reading: _Reading, asset: Sdf.AssetPath) -> ByteArray | None:
    """Decode a texture, from the package if there is one, else from the scan's folder."""
    package = _IN_PACKAGE.match(asset.resolvedPath)
    if package is None:
        return reading.folder.read_image(asset.path)
    if Path(package["package"]).resolve() != reading.path.resolve():
        raise ValueError(f"a texture in another package, {asset.path[:200]!r}")
    with zipfile.ZipFile(reading.path) as archive:
        data = archive.read(package["name"])
    return decode_image(data, name=f"texture '{package['name']}' of {reading.path.name}")


def _uv(
    reading: _Reading,
    prim: Usd.Prim,
    texture: _Texture,
    image: int,
    corners: IntArray,
    numbers: IntArray,
    polygon: IntArray,
) -> FloatArray | None:
    """(triangle, 3, 2) coordinates in an image of the reading, v up as in USD; None where the mesh has none."""
    names = (texture.primvar, *_UV_NAMES) if texture.primvar else _UV_NAMES
    for name in names:
        uv = _primvar(reading, prim, name, corners, numbers, polygon)
        if uv is not None and uv.shape[-1] == 2:
            angle = np.deg2rad(texture.rotation_deg)
            turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
            uv = _upside_down((uv * texture.scale) @ turn + texture.translation)
            return _upside_down(wrapped(uv, reading.images[image], texture.wraps))
    return None


def _upside_down(uv: FloatArray) -> FloatArray:
    """(..., 2) coordinates with v the other way."""
    return np.asarray(np.stack([uv[..., 0], 1.0 - uv[..., 1]], axis=-1), dtype=np.float64)


def _color(
    reading: _Reading,
    prim: Usd.Prim,
    material: UsdShade.Material | None,
    corners: IntArray,
    numbers: IntArray,
    polygon: IntArray,
    *,
    textured: bool = False,
) -> tuple[FloatArray | None, bool]:
    """(triangle, 3, 3) sRGB-encoded colours where there is no texture, and whether they are one material's.

    They are those of the variable that the material reads, or else the mesh's own display colour (both linear). Where
    that is one colour for all, and the material has one, too, the material's is shown.
    """
    shown = None
    for name in (_color_variable(material), "displayColor"):
        if name is not None and shown is None:
            values = _primvar(reading, prim, name, corners, numbers, polygon)
            shown = None if values is None or values.shape[-1] != 3 else encode_srgb(values)
    if textured or (shown is not None and (shown != shown[:1, :1]).any()):
        return shown, False
    flat = _flat_color(material, corners.shape[0])
    return (shown, False) if flat is None else (flat, True)


def _color_variable(material: UsdShade.Material | None) -> str | None:
    """Name of the mesh's variable that a material takes its diffuse colour from."""
    attribute = _producer(_surface_input(material))
    shader = UsdShade.Shader(attribute.GetPrim()) if attribute else None
    if not shader or not str(shader.GetIdAttr().Get()).startswith("UsdPrimvarReader"):
        return None
    return str(_value(shader, "varname", "")) or None


def _flat_color(material: UsdShade.Material | None, count: int) -> FloatArray | None:
    attribute = _producer(_surface_input(material))
    value = attribute.Get() if attribute else None
    if value is None or len(value) != 3:
        return None
    return np.broadcast_to(encode_srgb(np.array(value, dtype=np.float64)), (count, 3, 3))


def _primvar(
    reading: _Reading, prim: Usd.Prim, name: str, corners: IntArray, numbers: IntArray, polygon: IntArray
) -> FloatArray | None:
    """(triangle, 3, columns) values of a mesh's variable at the triangles' corners; None where it has no such one."""
    primvar = UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
    if not primvar or not primvar.HasValue():
        return None
    values = np.array(primvar.ComputeFlattened(reading.time), dtype=np.float64)
    if values.ndim != 2 or values.shape[0] == 0:
        return None
    places = {
        UsdGeom.Tokens.faceVarying: corners,
        UsdGeom.Tokens.vertex: numbers[corners],
        UsdGeom.Tokens.varying: numbers[corners],
        UsdGeom.Tokens.uniform: np.repeat(polygon[:, np.newaxis], 3, axis=1),
        UsdGeom.Tokens.constant: np.zeros_like(corners),
    }.get(primvar.GetInterpolation())
    if places is None or (places.size and places.max() >= values.shape[0]):
        raise ValueError(f"{values.shape[0]} values of '{name}', fewer than the mesh needs")
    return np.asarray(values[places], dtype=np.float64)
