"""What the 3D view is given: the room as it is, no more of it than a page can carry, and no name that could be code."""

import base64
import json
from dataclasses import replace

import numpy as np
import pytest

from lidarspectra.errors import ArrayError
from lidarspectra.mapping.maps.spectral_map import spectral_map
from lidarspectra.mapping.report.room_view import FINEST_CLUSTER_M, MAX_POINTS, coarser, point_triangles, room_view_data

HOSTILE = "</script><script>alert(1)</script><!-- \x00 \u2028 ' \" {}"
KINDS = {"u1": "u1", "u2": "<u2", "u4": "<u4", "f4": "<f4"}


def _array(packed):
    return np.frombuffer(base64.b64decode(packed["data"]), dtype=KINDS[packed["type"]])


@pytest.fixture
def report(make_transport, make_report):
    return make_report(make_transport(points=25, buried=(3,)))


def _data(report):
    text = room_view_data(
        report.spectral_map, report.surfaces, report.materials, report.material_areas_m2, report.lamps
    )
    return text, json.loads(text)


def _area_from_above_m2(corners):
    first, second = (corners[:, other, :2] - corners[:, 0, :2] for other in (1, 2))
    return 0.5 * (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]).sum()


def _moved(light, **places):
    return light.assign_coords({axis: ("point", values, {"units": "m"}) for axis, values in places.items()})


def _bumpy(surfaces, side=60):
    """A sheet of many small triangles, every one of another colour."""
    axis = np.linspace(0.0, 3.0, side)
    x, y = (each.ravel() for each in np.meshgrid(axis, axis))
    vertices = np.stack([x, y, 0.01 * np.sin(20 * x)], axis=1)
    corner = np.arange(side * side).reshape(side, side)[:-1, :-1].ravel()
    faces = np.concatenate(
        [
            np.stack([corner, corner + 1, corner + side], axis=1),
            np.stack([corner + 1, corner + side + 1, corner + side], axis=1),
        ]
    )
    count = faces.shape[0]
    return replace(
        surfaces,
        vertices=vertices,
        faces=faces,
        face_material=np.arange(count) % 2,
        face_color=np.tile(np.linspace(0.0, 1.0, count)[:, None], (1, 3)),
    )


def test_every_number_of_the_map_arrives_in_the_page(report):
    _, data = _data(report)
    shape = report.spectral_map["irradiance"].shape
    for name, variable in (("irradiance", "irradiance"), ("error", "irradiance_se")):
        sent = _array(data["points"][name]).reshape(shape)
        assert sent == pytest.approx(report.spectral_map[variable].to_numpy(), rel=1e-6)  # single precision
    assert _array(data["points"]["buried"]).nonzero()[0].tolist() == [3]
    assert data["bands"] == report.spectral_map["band"].to_numpy().tolist()
    assert data["points"]["illuminance"] is None  # nobody gave it


def test_illuminance_goes_with_its_points(make_transport, make_report):
    report = make_report(make_transport(points=MAX_POINTS + 500).isel(band=[5]))
    lux = np.linspace(100.0, 300.0, MAX_POINTS + 500)
    text = room_view_data(report.spectral_map, None, (), np.empty(0), (), illuminance_lx=lux)
    points = json.loads(text)["points"]
    assert _array(points["illuminance"]) == pytest.approx(lux[_array(points["numbers"]) - 1], rel=1e-6)


def test_the_room_arrives_where_it_stands_with_its_materials(report):
    _, data = _data(report)
    sent = data["surfaces"]
    places = np.array(sent["lowest"]) + sent["cell"] * _array(sent["vertices"]).reshape(-1, 3)
    corners = places[_array(sent["faces"]).reshape(-1, 3)]
    wanted = report.surfaces.vertices[report.surfaces.faces]
    assert corners == pytest.approx(wanted, abs=FINEST_CLUSTER_M / 2 + 1e-12)  # rounded to whole cells
    assert _array(sent["materials"]).tolist() == report.surfaces.face_material.tolist()
    floor = data["materials"][1]
    assert floor["name"] == "floor"
    assert floor["reflectance"][0] == pytest.approx(0.4 + 0.2 * (410 - 380) / 400, abs=1e-5)  # linear from .4 to .6


