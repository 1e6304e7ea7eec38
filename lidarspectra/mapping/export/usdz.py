"""The lit room as USDZ, which the AR viewer of iPhones and iPads opens; by the extra 'usd'.

Imported only where such a file is written.

References
----------
Pixar, "UsdPreviewSurface Specification" and "UsdGeomMesh" (OpenUSD documentation); Apple, "USDZ File Format
Specification".
"""

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdUtils, Vt

from lidarspectra.errors import MapError
from lidarspectra.io.files import write_whole, writing
from lidarspectra.mapping.export.lit_room import TexturedMesh

ROOT = "/Room"


def save_usdz(meshes: Sequence[TexturedMesh], path: Path) -> Path:
    """Write the meshes as one USDZ package; raises MapError if it cannot be written."""
    with writing(path.parent, error=MapError), tempfile.TemporaryDirectory() as folder:
        inner, package = Path(folder, "room.usdc"), Path(folder, "room.usdz")
        stage = Usd.Stage.CreateNew(str(inner))
        UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
        UsdGeom.SetStageMetersPerUnit(stage, 1.0)
        stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, ROOT).GetPrim())
        for mesh in meshes:
            Path(folder, f"{mesh.name}.png").write_bytes(mesh.png())
            _add(stage, mesh)
        stage.GetRootLayer().Save()
        if not UsdUtils.CreateNewUsdzPackage(Sdf.AssetPath(str(inner)), str(package)):
            raise MapError(expected="a USDZ package", found="none from usd-core", where=str(path))
        write_whole(path, package.read_bytes())
    return path


def _add(stage: Usd.Stage, mesh: TexturedMesh) -> None:
    """A mesh with its material, under the root."""
    shape = UsdGeom.Mesh.Define(stage, f"{ROOT}/{mesh.name}")
    shape.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(mesh.vertices.astype(np.float32)))
    shape.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(mesh.faces.shape[0], 3, dtype=np.int32)))
    shape.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(mesh.faces.ravel().astype(np.int32)))
    shape.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    shape.CreateDoubleSidedAttr(mesh.shines)
    low, high = mesh.vertices.min(axis=0).tolist(), mesh.vertices.max(axis=0).tolist()
    shape.CreateExtentAttr([Gf.Vec3f(*low), Gf.Vec3f(*high)])
    places = UsdGeom.PrimvarsAPI(shape).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
    places.Set(Vt.Vec2fArray.FromNumpy(mesh.places.astype(np.float32)))
    UsdShade.MaterialBindingAPI.Apply(shape.GetPrim()).Bind(_material(stage, mesh))


def _material(stage: Usd.Stage, mesh: TexturedMesh) -> UsdShade.Material:
    path = f"{ROOT}/{mesh.name}_material"
    material = UsdShade.Material.Define(stage, path)
    reader = UsdShade.Shader.Define(stage, f"{path}/places")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    found = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    picture = UsdShade.Shader.Define(stage, f"{path}/picture")
    picture.CreateIdAttr("UsdUVTexture")
    picture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath(f"./{mesh.name}.png"))
    picture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(found)
    for axis in ("wrapS", "wrapT"):
        picture.CreateInput(axis, Sdf.ValueTypeNames.Token).Set("clamp")
    color = picture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
    surface = UsdShade.Shader.Define(stage, f"{path}/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(1.0)
    shown = "emissiveColor" if mesh.shines else "diffuseColor"
    surface.CreateInput(shown, Sdf.ValueTypeNames.Color3f).ConnectToSource(color)
    if mesh.shines:
        surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(0.0))
    material.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", Sdf.ValueTypeNames.Token))
    return material
