"""Models of rooms as phones export them: boxes with names, as USDZ (RoomPlan) and as GLB (room modes of apps)."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh

from lidarspectra.arrays import FloatArray

WALL_M = 1e-4  # [m] RoomPlan's walls are so thin
INSET_M = 5e-4  # [m] and so its doors and windows
WHITE = (1.0, 1.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class ModelPart:
    """A box of the model.

    Parameters
    ----------
    name : str
        As RoomPlan writes it: 'Wall0', 'Door2', 'Table1'.
    center, size : (3,) float
        z up; the size before it is turned. [m]
    turn_deg : float
        About the vertical, counter-clockwise seen from above.
    """

    name: str
    center: tuple[float, float, float]
    size: tuple[float, float, float]
    turn_deg: float = 0.0


def empty_room(
    length_m: float, width_m: float, height_m: float, *, leave_out: Sequence[str] = ("Ceiling0",)
) -> tuple[ModelPart, ...]:
    """Floor, walls and ceiling around the box from (0, 0, 0) to (length, width, height), as thin boxes.

    Wall0 lies at y = 0, Wall1 at x = length, Wall2 at y = width, Wall3 at x = 0.
    """
    middle = (0.5 * length_m, 0.5 * width_m, 0.5 * height_m)
    parts = (
        ModelPart(name="Wall0", center=(middle[0], 0.0, middle[2]), size=(length_m, WALL_M, height_m)),
        ModelPart(
            name="Wall1", center=(length_m, middle[1], middle[2]), size=(width_m, WALL_M, height_m), turn_deg=90.0
        ),
        ModelPart(name="Wall2", center=(middle[0], width_m, middle[2]), size=(length_m, WALL_M, height_m)),
        ModelPart(name="Wall3", center=(0.0, middle[1], middle[2]), size=(width_m, WALL_M, height_m), turn_deg=90.0),
        ModelPart(name="Floor0", center=(middle[0], middle[1], 0.0), size=(length_m, width_m, WALL_M)),
        ModelPart(name="Ceiling0", center=(middle[0], middle[1], height_m), size=(length_m, width_m, WALL_M)),
    )
    return tuple(part for part in parts if part.name not in leave_out)


def furnished_room(*, leave_out: Sequence[str] = ("Ceiling0",)) -> tuple[ModelPart, ...]:
    """A room of 5 m x 4 m x 2.6 m with a door, a window, a table, a chair and a cabinet, as RoomPlan draws it."""
    furniture = (
        ModelPart(name="Door0", center=(1.0, 0.0, 1.02), size=(0.9, INSET_M, 2.04)),
        ModelPart(name="Window0", center=(5.0, 2.0, 1.5), size=(1.6, INSET_M, 1.2), turn_deg=90.0),
        ModelPart(name="Table0", center=(2.8, 2.4, 0.37), size=(1.4, 0.7, 0.74), turn_deg=20.0),
        ModelPart(name="Chair0", center=(2.6, 1.6, 0.45), size=(0.5, 0.5, 0.9), turn_deg=20.0),
        ModelPart(name="Storage0", center=(0.31, 2.5, 0.9), size=(0.6, 1.2, 1.8)),
    )
    kept = tuple(part for part in furniture if part.name not in leave_out)
    return (*empty_room(5.0, 4.0, 2.6, leave_out=leave_out), *kept)


def write_roomplan(path: Path, parts: Iterable[ModelPart]) -> None:
    """Write boxes as a USDZ of `Cube` prims with transforms, y up, each bound to a flat white material.

    As in RoomPlan's own files, walls have groups of their own and no prim says that it has materials, of which the
    USD library warns once a prim.

    Parameters
    ----------
    path : Path
        Ending in .usdz.
    parts : iterable of ModelPart
    """
    # Imported where it is needed: its library is an extra.
    from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdUtils

    inner = path.with_suffix(".usda")
    stage = Usd.Stage.CreateNew(str(inner))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(stage.DefinePrim("/Room", "Xform"))
    for part in parts:
        group = "Arch_grp" if part.name.startswith(("Wall", "Door", "Window")) else "Object_grp"
        place = f"/Room/Parametric_grp/{group}/{part.name}_grp/{part.name}"
        cube = UsdGeom.Cube.Define(stage, place)
        cube.CreateSizeAttr(1.0)
        x, y, z = part.center
        cube.AddTranslateOp().Set(Gf.Vec3d(x, z, -y))
        cube.AddRotateYOp().Set(part.turn_deg)
        cube.AddScaleOp().Set(Gf.Vec3f(part.size[0], part.size[2], part.size[1]))
        material = UsdShade.Material.Define(stage, f"{place}_color")
        shader = UsdShade.Shader.Define(stage, f"{place}_color/surfaceShader")
        shader.CreateIdAttr("UsdPreviewSurface")
        shader.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(WHITE)
        material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
        cube.GetPrim().CreateRelationship("material:binding").SetTargets([material.GetPath()])
    stage.Save()
    if not UsdUtils.CreateNewUsdzPackage(str(inner), str(path)):
        raise OSError(f"the USD library could not write {path}")
    inner.unlink()


def write_named_glb(path: Path, parts: Iterable[ModelPart]) -> None:
    """Write boxes as a GLB with one named node each and a flat colour, as the room modes of scanning apps do."""
    scene = trimesh.Scene()
    for part in parts:
        box = trimesh.creation.box(extents=part.size)
        box.apply_transform(_placed(part))
        box.vertices = box.vertices[:, [0, 2, 1]] * [1.0, 1.0, -1.0]  # glTF 2.0, 3.4: +Y is up
        box.visual = trimesh.visual.TextureVisuals(  # type: ignore[no-untyped-call]
            material=trimesh.visual.material.PBRMaterial(baseColorFactor=[*WHITE, 1.0])  # type: ignore[no-untyped-call]
        )
        scene.add_geometry(box, node_name=part.name, geom_name=part.name)
    path.write_bytes(trimesh.exchange.gltf.export_glb(scene))  # type: ignore[no-untyped-call]


def _placed(part: ModelPart) -> FloatArray:
    """(4, 4) transform of a part's box to its place."""
    angle = np.radians(part.turn_deg)
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    matrix[:3, 3] = part.center
    return matrix
