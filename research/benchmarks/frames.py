"""What the frames themselves buy over an app's texture: the same virtual phone, walk and light, by both.

    python -m research.scenes.frames FOLDER
    python -m research.benchmarks.frames FOLDER [--only office-day ...] [--no-map] [--rivals]
    python -m research.benchmarks.frames FOLDER --lamps         lamps seen in frames, with and without
    python -m research.benchmarks.frames FOLDER --only office-night-1 --plan docs/pictures/frames.png
    python -m research.benchmarks.frames --capture RAW_DATA     a real capture: held-out observations alone

Of each scan in the folder, by its texture and by its frames: area-weighted mean of the absolute reflectance error
(linear sRGB), of all faces and of those that some frame saw, and of the signed one of these; the map by the lamps alone
against the true room's; how many surfaces (by area, over 400 to 700 nm) lie within one and two stated deviations.
Of the frames, how far the gains are from the true ones, what held-out observations differ by as they are shown and
after the solve, and the processor time. `--rivals` adds the textures that an app would blend from these very frames,
whose exposure moves, as they are ("blended") and with their gains compensated before ("evened"), and the true radiance
of every face ("true"): what is left there is not the frames'.

`--lamps`: reflectance error and bias of the faces' colours after the light is taken out, where frames saw, and the
lamps' relative fluxes if they are not stated (truly 1), each with and without what frames show of the lamps' own
surfaces, and with and without the belief in white ceilings. `--plan`: the frames of the first scan on its plan, the
poses of two of them shifted by a metre so that they are left out.
"""

import argparse
import json
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, SmallFloatArray
from lidarspectra.geometry.appearance import NEUTRAL_COLOR, PHOTOGRAPHED, Appearance, LinearLight
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.captures import read_capture
from lidarspectra.hardware.phone.orientation import upright_rotation
from lidarspectra.hardware.phone.readers import read_scan, read_scan_and_frames
from lidarspectra.mapping.figures.figure_style import save_picture
from lidarspectra.mapping.figures.floor_plan import floor_plan
from lidarspectra.mapping.figures.frames_figure import frames_figure
from lidarspectra.mapping.maps.metrics import compare_maps
from lidarspectra.material.colors import surface_colors
from lidarspectra.material.delighting import light_objective
from lidarspectra.material.delighting.light_objective import CEILING_DEVIATION
from lidarspectra.material.estimate import estimate_materials
from lidarspectra.material.frames.frame_colors import FrameColors, color_from_frames
from lidarspectra.material.frames.records import FrameRecords
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.material.views.viewpoints import ViewSettings, render_views
from lidarspectra.room.room import find_room
from lidarspectra.spectra.colorimetry import xyz_to_linear_srgb
from lidarspectra.spectra.databases import load_reflectances, tristimulus_table
from lidarspectra.workflow.materials import picture_evidence
from lidarspectra.workflow.materials.delighting import take_light_out
from lidarspectra.workflow.materials.light_uncertainty import with_light_uncertainty
from lidarspectra.workflow.report.report_frames import frames_on_plan
from lidarspectra.workflow.run_folder.frames_of_run import FRAMES_FILE, save_frames
from research.benchmarks.blended_texture import blended, compensated
from research.benchmarks.by_day import coverage
from research.benchmarks.delighting import (
    Case,
    Light,
    light,
    on_color_grid,
    read_case,
    reflectance_errors,
    true_colors,
    true_light,
)
from research.benchmarks.true_faces import nearest_faces
from research.scenes.by_day import GLASS
from research.scenes.frames import FACE_LIGHT, FRAMES, GAINS

SURE = 0.9  # [1] of white, below which frames' colours are surfaces'
SPOILED, SPOILED_M = (24, 66), 1.0  # frames whose pose is shifted along their axis for the picture [m]
NO_BELIEF = 100.0  # [1] of the log: a deviation that tells nothing
HEADER = (
    f"{'scan':18s} {'':8s} {'error':>6s} {'seen':>6s} {'bias':>7s} {'NRMSE':>6s} {'bias':>8s} {'one':>6s} {'two':>6s}"
)


def run(folder: Path, *, with_map: bool, with_rivals: bool) -> None:
    """Print a scan's rows."""
    case = read_case(folder)
    reference = true_light(case) if with_map else None
    capture = read_capture(folder / FRAMES)
    frames = tuple(frame.moved(upright_rotation("+y")) for frame in capture.frames)
    start = time.process_time()
    colors = color_from_frames(case.scan, frames)
    took = time.process_time() - start
    # Errors are weighed over the faces whose texture shows a surface, of both alike.
    seen = surface_colors(case.scan)[1] & colors.face_seen
    _row(folder.name, "texture", case, case.scan, seen, reference)
    _row(folder.name, "frames", case, colors.scan, seen, reference, colors.records)
    if with_rivals:
        # Without the map: what no frame saw has no colour in them, which would be what the map tells.
        _row(folder.name, "blended", case, blended(case.scan, colors.frames), seen)
        _row(folder.name, "evened", case, compensated(case.scan, colors.frames), seen)
        _row(folder.name, "true", case, with_true_radiance(case, colors), seen)
    print(f"  {capture.app}: {radiometry_words(colors)}, gains off by {gain_error(folder, colors):.3f}; {took:.0f} s")


