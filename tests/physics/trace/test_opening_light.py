"""An open scan: a box with a side removed against the box whole, whose map must lie within what is stated."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import shape_of
from lidarspectra.mapping.maps.spectral_map import LampChange, relight, spectral_map
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.radiance.sampling.opening_light import opening_light
from lidarspectra.radiance.sampling.stated_error import opening_in_words
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.sampling.transport import load_transport, save_transport, with_opening
from lidarspectra.radiance.scene.scene import RadianceScene, write_scene
from lidarspectra.room.closing import close_room
from lidarspectra.room.room import Room, find_room
from lidarspectra.room.sensor_points import SensorPoints
from research.virtual_rooms.boxes import box_room

from .conftest import BANDS, flat

SIZE_M = (5.0, 3.0, 2.5)
WALLS = 0.6
TRUE_WALLS = (0.0, 0.65, 0.8)
NOISE = 0.03  # [1] of the mean: three standard errors of the two traces


def grey(value: float) -> Material:
    return Material(
        name="grey", category="test", reflectance=flat(value), source="test", provenance="modelled", confidence=1.0,
        measured_range_nm=(380.0, 780.0), color=(0.5, 0.5, 0.5),
    )  # fmt: skip


def materials(scan: Scan, side: float) -> MaterialMap:
    """Walls, floor and ceiling of one grey, and what stands at the open side of another."""
    at_side = scan.appearance.of_kind("closed side") | (scan.centers[:, 0] > SIZE_M[0] - 1e-3)
    return MaterialMap(
        materials=(grey(WALLS), grey(side)),
        face_material=at_side.astype(np.int64),
        face_color=np.full((len(scan.faces), 3), 0.5),
        face_seen=np.ones(len(scan.faces)),
    )


PANEL = Lamp(
    name="panel",
    shape=shape_of("panel", (0.6, 0.6)),
    center=np.array([2.5, 1.5, 2.45]),
    normal=np.array([0.0, 0.0, -1.0]),
    flux=flat(1.0),
)
POINTS = SensorPoints(positions=np.array([[x, y, 0.4] for x in (0.5, 2.0, 3.5, 4.6) for y in (0.6, 1.5, 2.4)]))


@pytest.fixture
def traced(tmp_path: Path) -> Callable[[Scan, float], tuple[RadianceScene, np.ndarray]]:
    """Write a scan as a scene and trace it: the scene and (point,) coefficients."""

    def made(scan: Scan, side: float) -> tuple[RadianceScene, np.ndarray]:
        scene = write_scene(scan, materials(scan, side), [PANEL], BANDS, tmp_path / f"{len(scan.faces)}-{side}")
        transport = trace(scene, POINTS, noise="standard", seed=1)
        return scene, transport["coefficient"].to_numpy()[0].mean(axis=1)

    return made


@pytest.fixture
def opened() -> tuple[Scan, Room]:
    scan = box_room(SIZE_M, leave_out=("east",))
    return scan, find_room(scan)


@pytest.mark.chance("the points of four traces are held to their noise, whose tails are long in a dark room")
def test_the_true_map_of_an_open_room_lies_between_dark_and_what_is_stated(traced, opened) -> None:
    scan, room = opened
    scene, dark = traced(scan, 0.0)
    stated = opening_light(scene, scan, room, materials(scan, 0.0), POINTS, seed=1)
    assert not stated.closed
    bright = dark + stated.coefficient[0].mean(axis=1)
    whole = box_room(SIZE_M)
    effects = []
    for side in TRUE_WALLS:
        _, truth = traced(whole, side)
        assert (truth > dark - NOISE * dark.mean()).all()
        assert (truth < bright + NOISE * dark.mean()).all()
        effects.append(truth.mean() - dark.mean())
    assert effects[0] == pytest.approx(0.0, abs=NOISE * float(dark.mean()))
    # Not so wide that it says nothing: a wall of .8 is nearly what is stated for one of .85.
    assert bright.mean() - dark.mean() < 1.6 * effects[-1]


def test_light_by_way_of_default_walls_is_what_goes_with_them(traced, opened) -> None:
    scan, room = opened
    _, dark = traced(scan, 0.0)
    closed, _ = close_room(scan, room, sides=True)
    scene, lit = traced(closed, 0.65)
    stated = opening_light(scene, closed, room, materials(closed, 0.65), POINTS, seed=1)
    assert stated.closed
    # The integrating sphere's even share stands for a room that is not one.
    assert stated.coefficient[0].mean() == pytest.approx(lit.mean() - dark.mean(), rel=0.4)
    _, truth = traced(box_room(SIZE_M), 0.65)
    assert np.abs(truth - lit).max() < 0.05 * truth.mean() + stated.coefficient[0].max()


def test_the_share_of_a_sensor_s_view_is_the_form_factor_of_the_opening(traced, opened) -> None:
    scan, room = opened
    scene, _ = traced(scan, 0.0)
    facing = SensorPoints(positions=np.array([[4.999, 1.5, 1.25], [2.5, 1.5, 0.4]]), normals=np.array([1.0, 0.0, 0.0]))
    light = opening_light(scene, scan, room, materials(scan, 0.0), facing, seed=1)
    assert light.share[0] == pytest.approx(1.0, abs=0.01), "at the opening, looking out"
    away = replace(facing, normals=np.array([-1.0, 0.0, 0.0]))
    assert opening_light(scene, scan, room, materials(scan, 0.0), away, seed=1).share.max() < 0.01


def test_a_whole_room_has_none(traced) -> None:
    whole = box_room(SIZE_M)
    scene, _ = traced(whole, WALLS)
    light = opening_light(scene, whole, find_room(whole), materials(whole, WALLS), POINTS, seed=1)
    assert light.share.max() < 0.01
    assert not light.coefficient.any()


def test_the_stated_part_goes_with_the_lamps_through_file_map_and_relighting(traced, opened, tmp_path: Path) -> None:
    scan, _ = opened
    scene, _ = traced(scan, 0.0)
    transport = trace(scene, POINTS, noise="draft", seed=1)
    part = 0.1 * transport["coefficient"].to_numpy().astype(np.float64)
    transport = with_opening(transport, share=np.full(len(POINTS), 0.2), coefficient=part, closed=False)
    save_transport(transport, tmp_path / "t.nc")
    back = load_transport(tmp_path / "t.nc")
    light = spectral_map(back)
    assert light["opening"].to_numpy() == pytest.approx(0.1 * light["irradiance"].to_numpy(), rel=1e-5)
    assert light.attrs["opening_share"] == pytest.approx(0.1, rel=1e-5)
    assert "20.0 % of what the sensors see leaves the scan" in (opening_in_words(light.attrs) or "")
    dimmed = relight(back, {"panel": LampChange(dim=0.5)})
    assert dimmed["opening"].to_numpy() == pytest.approx(0.5 * light["opening"].to_numpy(), rel=1e-5)
    assert dimmed.attrs["opening_share"] == pytest.approx(0.1, rel=1e-5)
