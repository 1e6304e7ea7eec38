"""Fixtures that every test room uses."""

import os
import shutil
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

from lidarspectra.garbage import collect_rarely
from lidarspectra.io.file_lock import FileLock
from lidarspectra.threads import start_with_one_thread
from tools.slowest_tests import PROPERTY

RERUNS = 2  # a defect fails every time; what fails once in 1,000 runs by chance fails thrice in a row once in 10^9
start_with_one_thread()  # before numpy is loaded: the workers of pytest share the cores
collect_rarely()  # as the command line does
SCATTERING_ORDERS = 2  # of the tables of the air that tests make; genssky itself would go to 4, in twice the time
FEW_VIEWPOINTS, FEW_SIGHT_LINES = 40, 200_000  # of a look for hidden layers; it has 200 and 1,000,000
BEGAN_S = pytest.StashKey[float]()  # processor time when a test began
PROJECT = Path(__file__).resolve().parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Try tests marked `chance(reason)` again before they count as failed, and begin with those marked `longest`.

    The engine seeds its shadow rays by the clock, and emulated devices and child processes answer when the machine
    lets them. Every other test fails at once. The summary names those that were tried again (RERUN).
    """
    items.sort(key=lambda item: item.get_closest_marker("longest") is None)
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


@pytest.fixture(scope="session")
def made_once(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, Callable[[Path], None]], Path]:
    """(name, make) -> folder that the first worker to ask made, for all of them; nobody may change what is in it."""
    base = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        base = base.parent  # a worker's own folder lies in the one of all

    def shared_folder(name: str, make: Callable[[Path], None]) -> Path:
        folder, done, lock = base / name, base / f"{name}.done", FileLock(base / f"{name}.lock")
        while not done.exists():
            if lock.take():
                try:
                    if not done.exists():
                        shutil.rmtree(folder, ignore_errors=True)  # of a worker that failed
                        folder.mkdir()
                        make(folder)
                        done.touch()
                finally:
                    lock.release()
            else:
                time.sleep(0.1)
        return folder

    return shared_folder


@pytest.fixture(scope="module")
def few_viewpoints() -> Iterator[None]:
    """Layers of a scan that nobody sees are looked for in a fifth of the time.

    For tests of what else is found in a room: tests/unit/room/test_hidden_layers.py holds that those layers are.
    """
    with pytest.MonkeyPatch.context() as patches:
        patches.setattr("lidarspectra.room.hidden_layers.VIEWPOINTS", FEW_VIEWPOINTS)
        patches.setattr("lidarspectra.room.hidden_layers.SIGHT_LINES", FEW_SIGHT_LINES)
        yield


@pytest.fixture(scope="session")
def atmosphere(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of genssky's tables of the air: pytest's cache keeps them from run to run.

    It lies where a program whose cache is two folders above it looks for them. Who needs a clear sky asks for
    `clear_air`, so that tables are in it.
    """
    cache = getattr(request.config, "cache", None)
    programs = tmp_path_factory.mktemp("programs") if cache is None else cache.mkdir("programs")
    made_by = f"pyradiance-{version('pyradiance')}-orders-{SCATTERING_ORDERS}"
    folder = Path(programs) / made_by / "lidarspectra" / "atmosphere"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@pytest.fixture(scope="session")
def clear_air(atmosphere: Path, made_once: Callable[[str, Callable[[Path], None]], Path]) -> Path:
    """Folder of genssky's tables of the air, with those of a summer's day: made by one worker, in half the usual time.

    Light that was scattered more often than SCATTERING_ORDERS is left out of them, which changes how a clear sky's
    light is spread over it, by some per cent. How
    much light there is follows from SPECTRL2 alone (`compute_sky`).
    """
    # Here, since they load numpy.
    from lidarspectra.radiance.engine.engine import Engine, EngineRun, find_engine
    from lidarspectra.radiance.scene.sky import TABLES_FOLDER, Daylight, compute_sky

    engine_run = Engine.run

    def fewer_orders(engine: Engine, program: str, arguments: Sequence[str], **others: Any) -> EngineRun:
        asked = ("-i", str(SCATTERING_ORDERS)) if program == "genssky" else ()
        return engine_run(engine, program, [*arguments, *asked], **others)

    def make(folder: Path) -> None:
        noon = Daylight(latitude_deg=48.0, longitude_deg=0.0, time=datetime(2024, 6, 21, 12, 0, tzinfo=UTC))
        if not any((atmosphere / TABLES_FOLDER).glob("*.dat")):
            with patch.object(Engine, "run", fewer_orders):
                compute_sky(noon, folder, find_engine(), atmosphere=atmosphere)

    made_once("clear-air", make)
    return atmosphere
