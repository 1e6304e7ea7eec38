"""A scan as objects, by Blender's own importers, in the frame of the run file: metres, z up."""

from pathlib import Path
from typing import Any

import bpy
from mathutils import Matrix

from .collections_of_scene import emptied, put
from .faults import ExtensionError
from .frames import METRES, UPRIGHT

USUAL_UP = {".glb": "+y", ".gltf": "+y", ".obj": "+y", ".ply": "+z", ".stl": "+z", ".usdz": "+y"}
AS_FILED = {"forward_axis": "Y", "up_axis": "Z"}  # these importers turn nothing then


def import_scan(scene: Any, path: Path, *, unit: str = "auto", up: str = "auto") -> list[Any]:
    """Import a scan into the collection Room.

    Parameters
    ----------
    scene : bpy.types.Scene
    path : Path
        GLB, glTF, OBJ, PLY, STL or USDZ.
    unit, up : str
        As in the run file; 'auto' takes metres and the upward axis that files of this kind usually have.

    Returns
    -------
    objects : list

    Raises
    ------
    ExtensionError
        If the file is not there, of another kind, or Blender cannot read it.
    """
    kind = path.suffix.lower()
    if kind not in USUAL_UP or not path.is_file():
        found = f"a file of kind '{kind}'" if path.is_file() else "no such file"
        raise ExtensionError(
            expected=f"a scan ({', '.join(USUAL_UP)})", found=found, where=str(path), todo="Choose another."
        )
    before = set(bpy.data.objects)
    try:
        turned_by_blender = _read(path, kind)
    except RuntimeError as cause:  # how operators report what they cannot read
        raise ExtensionError(expected="a scan that Blender reads", found=str(cause).strip(), where=str(path)) from cause
    new = [each for each in bpy.data.objects if each not in before]
    if not any(each.type == "MESH" for each in new):
        raise ExtensionError(expected="a mesh", found="none", where=str(path), todo="Choose another file.")
    axis = USUAL_UP[kind] if up == "auto" else up
    turn = Matrix(UPRIGHT[axis]).to_4x4()
    if turned_by_blender:
        turn = turn @ Matrix(UPRIGHT["+y"]).to_4x4().inverted()
    matrix = turn @ Matrix.Scale(METRES["m" if unit == "auto" else unit], 4)
    emptied(scene, "Room")
    bpy.context.view_layer.update()
    for thing in new:
        put(scene, "Room", thing)
        if thing.parent is None:
            thing.matrix_world = matrix @ thing.matrix_world
    bpy.context.view_layer.update()
    return new


def _read(path: Path, kind: str) -> bool:
    """Read a file; whether Blender has turned its y axis up to z."""
    name = str(path)
    if kind in (".glb", ".gltf"):
        bpy.ops.import_scene.gltf(filepath=name)
        return True
    if kind == ".usdz":
        bpy.ops.wm.usd_import(filepath=name)
        return True
    reader = {".obj": bpy.ops.wm.obj_import, ".ply": bpy.ops.wm.ply_import, ".stl": bpy.ops.wm.stl_import}[kind]
    reader(filepath=name, **AS_FILED)
    return False
