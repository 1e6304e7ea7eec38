"""Fixtures that every test room uses."""

import os
from collections.abc import Generator
from pathlib import Path

import pytest

from lidarspectra.threads import start_with_one_thread
from tools.slowest_tests import PROPERTY

RERUNS = 2  # a defect fails every time; what fails once in 1,000 runs by chance fails thrice in a row once in 10^9
start_with_one_thread()  # before numpy is loaded: the workers of pytest share the cores
BEGAN_S = pytest.StashKey[float]()  # processor time when a test began
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


def processor_s() -> float:
    """Processor time of this process and of the programs that it waited for [s]."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, None, None]:
    """Remember when a test began, with its fixtures."""
    item.stash[BEGAN_S] = processor_s()
    return (yield)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item) -> Generator[None, None, None]:
    """Note what a test took of the processor, for `tools/slowest_tests.py`."""
    try:
        return (yield)
    finally:
        item.user_properties.append((PROPERTY, f"{processor_s() - item.stash[BEGAN_S]:.2f}"))


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
