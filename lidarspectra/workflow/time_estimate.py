"""How long the stages of a run will take, roughly: by what they took in this folder, or else by the size of the task.

The constants are processor times on one core (docs/scale.md, docs/performance.md: a room of 54,000 triangles, and a
hall of a million with 100,000 sensor points under 64 lamps), and no better than to a factor of two or three.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from lidarspectra.config import RunFile
from lidarspectra.workflow.run_folder.workspace import STAGES, StageName, parse_record, stage_folder

STAGE_S: Mapping[StageName, tuple[float, float]] = {
    "scan": (1.0, 40.0),
    "views": (15.0, 55.0),
    "materials": (18.0, 350.0),
    "scene": (2.0, 20.0),
    "map": (1.0, 0.0),
    "report": (18.0, 0.0),
}
"""[s] of a stage, whatever the room, and [s] for a million triangles more."""
ONE_MATERIAL_S = 1.0  # [s] of the materials stage with method 'default'
PASS_S, POINT_S = 4.0, 1.5e-3  # [s] of tracing a pass, and of each sensor point in it, to 1 %
MAP_POINT_S = 1e-4  # [s] of each sensor point in the map
NOISE_FACTORS = {"draft": 0.4, "standard": 1.0, "fine": 2.5}  # [1] on the time a point takes
LAMPS_PER_PASS, BANDS_PER_PASS = 4, 24
PARALLEL = 0.8  # [1] share of a core that each further process of the trace gains


@dataclass(frozen=True, kw_only=True)
class Task:
    """The size of a run.

    Parameters
    ----------
    faces : int
        Triangles of the scan.
    lamps, bands, points : int
        Lamps that are lit, channels of the sensor, and sensor points.
    workers : int
        Processes side by side.
    """

    faces: int
    lamps: int
    bands: int
    points: int
    workers: int


def estimate_seconds(run: Path, run_file: RunFile, task: Task) -> dict[StageName, float]:
    """Time that each stage would take if it were made.

    Parameters
    ----------
    run : Path
        The run folder; a stage that was made there before takes about as long as then.
    run_file : RunFile
    task : Task

    Returns
    -------
    seconds : dict of str to float
        [s]
    """
    return {stage: _last_seconds(run, stage, run_file) or _seconds(stage, run_file, task) for stage in STAGES}


def _last_seconds(run: Path, stage: StageName, run_file: RunFile) -> float | None:
    """What a stage took last time; None where it was not made, or the trace was asked for something else."""
    record = parse_record(stage_folder(run, stage))
    if record is None:
        return None
    if stage == "trace":
        asked = {**run_file.trace.model_dump(mode="json"), "grid": _grid(run_file)}
        given = record.settings.get("run_file", {})
        then = {key: given.get(f"trace.{key}") for key in ("noise", "accuracy", "method")} | {
            "grid": given.get("sensors.grid")
        }
        if any(asked[key] != value for key, value in then.items()):
            return None
    return record.seconds


def _grid(run_file: RunFile) -> object:
    return None if run_file.sensors.grid is None else run_file.sensors.grid.model_dump(mode="json")


def _seconds(stage: StageName, run_file: RunFile, task: Task) -> float:
    if stage == "trace":
        factor = NOISE_FACTORS[run_file.trace.noise]
        passes = -(-task.lamps // LAMPS_PER_PASS) * -(-task.bands // BANDS_PER_PASS)
        return passes * (PASS_S + POINT_S * factor * task.points) / (1.0 + PARALLEL * (task.workers - 1))
    if stage == "materials" and run_file.materials.method == "default":
        return ONE_MATERIAL_S
    fixed_s, million_s = STAGE_S[stage]
    points_s = MAP_POINT_S * task.points if stage == "map" else 0.0
    return fixed_s + million_s * 1e-6 * task.faces + points_s


def time_words(seconds: float) -> str:
    """A rough time for a reader: 'a few seconds', 'about 40 s', 'about 3 min', 'about 2 h'."""
    if seconds < 7.5:
        return "a few seconds"
    if seconds < 90:
        return f"about {5 * round(seconds / 5)} s"
    if seconds < 5400:
        return f"about {round(seconds / 60)} min"
    return f"about {round(seconds / 3600)} h"
