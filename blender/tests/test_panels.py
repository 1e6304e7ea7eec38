"""The sidebar draws what there is: every property, operator and icon that it names exists, in every state."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import pytest

from blender.tests.made_room import module

ICONS = set(bpy.types.UILayout.bl_rna.functions["label"].parameters["icon"].enum_items.keys())


class Layout:
    """Stands in for Blender's layout, which is not drawn without a window; it checks and notes what it is told."""

    def __init__(self, told: list[str]) -> None:
        self.told = told

    def _part(self, **_: Any) -> "Layout":
        return Layout(self.told)

    row = column = box = _part

    def label(self, text: str, icon: str = "NONE") -> None:
        assert icon in ICONS
        self.told.append(text)

    def prop(self, data: Any, name: str, *, text: str | None = None, **_: Any) -> None:
        shown = data.bl_rna.properties[name].name if text is None else text
        value = getattr(data, name)
        self.told.append(f"{shown}: {value}")

    def operator(self, name: str, *, text: str | None = None, icon: str = "NONE") -> Any:
        assert icon in ICONS, icon
        kind, _, rest = name.partition(".")
        rna = getattr(getattr(bpy.ops, kind), rest).get_rna_type()
        self.told.append(rna.name if text is None else text)
        return SimpleNamespace(**dict.fromkeys(rna.properties.keys()))

    def operator_menu_enum(self, name: str, prop: str, *, text: str | None = None, icon: str = "NONE") -> None:
        assert hasattr(self.operator(name, text=text, icon=icon), prop)

    def progress(self, *, factor: float, text: str) -> None:
        assert 0.0 <= factor <= 1.0
        self.told.append(text)

    def template_list(self, kind: str, _: str, data: Any, name: str, active: Any, active_name: str, rows: int) -> None:
        assert hasattr(bpy.types, kind)
        self.told.append(f"{len(getattr(data, name))} rows, {getattr(active, active_name)} active")


def drawn() -> list[str]:
    """What all panels say."""
    told: list[str] = []
    for panel in module("panels").CLASSES:
        stand_in = SimpleNamespace(layout=Layout(told))
        if hasattr(panel, "_active"):
            stand_in._active = panel._active.__get__(stand_in)
        panel.draw(stand_in, bpy.context)
    return told


def test_an_empty_scene_says_what_can_be_done(scene) -> None:
    told = drawn()
    assert "Import scan" in told
    assert "Write and run" in told
    assert "No run is loaded." in told


def test_a_loaded_run_says_its_light(scene, write_light) -> None:
    bpy.ops.lidarspectra.load_run(filepath=str(write_light()))
    assert "illuminance: 0.0" in drawn()
    assert "mean 133.3 lx" in drawn()  # of 120, 200 and 80; the fourth is buried
    assert "80 to 200, U0 0.60" in drawn()
    scene.lidarspectra.slide = 1.0
    assert "spectral irradiance, 560 nm: 1.0" in drawn()
    assert any(line.startswith("mean 1 mW/m²/nm") for line in drawn())
    assert "west: 0.5" in drawn()
    assert "Take found lamps over" in drawn()


@pytest.mark.parametrize("shape", ["panel", "disc", "strip", "bulb", "spot", "point", "ies", "window"])
def test_every_lamp_has_its_settings(scene, shape: str) -> None:
    bpy.ops.lidarspectra.add_lamp(shape=shape)
    told = drawn()
    assert "Lumens: " in " ".join(told)
    assert ("Width: " in " ".join(told)) == (shape in ("panel", "strip", "window", "ies"))
    assert ("Beam angle: " in " ".join(told)) == (shape == "spot")
    for other in ("disc", "spot", "panel", shape):  # a light of another kind is another class in Blender
        bpy.ops.lidarspectra.shape(shape=other)
        drawn()
    assert bpy.context.object.lidarspectra.shape == shape


def test_sensors_and_materials_have_theirs(scene, write_light) -> None:
    bpy.ops.lidarspectra.load_run(filepath=str(write_light()))
    bpy.context.view_layer.objects.active = bpy.data.objects["Room"]
    assert "2 rows, 0 active" in drawn()
    scene.lidarspectra.sensors = "POINTS"
    assert "Grid on selected faces" in drawn()
    scene.lidarspectra.sensors, scene.lidarspectra.grid_by_count = "GRID", True
    assert "Points: 176" in drawn()


def test_found_lamps_are_taken_into_the_run_file_and_not_dropped_in_silence(scene, write_light, tmp_path: Path) -> None:
    run_file = tmp_path / "a.toml"
    run_file.write_text('[scan]\nfile = "a.glb"\n\n[lamps_from_scan]\nspectrum = "LED-B1"\n', encoding="utf-8")
    bpy.ops.lidarspectra.open_run_file(filepath=str(run_file), with_scan=False)
    bpy.ops.lidarspectra.load_run(filepath=str(write_light()))
    bpy.ops.lidarspectra.write_run_file(filepath=str(run_file))
    assert "[lamps_from_scan]" in run_file.read_text(encoding="utf-8")
    bpy.ops.lidarspectra.add_lamp(shape="bulb")
    with pytest.raises(RuntimeError, match="Take the found ones"):
        bpy.ops.lidarspectra.write_run_file(filepath=str(run_file))
    assert bpy.ops.lidarspectra.adopt() == {"FINISHED"}
    bpy.ops.lidarspectra.write_run_file(filepath=str(run_file))
    text = run_file.read_text(encoding="utf-8")
    assert "[lamps_from_scan]" not in text
    assert text.count('spectrum = "LED-B1"') == 2
    assert text.count("[[lamps]]") == 3
