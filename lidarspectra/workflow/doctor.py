"""Checks of `lidarspectra doctor`: engine, spectral samples per pass, a test room's light, machine, libraries."""

import os
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, metadata, requires, version
from pathlib import Path

import psutil

from lidarspectra.errors import EngineError, LidarSpectraError
from lidarspectra.radiance.engine.engine import INSTALL_ADVICE, MAX_SPECTRAL_SLOTS, Engine, engine_info, find_engine
from lidarspectra.workflow.method_check import check_methods

PACKAGE = "lidarspectra"
DEVELOPER_EXTRAS = ("docs", "test")
MIN_MEMORY_GIB = 4.0  # [GiB] the demo and the meeting-room scan stay well below it
MIN_DISK_GIB = 1.0  # [GiB] a run folder of a large scan


@dataclass(frozen=True, kw_only=True)
class Finding:
    """Result of one check.

    Parameters
    ----------
    subject : str
        What was checked.
    value : str
        What was found.
    good : bool
        Whether a run can work with it.
    todo : str
        How to mend it where not.
    """

    subject: str
    value: str
    good: bool = True
    todo: str = ""


def examine() -> tuple[Finding, ...]:
    """Check everything that a run needs.

    Returns
    -------
    findings : tuple of Finding
        Faults have `good` False and a `todo`.
    """
    return (*_engine(), *_machine(), *_libraries(), *_extras())


def _engine() -> Iterator[Finding]:
    try:
        engine = find_engine()
    except EngineError as error:
        yield Finding(subject="engine", value=str(error), good=False, todo=INSTALL_ADVICE)
        return
    info = engine_info(engine)
    yield Finding(
        subject="engine", value=info.version or "its version cannot be read", good=bool(info.version), todo=info.fault
    )
    yield Finding(
        subject="pyradiance", value=info.package_version or "not installed; the programs on the search path are used"
    )
    yield Finding(subject="programs", value=str(info.programs))
    yield Finding(subject="RAYPATH", value=f".{os.pathsep}{info.library}")
    yield Finding(
        subject="spectral slots",
        value=f"{info.slots} a pass" if info.slots else info.fault,
        good=info.slots == MAX_SPECTRAL_SLOTS,
        todo='Set mode = "rgb" under [trace], which any Radiance runs, or install pyradiance 1.3.1 or later.',
    )
    if info.slots == MAX_SPECTRAL_SLOTS:
        yield _methods(engine)


def _methods(engine: Engine) -> Finding:
    """Both methods to trace, in a small room."""
    subject = "light of a test room"
    try:
        check = check_methods(engine)
    except LidarSpectraError as error:
        return Finding(subject=subject, value=str(error), good=False, todo=INSTALL_ADVICE)
    return Finding(
        subject=subject,
        value=f"plain rtrace against the adaptive method: {100 * check.difference:+.2f} % "
        f"(standard error {100 * check.standard_error:.2f} %)",
        good=check.agrees,
        todo="Run the command again. If they differ again, do not trust maps from this machine and report it: "
        "one of the two methods is wrong.",
    )


def _machine() -> Iterator[Finding]:
    yield Finding(
        subject="Python",
        value=f"{sys.version.split()[0]} ({sys.executable})",
        good=sys.version_info >= (3, 11),
        todo="Install Python 3.11 or later, and the package in it.",
    )
    memory = psutil.virtual_memory()
    yield Finding(
        subject="cores, memory",
        value=f"{os.cpu_count()} cores, {memory.available / 2**30:.1f} of {memory.total / 2**30:.1f} GiB free",
        good=memory.available / 2**30 >= MIN_MEMORY_GIB,
        todo=f"Large scans need {MIN_MEMORY_GIB:.0f} GiB of free memory. End other programs, or set max_faces "
        "under [scan] to decimate the mesh.",
    )
    for subject, folder in (("disk, this folder", Path.cwd()), ("disk, temporary", Path(tempfile.gettempdir()))):
        free = shutil.disk_usage(folder).free / 2**30
        yield Finding(
            subject=subject,
            value=f"{free:.1f} GiB free, {'writable' if os.access(folder, os.W_OK) else 'not writable'} ({folder})",
            good=free >= MIN_DISK_GIB and os.access(folder, os.W_OK),
            todo="Free some space, or work in another folder.",
        )


def _libraries() -> Iterator[Finding]:
    for name in required_libraries():
        if name == "pyradiance":  # reported with the engine, whose programs may be another installation's
            continue
        found = _version(name)
        yield Finding(subject=name, value=found or "missing", good=bool(found), todo=f"pip install {name}")


def _extras() -> Iterator[Finding]:
    for extra in metadata(PACKAGE).get_all("Provides-Extra") or ():
        if extra in DEVELOPER_EXTRAS:
            continue
        there = all(map(_version, required_libraries(extra)))
        value = "installed" if there else f"not installed (pip install '{PACKAGE}[{extra}]')"
        yield Finding(subject=f"extra '{extra}'", value=value)


def required_libraries(extra: str = "") -> tuple[str, ...]:
    """Names of the libraries that the package needs, or that one of its extras adds."""
    names = []
    for requirement in requires(PACKAGE) or ():
        name, _, condition = requirement.partition(";")
        if condition.replace('"', "'").strip() == (f"extra == '{extra}'" if extra else ""):
            names.append(re.split(r"[^\w.-]", name.strip())[0])
    return tuple(names)


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""
