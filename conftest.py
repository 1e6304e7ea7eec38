"""Fixtures that every test room uses."""

import os
from pathlib import Path

import pytest

CHANCE_FOLDERS = ("engine", "faults", "physics", "pipeline", "unit/sensor")  # light by lot, or processes that wait
CHANCES = 2  # [1]
PROJECT = Path(__file__).resolve().parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Try what depends on chance again before it counts as failed, and say so in the summary (RERUN).

    The engine takes its random numbers from the clock, and emulated devices answer when the machine lets them. A
    defect fails every time; what fails once in a thousand runs by chance fails thrice in a row once in 10^9.
    """
    folders = tuple(PROJECT / "tests" / name for name in CHANCE_FOLDERS)
    for item in items:
        if any(folder in item.path.parents for folder in folders):
            item.add_marker(pytest.mark.flaky(reruns=CHANCES))


@pytest.fixture(scope="session")
def project() -> Path:
    """Root of the checkout."""
    return PROJECT


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder with real data that cannot be part of the repository; the test is skipped where it is absent."""
    folder = Path(os.environ.get("LIDARSPECTRA_SHARED", PROJECT.parent / "shared"))
    if not (folder / "data").is_dir():
        pytest.skip(f"real data is not at {folder} (or $LIDARSPECTRA_SHARED)")
    return folder / "data"
