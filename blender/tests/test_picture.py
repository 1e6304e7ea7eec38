"""A picture of what is shown: the colours on it are those of the scale."""

from pathlib import Path

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

SIZE_PX = 480
ONE_STEP = 2.5 / 255


def picture(scene, path: Path) -> np.ndarray:
    """(row, column, 3) sRGB of a Workbench picture, its lowest row first."""
    render = scene.render
    render.engine, render.filepath = "BLENDER_WORKBENCH", str(path)
    render.resolution_x = render.resolution_y = SIZE_PX
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    pixels = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(SIZE_PX, SIZE_PX, -1)[..., :3]


@pytest.mark.slow
def test_the_map_is_seen_from_above_in_the_colours_of_its_scale(scene, write_light, tmp_path: Path) -> None:
    bpy.ops.lidarspectra.load_run(filepath=str(write_light()))
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 4.0
    camera.location = (1.5, 1.0, 5.0)
    scene.collection.objects.link(camera)
    scene.camera = camera
    bpy.context.view_layer.update()
    seen = picture(scene, tmp_path / "a picture.png")

    def at(place: tuple[float, float, float]) -> np.ndarray:
        x, y, _ = world_to_camera_view(scene, camera, Vector(place))
        return seen[int(y * SIZE_PX), int(x * SIZE_PX)]

    # in the middle of an edge the map is half-way between its ends, in linear colours: 120 and 200 of 200 lx
    share = np.array([120.0, 200.0]) / 200.0
    middle = (((share + 0.055) / 1.055) ** 2.4).mean()
    encoded = 1.055 * middle ** (1 / 2.4) - 0.055
    assert at((1.5, 0.51, 0.503)) == pytest.approx([encoded, encoded, 0.0], abs=0.02)
    assert at((1.99, 0.51, 0.503)) == pytest.approx([1.0, 1.0, 0.0], abs=0.02)
    floor = np.array([0.1, 0.2, 0.3])  # beside the map the floor as it was scanned
    assert at((0.5, 0.2, 0.0)) == pytest.approx(1.055 * floor ** (1 / 2.4) - 0.055, abs=ONE_STEP)
    bpy.data.objects["west"].lidarspectra.dim = 0.0
    dark = picture(scene, tmp_path / "dimmed.png")
    assert dark[..., 0].sum() < seen[..., 0].sum()
