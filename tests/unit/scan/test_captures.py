"""Raw data of apps: frames with their poses in the mesh's axes, and what is broken left out by name."""

import contextlib
import json
import shutil
import zipfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from lidarspectra.errors import ScanError
from lidarspectra.hardware.phone.captures import read_capture
from lidarspectra.hardware.phone.frames import Capture, Frame, FrameFault, without_jumps
from lidarspectra.hardware.phone.readers import read_scan, read_scan_and_frames

from .capture_layouts import SIZE_PX, box_room, gray_shots, jpeg, png, turning_pose, write_3dscanner, write_polycam
from .test_reader_fuzz import damaged

CASES = 60


@pytest.fixture(scope="module")
def scanner_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    room = box_room()
    return write_3dscanner(tmp_path_factory.mktemp("captures") / "scan", room, gray_shots(room))


@pytest.fixture
def copied(scanner_folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(scanner_folder, tmp_path / "scan"))


def reasons(capture: Capture) -> dict[str, str]:
    return {each.name: each.reason for each in capture.left_out}


def test_a_folder_of_3d_scanner_app_gives_the_mesh_and_its_frames_in_one_system_of_axes(scanner_folder: Path) -> None:
    scan, capture = read_scan_and_frames(scanner_folder)
    assert capture is not None
    assert np.allclose(scan.bounds[1] - scan.bounds[0], (4.0, 3.0, 2.6), atol=1e-6)  # z up
    assert [frame.name for frame in capture.frames] == [f"{number:05d}" for number in range(6)]
    ahead = -capture.frames[0].camera_to_world[:3, 2]
    assert np.allclose(ahead, (0.0, 1.0, 0.0), atol=1e-9)  # -z of axes with y up is +y of those with z up
    assert capture.frames[0].read_image(SIZE_PX[0]).shape == (72, 96, 3)
    depth = capture.frames[0].read_depth()
    assert depth is not None
    assert depth.depth_m[9, 12] == pytest.approx(1.5, abs=2e-3)  # half of the room's 3 m
    assert capture.frames[0].exposure_s == pytest.approx(1 / 60)
    assert capture.frames[0].iso is None


def test_a_capture_that_leans_is_set_upright_with_its_frames(tmp_path: Path) -> None:
    room = box_room()
    lean = trimesh.transformations.rotation_matrix(np.radians(8.0), [0.3, 0.0, 1.0])
    shots = [replace(shot, pose=lean @ shot.pose) for shot in gray_shots(room)]
    room.apply_transform(lean)
    scan, capture = read_scan_and_frames(write_3dscanner(tmp_path / "scan", room, shots))
    assert capture is not None
    assert np.allclose(scan.bounds[1] - scan.bounds[0], (4.0, 3.0, 2.6), atol=1e-3)
    for number, frame in enumerate(capture.frames):
        looked, turn = -frame.camera_to_world[:3, 2], np.radians(360.0 * number / len(shots))
        assert np.allclose(looked, (-np.sin(turn), np.cos(turn), 0.0), atol=1e-3)
        assert np.allclose(frame.camera_to_world[:3, 3], (0.05 * number, 0.0, 0.0), atol=1e-3)


def test_an_archive_is_read_like_the_folder_wherever_the_layout_begins_in_it(
    scanner_folder: Path, tmp_path: Path
) -> None:
    archive = Path(shutil.make_archive(str(tmp_path / "a"), "zip", scanner_folder.parent, scanner_folder.name))
    inside, outside = read_capture(archive), read_capture(scanner_folder)
    assert len(inside.frames) == len(outside.frames)
    for one, other in zip(inside.frames, outside.frames, strict=True):
        assert np.array_equal(one.camera_to_world, other.camera_to_world)
        assert np.array_equal(one.read_image(1), other.read_image(1))
    assert len(read_scan(archive).faces) == len(read_scan(scanner_folder).faces)


