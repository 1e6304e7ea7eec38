"""What a year of daylight was made of, kept with it, so that a later command can tell whether it is of the present run.

The year is no stage of a run: it is made from the scan's and the materials' stages and from the run file when it is
asked for, and stays as the run goes on. Its inputs are declared as a stage's are (`workflow.run_folder.declared`).
"""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

import xarray as xr

from lidarspectra.config import RunFile, parse_run_file
from lidarspectra.io.files import hash_file
from lidarspectra.workflow.run_folder.declared import declare
from lidarspectra.workflow.run_folder.workspace import StageName, hash_files, read_request, stage_folder

FOLDER = "annual"  # of the year, in a run folder
MADE_OF = "made_of"  # attribute of a year
STAGES_OF_YEAR: tuple[StageName, ...] = ("scan", "materials")
KEYS: Mapping[str, tuple[str, ...]] = {  # what a user calls it: keys of the run file; the moment of a run is none
    "windows or sky": (
        "daylight.windows",
        "daylight.latitude_deg",
        "daylight.longitude_deg",
        "daylight.north_deg",
        "daylight.aerosol_optical_depth",
        "daylight.ground_reflectance",
        "daylight.weather",
    ),
    "points": ("sensors",),
    "lamps in the room": ("lamps.shape", "lamps.center", "lamps.size", "lamps.normal", "lamps.rotation_deg"),
    "calibration": ("calibration",),
    "number of reflections": ("trace.accuracy",),
}


def year_inputs(run_file: RunFile, base: Path, run: Path) -> dict[str, str]:
    """Hashes of what a year of daylight is made of, each under the name that a user has for it.

    Parameters
    ----------
    run_file : RunFile
    base : Path
        Its folder.
    run : Path
        The run folder, with its stages up to the materials.
    """
    found: dict[str, str] = {stage: _digest(hash_files(stage_folder(run, stage))) for stage in STAGES_OF_YEAR}
    for name, keys in KEYS.items():
        settings = declare(run_file, base, *keys).settings
        found[name] = _digest({"run_file": settings["run_file"], "files": settings["files"]})
    if run_file.daylight is not None and run_file.daylight.summer_time is not None:
        found["summer time"] = _digest(run_file.daylight.summer_time)
    weather = None if run_file.daylight is None else run_file.daylight.weather
    if weather is not None and (base / weather).is_file():
        found["weather file"] = hash_file(base / weather)
    return found


def with_inputs(year: xr.Dataset, inputs: Mapping[str, str]) -> xr.Dataset:
    """The year with what it was made of."""
    return year.assign_attrs({MADE_OF: json.dumps(dict(inputs))})


def changed_since(year: xr.Dataset, inputs: Mapping[str, str]) -> tuple[str, ...]:
    """What of a year's inputs is not as it was when it was made; all of it where a year does not tell."""
    try:
        made = dict(json.loads(str(year.attrs.get(MADE_OF, "{}"))))
    except (TypeError, ValueError):
        made = {}
    return tuple(name for name in dict.fromkeys((*inputs, *made)) if made.get(name) != inputs.get(name))


def changed_in_run(year: xr.Dataset, run: Path) -> tuple[str, ...]:
    """As `changed_since`, by the run file that a run folder keeps; raises WorkspaceError if it is no run folder."""
    request = read_request(run)
    if request is None:
        return changed_since(year, {})
    run_file = parse_run_file(request.text, where=request.name)
    return changed_since(year, year_inputs(run_file, (run / request.folder).resolve(), run))


def _digest(content: object) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode("utf-8")).hexdigest()
