"""The exact text of a small scene: what Radiance is told, to the letter."""

from pathlib import Path

import numpy as np
import pytest

from lidarspectra.geometry.scan import Appearance, Scan, ScanRecord
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Panel, Spot
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.radiance.scene.scene import RadianceScene, write_scene
from lidarspectra.spectra.spectrum import Spectrum, uniform_bands

FLAT = Spectrum(wavelengths_nm=[300.0, 1000.0], values=[1.0, 1.0])
BLUE = Spectrum(wavelengths_nm=[300.0, 475.0, 480.0], values=[2.0, 2.0, 0.0])


def material(name: str, reflectance: float, **settings: float | str) -> Material:
    return Material(
        name=name,
        category="unknown",
        reflectance=FLAT.scaled(reflectance),
        source="default",
        provenance="default",
        confidence=1.0,
        measured_range_nm=(300, 1000),
        color=(0.5, 0.5, 0.5),
        **settings,
    )


def small_scene(folder: Path, mode: str) -> RadianceScene:
    """A floor of two triangles, two materials, a panel, and a blue spot; bands 400-450 ... 550-600 nm."""
    scan = Scan(
        vertices=np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]),
        faces=np.array([[0, 1, 2], [0, 2, 3]]),
        appearance=Appearance(
            images=(), face_image=[-1, -1], corner_uv=np.zeros((2, 3, 2)), corner_color=np.full((2, 3, 3), 0.5)
        ),
        record=ScanRecord(
            file="f", unit="m", unit_confidence=1, up_axis="+z", up_confidence=1, faces_read=2, faces_kept=2
        ),
    )
    materials = MaterialMap(
        materials=(material("carpet", 0.25), material("tile", 0.5, specularity=0.04)),
        face_material=[0, 1],
        face_color=np.full((2, 3), 0.5),
        face_seen=np.ones(2),
    )
    down = np.array([0.0, 0.0, -1.0])
    lamps = [
        Lamp(name="panel", shape=Panel(0.5, 0.5), center=np.array([0.5, 0.5, 2.0]), normal=down, flux=FLAT),
        Lamp(
            name="spot", shape=Spot(0.1, beam_angle_deg=60.0), center=np.array([0.0, 0.0, 2.0]), normal=down,
            flux=BLUE,
        ),
    ]  # fmt: skip
    return write_scene(scan, materials, lamps, uniform_bands(400, 600, 4), folder, mode=mode)


SHARE = "max(1-((Px-A1)^2+(Py-A2)^2+(Pz-A3)^2)/A4,0)"
EVENLY = f"A5+A6*{SHARE}^A7+A8*{SHARE}^A9"  # shadow rays to a circle, see `lamp_text.SHADOW_RAY_WEIGHT`


def texts(scene: RadianceScene, *names: str) -> str:
    return "".join((scene.folder / name).read_text(encoding="utf-8") for name in names)


def test_a_panel_is_a_polygon_and_a_spot_a_ring(tmp_path: Path) -> None:
    assert texts(small_scene(tmp_path, "native"), "lamps.rad") == (
        "lamp0 polygon lamp0_shape\n0\n0\n12 0.25 0.75 2\n0.75 0.75 2\n0.75 0.25 2\n0.25 0.25 2\n"
        "lamp1 ring lamp1_shape\n0\n0\n8 0 0 2 0 0 -1 0 0.05\n"
    )


def test_native_passes_light_one_group_each_and_hide_the_other(tmp_path: Path) -> None:
    scene = small_scene(tmp_path, "native")
    assert texts(scene, "pass0.rad") == (
        "void spectrum lamp0_slots\n0\n0\n6 430 730 1273239.54 1273239.54 1273239.54 1273239.54\n"
        "lamp0_slots light lamp0\n0\n0\n3 1 1 1\n"
        "void plastic lamp1\n0\n0\n5 0 0 0 0 0\n"
        "void mesh room\n1 ./pass0_room.rtm\n0\n0\n"
    )
    # In µW. The spot: n = ln .5 / ln cos 30 = 4.8188; L = Φ (n + 1)/(2πA); a dark band is lifted to 1e-6 of the peak.
    assert texts(scene, "pass1.rad") == (
        "void plastic lamp0\n0\n0\n5 0 0 0 0 0\n"
        "void brightfunc lamp1_beam\n2 if(Rdot,Rdot^A1,0) .\n0\n1 3.81884168\n"
        "lamp1_beam spectrum lamp1_seen_slots\n0\n0\n6 430 730 235828771 129705824 235.828771 235.828771\n"
        "lamp1_seen_slots light lamp1_seen\n0\n0\n3 1 1 1\n"
        "lamp1_beam brightfunc lamp1_evenly\n2 " + EVENLY + " .\n0\n"
        "9 0 0 2 0.0025 0.11145837 0.55139723 0.4512956 0.61041684 0.1142228\n"
        "lamp1_evenly spectrum lamp1_slots\n0\n0\n6 430 730 235828771 129705824 235.828771 235.828771\n"
        "lamp1_slots illum lamp1\n1 lamp1_seen\n0\n3 1 1 1\n"
        "void mesh room\n1 ./pass1_room.rtm\n0\n0\n"
    )


def test_materials_have_all_slots_and_compensated_gloss(tmp_path: Path) -> None:
    assert texts(small_scene(tmp_path, "native"), "pass0_materials.rad") == (
        "void spectrum m0_slots\n0\n0\n6 430 730 0.25 0.25 0.25 0.25\n"
        "m0_slots plastic m0\n0\n0\n5 1 1 1 0 0\n"
        "void spectrum m1_slots\n0\n0\n6 430 730 0.479166667 0.479166667 0.479166667 0.479166667\n"
        "m1_slots plastic m1\n0\n0\n5 1 1 1 0.04 0.05\n"
    )


def test_rgb_passes_carry_three_slots_as_colours(tmp_path: Path) -> None:
    scene = small_scene(tmp_path, "rgb")
    assert [(scene_pass.lamps, scene_pass.slots) for scene_pass in scene.passes] == [
        ((0,), (0, 1)), ((0,), (2, 3)), ((1,), (0, 1)), ((1,), (2, 3)),
    ]  # fmt: skip
    assert texts(scene, "pass2.rad") == (
        "void plastic lamp0\n0\n0\n5 0 0 0 0 0\n"
        "void brightfunc lamp1_beam\n2 if(Rdot,Rdot^A1,0) .\n0\n1 3.81884168\n"
        "lamp1_beam light lamp1_seen\n0\n0\n3 129705824 129705824 235828771\n"
        "lamp1_beam brightfunc lamp1_evenly\n2 " + EVENLY + " .\n0\n"
        "9 0 0 2 0.0025 0.11145837 0.55139723 0.4512956 0.61041684 0.1142228\n"
        "lamp1_evenly illum lamp1\n1 lamp1_seen\n0\n3 129705824 129705824 235828771\n"
        "void mesh room\n1 ./pass2_room.rtm\n0\n0\n"
    )
    assert texts(scene, "pass0_materials.rad") == (
        "void plastic m0\n0\n0\n5 0.25 0.25 0.25 0 0\n"
        "void plastic m1\n0\n0\n5 0.479166667 0.479166667 0.479166667 0.04 0.05\n"
    )


@pytest.mark.parametrize("mode", ["native", "rgb"])
def test_the_mesh_is_the_same_in_every_mode(tmp_path: Path, mode: str) -> None:
    assert texts(small_scene(tmp_path, mode), "room.obj") == (
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvn 0 0 1\nusemtl m0\nf 1//1 2//1 3//1\nusemtl m1\nf 1//1 3//1 4//1\n"
    )
