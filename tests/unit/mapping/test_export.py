"""The lit room as GLB, USDZ and VTK, opened by other libraries: MeshLab, OpenUSD, meshio."""

import io
import zipfile

import matplotlib as mpl
import numpy as np
import pytest
import trimesh
from matplotlib.colors import Normalize
from PIL import Image

from lidarspectra.mapping.export.gltf import save_glb
from lidarspectra.mapping.export.lit_room import legend_mesh, map_mesh, room_mesh
from lidarspectra.mapping.export.vtk import save_vtu
from lidarspectra.mapping.maps.spectral_map import spectral_map
from lidarspectra.mapping.report.room_view import point_triangles
from lidarspectra.spectra.colorimetry import encode_srgb

NORM = Normalize(0.0, 400.0)
TOLERANCE_M = 1e-5  # of single precision, in a room of 3 m


@pytest.fixture
def light(make_transport, lamps):
    return spectral_map(make_transport(points=25, buried=(3,)), lamps=lamps)


@pytest.fixture
def meshes(light, room_surfaces):
    """Room, map and legend of a small room."""
    positions = np.stack([light[name].to_numpy() for name in "xyz"], axis=1)
    normals = np.tile([0.0, 0.0, 1.0], (25, 1))
    room = room_mesh(room_surfaces.vertices, room_surfaces.faces, room_surfaces.face_color)
    shown = map_mesh(positions, normals, point_triangles(light), light["illuminance"].to_numpy(), NORM)
    return room, shown, legend_mesh(room_surfaces.vertices, NORM, "illuminance [lx]")


def _shown(mesh, places):
    """Colours of a picture at places from its lower left corner."""
    height, width = mesh.shape[:2]
    column = np.clip((places[:, 0] * width).astype(int), 0, width - 1)
    row = np.clip(((1.0 - places[:, 1]) * height).astype(int), 0, height - 1)
    return mesh[row, column]


def test_meshlab_opens_the_glb_with_room_map_and_legend_standing_upright(meshes, light, tmp_path) -> None:
    pymeshlab = pytest.importorskip("pymeshlab")
    opened = pymeshlab.MeshSet()
    opened.load_new_mesh(str(save_glb(meshes, tmp_path / "room.glb")))
    parts = {opened.mesh(number).label(): opened.mesh(number) for number in range(opened.mesh_number())}
    assert len(parts) == 3
    shown = min(parts.values(), key=lambda part: np.ptp(part.vertex_matrix()[:, 1]))  # the map is level
    assert shown.vertex_matrix()[:, 1] == pytest.approx(0.303, abs=TOLERANCE_M)  # y is up
    assert sorted(shown.vertex_matrix()[:, 0]) == pytest.approx(sorted(light["x"].to_numpy()), abs=TOLERANCE_M)
    assert sorted(shown.vertex_matrix()[:, 2]) == pytest.approx(sorted(-light["y"].to_numpy()), abs=TOLERANCE_M)


def test_every_point_of_the_map_has_its_colour_of_the_scale(meshes, light, tmp_path) -> None:
    scene = trimesh.load_scene(save_glb(meshes, tmp_path / "room.glb"))
    shown = scene.geometry["map"]
    colors = _shown(np.asarray(shown.visual.material.emissiveTexture.convert("RGB")), np.asarray(shown.visual.uv))
    wanted = 255 * mpl.colormaps["inferno"](NORM(light["illuminance"].to_numpy()))[:, :3]
    assert np.abs(colors - wanted).max() <= 4  # one step of 256 of the scale
    assert len(shown.faces) == len(point_triangles(light))


def test_every_face_of_the_room_has_nearly_the_colour_of_the_scan(meshes, room_surfaces) -> None:
    room = meshes[0]
    colors = _shown(room.picture, room.places)[::3]
    assert np.abs(colors - 255 * encode_srgb(room_surfaces.face_color)).max() <= 255 / 15 / 2 + 0.5  # of 16 levels
    normals = np.cross(
        room.vertices[room.faces[:, 1]] - room.vertices[room.faces[:, 0]],
        room.vertices[room.faces[:, 2]] - room.vertices[room.faces[:, 0]],
    )
    assert normals[0, 1] > 0  # the floor still faces up, now along y


def test_openusd_finds_nothing_wrong_with_the_usdz_and_its_pictures_are_in_it(meshes, tmp_path) -> None:
    pytest.importorskip("pxr", reason="the extra 'usd' is not installed")
    from pxr import Usd, UsdGeom, UsdShade

    from lidarspectra.mapping.export.usdz import save_usdz

    path = save_usdz(meshes, tmp_path / "room.usdz")
    stage = Usd.Stage.Open(str(path))
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    for mesh in meshes:
        prim = stage.GetPrimAtPath(f"/Room/{mesh.name}")
        points = np.array(UsdGeom.Mesh(prim).GetPointsAttr().Get())
        assert points == pytest.approx(mesh.vertices, abs=TOLERANCE_M)
        material = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()[0]
        picture = UsdShade.Shader(stage.GetPrimAtPath(f"{material.GetPath()}/picture"))
        assert picture.GetInput("file").Get().resolvedPath  # found within the package
    with zipfile.ZipFile(path) as package:
        assert all(info.compress_type == zipfile.ZIP_STORED for info in package.infolist())  # as Apple wants it
        with Image.open(io.BytesIO(package.read("map.png"))) as picture:
            assert np.array_equal(np.asarray(picture.convert("RGB")), meshes[1].picture)


def test_our_own_reader_reads_the_usdz_as_a_room(meshes, tmp_path) -> None:
    pytest.importorskip("pxr", reason="the extra 'usd' is not installed")
    from lidarspectra.hardware.phone.readers import read_scan
    from lidarspectra.mapping.export.usdz import save_usdz

    scan = read_scan(save_usdz(meshes[:1], tmp_path / "room.usdz"))
    assert np.ptp(scan.vertices, axis=0) == pytest.approx([3.0, 3.0, 2.7], abs=0.01)


def test_meshio_opens_the_vtk_file_with_every_number(light, tmp_path) -> None:
    meshio = pytest.importorskip("meshio")
    positions = np.stack([light[name].to_numpy() for name in "xyz"], axis=1)
    cells = [np.arange(25)[:, None], point_triangles(light)]
    data = {
        "illuminance <lx> \"&'": light["illuminance"].to_numpy().astype(np.float64),
        "normal": np.tile([0.0, 0.0, 1.0], (25, 1)),
        "buried": light["buried"].to_numpy().astype(np.uint8),
    }
    number = np.arange(25 + len(cells[1]))
    path = save_vtu(tmp_path / "map.vtu", positions, cells, point_data=data, cell_data={"number": number})
    opened = meshio.read(path)
    assert np.array_equal(opened.points, positions)
    assert {block.type: len(block.data) for block in opened.cells} == {"vertex": 25, "triangle": len(cells[1])}
    assert np.array_equal(opened.cells_dict["triangle"], cells[1])
    for name, values in data.items():
        assert np.array_equal(opened.point_data[name], values)
    assert np.array_equal(np.concatenate(opened.cell_data["number"]), number)
