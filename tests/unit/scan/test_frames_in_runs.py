"""What a run keeps of frames: gains and names, and nothing that says where, when and by whom a room was scanned."""

import json
from pathlib import Path

import numpy as np
import pytest

from lidarspectra.config import read_run_file
from lidarspectra.hardware.phone.readers import read_scan_and_frames
from lidarspectra.material.frames import frame_colors as coloring
from lidarspectra.material.frames.frame_colors import color_from_frames
from lidarspectra.workflow.init.init_file import run_file_of, write_init
from lidarspectra.workflow.run_folder.declared import FILES
from lidarspectra.workflow.run_folder.frames_of_run import (
    FRAMES_FILE,
    NOT_KEPT,
    frame_colors,
    frame_notes,
    frames_in_words,
    save_frames,
)

from .capture_layouts import GPS, box_room, gray_shots, write_3dscanner


def test_a_run_keeps_gains_and_faults_of_frames_and_no_personal_field(tmp_path: Path) -> None:
    room = box_room()
    folder = write_3dscanner(tmp_path / "scan", room, gray_shots(room))
    (folder / "frame_00002.jpg").write_bytes(b"")
    scan, capture = read_scan_and_frames(folder)
    assert capture is not None
    colors = color_from_frames(scan, capture.frames, texel_m=0.1)
    save_frames(colors, capture, tmp_path)
    text = (tmp_path / FRAMES_FILE).read_text(encoding="utf-8")
    assert not any(str(value) in text for value in GPS.values())
    about = json.loads(text)
    assert about["not_kept"] == list(NOT_KEPT)
    assert list(about["left_out"]) == ["00002"]
    assert all(np.isclose(np.linalg.norm(frame["direction"]), 1.0) for frame in about["frames"])
    gains = np.array([frame["gain"] for frame in about["frames"]])
    assert np.abs(np.log(gains)).max() < 0.02  # all are the same gray
    words = " ".join(frame_notes(colors, capture))
    assert "1 of 6 frames" in words
    assert "00002" in words
    assert "no GPS" in frames_in_words(colors)


def test_the_gray_room_is_coloured_by_its_frames_and_says_nothing_of_a_file_without_colour(tmp_path: Path) -> None:
    room = box_room()
    scan, capture = read_scan_and_frames(write_3dscanner(tmp_path / "scan", room, gray_shots(room)))
    assert any("no colour" in note for note in scan.record.notes)
    assert capture is not None
    colored = color_from_frames(scan, capture.frames, texel_m=0.1).scan
    assert colored.appearance.known
    assert not any("no colour" in note for note in colored.record.notes)


def test_a_single_frame_leaves_the_meshs_colours_and_the_run_says_why(tmp_path: Path) -> None:
    room = box_room()
    scan, capture = read_scan_and_frames(write_3dscanner(tmp_path / "scan", room, gray_shots(room, 1)))
    colors = frame_colors(scan, capture, wanted=True)
    assert capture is not None
    assert colors is not None
    save_frames(colors, capture, tmp_path)
    assert list(json.loads((tmp_path / FRAMES_FILE).read_text(encoding="utf-8"))["left_out"]) == ["00000"]
    (note,) = frame_notes(colors, capture)
    assert "1 of 1 frames" in note
    assert "colours of its mesh" in note
    assert not frames_in_words(colors)


def test_every_file_of_a_folder_of_frames_makes_the_scan_stale(tmp_path: Path) -> None:
    room = box_room()
    write_3dscanner(tmp_path / "scan", room, gray_shots(room, 2))
    names = set(FILES["scan.file"]("scan", tmp_path))
    assert {"scan/frame_00001.jpg", "scan/depth_00000.png", "scan/export.obj"} <= names


def test_init_says_whose_frames_it_uses_and_which_it_leaves_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(coloring, "ATLAS_PX", (256, 256))  # texels of 4 cm; what is told of frames is no picture
    room = box_room()
    folder = write_3dscanner(tmp_path / "scan", room, gray_shots(room))
    (folder / "frame_00002.jpg").write_bytes(b"")
    summary = write_init(folder, tmp_path / "room.toml")
    lines, text = summary.lines(), (tmp_path / "room.toml").read_text(encoding="utf-8")
    (line,) = (each for each in lines if each.startswith("frames "))
    assert "5 of 3D Scanner App" in line
    assert "exposures not told" in line
    assert any(each.startswith("note: 1 of 6 frames") for each in lines)
    assert line.removeprefix("frames    ") in text
    assert "1 of 6 frames" in text


def test_a_folder_of_frames_may_be_named_from_within(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(coloring, "ATLAS_PX", (256, 256))
    room = box_room()
    monkeypatch.chdir(write_3dscanner(tmp_path / "my scan", room, gray_shots(room, 2)))
    assert run_file_of(Path()) == tmp_path / "my scan.toml"
    write_init(Path(), run_file_of(Path()))
    assert read_run_file(tmp_path / "my scan.toml").scan.file == "my scan"
    write_init(Path(), Path("room.toml"))
    assert read_run_file("room.toml").scan.file == "."
