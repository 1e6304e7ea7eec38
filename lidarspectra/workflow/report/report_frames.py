"""The report's section on the frames of a scan, from what the scan stage kept of them."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from lidarspectra.errors import ArrayError, WorkspaceError
from lidarspectra.mapping.figures.floor_plan import FloorPlan
from lidarspectra.mapping.figures.frames_figure import FramesOnPlan, frames_figure
from lidarspectra.mapping.report.applications import Application, ApplicationFigure
from lidarspectra.workflow.run_folder.frames_of_run import FRAMES_FILE

TITLE = "Frames"
CAPTION = (
    "The frames that the scan's colours come of, from above: each arrow is one frame and points where it looks, "
    "shorter the more it looks up or down. Its colour is its gain, in stops over the mean of all: blue where the "
    "camera was exposed for bright surfaces, red for dark ones. Below, the gains in the order of the walk; where they "
    "wander and their deviation grows, the walk did not come back to what it had seen."
)


def frames_section(folder: Path, plan: FloorPlan) -> Application | None:
    """The section; None where no frame was used.

    Parameters
    ----------
    folder : Path
        Of the scan stage.
    plan : FloorPlan

    Raises
    ------
    WorkspaceError
        If what is kept of the frames is damaged.
    """
    path = folder / FRAMES_FILE
    if not path.is_file():
        return None
    try:
        about = json.loads(path.read_text(encoding="utf-8"))
        if about.get("left_out_position_m") is None or not about.get("frames"):
            return None  # no frame was used, or it is of an earlier version
        return _section(about, plan)
    except (OSError, ValueError, KeyError, TypeError, AttributeError, ArrayError) as cause:
        raise WorkspaceError(
            expected="what the scan stage wrote of its frames",
            found=f"{type(cause).__name__}: {cause}",
            where=str(path),
            todo="Run the scan stage again.",
        ) from cause


def _section(about: dict[str, Any], plan: FloorPlan) -> Application:
    held_out = about["held_out_deviation"]
    words = (
        f"{len(about['frames'])} frames of {about['app']} have one radiometry. Observations held out of the solve "
        f"differ from the others by {100 * held_out['solved']:.1f} %, as the pictures show them by "
        f"{100 * held_out['as_shown']:.1f} %. {100 * about['seen_share']:.0f} % of the surface is in some frame. "
        f"Not read: {', '.join(about['not_kept'])}."
    )
    figure = frames_figure(plan, frames_on_plan(about))
    return Application(
        title=TITLE, words=(words,), figures=(ApplicationFigure(name="frames", figure=figure, caption=CAPTION),)
    )


def frames_on_plan(about: dict[str, Any]) -> FramesOnPlan:
    """Frames as a run keeps them, in `FRAMES_FILE`, for the figure."""
    frames, places = about["frames"], about["left_out_position_m"]
    return FramesOnPlan(
        position=np.array([each["position_m"] for each in frames]),
        direction=np.array([each["direction"] for each in frames]),
        gain_stops=np.log2([each["gain"][1] for each in frames]),
        deviation_stops=np.array([each["log_gain_deviation"] for each in frames]) / np.log(2.0),
        left_out=tuple(
            (reason, np.array(places[name]) if name in places else None) for name, reason in about["left_out"].items()
        ),
    )
