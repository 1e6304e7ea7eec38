"""Take the pictures of docs/howto-blender.md: .venv-blender-4.5.1/bin/python blender/pictures.py ROOM.npz FOLDER.

ROOM.npz is what `lidarspectra export lidarspectra-demo/room.run --blender` writes. No window and no
graphics card is needed.
"""

import os
import sys
import tempfile
from pathlib import Path
from typing import Any

os.environ["BLENDER_USER_RESOURCES"] = tempfile.mkdtemp(prefix="blender settings ")  # read when bpy is loaded
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import bpy
from mathutils import Vector

from blender.build import EXTENSION, build

EYE, SIGHT = Vector((1.55, -3.9, 4.7)), Vector((1.55, 1.1, 0.7))  # [m] outside, before the legend
INSIDE, INTO = Vector((0.35, 0.35, 1.7)), Vector((2.0, 2.3, 0.8))  # [m] in a corner of the room
WIDTH_PX, HEIGHT_PX = 720, 720
CYCLES_SIDE_PX, CYCLES_SAMPLES, CYCLES_BOUNCES = 480, 24, 4  # a minute on two cores


def camera(scene: Any, place: Vector, aim: Vector, lens_mm: float) -> None:
    """Look from a place at another [m]."""
    made = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    made.data.lens, made.data.clip_start = lens_mm, 0.02
    made.location = place
    made.rotation_euler = (aim - place).to_track_quat("-Z", "Y").to_euler()
    scene.collection.objects.link(made)
    scene.camera = made


def save(scene: Any, path: Path, engine: str = "BLENDER_WORKBENCH") -> None:
    """Render what the camera sees."""
    render = scene.render
    render.engine, render.filepath = engine, str(path)
    render.resolution_x, render.resolution_y = WIDTH_PX, HEIGHT_PX
    render.image_settings.color_mode, render.image_settings.compression = "RGB", 100
    if engine == "CYCLES":
        render.resolution_x = render.resolution_y = CYCLES_SIDE_PX
        scene.cycles.samples, scene.cycles.use_denoising = CYCLES_SAMPLES, True
        scene.cycles.max_bounces = CYCLES_BOUNCES
    bpy.ops.render.render(write_still=True)


def main(room: Path, folder: Path) -> None:
    """Install, load, and take each picture."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    zipped = build(EXTENSION, Path(tempfile.mkdtemp()))
    bpy.ops.extensions.package_install_files(filepath=str(zipped), repo="user_default", enable_on_install=True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("paper")
    scene.world.color = (1.0, 1.0, 1.0)
    bpy.ops.lidarspectra.load_run(filepath=str(room))
    camera(scene, EYE, SIGHT, 38.0)
    save(scene, folder / "blender-map.png")
    lamps = [each for each in bpy.data.objects if each.type == "LIGHT"]
    lamps[0].lidarspectra.dim = 0.2
    scene.lidarspectra.layer = 1
    bpy.ops.lidarspectra.points()
    save(scene, folder / "blender-dimmed.png")
    lamps[0].lidarspectra.dim = 1.0
    for each in bpy.data.collections["Light"].objects:
        each.hide_render = True
    scene.world.color = (0.0, 0.0, 0.0)
    scene.view_settings.exposure = 0.6
    camera(scene, INSIDE, INTO, 16.0)
    save(scene, folder / "blender-materials.png", "CYCLES")


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve())
