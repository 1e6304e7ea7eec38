"""A small room, and the command line as a user starts it."""

import contextlib
import io
import os
import shutil
import signal
import subprocess
import sys
import sysconfig
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import cv2
import numpy as np
import pytest
import trimesh
from matplotlib.figure import Figure
from PIL import Image

from lidarspectra.cli.app import main
from lidarspectra.mapping.report import report_writer
from lidarspectra.radiance.engine.options import NOISE_LEVELS
from lidarspectra.radiance.pictures import render
from lidarspectra.workflow.materials import picture_evidence
from lidarspectra.workflow.pipeline import run
from lidarspectra.workflow.run_folder.workspace import STAGES

RoomWriter = Callable[..., Path]
RunCopier = Callable[[Path], Path]
SharedMaker = Callable[[str, Callable[[Path], None]], Path]  # the fixture `made_once`
FEW_SAMPLES = 1_000  # places whose light is estimated, of 6,000: tests/physics/material hold what that gives

EMPTY = {
    ".svg": b'<svg xmlns="http://www.w3.org/2000/svg" width="72pt" height="72pt" viewBox="0 0 72 72"/>',
    ".png": bytes(cv2.imencode(".png", np.zeros((1, 1), dtype=np.uint8))[1]),
}

ROOM = """
[scan]
file = "room scan.glb"
up = "+y"
[[lamps]]
name = 'lamp "one" !rm'
shape = "panel"
center = [1.2, 1.0, 2.3]
size = [0.5, 0.5]
spectrum = "LED-B3"
luminous_flux_lm = 2000
[[lamps]]
name = "warm"
shape = "bulb"
center = [0.6, 1.6, 1.9]
size = 0.06
spectrum = "A"
luminous_flux_lm = 800
[materials]
coverage = 0.5
[sensors.grid]
count = 9
height = 0.5
[trace]
accuracy = "low"
noise = "draft"
"""


def _room_mesh() -> trimesh.Trimesh:
    """An empty room of 2.4 m x 2 m x 2.5 m, normals inwards, z up, in two colours."""
    mesh = trimesh.creation.box(extents=(2.4, 2.0, 2.5))
    mesh.apply_translation((1.2, 1.0, 1.25))
    mesh = mesh.subdivide().subdivide().subdivide()
    mesh.invert()
    pixels = np.zeros((32, 32, 3), dtype=np.uint8)
    pixels[:, :16], pixels[:, 16:] = (200, 190, 170), (150, 70, 40)
    uv = mesh.vertices[:, [0, 2]] / (2.4, 2.5)
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(pixels))
    mesh.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    return mesh


def _write_room(folder: Path, text: str = ROOM) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    mesh = _room_mesh()
    mesh.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0)))  # glTF is y up
    mesh.export(folder / "room scan.glb")
    path = folder / "room.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def room_text() -> str:
    """The run file of the room below."""
    return ROOM


@pytest.fixture(scope="session")
def write_room() -> RoomWriter:
    """(folder, text) -> run file: writes it with the room's textured scan; the scan's name has a space."""
    return _write_room


@pytest.fixture(scope="session")
def _whole_run(made_once: SharedMaker) -> Path:
    """The run file of the room's run up to its map, which nobody may change."""

    def make(folder: Path) -> None:
        with patch.object(picture_evidence, "SAMPLES", FEW_SAMPLES):
            made = run(_write_room(folder / "room"), last="map").results
        assert [stage for stage, result in made.items() if not result.was_fresh] == list(STAGES[:-1])

    return made_once("whole-run", make) / "room" / "room.toml"


@pytest.fixture(scope="session")
def copy_run(_whole_run: Path) -> Callable[[Path], Path]:
    """(folder) -> run file: the room and its run up to the map, made once for all, copied into a new folder."""

    def copy(folder: Path) -> Path:
        shutil.copytree(_whole_run.parent, folder)
        return folder / _whole_run.name

    return copy