def test_poses_between_two_pictures_of_3d_scanner_app_are_no_frames_that_are_lost(copied: Path) -> None:
    """The app has a pose and a depth for each, and keeps the picture of every sixth or so."""
    for number in (1, 2, 4, 5):
        (copied / f"frame_{number:05d}.jpg").unlink()
    scan, capture = read_scan_and_frames(copied)
    assert capture is not None
    assert [frame.name for frame in capture.frames] == ["00000", "00003"]
    assert capture.left_out == ()
    assert any("Of the 6 poses that the app exported, 2 have a picture" in note for note in scan.record.notes)
    for number in (0, 3):
        (copied / f"frame_{number:05d}.jpg").unlink()
    with pytest.raises(ScanError, match=r"6 that cannot be used.*\.jpg is missing"):
        read_capture(copied)


@pytest.mark.parametrize("app", ["3D Scanner App", "Polycam"])
@pytest.mark.parametrize("kind", ["folder", "archive"])
def test_what_a_mac_puts_beside_every_file_is_no_frame(app: str, kind: str, tmp_path: Path) -> None:
    """Its attributes, under the same name after "._", on sticks and shares, and in an archive in a folder apart."""
    room, raw = box_room(), tmp_path / "outer" / "raw"
    if app == "Polycam":
        write_polycam(raw, room, gray_shots(room, 3), np.eye(4))
    else:
        write_3dscanner(raw, room, gray_shots(room, 3))
    for path in [each for each in raw.rglob("*") if each.is_file()]:
        apart = tmp_path / "outer" / "__MACOSX" / path.relative_to(raw.parent)
        apart.parent.mkdir(parents=True, exist_ok=True)
        for place in (path.parent, apart.parent):
            (place / f"._{path.name}").write_bytes(b"\0\5\x16\7")
    outer = tmp_path / "outer"
    capture = read_capture(outer if kind == "folder" else Path(shutil.make_archive(str(outer), "zip", outer)))
    assert len(capture.frames) == 3
    assert capture.left_out == ()
    assert capture.mesh is not None
    capture.close()


@pytest.mark.parametrize("kind", ["folder", "archive"])
def test_of_a_folder_of_two_scans_neither_is_taken_for_the_one_that_is_meant(
    scanner_folder: Path, tmp_path: Path, kind: str
) -> None:
    outer, room = tmp_path / "scans", box_room()
    shutil.copytree(scanner_folder, outer / "kitchen")
    shutil.copytree(scanner_folder, outer / "kitchen" / "copy")  # in the folder of a scan, and so its own
    given = outer if kind == "folder" else Path(shutil.make_archive(str(tmp_path / "a"), "zip", outer))
    assert len(read_capture(given).frames) == 6
    write_polycam(outer / "later" / "attic", room, gray_shots(room, 3), np.eye(4))
    given = outer if kind == "folder" else Path(shutil.make_archive(str(tmp_path / "a"), "zip", outer))
    with pytest.raises(ScanError, match=r"that of 2: kitchen, later/attic.*the folder of one of them"):
        read_capture(given)


def test_an_archive_that_was_closed_is_opened_again_when_its_frames_are_looked_at_once_more(
    scanner_folder: Path, tmp_path: Path
) -> None:
    """Colours are taken from frames, which are then closed, and mirrors and glass looked for in them afterwards."""
    capture = read_capture(Path(shutil.make_archive(str(tmp_path / "a"), "zip", scanner_folder)))
    first = capture.frames[0].read_image(1)
    capture.close()
    assert np.array_equal(capture.frames[0].read_image(1), first)
    capture.close()


