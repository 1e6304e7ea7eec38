"""The report's section of a calibrated run: what the readings determined, and what they changed."""

import json
from pathlib import Path

import numpy as np
import pandas as pd

from lidarspectra.config import CalibrationSection
from lidarspectra.errors import WorkspaceError
from lidarspectra.io.csv_cells import read_table
from lidarspectra.mapping.calibration.figures import before_after_figure
from lidarspectra.mapping.figures.floor_plan import FloorPlan
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.report.applications import Application, ApplicationFigure
from lidarspectra.workflow.calibration.results import SUMMARY

LEVEL_M = 0.1  # [m] points whose heights differ by less are of one level


def calibration_sections(section: CalibrationSection | None, folder: Path, plan: FloorPlan) -> tuple[Application, ...]:
    """The section, or none where there are no tables of just this calibration.

    Parameters
    ----------
    section : CalibrationSection or None
        Of the run file.
    folder : Path
        `RUN/calibration`.
    plan : FloorPlan

    Raises
    ------
    WorkspaceError
        If a table cannot be read.
    """
    path = folder / SUMMARY
    if section is None or not path.is_file():
        return ()
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
        unknowns, readings, points = (
            read_table((folder / f"{name}.csv").read_text(encoding="utf-8"), ("name", "reading"))
            for name in ("unknowns", "readings", "points")
        )
        if summary["factors"] != section.model_dump(mode="json"):
            return ()  # the run file's factors were changed by hand since
        return (_section(summary, unknowns, readings, points, plan),)
    except (OSError, ValueError, KeyError) as error:
        raise WorkspaceError(
            expected="the tables that 'lidarspectra calibrate' wrote",
            found=str(error),
            where=str(folder),
            todo="Calibrate again with --force, or delete the folder: the report then goes without them.",
        ) from error


def _section(
    summary: dict[str, object], unknowns: pd.DataFrame, readings: pd.DataFrame, points: pd.DataFrame, plan: FloorPlan
) -> Application:
    before, after = (100 * float(each) for each in summary["map_sd"])  # type: ignore[attr-defined]
    undetermined = unknowns.loc[
        (unknowns["determined by the readings"] == "no") & (unknowns["factor on"] != "meter"), "name"
    ]
    words = (
        f"Deviation of the map, mean over its points: {before:.1f} % before, {after:.1f} % after the readings. "
        f"Chi-square is {summary['chi_square']:.1f} of {summary['numbers']} numbers, about as large if all is well; "
        f"the model's own error at a place, as the misfit tells it, is {100 * float(summary['local_sd']):.1f} %.",  # type: ignore[arg-type]
        f"No reading determines {', '.join(undetermined)}: the prior stays."
        if undetermined.size
        else "The readings determine every factor.",
        "Reflectances on this page and in exported files have these factors.",
        *(str(note) for note in summary["notes"]),  # type: ignore[attr-defined]
    )
    headings = [name for name in points.columns if name.startswith(("before [", "after ["))]
    chosen = _one_level(points["z [m]"].to_numpy())
    unit = headings[0].removeprefix("before [").removesuffix("]")
    figure = before_after_figure(
        points[["x [m]", "y [m]", "z [m]"]].to_numpy()[chosen],
        points[headings[0]].to_numpy()[chosen],
        points[headings[1]].to_numpy()[chosen],
        plan,
        unit=unit,
        readings=readings[["x [m]", "y [m]", "z [m]"]].to_numpy(),
    )
    caption = (
        f"The run's points {points['z [m]'].iloc[chosen].median():.2f} m high in the scan, before and after the "
        "readings, which were taken at the crosses."
    )
    return Application(
        title="Calibration",
        words=words,
        figures=(ApplicationFigure(name="calibration", figure=figure, caption=caption),),
        tables=(
            Table(
                name="calibration-factors",
                caption="What the readings determine of lamps, reflectances and meters; elsewhere the prior stays.",
                frame=unknowns,
                formats={"factor [1]": ".3f", "deviation before [%]": ".1f", "deviation after [%]": ".1f"},
            ),
            Table(
                name="calibration-readings",
                caption="The readings, and what the run has there. The probability is that of so large a deviation "
                "from what all other readings predict: a reading below 0.001 disagrees.",
                frame=readings,
                formats={"off before [%]": "+.1f", "off after [%]": "+.1f", "probability [1]": ".2g"},
            ),
        ),
    )


def _one_level(heights: np.ndarray) -> np.ndarray:
    """Indices of the points of the height that most have."""
    levels = np.round(heights / LEVEL_M).astype(np.int64)
    values, counts = np.unique(levels, return_counts=True)
    return np.flatnonzero(levels == values[int(np.argmax(counts))])
