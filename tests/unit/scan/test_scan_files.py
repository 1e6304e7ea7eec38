import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lidarspectra.errors import ArrayError, ScanError
from lidarspectra.geometry.scan import MESH_FILE, RECORD_FILE, Scan, load_scan, save_scan, some_faces, with_record
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.room.room_planes import face_geometry


@pytest.fixture
def saved(room_glb: Path, tmp_path: Path) -> tuple[Scan, Path]:
    scan = read_scan(room_glb)
    scan = replace(scan, record=replace(scan.record, notes=("ein Ärmel", "zwei"), holes_closed=3))
    folder = tmp_path / "1-scan"
    save_scan(scan, folder)
    return scan, folder


def test_a_saved_scan_comes_back_bit_by_bit(saved: tuple[Scan, Path]) -> None:
    scan, folder = saved
    back = load_scan(folder)
    assert back.record == scan.record
    np.testing.assert_array_equal(back.vertices, scan.vertices)
    np.testing.assert_array_equal(back.faces, scan.faces)
    for name in ("face_image", "corner_uv", "corner_color", "known"):
        np.testing.assert_array_equal(getattr(back.appearance, name), getattr(scan.appearance, name))
    np.testing.assert_array_equal(back.appearance.images[0], scan.appearance.images[0])
    np.testing.assert_array_equal(back.face_colors(), scan.face_colors())


def test_some_faces_and_another_record_keep_what_was_worked_out_as_it_would_be_again(room_glb: Path) -> None:
    scan = read_scan(room_glb)
    order = np.random.default_rng(4).permutation(len(scan.faces))[:40]
    record = replace(scan.record, holes_open=7)
    fresh = some_faces(scan, order, record=record)  # nothing was worked out yet
    worked_out = [scan.centers, scan.areas, scan.normals, scan.bounds, face_geometry(scan).areas]
    for other, expected in ((some_faces(scan, order, record=record), fresh), (with_record(scan, record), scan)):
        assert other.record == record
        for name in ("vertices", "faces", "centers", "areas", "normals", "bounds"):
            np.testing.assert_array_equal(getattr(other, name), getattr(expected, name), strict=True)
            assert not getattr(other, name).flags.writeable
        np.testing.assert_array_equal(other.appearance.corner_uv, expected.appearance.corner_uv)
    assert with_record(scan, record).areas is worked_out[1]
    assert face_geometry(with_record(scan, record)) is face_geometry(scan)
    assert len(face_geometry(fresh).areas) < len(face_geometry(scan).areas)


@pytest.mark.parametrize("name", [MESH_FILE, RECORD_FILE, "texture0.png"])
def test_a_folder_that_lacks_a_file_or_half_of_it_is_refused(saved: tuple[Scan, Path], name: str) -> None:
    path = saved[1] / name
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    with pytest.raises(ScanError, match="scan stage"):
        load_scan(saved[1])
    path.unlink()
    with pytest.raises(ScanError, match="scan stage"):
        load_scan(saved[1])


def test_arrays_that_hold_objects_are_not_unpickled(saved: tuple[Scan, Path]) -> None:
    np.savez(saved[1] / MESH_FILE, vertices=np.array([{"a": 1}], dtype=object))
    with pytest.raises(ScanError, match=r"allow_pickle|KeyError"):
        load_scan(saved[1])


@pytest.mark.parametrize(("key", "value"), [("format", 99), ("faces", 5), ("images", 2), ("record", {"file": 1})])
def test_a_record_that_does_not_fit_is_refused(saved: tuple[Scan, Path], key: str, value: object) -> None:
    path = saved[1] / RECORD_FILE
    about = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps(about | {key: value}), encoding="utf-8")
    with pytest.raises(ScanError):
        load_scan(saved[1])


def test_a_folder_that_cannot_be_made_is_an_error_of_ours(room_glb: Path) -> None:
    with pytest.raises(ScanError, match="can be written"):
        save_scan(read_scan(room_glb), room_glb / "below-a-file")


def test_a_scans_images_cannot_be_changed(room_glb: Path) -> None:
    with pytest.raises(ValueError, match="read-only"):
        read_scan(room_glb).appearance.images[0][0, 0] = 0


def test_an_appearance_checks_itself(room_glb: Path) -> None:
    appearance = read_scan(room_glb).appearance
    with pytest.raises(ArrayError, match="image numbers"):
        replace(appearance, face_image=appearance.face_image + 1)
    with pytest.raises(ArrayError, match="uint8"):
        replace(appearance, images=(np.zeros((2, 2, 4), dtype=np.uint8),))
