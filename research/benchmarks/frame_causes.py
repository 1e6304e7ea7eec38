"""Where the reflectance error of frames comes from: one scan, its light taken out of colours of several origins.

    python -m research.scenes.frames FOLDER
    python -m research.benchmarks.frame_causes FOLDER [--only office-day-1 ...] [--surfaces]

Of each scan, over the faces that some frame saw, the area-weighted mean of the absolute and of the signed error of the
faces' colours after the light is taken out (linear sRGB, before materials are matched): by the app's texture, by the
textures that an app blends from these very frames, as they are and with their gains compensated, by the frames, by the
frames without bright patches of less than `LARGE_M2` that are taken for sources of light, by the frames without what
they tell of windows and other sources, by the frames as if their tone curve were known, by the true radiance of every
face, and by the same without the lamps' own where all frames cut it at white. And how near the frames' radiance of
these faces is to the true one. `--surfaces`: the same for each true material.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.captures import read_capture
from lidarspectra.hardware.phone.orientation import upright_rotation
from lidarspectra.material.colors import surface_colors
from lidarspectra.material.delighting.unknown_light import UnknownSource, find_unknown_sources
from lidarspectra.material.frames.frame_colors import FrameColors, color_from_frames
from lidarspectra.material.frames.records import FrameRecords
from lidarspectra.room.room import find_room
from lidarspectra.workflow.materials import picture_evidence
from lidarspectra.workflow.materials.delighting import take_light_out
from research.benchmarks.blended_texture import blended, compensated
from research.benchmarks.delighting import Case, read_case, true_colors
from research.benchmarks.frames import with_true_radiance, without_colors
from research.scenes.frames import FRAMES

LARGE_M2 = 0.5  # [m²] a window is larger; paper on a desk that all frames show cut at white is not


def large_sources(scan: Scan, bright: BoolArray) -> tuple[UnknownSource, ...]:
    """Bright patches that are taken for sources, but for small ones."""
    found = find_unknown_sources(scan, bright)
    return tuple(source for source in found if scan.areas[source.faces].sum() > LARGE_M2)


def radiance_words(case: Case, colors: FrameColors, seen: BoolArray) -> str:
    """How far the frames' radiance of surfaces is from the truth, by area."""
    shown, true = (each.face_colors().mean(axis=1) for each in (colors.scan, with_true_radiance(case, colors)))
    told = seen & (true > 0)
    apart, areas = np.log(np.maximum(shown[told], 1e-6) / true[told]), case.scan.areas[told]
    two, five = (100.0 * float(np.average(np.abs(apart) < limit, weights=areas)) for limit in (0.02, 0.05))
    return f"radiance of surfaces within 2 % of the truth on {two:.0f} % of the area, within 5 % on {five:.0f} %"


def with_known_curve(scan: Scan) -> Scan:
    """The scan as if the frames' tone curve, of which nothing tells the power without exposures, were known."""
    linear = scan.appearance.linear
    if linear is None:
        raise ValueError("a scan that is not coloured by frames")
    known = replace(linear, power_deviation=0.0, shoulder_deviation=0.0)
    return replace(scan, appearance=replace(scan.appearance, linear=known))


def with_lamps_cut(true: Scan, colors: FrameColors) -> Scan:
    """A scan of true radiance that does not know what all frames cut at white, so that no lamp tells the level."""
    of_true, of_frames = true.appearance.linear, colors.scan.appearance.linear
    if of_true is None or of_frames is None:
        raise ValueError("a scan that is not coloured by frames")
    cut = np.maximum(of_true.face_cut, of_frames.face_cut)
    return replace(true, appearance=replace(true.appearance, linear=replace(of_true, face_cut=cut)))


def causes(folder: Path, *, surfaces: bool) -> None:
    """Print a scan's rows."""
    case = read_case(folder)
    frames = tuple(frame.moved(upright_rotation("+y")) for frame in read_capture(folder / FRAMES).frames)
    colors = color_from_frames(without_colors(case.scan), frames)
    seen = surface_colors(case.scan)[1] & colors.face_seen
    print(f"{folder.name:18s} {radiance_words(case, colors, seen)}", flush=True)
    _row(case, case.scan, seen, "texture", surfaces=surfaces)
    _row(case, colors.scan, seen, "frames", colors.records, surfaces=surfaces)
    with patch.object(picture_evidence, "find_unknown_sources", large_sources):
        _row(case, colors.scan, seen, "frames, large sources", colors.records)
    _row(case, colors.scan, seen, "frames, sources unseen")
    _row(case, with_known_curve(colors.scan), seen, "frames, curve known", colors.records)
    true = with_true_radiance(case, colors)
    _row(case, true, seen, "true radiance", surfaces=surfaces)
    _row(case, with_lamps_cut(true, colors), seen, "true, lamps cut")
    _row(case, blended(case.scan, colors.frames), seen, "blended texture")
    _row(case, compensated(case.scan, colors.frames), seen, "blended, gains evened")


def _row(
    case: Case, scan: Scan, seen: BoolArray, kind: str, records: FrameRecords | None = None, *, surfaces: bool = False
) -> None:
    found = take_light_out(scan, find_room(scan), case.lamps, records=records)
    if found.face_color is None:
        print(f"{case.folder.name:18s} {kind:22s} {found.warnings[0]}", flush=True)
        return
    apart = found.face_color - true_colors(case)
    print(f"{case.folder.name:18s} {kind:22s} {_errors(case, apart, seen)}   {found.words}", flush=True)
    for number, material in enumerate(case.truth if surfaces else ()):
        member = seen & (case.face_truth == number)
        if case.scan.areas[member].sum() > LARGE_M2:
            print(
                f"  {material.name:20s} {case.scan.areas[member].sum():4.0f} m² {_errors(case, apart, member)}",
                flush=True,
            )


def _errors(case: Case, apart: FloatArray, member: BoolArray) -> str:
    """Mean of the absolute and the signed error of some faces, from (face, 3) errors of all."""
    areas = case.scan.areas[member]
    error, bias = (float(np.average(each[member].mean(axis=1), weights=areas)) for each in (np.abs(apart), apart))
    return f"error {error:.4f} bias {bias:+.4f}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", default=[""], help="scans whose names begin so")
    parser.add_argument("--surfaces", action="store_true", help="each true material, too")
    given = parser.parse_args(arguments)
    for folder in sorted(given.folder.iterdir()):
        if (folder / FRAMES).is_dir() and folder.name.startswith(tuple(given.only)):
            causes(folder, surfaces=given.surfaces)


if __name__ == "__main__":
    main()
