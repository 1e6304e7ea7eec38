import base64
import json
import os
import struct
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from lidarspectra.errors import ScanError
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone import raw_mesh
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.hardware.phone.repair import repair_scan
from lidarspectra.spectra.colorimetry import decode_srgb

SHARED = Path(os.environ.get("LIDARSPECTRA_SHARED", Path(__file__).parents[4] / "shared"))
MEETING_ROOM = SHARED / "data" / "scans" / "meeting-room" / "poly.glb"

# A triangle in the plane z = 0, as glTF has it: x to the right, y up.
CORNERS = np.array([[0, 0, 0], [3, 0, 0], [0, 3, 0]], dtype="<f4")


def write_gltf(
    folder: Path,
    *,
    document: dict[str, object] | None = None,
    primitive: dict[str, object] | None = None,
    arrays: dict[str, np.ndarray] | None = None,
    nodes: list[dict[str, object]] | None = None,
    uri: str | None = None,
) -> Path:
    """A glTF file of one mesh whose attributes are given as arrays; further keys are taken over as they are."""
    attributes = {"POSITION": CORNERS} | (arrays or {})
    kinds = {"f": 5126, "B": 5121, "H": 5123, "I": 5125, "h": 5122}
    data, views, accessors, named = b"", [], [], {}
    for name, array in attributes.items():
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": array.nbytes})
        shape = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}[1 if array.ndim == 1 else array.shape[1]]
        accessors.append(
            {
                "bufferView": len(views) - 1,
                "componentType": kinds[array.dtype.char],
                "count": len(array),
                "type": shape,
                "normalized": array.dtype.kind in "ui" and name != "indices",
            }
        )
        named[name] = len(accessors) - 1
        data += array.tobytes() + b"\0" * (-array.nbytes % 4)
    indices = {"indices": named.pop("indices")} if "indices" in named else {}
    inline = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    everything = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(data), "uri": uri or inline}],
        "bufferViews": views,
        "accessors": accessors,
        "meshes": [{"primitives": [{"attributes": named} | indices | (primitive or {})]}],
        "nodes": nodes or [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    } | (document or {})  # fmt: skip
    if uri is not None:
        (folder / "scan.bin").write_bytes(data)
    path = folder / "scan.gltf"
    path.write_text(json.dumps(everything), encoding="utf-8")
    return path


def textured_document(image: Image.Image, folder: Path, **texture_info: object) -> dict[str, object]:
    image.save(folder / "t.png")
    return {
        "images": [{"uri": "t.png"}],
        "textures": [{"source": 0}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0} | texture_info}}],
    }


UV = np.array([[0.1, 0.2], [0.6, 0.2], [0.1, 0.9]], dtype="<f4")


def center_color(scan: Scan) -> np.ndarray:
    return scan.appearance.sample(np.array([0]), np.full((1, 3), 1 / 3))[0]


# --- the same room through every format


def same_faces(scan: Scan, room: trimesh.Trimesh) -> None:
    """Both have the same triangles, in whatever order."""
    # 32-bit floats, and text of 8 digits: a micrometre
    ours = np.sort(np.round(scan.corners.mean(axis=1), 5), axis=0)
    theirs = np.sort(np.round(room.triangles.mean(axis=1), 5), axis=0)
    np.testing.assert_allclose(ours, theirs, atol=2e-5)
    assert scan.areas.sum() == pytest.approx(room.area, rel=1e-5)


@pytest.mark.parametrize("kind", ["glb", "obj", "ply", "stl"])
def test_a_room_that_trimesh_wrote_is_read_as_it_was(
    tmp_path: Path,
    furnished_room: trimesh.Trimesh,
    to_y_up: Callable[[trimesh.Trimesh], trimesh.Trimesh],
    kind: str,
) -> None:
    path = tmp_path / f"room.{kind}"
    exported = (to_y_up(furnished_room) if kind == "glb" else furnished_room).export(file_type=kind)
    path.write_bytes(exported if isinstance(exported, bytes) else exported.encode())
    scan = read_scan(path)
    same_faces(scan, furnished_room)
    assert scan.record.up_axis == ("+y" if kind == "glb" else "+z")
    assert (scan.record.faces_read, scan.record.unit) == (len(furnished_room.faces), "m")


def test_texture_coordinates_of_a_glb_mean_the_same_as_in_trimesh(
    room_glb: Path, textured_room: trimesh.Trimesh, pattern: Image.Image
) -> None:
    scan = read_scan(room_glb)
    centers = textured_room.visual.uv[textured_room.faces].mean(axis=1)
    expected = trimesh.visual.color.uv_to_interpolated_color(centers, pattern)[:, :3] / 255
    colors = scan.appearance.sample(np.arange(len(scan.faces)), np.full((len(scan.faces), 3), 1 / 3))
    # trimesh interpolates encoded bytes between corners of the image, we light between pixel centres: half a texel
    np.testing.assert_allclose(colors, decode_srgb(expected), atol=0.04)


def test_obj_with_mtl_and_texture_has_the_colours_of_the_glb(
    tmp_path: Path, room_glb: Path, textured_room: trimesh.Trimesh, pattern: Image.Image
) -> None:
    room = textured_room.copy()
    room.visual.material = trimesh.visual.material.SimpleMaterial(image=pattern)
    room.export(tmp_path / "room.obj")
    scan = read_scan(tmp_path / "room.obj")
    np.testing.assert_allclose(
        np.sort(scan.face_colors(), axis=0), np.sort(read_scan(room_glb).face_colors(), axis=0), atol=1e-4
    )
    assert scan.record.notes == ()


def test_a_room_without_colour_says_so(tmp_path: Path, furnished_room: trimesh.Trimesh) -> None:
    (tmp_path / "room.stl").write_bytes(furnished_room.export(file_type="stl"))
    scan = read_scan(tmp_path / "room.stl")
    assert not scan.appearance.known
    assert any("no colour" in note for note in scan.record.notes)
    np.testing.assert_allclose(scan.face_colors(), 0.5, atol=0.002)  # linear, of the neutral stand-in


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_ply_vertex_colours_are_taken_as_encoded(
    tmp_path: Path, furnished_room: trimesh.Trimesh, encoding: str
) -> None:
    room = furnished_room.copy()
    room.visual.vertex_colors = [200, 100, 50, 255]
    (tmp_path / "room.ply").write_bytes(trimesh.exchange.ply.export_ply(room, encoding=encoding))
    scan = read_scan(tmp_path / "room.ply")
    assert scan.appearance.known
    np.testing.assert_allclose(
        scan.face_colors(), np.tile(decode_srgb([200 / 255, 100 / 255, 50 / 255]), (len(scan.faces), 1))
    )


PLY_TEXT = """ply
format ascii 1.0
comment TextureFile t.png
element vertex 3
property float x
property float y
property float z
property float s
property float t
element face 1
property list uchar int vertex_indices
end_header
0 0 0 0.1 0.2
3 0 0 0.6 0.2
0 3 0 0.1 0.9
3 0 1 2
"""


def test_ply_with_a_texture_file(tmp_path: Path) -> None:
    Image.new("RGB", (4, 4), (255, 0, 0)).save(tmp_path / "t.png")
    path = tmp_path / "a.ply"
    path.write_text(PLY_TEXT, encoding="utf-8")
    np.testing.assert_allclose(center_color(read_scan(path)), [1, 0, 0], atol=1e-6)
    (tmp_path / "t.png").unlink()
    scan = read_scan(path)
    assert not scan.appearance.known
    assert any("'t.png'" in note for note in scan.record.notes)
    path.write_text(PLY_TEXT.replace("t.png", "../t.png"), encoding="utf-8")
    with pytest.raises(ScanError, match="own folder"):
        read_scan(path)


# --- glTF in detail


