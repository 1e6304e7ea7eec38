"""What a loaded run shows: golden values of attributes, under any dimming."""

import bpy
import numpy as np
import pytest

from blender.tests.made_room import GREEN, SHARES, WHITE, module

SUM = np.array(SHARES).sum(axis=0)
SINGLE = 1e-6  # relative, of single precision


def values(thing, name: str, field: str = "value", width: int = 1) -> np.ndarray:
    held = thing.data.attributes[name].data
    found = np.empty(width * len(held), dtype=np.float32)
    held.foreach_get(field, found)
    return found.reshape(-1, width) if width > 1 else found


def linear(encoded):
    return ((np.asarray(encoded) + 0.055) / 1.055) ** 2.4


@pytest.fixture
def loaded(scene, write_light):
    path = write_light()
    assert bpy.ops.lidarspectra.load_run(filepath=str(path)) == {"FINISHED"}
    return scene


def test_the_room_stands_where_it_was_scanned_with_a_material_a_group(loaded) -> None:
    room = bpy.data.objects["Room"]
    assert [tuple(vertex.co) for vertex in room.data.vertices][4] == pytest.approx((0, 2, 2.5))
    assert [face.material_index for face in room.data.polygons] == [0, 0, 1]
    assert [material.name for material in room.data.materials] == ["0 green painted 1", "1 white"]
    for material, color in zip(room.data.materials, (GREEN, WHITE), strict=True):
        surface = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
        assert list(surface.inputs["Base Color"].default_value)[:3] == pytest.approx(color)
        assert list(material.diffuse_color)[:3] == pytest.approx(color)
    scanned = values(room, "scanned", "color", 4)
    assert scanned[0] == pytest.approx([0.1, 0.2, 0.3, 1.0])
    assert scanned[-1] == pytest.approx([0.9, 0.8, 0.7, 1.0])
    assert values(room, "lidarspectra_face") == pytest.approx([0, 1, 2])


def test_the_map_has_every_layer_as_an_attribute_and_the_shown_one_as_a_colour(loaded) -> None:
    shown = bpy.data.objects["Map"]
    assert values(shown, "illuminance_lx") == pytest.approx(SUM[:, 0], rel=SINGLE)
    assert values(shown, "E_560") == pytest.approx(SUM[:, 1], rel=SINGLE)
    assert shown.data.color_attributes.active_color.name == "light"
    highest = SUM[[0, 1, 3], 0].max()  # the third is buried
    share = np.clip(SUM[:, 0] / highest, 0, 1)
    encoded = np.stack([share, share, 0 * share], axis=1)  # of the scale from black to yellow
    wanted = np.where(encoded <= 0.04045, encoded / 12.92, linear(encoded))
    assert values(shown, "light", "color", 4)[:, :3] == pytest.approx(wanted, abs=1e-5)
    assert shown.data.vertices[0].co.z == pytest.approx(0.503)


def test_views_show_the_colours_as_they_are(installed, write_light) -> None:
    bpy.ops.wm.read_homefile(use_empty=False, use_factory_startup=True)  # with a window
    bpy.ops.lidarspectra.load_run(filepath=str(write_light()))
    (window,) = bpy.context.window_manager.windows
    (view,) = [area.spaces.active.shading for area in window.screen.areas if area.type == "VIEW_3D"]
    assert (view.type, view.light, view.color_type) == ("SOLID", "FLAT", "VERTEX")
    assert bpy.context.scene.view_settings.view_transform == "Standard"


def test_points_are_discs_in_the_same_colours_that_face_as_the_sensors_do(loaded) -> None:
    marks, shown = bpy.data.objects["Points"], bpy.data.objects["Map"]
    assert len(marks.data.polygons) == 4
    assert all(face.normal.z == pytest.approx(1.0) for face in marks.data.polygons)
    places = np.array([face.center[:] for face in marks.data.polygons])
    assert places[:, :2] == pytest.approx(np.array([[1, 0.5], [2, 0.5], [2, 1.5], [1, 1.5]]), abs=1e-5)
    colors = values(marks, "light", "color", 4).reshape(4, 8, 4)
    assert colors == pytest.approx(np.repeat(values(shown, "light", "color", 4)[:, None], 8, axis=1))
    assert marks.hide_render
    bpy.ops.lidarspectra.points()
    assert not marks.hide_render
    assert shown.hide_render


