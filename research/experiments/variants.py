"""Run files with something changed: an experiment is an ordinary run of a scene, by the run file that stands here."""

from pathlib import Path
from typing import Any

from lidarspectra.config import LampSection, RunFile, SensorsSection, read_run_file
from lidarspectra.io.files import write_whole
from lidarspectra.io.toml_text import toml_value


def fixed_points(run_file: RunFile, points: Path) -> RunFile:
    """The same run with its sensors at the points of a file, wherever the scan would have put them.

    Parameters
    ----------
    run_file : RunFile
    points : Path
        CSV with x, y, z, nx, ny, nz [m, 1].

    Returns
    -------
    run_file : RunFile
    """
    sensors = SensorsSection(device=run_file.sensors.device, points=str(points.resolve()), lift=0.0)
    return run_file.model_copy(update={"sensors": sensors})


def with_lamps(run_file: RunFile, **changes: Any) -> RunFile:
    """The same run with keys of every lamp changed, such as spectrum = 'LED-B1'."""
    lamps = tuple(LampSection(**{**lamp.model_dump(), **changes}) for lamp in run_file.lamps)
    return run_file.model_copy(update={"lamps": lamps})


def with_flux(run_file: RunFile, factor: float) -> RunFile:
    """The same run with every lamp's luminous flux times a factor [1]."""
    lamps = tuple(
        LampSection(**{**lamp.model_dump(), "luminous_flux_lm": factor * (lamp.luminous_flux_lm or 0.0)})
        for lamp in run_file.lamps
    )
    return run_file.model_copy(update={"lamps": lamps})


def changed(run_file: RunFile, section: str, **values: Any) -> RunFile:
    """The same run with keys of one table changed, as changed(run_file, 'trace', accuracy='low')."""
    table = getattr(run_file, section)
    return run_file.model_copy(update={section: type(table)(**{**table.model_dump(), **values})})


def write_run_file(run_file: RunFile, path: Path) -> Path:
    """Write a run file as TOML, and read it back to be sure that it says the same.

    Parameters
    ----------
    run_file : RunFile
    path : Path

    Returns
    -------
    path : Path

    Raises
    ------
    RunFileError
        If the changes do not go together.
    """
    lines: list[str] = []
    for name, value in run_file.model_dump(exclude_defaults=True).items():
        tables = value if isinstance(value, tuple | list) else [value]
        for table in tables:
            lines.append(f"[[{name}]]" if table is not value else f"[{name}]")
            lines += [f"{key} = {toml_value(item)}" for key, item in table.items()]
            lines.append("")
    write_whole(path, "\n".join(lines))
    read_run_file(path)
    return path