def with_true_radiance(case: Case, colors: FrameColors) -> Scan:
    """The scan with the true radiance of every face, on the scale of the frames', and a camera that is known."""
    scan, count = colors.scan, len(case.scan.faces)
    light = np.load(case.folder / FACE_LIGHT)[nearest_faces(case.scan, read_scan(case.folder / "scan.glb"))]
    shown = scan.face_colors()
    alike = colors.face_seen & (light.min(axis=1) > 0) & (shown.max(axis=1) < SURE)
    scale = float(np.median(shown[alike].mean(axis=1) / light[alike].mean(axis=1)))
    nothing = np.zeros(count)
    # A window's radiance depends on the direction: one number a face would be wrong from most places.
    windows = np.array([material.name == GLASS for material in case.truth])[case.face_truth]
    exact = LinearLight(
        power_deviation=0.0, shoulder_deviation=0.0, face_deviation=nothing, face_cut=windows.astype(np.float64)
    )
    image, corner_uv = _texel_each(scale * light)
    appearance = Appearance(
        images=(image,), face_image=np.zeros(count, dtype=np.int64), corner_uv=corner_uv,
        corner_color=np.full((count, 3, 3), NEUTRAL_COLOR), color_source=np.full(count, PHOTOGRAPHED), linear=exact,
    )  # fmt: skip
    return replace(scan, appearance=appearance)


def _texel_each(light: FloatArray) -> tuple[SmallFloatArray, FloatArray]:
    """Linear texture with one texel for each of (face, 3) colours, and (face, 3, 2) places in it.

    Colours of corners end at white, which lamps are beyond.
    """
    size = int(np.ceil(np.sqrt(len(light))))
    image = np.zeros((size * size, 3), dtype=np.float32)
    image[: len(light)] = light
    row, column = np.divmod(np.arange(len(light)), size)
    uv = np.stack([(column + 0.5) / size, 1.0 - (row + 0.5) / size], axis=1)
    return image.reshape(size, size, 3), np.repeat(uv[:, None], 3, axis=1)


def error_where(found: MaterialMap, case: Case, chosen: BoolArray) -> tuple[float, float]:
    """Area-weighted mean absolute and signed error over some faces, in linear sRGB [1]."""
    weights = tristimulus_table()
    estimate, truth = (xyz_to_linear_srgb(on_color_grid(each) @ weights) for each in (found.materials, case.truth))
    apart = (estimate[found.face_material] - truth[case.face_truth])[chosen]
    areas = case.scan.areas[chosen]
    absolute, signed = (float(np.average(each.mean(axis=1), weights=areas)) for each in (np.abs(apart), apart))
    return absolute, signed


def _row(
    name: str,
    kind: str,
    case: Case,
    scan: Scan,
    seen: BoolArray,
    reference: Light | None = None,
    records: FrameRecords | None = None,
) -> None:
    views = render_views(scan, settings=ViewSettings(width=128, height=128))
    delit = take_light_out(scan, find_room(scan), case.lamps, records=records)
    found = estimate_materials(scan, views, library=load_reflectances(), face_color=delit.face_color)
    materials = with_light_uncertainty(found, delit, scan.areas)
    of_map = ""
    if reference is not None:
        errors = compare_maps(light(scan, materials, replace(case, scan=scan)).irradiance, reference.irradiance)
        of_map = f"{errors.nrmse_all:6.3f} {errors.bias_percent:+6.1f} %"
    one, two = coverage(materials, case)
    of_seen = error_where(materials, case, seen)
    print(
        f"{name:18s} {kind:8s} {reflectance_errors(materials, case)[0]:6.3f} {of_seen[0]:6.3f} {of_seen[1]:+7.3f} "
        f"{of_map:15s} {100 * one:4.0f} % {100 * two:4.0f} %",
        flush=True,
    )
    print(
        f"  {delit.words or 'light left in'}\n" + "".join(f"  {warning}\n" for warning in delit.warnings),
        end="",
        flush=True,
    )


def radiometry_words(colors: FrameColors) -> str:
    """What the solve says of itself."""
    found = colors.radiometry
    if found is None:
        return "no two frames show the same surface"
    gain = np.exp(found.log_gain[:, 1])
    return (
        f"{len(colors.frames)} frames, {len(colors.left_out)} left out, gain {gain.min():.2f} to {gain.max():.2f} "
        f"± {100 * np.median(found.deviation):.1f} %, shoulder {found.tone.shoulder:.2f} (log ± "
        f"{found.shoulder_deviation:.2f}), power {found.tone.power:.2f} (log ± {found.power_deviation:.2f}), held-out "
        f"observations differ by {100 * found.before:.1f} % as shown, {100 * found.after:.1f} % solved; "
        f"{100 * colors.seen_share:.0f} % seen, {colors.recovered_m2:.1f} m² above white told, {colors.cut_m2:.1f} not"
    )


