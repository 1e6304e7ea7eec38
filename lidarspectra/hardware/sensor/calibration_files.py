"""Calibrations on disk: JSON files by name and version in the user's data folder, never overwritten."""

import json
import math
import re
from dataclasses import asdict, fields, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from lidarspectra.errors import ArrayError, ReadingError
from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS, DIES
from lidarspectra.hardware.sensor.calibration import Calibration
from lidarspectra.io.files import writing
from lidarspectra.spectra.database_files import user_folder

FORMAT = "lidarspectra sensor calibration 1"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
_FILE = re.compile(r"v(\d{4,})\.json")


def calibration_folder() -> Path:
    """Folder of all calibrations, in the user's data folder (or $LIDARSPECTRA_DATA); it may not exist yet."""
    return user_folder() / "calibrations"


def _folder(name: str) -> Path:
    if not _NAME.fullmatch(name) or name.endswith("."):
        raise ReadingError(
            expected="a name of letters, digits, '.', '_' and '-', up to 64, starting with a letter or digit",
            found=f"'{name}'",
            where="calibration name",
            todo="Choose such a name, because it becomes the name of a folder.",
        )
    return calibration_folder() / name


def versions(name: str) -> tuple[int, ...]:
    """Versions of a calibration, ascending."""
    folder = _folder(name)
    if not folder.is_dir():
        return ()
    return tuple(sorted(int(match[1]) for path in folder.iterdir() if (match := _FILE.fullmatch(path.name))))


def list_calibrations() -> tuple[Calibration, ...]:
    """The newest version of each calibration, by name."""
    folder = calibration_folder()
    if not folder.is_dir():
        return ()
    names = sorted(path.name for path in folder.iterdir() if path.is_dir() and _NAME.fullmatch(path.name))
    return tuple(load_calibration(name) for name in names if versions(name))


def save_calibration(calibration: Calibration) -> Calibration:
    """Save as the next version of its name.

    Returns
    -------
    calibration : Calibration
        With version and time.

    Raises
    ------
    ReadingError
        If the name is not valid for a folder, or the folder cannot be written.
    """
    folder = _folder(calibration.name)
    with writing(
        folder,
        error=ReadingError,
        expected="a calibration folder that can be written",
        todo="Set LIDARSPECTRA_DATA to a folder of yours.",
    ):
        folder.mkdir(parents=True, exist_ok=True)
        while True:
            version = max(versions(calibration.name), default=0) + 1
            now = datetime.now(UTC).isoformat(timespec="seconds")
            saved = replace(calibration, version=version, created=now)
            try:
                with (folder / f"v{version:04d}.json").open("x", encoding="utf-8", newline="\n") as file:
                    file.write(calibration_text(saved))
            except FileExistsError:  # another program took that number meanwhile
                continue
            return saved


def calibration_by_label(label: str) -> Calibration:
    """A saved calibration by NAME, its newest version, or by NAME@VERSION.

    Raises
    ------
    ReadingError
        If there is none, the version is no number, or the file is malformed.
    """
    name, mark, version = label.partition("@")
    if not mark:
        return load_calibration(name)
    if not version.isdecimal():
        raise ReadingError(
            expected="a calibration as NAME or NAME@VERSION, its version a number",
            found=f"'{label}'",
            where="calibration name",
            todo="'lidarspectra sensor calibrations' lists them.",
        )
    return load_calibration(name, int(version))


def load_calibration(name: str, version: int | None = None) -> Calibration:
    """Load by name; the newest version unless one is given.

    Raises
    ------
    ReadingError
        If there is none, or the file is malformed.
    """
    known = versions(name)
    if not known or (version is not None and version not in known):
        wanted = name if version is None else f"{name} version {version}"
        folder = calibration_folder()
        others = sorted(path.name for path in folder.iterdir() if path.is_dir()) if folder.is_dir() else []
        saved = f"only {', '.join(others)}" if others else "no saved calibration"
        raise ReadingError(
            expected=f"a saved calibration '{wanted}'",
            found=f"versions {', '.join(map(str, known))}" if known else saved,
            where=str(folder),
            todo="Make one with 'lidarspectra sensor calibrate'.",
        )
    path = _folder(name) / f"v{version if version is not None else known[-1]:04d}.json"
    return read_calibration(path)


def calibration_text(calibration: Calibration) -> str:
    """A calibration as JSON: arrays as lists, NaN as null, channels and dies named."""
    record: dict[str, Any] = {"format": FORMAT, "channels_nm": list(CHANNEL_LABELS), "dies": list(DIES)}
    for name, value in asdict(calibration).items():
        if isinstance(value, np.ndarray):
            record[name] = value.tolist()
        else:
            record[name] = None if isinstance(value, float) and math.isnan(value) else value
    return json.dumps(record, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def read_calibration(path: Path) -> Calibration:
    """Read a calibration file.

    Raises
    ------
    ReadingError
        If it cannot be read, is of another format, or a part is missing or malformed.
    """
    try:
        record = json.loads(path.read_text(encoding="utf-8"))
        if (
            record.pop("format") != FORMAT
            or record.pop("channels_nm") != list(CHANNEL_LABELS)
            or record.pop("dies") != list(DIES)
        ):
            raise ValueError("it is of another format or another sensor")
        for name in ("gain", "integration_ms"):
            record[name] = math.nan if record[name] is None else float(record[name])
        for name in ("observations", "notes"):
            record[name] = tuple(str(part) for part in record[name])
        known = {field.name for field in fields(Calibration)}
        if set(record) != known:
            raise ValueError(f"parts missing or unknown: {', '.join(sorted(set(record) ^ known))}")
        return Calibration(**record)
    except (
        OSError,
        ValueError,
        KeyError,
        TypeError,
        AttributeError,
        OverflowError,
        RecursionError,
        ArrayError,
    ) as cause:
        raise ReadingError(
            expected=f"a file of format '{FORMAT}'",
            found=f"{type(cause).__name__}: {cause}",
            where=str(path),
            todo="Calibrate again, or choose another version.",
        ) from cause