def test_the_directory_of_an_archive_is_parsed_once_for_all_its_files(
    scanner_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    archive = Path(shutil.make_archive(str(tmp_path / "a"), "zip", scanner_folder))
    opened: list[zipfile.ZipFile] = []

    class Counted(zipfile.ZipFile):
        def __init__(self, path: Path) -> None:
            super().__init__(path)
            opened.append(self)

    monkeypatch.setattr(zipfile, "ZipFile", Counted)
    capture = read_capture(archive)
    with ThreadPoolExecutor(4) as pool:
        pictures = list(pool.map(lambda frame: frame.read_image(SIZE_PX[0]), capture.frames))
    assert [picture.shape for picture in pictures] == [(72, 96, 3)] * 6
    assert len(opened) == 1
    capture.close()
    assert opened[0].fp is None
    assert capture.frames[0].read_depth() is not None  # opened again
    capture.close()
    assert [each.fp for each in opened] == [None, None]


def test_polycams_poses_are_turned_with_its_mesh_and_exposures_are_read(tmp_path: Path) -> None:
    room = box_room()
    alignment = turning_pose(30.0, 0.0, (1.0, 0.2, -0.5))
    capture = read_capture(write_polycam(tmp_path / "raw", room, gray_shots(room), alignment))
    assert capture.app == "Polycam"
    assert capture.mesh is not None
    assert np.allclose(capture.frames[0].position, alignment[:3, 3])
    assert np.allclose(capture.frames[0].camera_to_world[:3, :3], alignment[:3, :3])
    corners = np.concatenate([part.vertices for part in capture.mesh.parts])
    assert np.allclose((corners.min(axis=0) + corners.max(axis=0)) / 2, alignment[:3, 3], atol=1e-5)
    assert capture.frames[0].iso == 100.0
    depth = capture.frames[0].read_depth()
    assert depth is not None
    assert set(np.unique(depth.confidence)) == {2}


@pytest.mark.parametrize("kind", ["folder", "archive"])
@pytest.mark.parametrize("name", ["texture.png", "private.png", "../private.png", "/etc/passwd"])
def test_a_mesh_finds_its_textures_in_its_own_capture_and_nowhere_else(tmp_path: Path, kind: str, name: str) -> None:
    room = box_room()
    outer = tmp_path / "outer"
    write_polycam(outer / "raw", room, gray_shots(room, 3), np.eye(4))
    (outer / "raw" / "raw.glb").write_bytes(glb_with_texture(room, name))
    for beside in (tmp_path, outer):  # of the archive, and of the layout within the folder
        (beside / "private.png").write_bytes(png_of((250, 0, 0)))
    (outer / "raw" / "texture.png").write_bytes(png_of((0, 250, 0)))
    path = outer if kind == "folder" else Path(shutil.make_archive(str(tmp_path / "a"), "zip", outer))
    if name not in ("texture.png", "private.png"):
        with pytest.raises(ScanError, match="own folder"):
            read_capture(path)
        return
    mesh = read_capture(path).mesh
    assert mesh is not None
    found = [image[0, 0].tolist() for image in mesh.images]
    assert found == ([[0, 250, 0]] if name == "texture.png" else [])
    assert any("private.png" in note for note in mesh.notes) == (not found)


def png_of(color: tuple[int, int, int]) -> bytes:
    """A picture of one colour."""
    return png(np.full((8, 8, 3), color, dtype=np.uint8))


def glb_with_texture(room: trimesh.Trimesh, name: str) -> bytes:
    """A GLB file whose texture is a file of a name."""
    uv = np.random.default_rng(1).random((len(room.vertices), 2))
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.new("RGB", (8, 8)))
    mesh = room.copy()
    mesh.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    data = mesh.export(file_type="glb")
    length = int.from_bytes(data[12:16], "little")
    document = json.loads(data[20 : 20 + length])
    document["images"] = [{"uri": name}]
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    size = (20 + len(text) + len(rest)).to_bytes(4, "little")
    return bytes(data[:8] + size + len(text).to_bytes(4, "little") + b"JSON" + text + rest)


def test_polycams_corrected_cameras_go_with_the_exposures_of_the_plain_ones(tmp_path: Path) -> None:
    room = box_room()
    folder = write_polycam(tmp_path / "raw", room, gray_shots(room), np.eye(4))
    for name in ("cameras", "images"):
        shutil.copytree(folder / "keyframes" / name, folder / "keyframes" / f"corrected_{name}")
    for path in (folder / "keyframes" / "corrected_cameras").iterdir():
        about = json.loads(path.read_text())
        about["t_03"] += 0.25
        path.write_text(json.dumps({key: value for key, value in about.items() if key not in ("iso", "exposure_time")}))
    frame = read_capture(folder).frames[0]
    assert frame.position[0] == pytest.approx(0.25)
    assert frame.iso == 100.0