def gain_error(folder: Path, colors: FrameColors) -> float:
    """Root mean square error of the logs of the gains, over their mean."""
    true = np.log(np.loadtxt(folder / GAINS, delimiter=",", skiprows=1))
    names = [frame.name for frame in read_capture(folder / FRAMES).frames]
    rows = [names.index(frame.name) for frame in colors.frames]
    if colors.radiometry is None:
        return float("nan")
    apart = colors.radiometry.log_gain - true[rows]
    return float((apart - apart.mean(axis=0)).std())


def lamps_seen(folder: Path) -> None:
    """Print what lamps that frames show unclipped tell."""
    case, capture = read_case(folder), read_capture(folder / FRAMES)
    colors = color_from_frames(case.scan, tuple(frame.moved(upright_rotation("+y")) for frame in capture.frames))
    seen = surface_colors(case.scan)[1] & colors.face_seen
    room, areas = find_room(colors.scan), case.scan.areas[seen]
    for lamps in (True, False):
        with ExitStack() as stack:
            if not lamps:
                stack.enter_context(patch.object(picture_evidence, "shown_of_lamps", lambda scan, lamps: None))
            for ceiling in (True, False):
                with patch.object(light_objective, "CEILING_DEVIATION", CEILING_DEVIATION if ceiling else NO_BELIEF):
                    found = take_light_out(colors.scan, room, case.lamps, records=colors.records)
                if found.face_color is None:
                    print(f"{folder.name}: light left in")
                    continue
                apart = (found.face_color - true_colors(case))[seen].mean(axis=1)
                absolute = np.abs(found.face_color - true_colors(case))[seen].mean(axis=1)
                print(
                    f"{folder.name:20s} lamps {'seen' if lamps else 'unseen'} ceiling {'white' if ceiling else 'any'} "
                    f"error {np.average(absolute, weights=areas):.3f} bias {np.average(apart, weights=areas):+.3f}",
                    flush=True,
                )
            free = take_light_out(
                colors.scan, room, case.lamps, records=colors.records, fluxes_stated=False
            ).lamp_fluxes
            print("  fluxes " + ", ".join(f"{each.factor:.2f} ± {each.log_deviation:.2f}" for each in free), flush=True)


def draw_on_plan(folder: Path, picture: Path) -> None:
    """Draw where a scan's frames were taken, with what is left out of them."""
    case, capture = read_case(folder), read_capture(folder / FRAMES)
    frames = [frame.moved(upright_rotation("+y")) for frame in capture.frames]
    for number in SPOILED:
        pose = frames[number].camera_to_world.copy()
        pose[:3, 3] += SPOILED_M * frames[number].direction
        frames[number] = replace(frames[number], camera_to_world=pose)
    colors = color_from_frames(case.scan, frames)
    with TemporaryDirectory() as kept:
        save_frames(colors, capture, Path(kept))
        about = json.loads((Path(kept) / FRAMES_FILE).read_text(encoding="utf-8"))
    save_picture(frames_figure(floor_plan(case.scan, find_room(case.scan)), frames_on_plan(about)), picture)


def real(path: Path) -> None:
    """Print what the solve makes of a real capture."""
    scan, capture = read_scan_and_frames(path, unit="m", up="+y")
    if capture is None:
        raise SystemExit(f"{path}: no raw data")
    start = time.process_time()
    colors = color_from_frames(scan, capture.frames)
    print(f"{path.name} ({capture.app}): {radiometry_words(colors)}; {time.process_time() - start:.0f} s")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", default=[""], help="scans whose names begin so")
    parser.add_argument("--no-map", action="store_true", help="reflectances alone")
    parser.add_argument("--rivals", action="store_true", help="textures that an app blends from these frames, too")
    parser.add_argument("--lamps", action="store_true", help="what lamps seen in frames tell")
    parser.add_argument("--plan", type=Path, help="draw the frames of the first scan there, as PNG")
    parser.add_argument("--capture", action="store_true", help="the folder is a real capture")
    given = parser.parse_args(arguments)
    if given.capture:
        real(given.folder)
        return
    if not given.lamps and given.plan is None:
        print(HEADER)
    for folder in sorted(given.folder.iterdir()):
        if not (folder / FRAMES).is_dir() or not folder.name.startswith(tuple(given.only)):
            continue
        if given.plan is not None:
            draw_on_plan(folder, given.plan)
            return
        if given.lamps:
            lamps_seen(folder)
        else:
            run(folder, with_map=not given.no_map, with_rivals=given.rivals)


if __name__ == "__main__":
    main()
