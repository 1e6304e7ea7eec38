"""Fixtures that every test room uses."""

import os
from pathlib import Path

import pytest

from lidarspectra.threads import start_with_one_thread

RERUNS = 2  # a defect fails every time; what fails once in 1,000 runs by chance fails thrice in a row once in 10^9
start_with_one_thread()  # before numpy is loaded: the workers of pytest share the cores
PROJECT = Path(__file__).resolve().parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Try tests marked `chance(reason)` again before they count as failed; the summary says so (RERUN).

    The engine seeds its shadow rays by the clock, and emulated devices and child processes answer when the machine
    lets them. Every other test fails at once.
    """
    for item in items:
        for mark in item.iter_markers("chance"):
            if len(mark.args) != 1 or not isinstance(mark.args[0], str) or mark.kwargs:
                raise pytest.UsageError(f"{item.nodeid}: expected @pytest.mark.chance('why it depends on chance')")
            item.add_marker(pytest.mark.flaky(reruns=RERUNS))


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
