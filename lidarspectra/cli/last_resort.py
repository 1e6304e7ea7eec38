"""What is said of an error that nobody foresaw: that it is a bug, where its log is, and what to send."""

import platform
import sys
import tempfile
import traceback
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from platformdirs import user_log_path

LOGGED_PACKAGES = ("lidarspectra", "numpy", "scipy", "trimesh", "pyradiance", "xarray")
LOG_FOLDER = "lidarspectra"


def bug_report(error: Exception) -> str:
    """Keep an error's traceback in a log, and put into words what a user can do.

    Parameters
    ----------
    error : Exception
        Whatever is no error of this package.

    Returns
    -------
    words : str
    """
    kind = f"{type(error).__name__}: {error}".strip().splitlines()[0]
    log = _write_log(error)
    if log is None:
        kept = "No log of it could be written; its traceback is above."
        traceback.print_exception(error)
    else:
        kept = f"Its log is {log}."
    return (
        f"This is a bug of lidarspectra, and not your mistake ({kind}). {kept} Please report it with that log, the "
        "command, and, if you may share them, the run file and the scan; the log names files and folders of this "
        "machine. Finished stages of a run are kept."
    )


def _write_log(error: Exception) -> Path | None:
    """The file in which the error is kept: in the user's log folder, or else among the temporary files."""
    now = datetime.now(UTC)
    name = f"error-{now:%Y%m%d-%H%M%S}.log"
    for folder in (user_log_path(LOG_FOLDER, appauthor=False), Path(tempfile.gettempdir())):
        try:
            folder.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(_log_text(error, now), encoding="utf-8", errors="backslashreplace")
        except OSError:
            continue
        return folder / name
    return None


def _log_text(error: Exception, now: datetime) -> str:
    lines = [f"{now:%Y-%m-%d %H:%M:%S} UTC", f"command: {' '.join(sys.argv)}", f"python {platform.python_version()}"]
    lines += [f"{platform.system()} {platform.release()} {platform.machine()}"]
    for package in LOGGED_PACKAGES:
        try:
            lines.append(f"{package} {version(package)}")
        except PackageNotFoundError:
            lines.append(f"{package} is not installed")
    return "\n".join([*lines, "", *traceback.format_exception(error)])
