"""The program beside Blender: what was started, how far it is, and what follows when it ends."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import bpy

from .faults import ExtensionError
from .process import Job, find_program

TICK_S = 0.3  # [s] between two looks at a running program
_RUNNING: dict[str, Any] = {}  # the job and what follows it; there is one at a time

Follow = Callable[[Any], None]
"""What follows a program that ended well; takes the scene, since Blender's undo makes older references invalid."""


def job() -> Job | None:
    """The program that runs now."""
    held: Job | None = _RUNNING.get("job")
    return held


def program(context: Any) -> str:
    """Path of the program that the preferences name; raises ExtensionError if there is none."""
    return find_program(bpy.path.abspath(context.preferences.addons[__package__].preferences.program))


def start(context: Any, arguments: Sequence[str], words: str, follow: Follow) -> None:
    """Start the program with arguments; `follow` is called when it has ended well.

    Raises
    ------
    ExtensionError
        If there is no such program, or one runs already.
    """
    if job() is not None:
        raise ExtensionError(
            expected="one program at a time", found="one that runs", where="LiDARSpectra", todo="Wait, or stop it."
        )
    settings = context.scene.lidarspectra
    started = Job([program(context), *arguments])
    _RUNNING.update(job=started, follow=follow, scene=context.scene.name, run_file=settings.run_file)
    settings.job_words, settings.job_fraction, settings.message = words, 0.0, ""
    if not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=TICK_S, persistent=True)  # another file may be opened meanwhile


def stop() -> None:
    """Ask the running program to end."""
    held = job()
    if held is not None:
        held.stop()


def end() -> None:
    """End it at once and forget it; when the extension is disabled."""
    held = job()
    if held is not None:
        held.kill()
    _RUNNING.clear()
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)


def look() -> bool:
    """Take in what the program said; whether it still runs. Blender's timer calls it."""
    held = job()
    if held is None:
        return False
    status = held.poll()
    scene = bpy.data.scenes.get(_RUNNING["scene"]) or bpy.context.scene
    settings = scene.lidarspectra
    settings.job_fraction = held.fraction
    if status is None:
        settings.job_words = held.words if held.words != "starting" else settings.job_words
        return True
    follow, is_same = _RUNNING["follow"], settings.run_file == _RUNNING["run_file"]
    _RUNNING.clear()
    settings.job_words = ""
    if held.was_stopped:
        settings.message = "Stopped. Finished stages are kept: the next run continues after them."
    elif status != 0:
        settings.message = held.message() or f"lidarspectra ended with status {status}."
    elif not is_same:
        settings.message = "The program has ended; this is another room now. Load the run to see its light."
    else:
        try:
            follow(scene)
        except ExtensionError as fault:
            settings.message = str(fault)
    return job() is not None  # what follows may have started another


def lines() -> list[str]:
    """What the running program has printed."""
    held = job()
    return [] if held is None else held.lines


def export_arguments(run: Path) -> list[str]:
    """Of the command that writes a run's light for Blender."""
    return ["export", str(run), "--blender"]


def run_arguments(run_file: Path) -> list[str]:
    """Of the command that makes a run."""
    return ["run", str(run_file), "--lines"]


def _tick() -> float | None:
    goes_on = look()
    windows = bpy.context.window_manager.windows
    if not goes_on and len(windows):
        with bpy.context.temp_override(window=windows[0]):
            bpy.ops.ed.undo_push(message="LiDARSpectra")  # what was loaded is a step of its own
    for window in windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()
    return TICK_S if goes_on else None