@pytest.mark.parametrize("name", ["cameras", "images"])
def test_a_frame_of_polycam_whose_pose_was_not_corrected_is_not_mixed_with_those_whose_was(
    tmp_path: Path, name: str
) -> None:
    """Before a loop is closed a walk has drifted by decimetres; its pictures would smear what the others show."""
    room = box_room()
    folder = write_polycam(tmp_path / "raw", room, gray_shots(room), np.eye(4)) / "keyframes"
    whole = [frame.name for frame in read_capture(folder.parent).frames]
    for each in ("cameras", "images"):
        shutil.copytree(folder / each, folder / f"corrected_{each}")
    sorted((folder / f"corrected_{name}").iterdir())[1].unlink()
    capture = read_capture(folder.parent)
    assert [frame.name for frame in capture.frames] == [whole[0], *whole[2:]]
    assert "did not correct its pose" in reasons(capture)[whole[1]]


def test_broken_frames_are_left_out_by_name_and_the_others_stay(copied: Path) -> None:
    (copied / "frame_00001.json").unlink()
    about = json.loads((copied / "frame_00002.json").read_text())
    about["cameraPoseARFrame"] = about["cameraPoseARFrame"][:-1]
    (copied / "frame_00002.json").write_text(json.dumps(about))
    (copied / "frame_00003.jpg").write_bytes(b"")
    capture = read_capture(copied)
    assert [frame.name for frame in capture.frames] == ["00000", "00004", "00005"]
    assert set(reasons(capture)) == {"00001", "00002", "00003"}
    assert "pose" in reasons(capture)["00002"]


@pytest.mark.parametrize(
    ("across", "down", "swap"), [(0.5, 0.5, False), (2.0, 2.0, False), (1.0, 1.3, False), (1.0, 1.0, True)]
)
def test_intrinsics_of_another_picture_are_a_fault_of_their_frame(copied: Path, across, down, swap) -> None:
    about = json.loads((copied / "frame_00002.json").read_text())
    matrix = np.diag([across, down, 1.0]) @ np.reshape(about["intrinsics"], (3, 3))
    if swap:  # of the picture held upright
        matrix[0, 2], matrix[1, 2] = matrix[1, 2], matrix[0, 2]
    about["intrinsics"] = matrix.ravel().tolist()
    (copied / "frame_00002.json").write_text(json.dumps(about))
    capture = read_capture(copied)
    assert "intrinsics" in reasons(capture)["00002"]
    assert len(capture.frames) == 5