def test_transforms_of_nested_nodes_are_applied_from_the_inside_out(tmp_path: Path) -> None:
    nodes = [
        {"children": [1], "translation": [10, 0, 0], "scale": [2, 2, 2]},
        {"mesh": 0, "rotation": [0, 0, 2**-0.5, 2**-0.5], "translation": [0, 1, 0]},
    ]
    scan = read_scan(write_gltf(tmp_path, nodes=nodes), unit="m", up="+z")
    # corner (3, 0, 0): a quarter turn about z gives (0, 3, 0); + (0, 1, 0); x 2; + (10, 0, 0)
    np.testing.assert_allclose(scan.vertices[1], [10, 8, 0], atol=1e-6)


@pytest.mark.parametrize(
    "node",
    [{"scale": [-1, 1, 1]}, {"matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}, {"scale": [1, -1, 1]}],
)
def test_a_mirroring_transform_keeps_the_front_of_a_triangle(tmp_path: Path, node: dict[str, object]) -> None:
    image = Image.fromarray(np.random.default_rng(0).integers(0, 255, (9, 9, 3), dtype=np.uint8))
    document = textured_document(image, tmp_path)
    arguments = {"document": document, "primitive": {"material": 0}, "arrays": {"TEXCOORD_0": UV}}
    plain = read_scan(write_gltf(tmp_path, **arguments), up="+z")
    mirrored = read_scan(write_gltf(tmp_path, nodes=[{"mesh": 0} | node], **arguments), up="+z")
    np.testing.assert_allclose(mirrored.normals, plain.normals, atol=1e-7)
    # Every corner keeps its texture coordinate through the swap.
    for scan, sign in ((plain, 1), (mirrored, -1)):
        flip = np.array([sign, 1, 1]) if node.get("scale") != [1, -1, 1] else np.array([1, sign, 1])
        at = {
            tuple(np.round(p * flip, 5)): tuple(uv)
            for p, uv in zip(scan.corners[0], scan.appearance.corner_uv[0], strict=True)
        }
        assert at[(3.0, 0.0, 0.0)] == pytest.approx((0.6, 0.8))


def test_one_mesh_used_by_two_nodes_stands_twice(tmp_path: Path) -> None:
    nodes = [{"children": [1, 2]}, {"mesh": 0}, {"mesh": 0, "translation": [0, 0, 2]}]
    assert len(read_scan(write_gltf(tmp_path, nodes=nodes)).faces) == 2


def test_nodes_that_go_round_in_a_circle_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ScanError, match="tree"):
        read_scan(write_gltf(tmp_path, nodes=[{"children": [1]}, {"mesh": 0, "children": [0]}]))


@pytest.mark.parametrize(
    ("mode", "indices", "count"),
    [(4, [0, 1, 2], 1), (5, [0, 1, 2, 0, 1], 3), (6, [0, 1, 2, 0], 2)],
)
def test_lists_strips_and_fans_of_triangles(tmp_path: Path, mode: int, indices: list[int], count: int) -> None:
    path = write_gltf(tmp_path, primitive={"mode": mode}, arrays={"indices": np.array(indices, dtype="<u2")})
    assert len(read_scan(path).faces) == count


def test_triangles_of_a_strip_all_face_the_same_way(tmp_path: Path) -> None:
    grid = np.array([[0, 0, 0], [0, 3, 0], [3, 0, 0], [3, 3, 0], [6, 0, 0], [6, 3, 0]], dtype="<f4")
    path = write_gltf(tmp_path, primitive={"mode": 5}, arrays={"POSITION": grid})
    normals = read_scan(path, up="+z").normals
    np.testing.assert_allclose(normals, np.tile(normals[0], (4, 1)))


def test_points_and_lines_alone_are_no_mesh(tmp_path: Path) -> None:
    with pytest.raises(ScanError, match="at least one triangle"):
        read_scan(write_gltf(tmp_path, primitive={"mode": 0}))


def test_the_base_colour_factor_multiplies_light(tmp_path: Path) -> None:
    document = textured_document(Image.new("RGB", (2, 2), (255, 255, 255)), tmp_path)
    document["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = [0.5, 0.25, 1, 1]
    scan = read_scan(write_gltf(tmp_path, document=document, primitive={"material": 0}, arrays={"TEXCOORD_0": UV}))
    np.testing.assert_allclose(center_color(scan), [0.5, 0.25, 1], atol=0.004)  # a byte


def test_vertex_colours_are_linear_and_multiplied_by_the_factor(tmp_path: Path) -> None:
    document = {"materials": [{"pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 1, 1]}}]}
    colors = np.tile(np.array([65535, 32768, 0, 65535], dtype="<u2"), (3, 1))
    path = write_gltf(tmp_path, document=document, primitive={"material": 0}, arrays={"COLOR_0": colors})
    np.testing.assert_allclose(center_color(read_scan(path)), [0.5, 0.5, 0], atol=1e-4)


def test_vertex_colours_of_eight_bits_may_be_srgb_and_that_is_said(tmp_path: Path) -> None:
    for kind, said in (("u1", True), ("<u2", False), ("<f4", False)):
        white = np.iinfo(kind).max if kind != "<f4" else 1.0
        path = write_gltf(tmp_path, arrays={"COLOR_0": np.full((3, 4), white, dtype=kind)})
        assert any("taken for linear light" in note for note in read_scan(path).record.notes) == said


def test_a_material_without_texture_gives_its_flat_colour(tmp_path: Path) -> None:
    document = {"materials": [{"pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.4, 0.6, 1]}}]}
    scan = read_scan(write_gltf(tmp_path, document=document, primitive={"material": 0}))
    np.testing.assert_allclose(center_color(scan), [0.2, 0.4, 0.6], atol=1e-6)
    assert scan.appearance.known


def quadrants() -> Image.Image:
    """Upper left red, upper right green, lower left blue, lower right white."""
    pixels = np.zeros((64, 64, 3), dtype=np.uint8)
    pixels[:32, :32], pixels[:32, 32:], pixels[32:, :32], pixels[32:, 32:] = (255, 0, 0), (0, 255, 0), (0, 0, 255), 255
    return Image.fromarray(pixels)


@pytest.mark.parametrize(
    ("transform", "color"),
    [
        ({}, [1, 0, 0]),
        ({"offset": [0.5, 0]}, [0, 1, 0]),
        ({"offset": [0, 0.5]}, [0, 0, 1]),
        ({"offset": [1.5, 2.5]}, [1, 1, 1]),
        ({"scale": [3, 1]}, [0, 1, 0]),
        # Counter-clockwise by a quarter about the upper left corner: (u, v) goes to (v, -u), that is 1 - u below.
        ({"rotation": np.pi / 2}, [0, 0, 1]),
        ({"texCoord": 1}, [1, 1, 1]),
    ],
)
def test_texture_transforms_and_further_coordinates(
    tmp_path: Path, transform: dict[str, object], color: list[float]
) -> None:
    extensions = {"KHR_texture_transform": transform}
    document = textured_document(quadrants(), tmp_path, extensions=extensions)
    document["extensionsRequired"] = ["KHR_texture_transform"]
    at = {
        "TEXCOORD_0": np.tile(np.array([0.25, 0.2], dtype="<f4"), (3, 1)),
        "TEXCOORD_1": np.tile(np.array([0.8, 0.8], dtype="<f4"), (3, 1)),
    }
    path = write_gltf(tmp_path, document=document, primitive={"material": 0}, arrays=at)
    np.testing.assert_allclose(center_color(read_scan(path)), color, atol=1e-5)


@pytest.mark.parametrize(
    ("wrap", "place", "expected"),
    [
        (10497, (1.2, 0.2), (0, 0)),
        (33071, (1.2, 0.2), (1, 0)),
        (33071, (-0.3, 1.4), (0, 1)),
        (33071, (0.9, -7.0), (1, 0)),
        (33648, (1.2, 0.2), (1, 0)),
        (33648, (1.8, 0.2), (0, 0)),
        (33648, (-0.2, 1.2), (0, 1)),
        (33648, (2.2, -1.8), (0, 0)),
        (33648, (0.2, 1.8), (0, 0)),
        (None, (1.2, 1.2), (0, 0)),
    ],
)
def test_a_texture_repeats_mirrors_or_ends_as_its_sampler_says(tmp_path: Path, wrap, place, expected) -> None:
    """Of a picture of 2 x 2 colours, v down: red and green tell column and row."""
    pixels = np.zeros((64, 64, 3), dtype=np.uint8)
    pixels[:, 32:, 0], pixels[32:, :, 1] = 255, 255
    document = textured_document(Image.fromarray(pixels), tmp_path)
    if wrap is not None:
        document["samplers"] = [{"wrapS": wrap, "wrapT": wrap}]
        document["textures"] = [{"source": 0, "sampler": 0}]
    uv = np.tile(np.array(place, dtype="<f4"), (3, 1))
    scan = read_scan(write_gltf(tmp_path, document=document, primitive={"material": 0}, arrays={"TEXCOORD_0": uv}))
    np.testing.assert_allclose(center_color(scan)[:2], expected, atol=1e-6)


def test_a_mirrored_texture_is_tinted_and_its_plain_one_kept(tmp_path: Path) -> None:
    document = textured_document(quadrants(), tmp_path)
    document["samplers"] = [{"wrapS": 33648}, {}]
    document["textures"] = [{"source": 0, "sampler": 0}, {"source": 0, "sampler": 1}]
    for number in (0, 1):
        document["materials"] = [
            {"pbrMetallicRoughness": {"baseColorTexture": {"index": number}, "baseColorFactor": [0.5, 0.5, 0.5, 1]}}
        ]
        uv = np.tile(np.array([0.2, 0.2], dtype="<f4"), (3, 1))
        scan = read_scan(write_gltf(tmp_path, document=document, primitive={"material": 0}, arrays={"TEXCOORD_0": uv}))
        np.testing.assert_allclose(center_color(scan), [0.5, 0, 0], atol=5e-3)


def test_quantized_positions_and_coordinates_are_scaled(tmp_path: Path) -> None:
    document = textured_document(quadrants(), tmp_path) | {"extensionsRequired": ["KHR_mesh_quantization"]}
    arrays = {
        "POSITION": np.array([[0, 0, 0], [32767, 0, 0], [0, 32767, 0]], dtype="<i2"),
        "TEXCOORD_0": np.tile(np.array([200, 30], dtype="u1"), (3, 1)),
    }
    path = write_gltf(
        tmp_path, document=document, primitive={"material": 0}, arrays=arrays, nodes=[{"mesh": 0, "scale": [3, 3, 3]}]
    )
    scan = read_scan(path)
    assert scan.bounds[1].max() == pytest.approx(3.0)
    np.testing.assert_allclose(center_color(scan), [0, 1, 0], atol=1e-5)


def test_two_textures_each_colour_their_own_triangles(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    for number, color in enumerate([(255, 0, 0), (0, 0, 255)]):
        box = trimesh.creation.box(extents=(3, 2, 3))
        box.unmerge_vertices()
        material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.new("RGB", (4, 4), color))
        box.visual = trimesh.visual.TextureVisuals(uv=np.zeros((len(box.vertices), 2)), material=material)
        scene.add_geometry(box, transform=trimesh.transformations.translation_matrix([5.0 * number, 0, 0]))
    path = tmp_path / "two.glb"
    path.write_bytes(scene.export(file_type="glb"))
    scan = read_scan(path)
    right = scan.centers[:, 0] > 2.5
    np.testing.assert_allclose(scan.face_colors()[~right], np.tile([1, 0, 0], (12, 1)), atol=1e-6)
    np.testing.assert_allclose(scan.face_colors()[right], np.tile([0, 0, 1], (12, 1)), atol=1e-6)


def test_buffers_and_images_beside_the_file_are_read(tmp_path: Path) -> None:
    document = textured_document(quadrants(), tmp_path)
    (tmp_path / "t.png").rename(tmp_path / "my texture.png")
    document["images"] = [{"uri": "my%20texture.png"}]
    path = write_gltf(tmp_path, document=document, primitive={"material": 0}, arrays={"TEXCOORD_0": UV}, uri="scan.bin")
    assert read_scan(path).appearance.images[0].shape == (64, 64, 3)


def test_a_missing_texture_is_noted_and_its_colour_unknown(tmp_path: Path) -> None:
    document = textured_document(quadrants(), tmp_path) | {"images": [{"uri": "lost.jpg"}]}
    scan = read_scan(write_gltf(tmp_path, document=document, primitive={"material": 0}, arrays={"TEXCOORD_0": UV}))
    assert not scan.appearance.known
    assert any("'lost.jpg'" in note for note in scan.record.notes)


def test_a_missing_buffer_is_an_error(tmp_path: Path) -> None:
    path = write_gltf(tmp_path, uri="scan.bin")
    (tmp_path / "scan.bin").unlink()
    with pytest.raises(ScanError, match=r"scan\.bin"):
        read_scan(path)


@pytest.mark.parametrize(
    "uri",
    ["../secret.bin", "%2e%2e/secret.bin", "..\\secret.bin", "/etc/passwd", "C:\\secret.bin", "file:///etc/passwd",
     "http://example.org/a.bin", "a/../../secret.bin", "a/../scan.bin", "link/secret.bin", "a\0b"],
)  # fmt: skip
def test_nothing_outside_the_scans_folder_is_read(tmp_path: Path, uri: str) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    (tmp_path / "secret.bin").write_bytes(CORNERS.tobytes())
    try:
        (inner / "link").symlink_to(tmp_path, target_is_directory=True)
    except OSError:
        pytest.skip("this machine makes no links")
    with pytest.raises(ScanError, match="own folder"):
        read_scan(write_gltf(inner, uri=uri))


@pytest.mark.parametrize("name", ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_texture_basisu"])
def test_compression_that_cannot_be_read_is_named(tmp_path: Path, name: str) -> None:
    with pytest.raises(ScanError, match=name):
        read_scan(write_gltf(tmp_path, document={"extensionsRequired": [name]}))


@pytest.mark.parametrize(
    ("document", "message"),
    [
        ({"asset": {"version": "1.0"}}, "version"),
        ({"accessors": []}, "accessor"),
        ({"bufferViews": []}, "buffer view"),
        ({"buffers": []}, "buffer"),
        ({"scene": 7}, "scene"),
        ({"meshes": 5}, "meshes"),
        ({"nodes": [{"mesh": -1}]}, "mesh"),
        ({"nodes": [{"mesh": 0, "translation": [float("nan"), 0, 0]}]}, "translation"),
        ({"nodes": [{"mesh": 0, "scale": [1e308, 1e308, 1]}, {}]}, "finite|far"),
    ],
)
def test_a_document_that_contradicts_itself_is_refused(
    tmp_path: Path, document: dict[str, object], message: str
) -> None:
    with pytest.raises(ScanError, match=message):
        read_scan(write_gltf(tmp_path, document=document))


def test_sparse_data_are_refused_not_read_as_zeros(tmp_path: Path) -> None:
    accessor = {"componentType": 5126, "count": 3, "type": "VEC3", "sparse": {"count": 1}}
    with pytest.raises(ScanError, match="sparse"):
        read_scan(write_gltf(tmp_path, document={"accessors": [accessor]}))


def test_a_count_beyond_the_data_takes_no_memory(tmp_path: Path) -> None:
    accessor = {"bufferView": 0, "componentType": 5126, "count": 2**31, "type": "VEC3"}
    with pytest.raises(ScanError, match="bytes of mesh data"):
        read_scan(write_gltf(tmp_path, document={"accessors": [accessor]}))


def test_a_cut_off_glb_says_how_much_is_missing(room_glb: Path) -> None:
    data = room_glb.read_bytes()
    room_glb.write_bytes(data[: len(data) // 2])
    with pytest.raises(ScanError, match=f"{len(data)} bytes"):
        read_scan(room_glb)


def test_deeply_nested_json_is_an_error_not_a_crash(tmp_path: Path) -> None:
    text = b"[" * 200_000
    text += b" " * (-len(text) % 4)
    path = tmp_path / "deep.glb"
    path.write_bytes(b"glTF" + struct.pack("<IIII", 2, 20 + len(text), len(text), 0x4E4F534A) + text)
    with pytest.raises(ScanError, match="document"):
        read_scan(path)


# --- OBJ in detail

OBJ_HEAD = "mtllib room.mtl\nv 0 0 0\nv 3 0 0\nv 3 3 0\nv 0 3 0\nvt 0.2 0.8\n"


def write_obj(folder: Path, body: str, materials: str | None = None) -> Path:
    path = folder / "room.obj"
    path.write_text(OBJ_HEAD + body, encoding="utf-8")
    if materials is not None:
        (folder / "room.mtl").write_text(materials, encoding="utf-8")
    return path


def test_quads_and_numbers_from_the_end(tmp_path: Path) -> None:
    scan = read_scan(write_obj(tmp_path, "f 1 2 3 4\nf -4/1/1 -3//2 -2/1\n", "newmtl a\n"), up="+z")
    assert len(scan.faces) == 3
    assert scan.areas.sum() == pytest.approx(9 + 4.5)
    assert (scan.normals[:, 2] == 1).all()


HOLLOW = [(0, 0), (5, 0), (5, 4), (3, 4), (3, 2), (0, 2)]  # the plan of an L-shaped room, of 14 m²
DART = [(0, 0), (4, -2), (1, 0), (4, 2)]  # of 2 m²


@pytest.mark.parametrize(("corners", "area_m2"), [(HOLLOW, 14.0), (DART, 2.0)])
@pytest.mark.parametrize("first", [0, 1, 2, 3])
@pytest.mark.parametrize("kind", ["obj", "usda"])
def test_a_hollow_polygon_is_covered_and_nothing_beside_it(tmp_path: Path, corners, area_m2, first, kind) -> None:
    points = np.column_stack([np.roll(corners, -first, axis=0), np.zeros(len(corners))])
    path = tmp_path / f"a.{kind}"
    if kind == "obj":
        numbers = " ".join(str(place + 1) for place in range(len(points)))
        path.write_text("".join(f"v {x} {y} {z}\n" for x, y, z in points) + f"f {numbers}\n", encoding="utf-8")
    else:
        pytest.importorskip("pxr", reason="the extra 'usd' is not installed")
        path.write_text(usd_mesh(points, [range(len(points))]), encoding="utf-8")
    scan = read_scan(path, up="+z", unit="m")
    assert scan.areas.sum() == pytest.approx(area_m2, rel=1e-6)
    assert (scan.normals[:, 2] > 0.999).all(), "wound as the polygon"


def usd_mesh(points, faces, more: str = "", beside: str = "", unit: str = "metersPerUnit = 1") -> str:
    """A USD text file of one mesh, with more of its properties and other things beside it in the scene."""
    corners = ", ".join(str(tuple(point)) for point in np.asarray(points).tolist())
    return f"""#usda 1.0
(
  upAxis = "Z"
  {unit}
)
def Xform "r" {{
  def Mesh "m" {{
    point3f[] points = [{corners}]
    int[] faceVertexCounts = {[len(face) for face in faces]}
    int[] faceVertexIndices = {[corner for face in faces for corner in face]}
    {more}
  }}
  {beside}
}}
"""


def test_faces_of_a_usd_mesh_that_are_holes_are_none(tmp_path: Path) -> None:
    pytest.importorskip("pxr", reason="the extra 'usd' is not installed")
    path = tmp_path / "a.usda"
    square = [(0, 0, 0), (3, 0, 0), (3, 3, 0), (0, 3, 0), (6, 0, 0), (6, 3, 0)]
    path.write_text(usd_mesh(square, [(0, 1, 2, 3), (1, 4, 5, 2)], "int[] holeIndices = [1]"), encoding="utf-8")
    scan = read_scan(path)
    assert scan.areas.sum() == pytest.approx(9.0)
    assert scan.bounds[1, 0] == 3.0


BOX = np.array([(x, y, z) for z in (0, 2.6) for y in (0, 4) for x in (0, 5)])
BOX_SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
BOX_M2 = 2 * (5 * 4 + 5 * 2.6 + 4 * 2.6)


@pytest.fixture
def read_usda(tmp_path: Path) -> Callable[..., Scan]:
    pytest.importorskip("pxr", reason="the extra 'usd' is not installed")

    def read(*, size: float = 1.0, sides=BOX_SIDES, **more: str) -> Scan:
        path = tmp_path / "a.usda"
        path.write_text(usd_mesh(size * BOX, sides, **more), encoding="utf-8")
        return read_scan(path)

    return read


@pytest.mark.parametrize("metres", [0.1, 10.0, 0.9144])
def test_a_usd_scene_may_be_in_any_unit(read_usda, metres: float) -> None:
    scan = read_usda(size=1.0 / metres, unit=f"metersPerUnit = {metres}")
    assert scan.areas.sum() == pytest.approx(BOX_M2)
    assert any(f"{metres:g} m" in note for note in scan.record.notes)


def material(value: str) -> str:
    """A preview surface, whose diffuse colour is told by a line, with what reads a mesh's variable 'Col'."""
    return f"""def Material "M" {{
    token outputs:surface.connect = </r/M/S.outputs:surface>
    def Shader "S" {{
      uniform token info:id = "UsdPreviewSurface"
      {value}
      token outputs:surface
    }}
    def Shader "R" {{
      uniform token info:id = "UsdPrimvarReader_float3"
      string inputs:varname = "Col"
      float3 outputs:result
    }}
  }}"""


BOUND = "rel material:binding = </r/M>"
RED = "color3f inputs:diffuseColor = (0.8, 0.1, 0.1)"
READER = "color3f inputs:diffuseColor.connect = </r/M/R.outputs:result>"
VARIABLE = '(0.8, 0.1, 0.1)] (interpolation = "constant")'


@pytest.mark.parametrize(
    ("of_mesh", "of_material"),
    [
        (f"color3f[] primvars:displayColor = [(0.18, 0.18, 0.18)]\n{BOUND}", RED),
        (f"color3f[] primvars:displayColor = [{VARIABLE}\n{BOUND}", ""),
        (f"color3f[] primvars:Col = [{VARIABLE}\ncolor3f[] primvars:displayColor = [(0, 0, 0)]\n{BOUND}", READER),
    ],
    ids=["the material's own", "the mesh's where it has none", "the variable that it reads"],
)
def test_a_usd_mesh_has_the_colour_that_its_material_shows(read_usda, of_mesh: str, of_material: str) -> None:
    scan = read_usda(more=of_mesh, beside=material(of_material))
    np.testing.assert_allclose(scan.face_colors(), np.tile([0.8, 0.1, 0.1], (12, 1)), atol=1e-6)


def test_colours_that_differ_over_a_usd_mesh_count_for_more_than_a_materials_one(read_usda) -> None:
    six = ", ".join(f"({i / 10}, 0.5, 0.5)" for i in range(6))
    more = f'color3f[] primvars:displayColor = [{six}] (interpolation = "uniform")\n{BOUND}'
    colors = read_usda(more=more, beside=material(RED)).face_colors()
    np.testing.assert_allclose(colors[:, 0], np.repeat(np.arange(6) / 10, 2), atol=1e-6)


def other_mesh(lines: str, name: str = "other") -> str:
    corners = ", ".join(str(tuple(point)) for point in (BOX + [0, 0, 3]).tolist())
    return f"""def Mesh "{name}" {{
      {lines}
      point3f[] points = [{corners}]
      int[] faceVertexCounts = [4, 4]
      int[] faceVertexIndices = [0, 1, 3, 2, 4, 6, 7, 5]
    }}"""


@pytest.mark.parametrize(
    ("of_mesh", "beside", "what"),
    [
        ("", other_mesh('uniform token purpose = "guide"'), "guide"),
        ('uniform token purpose = "render"', other_mesh('uniform token purpose = "proxy"'), "proxy"),
        ("", 'def PointInstancer "many" {\n' + other_mesh("") + "\n}", "PointInstancer"),
    ],
)
def test_what_a_picture_of_a_usd_scene_does_not_show_is_left_out(read_usda, of_mesh, beside, what) -> None:
    scan = read_usda(more=of_mesh, beside=beside)
    assert len(scan.faces) == 12
    assert any(what in note for note in scan.record.notes)


def test_stand_ins_in_a_usd_scene_are_shown_where_nothing_else_is(read_usda) -> None:
    assert len(read_usda(more='uniform token purpose = "proxy"').faces) == 12


def test_a_usd_scene_may_repeat_parts_of_its_own(read_usda) -> None:
    beside = """def Xform "again" (
    instanceable = true
    references = </r/one>
  ) {
    double3 xformOp:translate = (0, 0, 10)
    uniform token[] xformOpOrder = ["xformOp:translate"]
  }
  def Xform "one" {
    %s
  }"""
    scan = read_usda(beside=beside % other_mesh(""))
    assert len(scan.faces) == 12 + 4 + 4
    assert scan.bounds[1, 2] == pytest.approx(2.6 + 3 + 10)


@pytest.mark.parametrize("line", ["map_Kd t.png", "map_Kd -s 1 1 1 -bm 0.5 t.png", "  MAP_KD\tt.png  "])
def test_the_texture_is_found_behind_options(tmp_path: Path, line: str) -> None:
    quadrants().save(tmp_path / "t.png")
    path = write_obj(tmp_path, "usemtl a\nf 1/1 2/1 3/1\n", f"newmtl a\nKd 0.1 0.1 0.1\n{line}\n")
    np.testing.assert_allclose(center_color(read_scan(path)), [1, 0, 0], atol=1e-5)  # v counts upwards in OBJ


@pytest.mark.parametrize("options", ["-s 1 1 t.png", "-o 0 t.png", '"t.png"', "-t 1 -s 1 t.png"])
def test_options_of_a_texture_may_have_fewer_numbers(tmp_path: Path, options: str) -> None:
    quadrants().save(tmp_path / "t.png")
    path = write_obj(tmp_path, "usemtl a\nf 1/1 2/1 3/1\n", f"newmtl a\nmap_Kd {options}\n")
    np.testing.assert_allclose(center_color(read_scan(path)), [1, 0, 0], atol=1e-5)


@pytest.mark.parametrize("line", ["-s 3 1", "-o 0.5 0 0", "-o 0.1 -s 2 1 1"])
def test_a_texture_may_be_scaled_and_shifted(tmp_path: Path, line: str) -> None:
    """Of a place in its left half each makes one in the right half."""
    image = np.zeros((10, 10, 3), dtype=np.uint8)
    image[:, 5:] = (0, 255, 0)
    Image.fromarray(image).save(tmp_path / "t.png")
    body = "vt 0.25 0.8\nusemtl a\nf 1/2 2/2 3/2\n"
    scan = read_scan(write_obj(tmp_path, body, f"newmtl a\nmap_Kd {line} t.png\n"))
    np.testing.assert_allclose(center_color(scan), [0, 1, 0], atol=1e-5)


def test_one_line_may_name_several_material_files(tmp_path: Path) -> None:
    (tmp_path / "b.mtl").write_text("newmtl b\nKd 0.2 0.4 0.6\n", encoding="utf-8")
    path = write_obj(tmp_path, "usemtl b\nf 1 2 3\n", "newmtl a\nKd 1 1 1\n")
    path.write_text(path.read_text(encoding="utf-8").replace("room.mtl", "room.mtl b.mtl"), encoding="utf-8")
    scan = read_scan(path)
    np.testing.assert_allclose(center_color(scan), [0.2, 0.4, 0.6], atol=1e-6)
    (tmp_path / "room.mtl b.mtl").write_text("newmtl b\nKd 0.5 0.5 0.5\n", encoding="utf-8")
    np.testing.assert_allclose(center_color(read_scan(path)), [0.5, 0.5, 0.5], atol=1e-6)


def test_what_follows_a_sign_in_a_line_of_numbers_is_a_comment(tmp_path: Path) -> None:
    scan = read_scan(write_obj(tmp_path, "v 9 9 9 # unused\nf 1 2 3 # one\nf 1 3 4#two\n"), up="+z", unit="m")
    assert scan.areas.sum() == pytest.approx(9.0)


def test_colours_a_little_above_one_are_no_bytes(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0 1.004 .5 0\nv 3 0 0 1 .5 0\nv 0 3 0 1 .5 0\nf 1 2 3\n", encoding="utf-8")
    np.testing.assert_allclose(center_color(read_scan(path)), decode_srgb([1, 0.5, 0]), atol=1e-6)


def test_names_with_spaces_and_windows_line_ends(tmp_path: Path) -> None:
    quadrants().save(tmp_path / "my room.png")
    path = tmp_path / "room.obj"
    text = OBJ_HEAD.replace("room.mtl", "my room.mtl") + "usemtl the wall\nf 1/1 2/1 \\\n3/1\n"
    path.write_bytes(text.replace("\n", "\r\n").encode())
    (tmp_path / "my room.mtl").write_bytes(b"newmtl the wall\r\nmap_Kd my room.png\r\n")
    np.testing.assert_allclose(center_color(read_scan(path)), [1, 0, 0], atol=1e-5)


def test_a_material_colour_is_used_and_a_missing_library_noted(tmp_path: Path) -> None:
    body = "usemtl a\nf 1 2 3\n"
    scan = read_scan(write_obj(tmp_path, body))
    assert not scan.appearance.known
    assert any("'room.mtl'" in note for note in scan.record.notes)
    scan = read_scan(write_obj(tmp_path, body, "newmtl a\nKd 0.2 0.4 0.6\n"))
    np.testing.assert_allclose(center_color(scan), [0.2, 0.4, 0.6], atol=1e-6)


@pytest.mark.parametrize("scale", [1, 255])
def test_colours_behind_positions_go_to_1_or_to_255(tmp_path: Path, scale: int) -> None:
    color = f"{scale} {0.5 * scale} 0"
    path = tmp_path / "a.obj"
    path.write_text(f"v 0 0 0 {color}\nv 3 0 0 {color}\nv 0 3 0 {color}\nf 1 2 3\n", encoding="utf-8")
    np.testing.assert_allclose(center_color(read_scan(path)), decode_srgb([1, 0.5, 0]), atol=1e-6)


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("f 1 2\n", "line 7"),
        ("f 1 2 0\n", "line 7"),
        ("f 1 2 9\n", "4 positions"),
        ("f 1 2 -9\n", "line 7"),
        ("v 1 x 2\nf 1 2 3\n", "line 7"),
        ("v 1\nf 1 2 3\n", "three numbers"),
        ("vt\nf 1 2 3\n", "line 7"),
    ],
)
def test_a_damaged_line_is_named(tmp_path: Path, body: str, message: str) -> None:
    with pytest.raises(ScanError, match=message):
        read_scan(write_obj(tmp_path, body))


@pytest.mark.parametrize("name", ["../t.png", "/t.png", "http://example.org/t.png"])
def test_an_mtl_reaches_nothing_outside_the_folder(tmp_path: Path, name: str) -> None:
    with pytest.raises(ScanError, match="own folder"):
        read_scan(write_obj(tmp_path, "usemtl a\nf 1/1 2/1 3/1\n", f"newmtl a\nmap_Kd {name}\n"))


@pytest.mark.parametrize("place", ["C:\\scans\\of me\\", "/Users/me/scans/", "D:/"])
def test_files_named_by_full_paths_of_another_machine_are_found_beside_the_scan(tmp_path: Path, place: str) -> None:
    quadrants().save(tmp_path / "my t.png")
    path = write_obj(tmp_path, "usemtl a\nf 1/1 2/1 3/1\n", f"newmtl a\nmap_Kd {place}my t.png\n")
    path.write_text(path.read_text("utf-8").replace("mtllib ", f"mtllib {place}"), encoding="utf-8")
    scan = read_scan(path)
    assert (scan.appearance.face_image == 0).all()
    assert not any("missing" in note for note in scan.record.notes)


def test_parts_without_colours_leave_those_of_an_obj_that_have_them(tmp_path: Path) -> None:
    """Programs that join meshes write six numbers for the vertices of those that have colours, and three for others."""
    body = "v 0 0 3 1 0 0\nv 3 0 3 1 0 0\nv 0 3 3 1 0 0\nf 1 2 3\nf 5 6 7\nusemtl b\nf 1 3 2\n"
    scan = read_scan(write_obj(tmp_path, body, "newmtl b\nKd 0.2 0.4 0.6\n"), up="+z")
    upper, painted = scan.centers[:, 2] > 1.0, scan.appearance.photographed
    np.testing.assert_allclose(scan.face_colors()[upper], [[1, 0, 0]], atol=1e-6)
    np.testing.assert_allclose(scan.face_colors()[painted & ~upper], [[0.2, 0.4, 0.6]], atol=1e-6)
    assert (~painted).sum() == 1


def wall_of_squares(step_m: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """A wall of 3 m x 2 m that runs askew, in squares of two triangles."""
    along, up = np.meshgrid(np.arange(0, 3.01, step_m), np.arange(0, 2.01, step_m), indexing="ij")
    points = np.stack([0.8 * along, 0.6 * along, up], axis=-1).reshape(-1, 3)
    first = (np.arange(along.shape[0] - 1)[:, None] * along.shape[1] + np.arange(along.shape[1] - 1)).ravel()
    right = first + along.shape[1]
    return points, np.concatenate([np.stack([first, right, right + 1], 1), np.stack([first, right + 1, first + 1], 1)])


@pytest.mark.parametrize(
    ("origin", "said"),
    [((0, 0, 0), ""), ((1.2e5, 0, 0), "steps of 8 mm"), ((4e5, 3e5, 0), "steps of 31 mm"), ((5e5, 5.4e6, 0), "500 mm")],
)
def test_a_scan_in_a_maps_coordinates_says_the_steps_of_its_file_or_is_refused(tmp_path: Path, origin, said) -> None:
    """Numbers of 32 bits have half a metre 5,400 km from the origin: the wall would have a tenth more area."""
    points, faces = wall_of_squares()
    trimesh.Trimesh(points + origin, faces, process=False).export(tmp_path / "a.ply")  # 32 bits
    if said == "500 mm":
        with pytest.raises(ScanError, match=r"steps of 500 mm.*local, not georeferenced"):
            read_scan(tmp_path / "a.ply", up="+z", unit="m")
        return
    notes = [note for note in read_scan(tmp_path / "a.ply", up="+z", unit="m").record.notes if "km from" in note]
    assert len(notes) == bool(said)
    assert all(said in note for note in notes)


def test_a_scan_in_a_maps_coordinates_whose_file_has_all_digits_is_read(tmp_path: Path) -> None:
    points, faces = wall_of_squares()
    rows = [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in points + [5e5, 5.4e6, 120.0]]
    (tmp_path / "a.obj").write_text("\n".join([*rows, *(f"f {a} {b} {c}" for a, b, c in faces + 1)]), "utf-8")
    scan = read_scan(tmp_path / "a.obj", up="+z", unit="m")
    assert scan.areas.sum() == pytest.approx(6.0, rel=1e-3)
    assert any("positions to 9 digits, there to 10 mm" in note for note in scan.record.notes)


# --- what is no scan


def test_a_missing_file_a_folder_and_an_unknown_format_are_said(tmp_path: Path) -> None:
    with pytest.raises(ScanError, match="nothing there"):
        read_scan(tmp_path / "no.glb")
    with pytest.raises(ScanError, match="a folder"):
        read_scan(tmp_path)
    for name, message in (("a.txt", "GLB is best"), ("a.las", "point cloud"), ("a.zip", "zip archive")):
        (tmp_path / name).write_bytes(b"x")
        with pytest.raises(ScanError, match=message):
            read_scan(tmp_path / name)
    (tmp_path / "a.glb").write_bytes(b"PK\x03\x04 and so on")
    with pytest.raises(ScanError, match="ZIP"):
        read_scan(tmp_path / "a.glb")


@pytest.mark.parametrize("suffix", ["glb", "gltf", "obj", "ply", "stl"])
def test_an_empty_file_is_refused(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a.{suffix}"
    path.write_bytes(b"")
    with pytest.raises(ScanError):
        read_scan(path)


def test_a_point_cloud_is_refused_with_advice(tmp_path: Path) -> None:
    path = tmp_path / "a.ply"
    path.write_bytes(trimesh.PointCloud(np.random.default_rng(0).random((50, 3))).export(file_type="ply"))
    with pytest.raises(ScanError, match="point cloud"):
        read_scan(path)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30])
def test_positions_that_are_no_numbers_are_refused(tmp_path: Path, value: float) -> None:
    corners = CORNERS.copy()
    corners[1, 2] = value
    with pytest.raises(ScanError, match="1 of 1 triangles"):
        read_scan(write_gltf(tmp_path, arrays={"POSITION": corners}))


def test_texture_coordinates_that_are_no_numbers_are_noted(tmp_path: Path) -> None:
    uv = UV.copy()
    uv[0, 0] = np.nan
    document = textured_document(quadrants(), tmp_path)
    scan = read_scan(write_gltf(tmp_path, document=document, primitive={"material": 0}, arrays={"TEXCOORD_0": uv}))
    assert any("not finite numbers" in note for note in scan.record.notes)


def test_a_vertex_that_no_triangle_uses_does_no_harm(tmp_path: Path) -> None:
    corners = np.vstack([CORNERS, [[np.nan, 0, 0]]]).astype("<f4")
    scan = read_scan(write_gltf(tmp_path, arrays={"POSITION": corners, "indices": np.array([0, 1, 2], dtype="<u4")}))
    assert len(scan.vertices) == 3


def test_files_and_meshes_of_absurd_size_are_refused(room_glb: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(raw_mesh, "MAX_FACES", 100)
    with pytest.raises(ScanError, match="at most 100 triangles"):
        read_scan(room_glb)
    monkeypatch.setattr(raw_mesh, "MAX_FILE_BYTES", 1000)
    with pytest.raises(ScanError, match="at most 1000 bytes"):
        read_scan(room_glb)


def test_without_the_extra_a_usd_file_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.usdz").write_bytes(b"x")
    monkeypatch.setitem(sys.modules, "pxr", None)
    monkeypatch.delitem(sys.modules, "lidarspectra.hardware.phone.usd", raising=False)
    with pytest.raises(ScanError, match=r"lidarspectra\[usd\]"):
        read_scan(tmp_path / "a.usdz")


def test_progress_goes_from_zero_to_one(room_glb: Path) -> None:
    fractions: list[float] = []
    scan = read_scan(room_glb, progress=lambda f, _: fractions.append(f))
    repaired: list[float] = []
    repair_scan(scan, flatten=True, max_faces=len(scan.faces) // 2, progress=lambda f, _: repaired.append(f))
    for each in (fractions, repaired):
        assert each[0] == 0.0
        assert each[-1] == 1.0
        assert each == sorted(each)


@pytest.mark.parametrize(
    ("extra", "rows", "expected", "noted"),
    [
        ("property int texnumber\n", (" 0", " 1"), [[1, 0, 0], [0, 0, 1]], False),
        ("property int texnumber\n", (" 1", " 0"), [[0, 0, 1], [1, 0, 0]], False),
        ("property int texnumber\n", (" 1", " 7"), [[0, 0, 1], None], True),
        ("", ("", ""), [None, None], True),
    ],
)
def test_faces_of_a_ply_have_the_picture_that_they_name(tmp_path: Path, extra, rows, expected, noted) -> None:
    Image.new("RGB", (4, 4), (255, 0, 0)).save(tmp_path / "red.png")
    Image.new("RGB", (4, 4), (0, 0, 255)).save(tmp_path / "the blue.png")
    path = tmp_path / "a.ply"
    path.write_text(
        "ply\nformat ascii 1.0\ncomment TextureFile red.png\ncomment TextureFile the blue.png\nelement vertex 4\n"
        "property float x\nproperty float y\nproperty float z\nelement face 2\n"
        "property list uchar int vertex_indices\nproperty list uchar float texcoord\n"
        f"{extra}end_header\n0 0 0\n3 0 0\n0 3 0\n3 4 0\n"
        f"3 0 1 2 6 0 0 1 0 0 1{rows[0]}\n3 1 3 2 6 0 0 1 0 0 1{rows[1]}\n",
        encoding="utf-8",
    )
    scan = read_scan(path, up="+z", unit="m")
    first = int(scan.areas.argmin())  # of 4.5 and 6 m²
    for face, color in zip((first, 1 - first), expected, strict=True):
        if color is not None:
            np.testing.assert_allclose(scan.face_colors()[face], color, atol=1e-6)
        else:
            assert not scan.appearance.photographed[face]
    assert any("which of them" in note for note in scan.record.notes) == noted


def write_ply(path: Path, vertices: list[str], faces: list[str], of_vertex: str = "", of_face: str = "") -> Path:
    properties = "property float x\nproperty float y\nproperty float z\n" + of_vertex
    head = f"ply\nformat ascii 1.0\ncomment TextureFile t.png\nelement vertex {len(vertices)}\n{properties}"
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\n{of_face}end_header\n"
    path.write_text(head + "\n".join([*vertices, *faces]) + "\n", encoding="utf-8")
    return path


FACE_RGB = "property uchar red\nproperty uchar green\nproperty uchar blue\n"


@pytest.mark.parametrize(("corners", "area_m2"), [(HOLLOW, 14.0), (DART, 2.0)])
@pytest.mark.parametrize("first", [0, 1, 3])
@pytest.mark.parametrize("beside", [(), ("3 0 1 2",)])
def test_a_hollow_polygon_of_a_ply_is_covered_and_nothing_beside_it(
    tmp_path: Path, corners, area_m2, first, beside
) -> None:
    rolled = np.roll(corners, -first, axis=0)
    polygon = " ".join(str(each) for each in (len(rolled), *range(len(rolled))))
    path = write_ply(tmp_path / "a.ply", [f"{x} {y} 0" for x, y in rolled], [polygon, *beside])
    more = 0.5 * abs(float(np.linalg.det([rolled[1] - rolled[0], rolled[2] - rolled[0]]))) if beside else 0.0
    assert read_scan(path, up="+z", unit="m").areas.sum() == pytest.approx(area_m2 + more)


@pytest.mark.parametrize(
    ("properties", "values"),
    [
        ("uchar diffuse_red uchar diffuse_green uchar diffuse_blue", "255 0 51"),
        ("uchar r uchar g uchar b", "255 0 51"),
        ("float red float green float blue", "255 0 51"),
        ("float red float green float blue", "1 0 0.2"),
        ("float s float t uchar red uchar green uchar blue", "0.1 0.2 255 0 51"),
    ],
)
@pytest.mark.parametrize("of_corners", [False, True])
def test_colours_of_a_plys_vertices_are_found_by_other_names_and_beside_coordinates_without_a_picture(
    tmp_path: Path, properties: str, values: str, of_corners: bool
) -> None:
    words = properties.split()
    declared = "".join(f"property {kind} {name}\n" for kind, name in zip(words[::2], words[1::2], strict=True))
    corners = [f"{place} {values}" for place in ("0 0 0", "3 0 0", "3 3 0", "0 3 0")]
    coordinates, listed = (" 6 0 0 1 0 1 1", "property list uchar float texcoord\n") if of_corners else ("", "")
    faces = [f"3 0 1 2{coordinates}", f"3 0 2 3{coordinates}"]
    path = write_ply(tmp_path / "a.ply", corners, faces, of_vertex=declared, of_face=listed)
    scan = read_scan(path, up="+z", unit="m")
    assert scan.appearance.known
    np.testing.assert_allclose(scan.appearance.corner_color, np.broadcast_to([1.0, 0.0, 0.2], (2, 3, 3)), atol=1e-6)


def test_colours_and_pictures_of_polygons_of_a_ply_stay_with_them(tmp_path: Path) -> None:
    corners = ["0 0 0", "3 0 0", "3 3 0", "0 3 0", "6 0 0", "6 3 0", "9 0 0"]
    faces = ["4 0 1 2 3 255 0 0", "3 4 6 5 0 255 0", "4 1 4 5 2 0 0 255"]
    scan = read_scan(write_ply(tmp_path / "a.ply", corners, faces, of_face=FACE_RGB), up="+z", unit="m")
    place = scan.centers[:, 0]
    for color, here in zip(np.eye(3), (place < 3, place > 6, (place > 3) & (place < 6)), strict=True):
        np.testing.assert_allclose(scan.face_colors()[here], np.tile(color, (here.sum(), 1)), atol=1e-6)
    quadrants().save(tmp_path / "t.png")
    rows = ["4 0 1 2 3 8 0.2 0.8 0.3 0.8 0.3 0.9 0.2 0.9", "4 1 4 5 2 8 0.2 0.2 0.3 0.2 0.3 0.3 0.2 0.3"]
    listed = "property list uchar float texcoord\n"
    scan = read_scan(write_ply(tmp_path / "a.ply", corners, rows, of_face=listed), up="+z", unit="m")
    left = scan.centers[:, 0] < 3
    np.testing.assert_allclose(scan.face_colors()[left], [[1, 0, 0], [1, 0, 0]], atol=1e-5)
    np.testing.assert_allclose(scan.face_colors()[~left], [[0, 0, 1], [0, 0, 1]], atol=1e-5)


def test_a_binary_ply_of_polygons_of_different_sizes_is_refused_with_what_to_do(tmp_path: Path) -> None:
    head = write_ply(tmp_path / "a.ply", ["0 0 0"] * 4, ["", ""]).read_bytes().split(b"end_header\n")[0]
    corners = np.array([[0, 0, 0], [3, 0, 0], [3, 3, 0], [0, 3, 0]], dtype="<f4").tobytes()
    faces = struct.pack("<B3i", 3, 0, 1, 2) + struct.pack("<B4i", 4, 0, 1, 2, 3)
    head = head.replace(b"ascii", b"binary_little_endian") + b"end_header\n"
    (tmp_path / "a.ply").write_bytes(head + corners + faces)
    with pytest.raises(ScanError, match="polygons of different sizes"):
        read_scan(tmp_path / "a.ply")


# --- USD


def test_a_usdz_comes_back_with_texture_and_unit(tmp_path: Path) -> None:
    pytest.importorskip("pxr", reason="the extra 'usd' is not installed")
    from pxr import Sdf, Usd, UsdGeom, UsdShade, UsdUtils

    quadrants().save(tmp_path / "t.png")
    stage = Usd.Stage.CreateNew(str(tmp_path / "a.usda"))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    UsdGeom.Xform.Define(stage, "/Room").AddTranslateOp().Set((0, 0, 100))
    mesh = UsdGeom.Mesh.Define(stage, "/Room/Mesh")
    mesh.CreatePointsAttr([(0, 0, 0), (300, 0, 0), (300, 300, 0), (0, 300, 0)])
    mesh.CreateFaceVertexCountsAttr([4])
    mesh.CreateFaceVertexIndicesAttr([0, 1, 2, 3])
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.faceVarying)
    st.Set([(0.1, 0.9)] * 4)
    material = UsdShade.Material.Define(stage, "/Looks/M")
    surface = UsdShade.Shader.Define(stage, "/Looks/M/S")
    surface.CreateIdAttr("UsdPreviewSurface")
    texture = UsdShade.Shader.Define(stage, "/Looks/M/T")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set("t.png")
    output = texture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(output)
    material.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", Sdf.ValueTypeNames.Token))
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    stage.Save()
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "a.usda"), str(tmp_path / "a.usdz"))
    for name in ("a.usda", "a.usdz"):
        scan = read_scan(tmp_path / name)
        assert (scan.record.unit, scan.record.up_axis) == ("cm", "+z")
        assert scan.areas.sum() == pytest.approx(9.0)
        np.testing.assert_allclose(scan.bounds[:, 2], 1.0)
        np.testing.assert_allclose(center_color(scan), [1, 0, 0], atol=1e-5)


@pytest.mark.parametrize(
    ("said", "place", "expected"),
    [
        ("", (0.25, 0.75), (0.5, 0.1, 0.0)),
        ("float4 inputs:scale = (0.5, 2, 1, 1)", (0.25, 0.75), (0.25, 0.2, 0.0)),
        ("float4 inputs:bias = (0.25, 0, 0.125, 0)", (0.25, 0.75), (0.75, 0.1, 0.125)),
        ('token inputs:sourceColorSpace = "raw"', (0.25, 0.75), (188 / 255, 89 / 255, 0.0)),
        ('token inputs:wrapS = "mirror"\ntoken inputs:wrapT = "mirror"', (1.25, -0.25), (0.0, 0.0, 1.0)),
        ('token inputs:wrapS = "mirror"', (-0.25, 0.75), (0.5, 0.1, 0.0)),
        ('token inputs:wrapT = "mirror"', (1.25, 1.25), (0.5, 0.1, 0.0)),
        ('token inputs:wrapS = "clamp"\ntoken inputs:wrapT = "clamp"', (1.25, -0.25), (0.0, 0.0, 1.0)),
        ('token inputs:wrapS = "repeat"', (-0.75, 0.75), (0.5, 0.1, 0.0)),
    ],
)
def test_a_usd_texture_has_the_colours_and_the_edges_that_its_material_says(
    tmp_path: Path, read_usda, said: str, place: tuple[float, float], expected: tuple[float, float, float]
) -> None:
    """Of a picture that is orange at its upper left, blue at its lower right, and white elsewhere."""
    pixels = np.full((64, 64, 3), 255, dtype=np.uint8)
    pixels[:32, :32], pixels[32:, 32:] = (188, 89, 0), (0, 0, 255)  # .5 and .1 in linear light
    Image.fromarray(pixels).save(tmp_path / "t.png")
    looks = f"""def Material "M" {{
    token outputs:surface.connect = </r/M/S.outputs:surface>
    def Shader "S" {{
      uniform token info:id = "UsdPreviewSurface"
      color3f inputs:diffuseColor.connect = </r/M/T.outputs:rgb>
      token outputs:surface
    }}
    def Shader "T" {{
      uniform token info:id = "UsdUVTexture"
      asset inputs:file = @./t.png@
      {said}
      float3 outputs:rgb
    }}
  }}"""
    more = f'texCoord2f[] primvars:st = [{place}] (interpolation = "constant")\n{BOUND}'
    colors = read_usda(more=more, beside=looks).face_colors()
    np.testing.assert_allclose(colors, np.tile(expected, (12, 1)), atol=0.006)  # half a byte, 1.2 % at .5


@pytest.mark.parametrize(("scale", "handed", "normal"), [
    (1, "rightHanded", 1), (-1, "rightHanded", 1), (1, "leftHanded", -1), (-1, "leftHanded", -1),
])  # fmt: skip
def test_a_mirrored_or_left_handed_usd_mesh_keeps_its_front(
    tmp_path: Path, scale: int, handed: str, normal: int
) -> None:
    pytest.importorskip("pxr", reason="the extra 'usd' is not installed")
    path = tmp_path / "a.usda"
    path.write_text(
        f"""#usda 1.0
(
  upAxis = "Z"
  metersPerUnit = 1
)
def Xform "r" {{
  double3 xformOp:scale = ({scale}, 1, 1)
  uniform token[] xformOpOrder = ["xformOp:scale"]
  def Mesh "m" {{
    uniform token orientation = "{handed}"
    point3f[] points = [(0, 0, 0), (3, 0, 0), (0, 3, 0)]
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    color3f[] primvars:displayColor = [(1, 0, 0), (0, 1, 0), (0, 0, 1)] (interpolation = "vertex")
  }}
}}
""",
        encoding="utf-8",
    )
    scan = read_scan(path)
    np.testing.assert_allclose(scan.normals, [[0, 0, normal]])
    # colours went with their corners: the one at (3, 0, 0) is green
    green = scan.appearance.corner_color[0][:, 1].argmax()
    np.testing.assert_allclose(scan.corners[0, green], [3 * scale, 0, 0])


def test_a_binary_usd_layer_by_itself_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("pxr", reason="the extra 'usd' is not installed")
    (tmp_path / "a.usd").write_bytes(b"PXR-USDC" + bytes(100))
    with pytest.raises(ScanError, match="USDZ"):
        read_scan(tmp_path / "a.usd")


def test_a_usd_scene_that_refers_outside_its_folder_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("pxr", reason="the extra 'usd' is not installed")
    inner = tmp_path / "inner"
    inner.mkdir()
    (tmp_path / "other.usda").write_text('#usda 1.0\ndef Mesh "m" {}\n', encoding="utf-8")
    (inner / "a.usda").write_text("#usda 1.0\n(\n subLayers = [@../other.usda@]\n)\n", encoding="utf-8")
    with pytest.raises(ScanError, match="one file or folder"):
        read_scan(inner / "a.usda")


# --- a real scan


@pytest.mark.skipif(not MEETING_ROOM.is_file(), reason=f"the real scan is not at {MEETING_ROOM}")
def test_the_real_meeting_room_is_watertight_upright_and_of_its_true_height() -> None:
    scan = repair_scan(read_scan(MEETING_ROOM))
    record = scan.record
    assert (record.unit, record.up_axis, record.faces_read, record.holes_closed) == ("m", "+y", 27_560, 0)
    assert (record.flipped_faces, record.holes_open, record.duplicate_faces) == (0, 0, 0)
    up = scan.normals[:, 2]
    floor = scan.centers[up > 0.97, 2]
    ceiling = scan.centers[up < -0.97, 2]
    # a common office ceiling; floor normals look up and ceiling normals down, that is into the room
    assert 2.2 < np.median(ceiling) - np.median(floor) < 2.7
    blue_carpet = scan.face_colors()[(up > 0.97) & (scan.centers[:, 2] < np.median(floor) + 0.05)].mean(axis=0)
    assert blue_carpet[2] > 1.5 * blue_carpet[0]
