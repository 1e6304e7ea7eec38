"""Frames in a run: colours of the scan from them, what the run keeps of them, and what it says.

Kept are names of frames, their gains and what was fitted. Positions on Earth, dates, names of devices and titles, which
apps write beside the frames and into pictures, are not read, so that no run holds them.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lidarspectra.errors import ScanError
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.frames import Capture, left_out_note
from lidarspectra.io.files import write_whole, writing
from lidarspectra.material.frames.frame_colors import FrameColors, color_from_frames
from lidarspectra.material.frames.gains import Radiometry
from lidarspectra.material.frames.seen_panes import panes_of_frames
from lidarspectra.progress import Progress, silent
from lidarspectra.room.panes.pane import Pane
from lidarspectra.room.panes.search import Seen
from lidarspectra.room.panes.wall_view import WallView
from lidarspectra.words import counted

FRAMES_FILE = "frames.json"
NOT_KEPT = ("position on Earth", "date and time", "device", "title", "EXIF")
LOOSE_DEVIATION = 0.1  # [1] of a gain's logarithm, from which a note warns of drift
CUT_M2 = 0.02  # [m²] cut at white in all frames, from which a note says so
SEEN_SHARE = 0.9  # [1] of the area, below which a note says so
NONE_USED = (
    "No frame is left, so the scan keeps the colours of its mesh, if it has any. Scan so that every surface is in two "
    "frames or more, or export more frames."
)


def frame_colors(
    scan: Scan, capture: Capture | None, *, wanted: bool, progress: Progress = silent
) -> FrameColors | None:
    """Colours of a repaired scan from its frames, which are closed; None without any, or if they are not wanted."""
    if capture is None:
        return None
    try:
        return color_from_frames(scan, capture.frames, progress=progress) if wanted else None
    finally:
        capture.close()


def panes_seen_in(colors: FrameColors | None, capture: Capture | None) -> Seen | None:
    """What looks in frames for glass and mirrors, and closes them then; None without any."""
    if colors is None or capture is None:
        return None

    def seen(scan: Scan, walls: Sequence[WallView], caster: RayCaster) -> tuple[Pane, ...]:
        try:
            return panes_of_frames(colors, scan, walls, caster)
        finally:
            capture.close()

    return seen


def frames_in_words(colors: FrameColors | None) -> str:
    """What the frames gave, as an end of the stage's line."""
    if colors is None or colors.radiometry is None:
        return ""
    radiometry = colors.radiometry
    gain = np.exp(radiometry.log_gain[:, 1])
    return (
        f"; colours of {counted(len(colors.frames), 'frame')} (gain {gain.min():.2f} to {gain.max():.2f}, held-out "
        f"observations differ by {100 * radiometry.after:.1f} %, as shown by {100 * radiometry.before:.1f} %; no GPS "
        "or date kept)"
    )


def frames_of_app(colors: FrameColors | None, capture: Capture | None) -> str:
    """How many frames of which app colour a scan, and how their brightness is told; nothing if none does."""
    if colors is None or capture is None or colors.radiometry is None:
        return ""
    gain, deviation = np.exp(colors.radiometry.log_gain[:, 1]), float(np.median(colors.radiometry.deviation))
    told = all(frame.exposure_s is not None and frame.iso is not None for frame in colors.frames)
    return (
        f"{len(colors.frames)} of {capture.app}, gain {gain.min():.2f} to {gain.max():.2f} ± {100 * deviation:.0f} %, "
        f"exposures {'told' if told else 'not told'}"
    )


def frame_notes(colors: FrameColors | None, capture: Capture | None) -> tuple[str, ...]:
    """Notes on frames: those left out, gains that may drift, what no frame saw, what all show cut at white."""
    if capture is None:
        return ()
    total = len(capture.frames) + len(capture.left_out)
    if colors is None:
        return left_out_note(capture.left_out, total)
    left_out = (*capture.left_out, *colors.left_out)
    if colors.radiometry is None:
        return left_out_note(left_out, total, then=NONE_USED)
    notes = list(left_out_note(left_out, total))
    loose = float(np.median(colors.radiometry.deviation))
    if loose > LOOSE_DEVIATION:
        notes.append(
            f"The frames overlap so little that their brightnesses are known by {100 * loose:.0f} % only, and "
            "reflectances far from one another with them. Scan again in loops that come back to where they began."
        )
    bare = 1.0 - colors.seen_share - colors.texture_share
    if bare > 1.0 - SEEN_SHARE:
        notes.append(
            f"{100 * bare:.0f} % of the scan's area is in none of the frames and has no colour, so it takes the "
            "material of its neighbours. Export more frames, or set frames = false in [scan] if the app's own texture "
            "has it."
        )
    if colors.texture_share > 1.0 - SEEN_SHARE:
        notes.append(
            f"{100 * colors.texture_share:.0f} % of the scan's area is in none of the frames. Its colours are those of "
            "the app's texture on the scale of the frames, from which it differs by "
            f"{100 * colors.texture_spread:.0f} % where both show the surface."
        )
    if colors.cut_m2 > CUT_M2:
        notes.append(
            f"{colors.cut_m2:.1f} m² are cut at white in every frame that shows them, so that their radiance is only "
            "known to be above it. Where lamps and windows matter, let the phone look straight at them for a second: "
            "it then exposes for them."
        )
    return tuple(notes)


def save_frames(colors: FrameColors, capture: Capture, folder: Path) -> None:
    """Write what is known of the frames as JSON, and what they show of places all over the surface.

    Parameters
    ----------
    colors : FrameColors
    capture : Capture
    folder : Path
        Of the scan stage.

    Raises
    ------
    ScanError
        If it cannot be written.
    """
    left_out = (*capture.left_out, *colors.left_out)
    about = {
        "app": capture.app,
        "not_kept": NOT_KEPT,
        **({} if colors.radiometry is None else _fitted(colors, colors.radiometry)),
        "left_out": {each.name: each.reason for each in left_out},
        "left_out_position_m": {each.name: each.position_m for each in left_out if each.position_m is not None},
    }
    with writing(folder, error=ScanError):
        write_whole(folder / FRAMES_FILE, json.dumps(about, indent=1) + "\n")
    if colors.records is not None:
        colors.records.save(folder)


def _fitted(colors: FrameColors, radiometry: Radiometry) -> dict[str, object]:
    return {
        "tone_curve": {"power": radiometry.tone.power, "shoulder": radiometry.tone.shoulder},
        "tone_deviation": {"log_power": radiometry.power_deviation, "log_1_shoulder": radiometry.shoulder_deviation},
        "vignetting": radiometry.vignetting.tolist(),
        "held_out_deviation": {"as_shown": radiometry.before, "solved": radiometry.after},
        "seen_share": colors.seen_share,
        "texture_share": colors.texture_share,
        "texture_deviation": colors.texture_spread,
        "recovered_m2": colors.recovered_m2,
        "cut_m2": colors.cut_m2,
        "frames": [
            {
                "name": frame.name,
                "position_m": frame.position.tolist(),
                "direction": frame.direction.tolist(),
                "gain": np.exp(gain).tolist(),
                "log_gain_deviation": float(deviation),
            }
            for frame, gain, deviation in zip(colors.frames, radiometry.log_gain, radiometry.deviation, strict=True)
        ],
    }