def test_a_cut_picture_and_a_depth_of_another_shape_are_faults_of_their_frames(copied: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 255, (SIZE_PX[1], SIZE_PX[0], 3), dtype=np.uint8)
    data = jpeg(noise)
    (copied / "frame_00000.jpg").write_bytes(data[: 3 * len(data) // 4])
    (copied / "depth_00001.png").write_bytes((copied / "frame_00001.jpg").read_bytes())
    frames = {frame.name: frame for frame in read_capture(copied).frames}
    with pytest.raises(FrameFault, match="picture"):
        frames["00000"].read_image(1000)
    with pytest.raises(FrameFault, match="depth"):
        frames["00001"].read_depth()


def test_a_pose_that_jumps_away_and_back_is_left_out(copied: Path) -> None:
    about = json.loads((copied / "frame_00003.json").read_text())
    about["cameraPoseARFrame"][3] += 8.0  # m, in half a second
    (copied / "frame_00003.json").write_text(json.dumps(about))
    capture = read_capture(copied)
    assert "jumps" in reasons(capture)["00003"]
    assert len(capture.frames) == 5


def walked(*positions_m: float, step_s: float = 0.5) -> list[Frame]:
    """Frames along a line."""
    frames = []
    for number, x in enumerate(positions_m):
        pose = np.eye(4)
        pose[0, 3] = x
        frames.append(
            Frame(
                name=str(number), camera_to_world=pose, intrinsics=np.eye(3), size_px=(4, 3), time_s=number * step_s,
                read_image=lambda _: np.zeros((3, 4, 3), dtype=np.uint8), read_depth=lambda: None,
            )
        )  # fmt: skip
    return frames


@pytest.mark.parametrize(
    ("positions_m", "jumped"),
    [
        ((0.0, 0.1, 1.7, 0.3, 0.4), ["2"]),  # 3 m/s, which a floor that is looked down upon does not tell by its depth
        ((0.0, 0.1, 1.7, 1.8, 0.4, 0.5), ["2", "3"]),  # two that were shifted alike
        ((0.0, 0.1, 1.7, 0.3, 0.4, 1.9, 0.6), ["2", "5"]),
        ((1.7, 0.0, 0.1, 0.2, 0.3), ["0"]),
        ((0.0, 0.1, 0.2, 0.3, 1.9), ["4"]),
        ((0.0, 1.7), []),  # which of two is wrong, nothing tells
        ((0.0, 0.6, 1.2, 0.6, 0.0), []),  # quick steps, and an arm that swings back
        ((0.0, 0.1, 3.0, 3.1, 3.2), []),  # somebody who began anew there: the mesh says which of them are wrong
    ],
)
def test_poses_that_no_walk_has_are_left_out_and_quick_ones_kept(
    positions_m: tuple[float, ...], jumped: list[str]
) -> None:
    kept, out = without_jumps(walked(*positions_m))
    assert [each.name for each in out] == jumped
    assert len(kept) + len(out) == len(positions_m)


def test_a_hand_that_trembles_in_a_video_is_no_jump() -> None:
    assert not without_jumps(walked(0.0, 0.05, 0.0, 0.05, 0.0, step_s=1 / 60))[1]


def test_a_folder_of_something_else_is_refused_and_says_what_it_should_be(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("nothing")
    with pytest.raises(ScanError, match=r"3D Scanner App.*Polycam"):
        read_scan(tmp_path)


def test_of_the_meshes_of_3d_scanner_app_the_textured_one_is_taken(copied: Path) -> None:
    """What no frame saw has its colours from there; `export.obj` has none."""
    room = box_room()
    lines = [f"v {x} {y} {z}" for x, y, z in room.vertices.tolist()]
    lines += ["mtllib textured_output.mtl", "usemtl m", "vt 0.5 0.5"]
    lines += [f"f {a + 1}/1 {b + 1}/1 {c + 1}/1" for a, b, c in room.faces.tolist()]
    (copied / "textured_output.obj").write_text("\n".join(lines), encoding="utf-8")
    (copied / "textured_output.mtl").write_text("newmtl m\nmap_Kd textured_output.jpg\n", encoding="utf-8")
    (copied / "textured_output.jpg").write_bytes(jpeg(np.full((8, 8, 3), 188, dtype=np.uint8)))
    scan = read_scan(copied)
    assert scan.appearance.known
    assert scan.face_colors() == pytest.approx(0.5, abs=0.02)
    assert any("textured_output.obj was taken, and not export.obj" in note for note in scan.record.notes)
    (copied / "textured_output.jpg").unlink()
    scan = read_scan(copied)
    assert not scan.appearance.known
    assert any("export.obj was taken" in note and "picture" in note for note in scan.record.notes)


OBJ_OF_BOX = [f"v {x} {y} {z}" for x, y, z in box_room().vertices.tolist()] + ["vt 0.5 0.5", "usemtl m"]
OBJ_OF_BOX += [f"f {a + 1}/1 {b + 1}/1 {c + 1}/1" for a, b, c in box_room().faces.tolist()]


@pytest.mark.parametrize("above", ["", "My scan/"])
@pytest.mark.parametrize("others", [(), ("export.obj", "info.json")])
def test_an_obj_is_read_with_its_picture_in_the_archive_that_apps_pack_it_in(tmp_path: Path, above, others) -> None:
    files = {"room 1.obj": "\n".join(["mtllib room 1.mtl", *OBJ_OF_BOX]), "room 1.mtl": "newmtl m\nmap_Kd t.jpg\n"}
    files |= dict.fromkeys(others, "v 0 0 0")
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        for name, content in files.items():
            archive.writestr(above + name, content)
        archive.writestr(f"{above}t.jpg", jpeg(np.full((8, 8, 3), 188, dtype=np.uint8)))
        archive.writestr("__MACOSX/._room 1.obj", "x")
    scan = read_scan(tmp_path / "a.zip")
    assert np.allclose(scan.bounds[1] - scan.bounds[0], (4.0, 3.0, 2.6), atol=1e-6)
    assert scan.face_colors() == pytest.approx(0.5, abs=0.02)
    assert any(f"its mesh was read, {above}room 1.obj" in note for note in scan.record.notes)


def test_of_several_meshes_in_an_archive_none_is_guessed(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        for name in ("a.obj", "b.mtl", "b.obj", "c.mtl", "c.obj"):
            archive.writestr(name, "")
    with pytest.raises(ScanError, match=r"3 meshes: unpack it all, and give b\.obj itself"):
        read_scan(tmp_path / "a.zip")


def test_a_link_in_a_folder_is_not_followed(copied: Path, tmp_path: Path) -> None:
    secret = tmp_path / "secret.jpg"
    secret.write_bytes((copied / "frame_00000.jpg").read_bytes())
    (copied / "frame_00000.jpg").unlink()
    (copied / "frame_00000.jpg").symlink_to(secret)
    assert "00000" not in [frame.name for frame in read_capture(copied).frames]


@pytest.mark.parametrize(
    "name", ["frame_00000.json", "frame_00000.jpg", "depth_00000.png", "conf_00000.png", "export.obj"]
)
def test_a_damaged_file_of_3d_scanner_app_gives_frames_or_our_error(copied: Path, name: str) -> None:
    data = (copied / name).read_bytes()
    rng = np.random.default_rng(7)
    for _ in range(CASES):
        (copied / name).write_bytes(damaged(data, rng))
        read_all(copied)


@pytest.mark.parametrize("name", ["mesh_info.json", "keyframes/cameras/1000000.json", "raw.glb"])
def test_a_damaged_file_of_polycam_gives_frames_or_our_error(tmp_path: Path, name: str) -> None:
    room = box_room()
    folder = write_polycam(tmp_path / "raw", room, gray_shots(room, 3), turning_pose(20.0, 0.0))
    data = (folder / name).read_bytes()
    rng = np.random.default_rng(8)
    for _ in range(CASES):
        (folder / name).write_bytes(damaged(data, rng))
        read_all(folder)


def test_a_damaged_archive_gives_frames_or_our_error(scanner_folder: Path, tmp_path: Path) -> None:
    archive = Path(shutil.make_archive(str(tmp_path / "a"), "zip", scanner_folder))
    data = archive.read_bytes()
    rng = np.random.default_rng(9)
    refused = 0
    for _ in range(CASES):
        archive.write_bytes(damaged(data, rng))
        refused += not read_all(archive)
    assert refused > 5  # one that is cut off has no listing


def read_all(path: Path) -> bool:
    """Read mesh, poses, pictures and depths; whether it could be read at all."""
    try:
        scan, capture = read_scan_and_frames(path)
    except ScanError:
        return False
    assert np.isfinite(scan.vertices).all()
    assert capture is not None
    for frame in capture.frames[:2]:
        assert np.isfinite(frame.camera_to_world).all()
        for read in (lambda frame=frame: frame.read_image(64), frame.read_depth):
            with contextlib.suppress(FrameFault):
                read()
    return True