def test_no_name_can_end_the_element_that_the_data_stand_in(report, lamps, make_material):
    hostile_lamp = replace(lamps[0], name=HOSTILE * 500)
    hostile = replace(report, materials=(make_material(HOSTILE), make_material("floor")), lamps=(hostile_lamp,))
    text, data = _data(hostile)
    assert "<" not in text
    assert "\x00" not in json.dumps(data, ensure_ascii=False)
    assert data["materials"][0]["name"].startswith("</script><script>alert(1)")
    assert len(data["lamps"][0]["name"]) <= 120


def test_a_coarser_mesh_has_few_enough_triangles_each_with_its_own_material_in_nearly_its_own_place(room_surfaces):
    fine = _bumpy(room_surfaces)
    places, corners, kept, cell_m = coarser(fine, 1000)
    assert 100 < kept.size <= 1000
    assert corners.max() < places.shape[0]
    found = (fine.vertices.min(axis=0) + cell_m * places)[corners]
    assert np.abs(found - fine.vertices[fine.faces[kept]]).max() <= cell_m / 2 + 1e-12
    # The sheet of 3 m x 3 m is still covered once; its rim moves by half a cell at most.
    assert _area_from_above_m2(found) == pytest.approx(9.0, abs=4 * 3.0 * cell_m / 2)


def test_a_mesh_that_is_small_enough_keeps_every_triangle(room_surfaces):
    fine = _bumpy(room_surfaces)
    assert coarser(fine, fine.faces.shape[0])[2].tolist() == list(range(fine.faces.shape[0]))


def test_the_ground_is_filled_between_neighbours_but_neither_across_a_gap_nor_over_buried_points(make_transport):
    light = spectral_map(make_transport(points=25, buried=(12,)))
    triangles = point_triangles(light)
    assert 12 not in triangles
    places = np.stack([light["x"].to_numpy(), light["y"].to_numpy()], axis=1)
    edges = np.linalg.norm(places[triangles] - places[np.roll(triangles, 1, axis=1)], axis=2)
    assert triangles.shape[0] > 20
    moved = np.where(places[:, 0] > 1.6, places[:, 0] + 5.0, places[:, 0])
    apart = point_triangles(_moved(light, x=moved))
    assert apart.size
    assert np.ptp(moved[apart], axis=1).max() <= edges.max()


def test_points_on_one_line_and_points_of_several_levels_are_no_error(make_transport):
    light = spectral_map(make_transport(points=16))
    line = _moved(light, x=np.arange(16.0), y=np.zeros(16))
    assert point_triangles(line).shape == (0, 3)
    levels = _moved(light, z=np.repeat([0.3, 1.1], 8))
    heights = levels["z"].to_numpy()[point_triangles(levels)]
    assert np.ptp(heights, axis=1).max() == 0.0


def test_of_a_large_map_an_even_choice_is_sent_and_keeps_its_numbers(make_transport, make_report):
    report = make_report(make_transport(points=2 * MAX_POINTS).isel(band=[5]))
    _, data = _data(report)
    numbers = _array(data["points"]["numbers"])
    assert numbers.size == MAX_POINTS
    assert (numbers[0], numbers[-1], data["points"]["count"]) == (1, 2 * MAX_POINTS, 2 * MAX_POINTS)
    chosen = report.spectral_map["irradiance"].to_numpy()[numbers - 1, 0]
    assert _array(data["points"]["irradiance"]) == pytest.approx(chosen, rel=1e-6)


def test_a_face_of_a_material_that_there_is_none_of_is_refused(report):
    wrong = replace(report, surfaces=replace(report.surfaces, face_material=np.full(12, 2)))
    with pytest.raises(ArrayError, match="material numbers from 0 to 1"):
        _data(wrong)


def test_surfaces_whose_corners_are_none_are_refused(room_surfaces):
    with pytest.raises(ArrayError, match="corner numbers from 0 to 7"):
        replace(room_surfaces, faces=np.full((12, 3), 8))
