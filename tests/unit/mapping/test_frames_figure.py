"""Frames on the plan: each at its place and in the colour of its gain, and what is left out with its reason."""

import json
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.quiver import Quiver

from lidarspectra.errors import MapError, WorkspaceError
from lidarspectra.mapping.figures.floor_plan import FloorPlan
from lidarspectra.mapping.figures.frames_figure import FramesOnPlan, frames_figure
from lidarspectra.workflow.report.report_frames import frames_section
from lidarspectra.workflow.run_folder.frames_of_run import FRAMES_FILE

PLAN = FloorPlan(outline=np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]]))
JUMPED, CUT_OFF = "its depth does not fit the mesh from its pose", "its picture is cut off"


@pytest.fixture
def frames() -> FramesOnPlan:
    return FramesOnPlan(
        position=np.array([[1.0, 1.0, 1.4], [2.0, 1.0, 1.4], [3.0, 1.0, 1.4]]),
        direction=np.array([[1.0, 0.0, 0.0], [0.0, 0.6, 0.8], [-1.0, 0.0, 0.0]]),
        gain_stops=np.array([-2.0, 0.0, 2.0]),
        deviation_stops=np.array([0.1, 0.2, 0.3]),
        left_out=((JUMPED, np.array([1.5, 2.0, 1.4])), (CUT_OFF, None), (CUT_OFF, None)),
    )


def _bar_ends(chart: Axes) -> np.ndarray:
    """(frame, 2) lower and upper end of each error bar."""
    (bars,) = (each for each in chart.collections if isinstance(each, LineCollection))
    return np.array(bars.get_segments())[:, :, 1]


def test_an_arrow_stands_where_each_frame_was_taken_and_its_colour_is_the_gain(frames: FramesOnPlan) -> None:
    axes = frames_figure(PLAN, frames).axes[0]
    (arrows,) = (each for each in axes.get_children() if isinstance(each, Quiver))
    np.testing.assert_allclose(arrows.get_offsets(), frames.position[:, :2])
    np.testing.assert_allclose(arrows.get_array(), frames.gain_stops)
    lengths = np.hypot(arrows.U, arrows.V)
    np.testing.assert_allclose(lengths / lengths[0], [1.0, 0.6, 1.0])  # the second looks up
    assert arrows.U[0] > 0 > arrows.U[2]


def test_frames_that_are_not_used_are_counted_by_reason_and_drawn_where_their_place_is_known(
    frames: FramesOnPlan,
) -> None:
    figure = frames_figure(PLAN, frames)
    words = [" ".join(text.get_text().split()) for text in figure.legends[0].get_texts()]
    assert "3 frames used" in words
    assert f"1 left out: {JUMPED}" in words
    assert f"2 left out, 2 of them not drawn: {CUT_OFF}" in words
    marks = [line.get_xydata() for line in figure.axes[0].lines if line.get_marker() == "s"]
    np.testing.assert_allclose(np.concatenate(marks), [[1.5, 2.0]])


def test_error_bars_of_the_gains_are_two_deviations_long(frames: FramesOnPlan) -> None:
    chart = frames_figure(PLAN, frames).axes[-1]
    ends = _bar_ends(chart)
    np.testing.assert_allclose(ends[:, 1] - ends[:, 0], 4.0 * frames.deviation_stops)
    assert "[stops]" in chart.get_ylabel()


def test_a_plan_of_no_frame_is_refused() -> None:
    nothing = np.zeros((0, 3))
    with pytest.raises(MapError, match="at least one frame"):
        FramesOnPlan(position=nothing, direction=nothing, gain_stops=np.zeros(0), deviation_stops=np.zeros(0))


def test_the_reports_section_has_the_gains_in_stops(tmp_path: Path) -> None:
    about = {
        "app": "3D Scanner App", "not_kept": ["title"], "seen_share": 0.9,
        "held_out_deviation": {"as_shown": 0.5, "solved": 0.03}, "left_out": {"7": CUT_OFF}, "left_out_position_m": {},
        "frames": [
            {"position_m": [1, 1, 1], "direction": [1, 0, 0], "gain": [9, gain, 9], "log_gain_deviation": np.log(2.0)}
            for gain in (0.25, 4.0)
        ],
    }  # fmt: skip
    (tmp_path / FRAMES_FILE).write_text(json.dumps(about), encoding="utf-8")
    section = frames_section(tmp_path, PLAN)
    assert section is not None
    assert "3.0 %" in section.words[0]
    (drawn,) = section.figures
    (arrows,) = (each for each in drawn.figure.axes[0].get_children() if isinstance(each, Quiver))
    np.testing.assert_allclose(arrows.get_array(), [-2.0, 2.0])
    np.testing.assert_allclose(np.ptp(_bar_ends(drawn.figure.axes[-1]), axis=1), 4.0)


def test_a_scan_without_frames_has_no_section(tmp_path: Path) -> None:
    assert frames_section(tmp_path, PLAN) is None
    (tmp_path / FRAMES_FILE).write_text(json.dumps({"left_out": {}, "left_out_position_m": {}}), encoding="utf-8")
    assert frames_section(tmp_path, PLAN) is None


@pytest.mark.parametrize("damaged", ['{"frames": [', "[1]", '{"left_out_position_m": {}, "frames": [{"name": "a"}]}'])
def test_a_damaged_record_of_frames_is_one_clear_error(tmp_path: Path, damaged: str) -> None:
    (tmp_path / FRAMES_FILE).write_text(damaged, encoding="utf-8")
    with pytest.raises(WorkspaceError, match="Run the scan stage again"):
        frames_section(tmp_path, PLAN)