@pytest.fixture(autouse=True)
def few_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Light is taken out of colours by fewer places, in a quarter of the time."""
    monkeypatch.setattr(picture_evidence, "SAMPLES", FEW_SAMPLES)


@pytest.fixture(scope="session")
def drawn_kinds() -> set[tuple[str, int]]:
    """Names of files, and how many panels their figures had, of which one was drawn."""
    return set()


@pytest.fixture
def undrawn_figures(monkeypatch: pytest.MonkeyPatch, drawn_kinds: set[tuple[str, int]]) -> None:
    """Figures are made, and files of them drawn once of each name and number of panels: for tests that read words.

    A report's are not drawn at all: that they are, test_chain.py and tests/unit/mapping hold.
    """
    draw = Figure.savefig

    def draw_once(figure: Figure, file: Path | io.BytesIO, **options: Any) -> None:
        if isinstance(file, Path) and (file.name, len(figure.axes)) in drawn_kinds and file.suffix in EMPTY:
            file.write_bytes(EMPTY[file.suffix])
            return
        draw(figure, file, **options)
        if isinstance(file, Path):  # what is drawn into memory goes on to a file of another kind
            drawn_kinds.add((file.name, len(figure.axes)))

    monkeypatch.setattr(report_writer, "svg_text", lambda figure: EMPTY[".svg"].decode())
    monkeypatch.setattr(Figure, "savefig", draw_once)


@pytest.fixture
def coarse_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures whose indirect light is found from a sixteenth of the directions, over two reflections of six.

    For tests in which a picture is drawn and its light is not measured: tests/physics/pictures holds that.
    """
    monkeypatch.setattr(render, "AMBIENT_DIVISIONS", 16)
    monkeypatch.setattr(render, "BOUNCES", 2)


@pytest.fixture
def coarse_traces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Light is traced to a tenth, whatever noise is asked for: where nobody looks at its numbers."""
    for noise, level in NOISE_LEVELS.items():
        monkeypatch.setitem(NOISE_LEVELS, noise, replace(level, relative_se=0.1))


@dataclass(frozen=True, kw_only=True)
class Answer:
    """What a command answered."""

    status: int
    stdout: str
    stderr: str

    @property
    def words(self) -> str:
        """What it complained of, in one line: the terminal's line breaks fall anywhere."""
        return " ".join(self.stderr.split())


class CommandLine:
    """`lidarspectra`, with what a user types after it.

    Called, it answers in this process, where the libraries are loaded: that takes seconds in each new one. The
    installed program is started by `as_program` and `start`, where a process of its own is what is tested.
    """

    def __init__(self, cache: Path) -> None:
        name = "lidarspectra.exe" if sys.platform == "win32" else "lidarspectra"
        self.program = Path(sysconfig.get_path("scripts")) / name
        self.cache = cache
        self.environment = {**os.environ, **self._own_cache}

    @property
    def _own_cache(self) -> dict[str, str]:
        """Where programs keep what takes long to make; not the user's."""
        return {"XDG_CACHE_HOME": str(self.cache), "LOCALAPPDATA": str(self.cache)}

    def __call__(self, *words: str | Path) -> Answer:
        """Run a command to its end, in this process."""
        on_end = signal.getsignal(signal.SIGTERM)
        stdout, stderr = io.StringIO(), io.StringIO()
        try:
            with (
                patch.dict(os.environ, self._own_cache),
                patch.object(sys, "argv", ["lidarspectra", *map(str, words)]),
                contextlib.redirect_stdout(stdout),
                contextlib.redirect_stderr(stderr),
            ):
                main()
            status: int | str | None = 0
        except SystemExit as end:
            status = end.code
        finally:
            signal.signal(signal.SIGTERM, on_end)
        assert isinstance(status, int | None)
        return Answer(status=status or 0, stdout=stdout.getvalue(), stderr=stderr.getvalue())

    def as_program(self, *words: str | Path, environment: dict[str, str] | None = None) -> Answer:
        """Run a command to its end, by the installed program."""
        run = subprocess.run(
            [self.program, *map(str, words)],
            env=environment or self.environment, capture_output=True, text=True, encoding="utf-8", check=False,
        )  # fmt: skip
        return Answer(status=run.returncode, stdout=run.stdout, stderr=run.stderr)

    def start(self, *words: str | Path) -> subprocess.Popen[str]:
        """Start a command in a process group of its own, as a terminal does."""
        if threading.current_thread() is threading.main_thread():
            # A shell's background job ignores Ctrl-C, and so would its children.
            signal.signal(signal.SIGINT, signal.default_int_handler)
        return subprocess.Popen(
            [self.program, *map(str, words)],
            env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, encoding="utf-8",
            start_new_session=True,
        )  # fmt: skip


@pytest.fixture(scope="session")
def command_line(atmosphere: Path) -> CommandLine:
    """The command line, with the tables of the air at hand."""
    return CommandLine(atmosphere.parents[1])
