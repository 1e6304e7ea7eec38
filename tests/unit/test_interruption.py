"""Ctrl-C and SIGTERM end a command wherever they come."""

import importlib
import signal
import sys
import time
from pathlib import Path

import pytest

from lidarspectra.cli.interruption import AGAIN_S, end_when_interrupted, until_interrupted

CATCHES_ALL = """
import signal
caught = None
try:
    signal.raise_signal(signal.{name})
    for _ in range(1000):
        pass
except BaseException as problem:  # as trimesh does with what it cannot import
    caught = problem
"""


@pytest.fixture(autouse=True)
def _handlers_as_before():
    names = (signal.SIGINT, signal.SIGTERM)
    before = [signal.getsignal(name) for name in names]
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell lets what it starts in the background ignore it
    yield
    for name, handler in zip(names, before, strict=True):
        signal.signal(name, handler)


def load_and_wait() -> None:
    module = importlib.import_module("loads_others")
    assert module.caught is None  # the library is whole
    for _ in range(int(100 / AGAIN_S)):
        time.sleep(AGAIN_S)


def interrupt(name: str) -> None:
    signal.raise_signal(getattr(signal, name))
    time.sleep(0.0)


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_an_interruption_while_a_library_is_loaded_comes_when_it_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    (tmp_path / "loads_others.py").write_text(CATCHES_ALL.format(name=name), encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "loads_others", raising=False)
    end_when_interrupted()
    with pytest.raises(KeyboardInterrupt):
        load_and_wait()


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_an_interruption_comes_at_once_otherwise(name: str) -> None:
    end_when_interrupted()
    with pytest.raises(KeyboardInterrupt):
        interrupt(name)


def test_what_the_caller_ignores_stays_ignored() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_when_interrupted()
    signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM"])
def test_a_reading_loop_sees_an_interruption_as_a_flag_and_leaves_the_handlers_as_they_were(name: str) -> None:
    end_when_interrupted()
    with until_interrupted() as stopped:
        assert not stopped()
        interrupt(name)
        assert stopped()
    with pytest.raises(KeyboardInterrupt):
        interrupt(name)