def test_the_slider_goes_through_quantities_and_channels_and_the_legend_says_which(loaded) -> None:
    def texts() -> list[str]:
        things = [child for child in bpy.data.objects["Legend"].children if child.type == "FONT"]
        return [thing.data.body for thing in sorted(things, key=lambda each: (-each.location.y, each.location.x))]

    settings = loaded.lidarspectra
    assert texts() == ["illuminance [lx]", "0", "50", "100", "150", "200"]
    settings.slide = 1.0
    assert settings.layer == 1
    assert texts() == ["spectral irradiance, 560 nm [mW/m²/nm]", "0", "0.5", "1"]
    bpy.ops.lidarspectra.step(by=1)
    assert settings.layer == 1  # its end
    bpy.ops.lidarspectra.step(by=-1)
    assert settings.layer == 0
    assert settings.slide == pytest.approx(0.0)
    assert texts()[0] == "illuminance [lx]"


def test_dimming_a_lamp_dims_its_share_alone_from_what_the_run_file_had(loaded) -> None:
    west, shown = bpy.data.objects["west"], bpy.data.objects["Map"]
    assert not west.lidarspectra.in_run_file or west.lidarspectra.original == ""
    before = values(shown, "light", "color", 4)
    west.lidarspectra.dim_of_run = 0.5
    west.lidarspectra.dim = 0.25  # half of what the run has
    wanted = 0.5 * np.array(SHARES)[0] + np.array(SHARES)[1]
    assert values(shown, "illuminance_lx") == pytest.approx(wanted[:, 0], rel=SINGLE)
    assert values(shown, "E_560") == pytest.approx(wanted[:, 1], rel=SINGLE)
    assert (values(shown, "light", "color", 4)[:2, 0] < before[:2, 0]).all()  # the scale is the run's
    loaded.lidarspectra.fit_scale = True
    assert values(shown, "light", "color", 4)[:, 0].max() == pytest.approx(1.0, abs=1e-5)


def test_lamps_of_the_run_are_lights_of_their_size_colour_and_power(loaded) -> None:
    west = bpy.data.objects["west"]
    assert west.data.type == "AREA"
    assert (west.data.size, west.data.size_y) == pytest.approx((0.6, 0.3))
    assert list(west.location) == pytest.approx([1.0, 1.0, 2.5])
    assert list(west.data.color) == pytest.approx([1.0, 1.0, 1.0])  # the eye is adapted to it
    assert west.data.energy / west.lidarspectra.dim == pytest.approx(1790.0 / 179.0, rel=1e-5)
    assert np.array(west.matrix_world.to_3x3())[:, 2] == pytest.approx([0, 0, 1])  # shines down, along its -z


def test_lamps_keep_their_differences_in_colour_and_their_power(loaded) -> None:
    warm, cool = [1.0, 0.6, 0.3], [0.8, 0.9, 1.0]
    lamps = [{"name": str(n), "color": color, "luminous_flux_lm": 1000.0} for n, color in enumerate((warm, cool))]
    seen = [np.array(color) for color in module("lamp_objects").adapted_colors(lamps).values()]
    assert seen[0] / seen[1] / (seen[0] / seen[1])[0] == pytest.approx(np.array(warm) / cool / (warm[0] / cool[0]))
    light = sum(color / (color @ [0.2126, 0.7152, 0.0722]) for color in seen)
    assert np.ptp(light) < 0.25 * light.mean()  # together nearly white
    (alone,) = module("lamp_objects").adapted_colors(lamps[:1]).values()
    assert alone == pytest.approx([1.0, 1.0, 1.0])


def test_a_file_that_was_saved_and_opened_again_still_dims(loaded, tmp_path) -> None:
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a room.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a room.blend"))
    east = bpy.data.objects["east"]
    east.lidarspectra.dim = 0.0
    assert values(bpy.data.objects["Map"], "illuminance_lx") == pytest.approx(np.array(SHARES)[0, :, 0], rel=SINGLE)


def test_light_that_is_gone_is_said_and_breaks_nothing(loaded) -> None:
    module("room_file").Path(loaded.lidarspectra.room_npz).unlink()
    bpy.data.objects["east"].lidarspectra.dim = 0.5
    assert "Load the run again" in loaded.lidarspectra.message


def test_loading_again_replaces_what_was_there(loaded, write_light) -> None:
    count = len(bpy.data.objects)
    bpy.ops.lidarspectra.load_run(filepath=str(write_light(shares=2 * np.array(SHARES))))
    assert len(bpy.data.objects) == count
    assert values(bpy.data.objects["Map"], "illuminance_lx") == pytest.approx(2 * SUM[:, 0], rel=SINGLE)
