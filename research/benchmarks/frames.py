"""What the frames themselves buy over an app's texture: the same virtual phone, walk and light, by both.

    python -m research.scenes.frames FOLDER
    python -m research.benchmarks.frames FOLDER [--only office-day ...] [--no-map] [--rivals [evened ...]]
    python -m research.benchmarks.frames FOLDER --lamps         lamps seen in frames, with and without
    python -m research.benchmarks.frames FOLDER --only office-night-1 --plan docs/pictures/frames.png
    python -m research.benchmarks.frames --capture RAW_DATA     a real capture: held-out observations alone

Of each scan in the folder, by its texture and by its frames: area-weighted mean of the absolute and of the signed
reflectance error (linear sRGB) of the faces that some frame saw; how many of these (by area, over 400 to 700 nm) lie
within one and two stated deviations; the map by the lamps alone against the true room's; the lamps' fluxes over one
another if they are not stated, against the true ones. Of the frames, how far the gains are from the true ones, what
held-out observations differ by as they are shown and after the solve, and the processor time. `--rivals` adds the
textures that an app would blend from these very frames, whose exposure moves, as they are ("blended") and with their
gains compensated before ("evened"), and the true radiance of every face ("true"), or those of them that are named: what
is left by true radiance is not the frames'. What no frame saw has no colour by all of these, as by an app that has no
other pictures, and the material of the nearest surface; the phone's texture of one exposure shows it. Rows are kept in
each scan's folder: `research.benchmarks.frames_table` makes the table of them.

`--lamps`: reflectance error and bias of the faces' colours after the light is taken out, where frames saw, and the
lamps' relative fluxes if they are not stated (truly 1), each with and without what frames show of the lamps' own
surfaces, and with and without the belief in white ceilings. `--plan`: the frames of the first scan on its plan, the
poses of two of them shifted by a metre so that they are left out.
"""

import argparse
import json
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, SmallFloatArray
from lidarspectra.geometry.appearance import NEUTRAL_COLOR, NO_COLOR, PHOTOGRAPHED, Appearance, LinearLight
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
    true_colors,
    true_light,
)
from research.benchmarks.frames_table import Measured, save_rows
from research.benchmarks.true_faces import nearest_faces
from research.scenes.by_day import GLASS
from research.scenes.frames import FACE_LIGHT, FRAMES, GAINS

SURE = 0.9  # [1] of white, below which frames' colours are surfaces'
SPOILED, SPOILED_M = (24, 66), 1.0  # frames whose pose is shifted along their axis for the picture [m]
RIVALS = ("blended", "evened", "true")
NO_BELIEF = 100.0  # [1] of the log: a deviation that tells nothing
HEADER = (
    f"{'scan':18s} {'':8s} {'error':>6s} {'bias':>7s} {'one':>6s} {'two':>6s} {'NRMSE':>6s} {'bias':>8s} "
    f"{'fluxes':>8s} {'off by':>7s}"
)


def run(folder: Path, *, with_map: bool, rivals: Sequence[str]) -> None:
    """Print a scan's rows, and keep them in its folder."""
    case = read_case(folder)
    reference = true_light(case) if with_map else None
    capture = read_capture(folder / FRAMES)
    frames = tuple(frame.moved(upright_rotation("+y")) for frame in capture.frames)
    start = time.process_time()
    # Without the phone's texture of one exposure, which no app can make of these frames.
    colors = color_from_frames(without_colors(case.scan), frames)
    took = time.process_time() - start
    # Errors are weighed over the faces whose texture shows a surface, of all alike.
    seen = surface_colors(case.scan)[1] & colors.face_seen
    kinds: dict[str, Callable[[], Scan]] = {"texture": lambda: case.scan, "frames": lambda: colors.scan}
    of_rivals: dict[str, Callable[[], Scan]] = {
        "blended": lambda: blended(case.scan, colors.frames),
        "evened": lambda: compensated(case.scan, colors.frames),
        "true": lambda: with_true_radiance(case, colors),
    }
    kinds |= {kind: of_rivals[kind] for kind in RIVALS if kind in rivals}
    rows = []
    for kind, scan_of in kinds.items():
        records = colors.records if kind == "frames" else None
        rows.append(_row(kind, case, scan_of(), seen, reference if kind != "true" else None, records))
        print(f"{folder.name:18s} {_cells(rows[-1][0])}\n{rows[-1][1]}", end="", flush=True)
    save_rows([row for row, _ in rows], folder)
    print(f"  {capture.app}: {radiometry_words(colors)}, gains off by {gain_error(folder, colors):.3f}; {took:.0f} s")


def without_colors(scan: Scan) -> Scan:
    """The scan as if its app had exported no texture."""
    count = len(scan.faces)
    appearance = replace(
        scan.appearance, images=(), face_image=np.full(count, -1), color_source=np.full(count, NO_COLOR),
        corner_color=np.full((count, 3, 3), NEUTRAL_COLOR),
    )  # fmt: skip
    return replace(scan, appearance=appearance)


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
    kind: str,
    case: Case,
    scan: Scan,
    seen: BoolArray,
    reference: Light | None,
    records: FrameRecords | None,
) -> tuple[Measured, str]:
    """What is made of a scan, and what taking the light out says of itself."""
    views = render_views(scan, settings=ViewSettings(width=128, height=128))
    room = find_room(scan)
    delit = take_light_out(scan, room, case.lamps, records=records)
    free = take_light_out(scan, room, case.lamps, records=records, fluxes_stated=False).lamp_fluxes
    logs = np.log([flux.factor for flux in free if flux.identifiable])
    found = estimate_materials(scan, views, library=load_reflectances(), face_color=delit.face_color)
    materials = with_light_uncertainty(found, delit, scan.areas)
    nrmse = bias_percent = float("nan")
    if reference is not None:
        errors = compare_maps(light(scan, materials, replace(case, scan=scan)).irradiance, reference.irradiance)
        nrmse, bias_percent = errors.nrmse_all, errors.bias_percent
    absolute, signed = error_where(materials, case, seen)
    one, two = coverage(materials, case, seen)
    measured = Measured(
        kind=kind, error=absolute, bias=signed, within_one=one, within_two=two, nrmse=nrmse,
        map_bias_percent=bias_percent, flux_error=float(np.sqrt((logs**2).mean())) if logs.size else float("nan"),
        fluxes=logs.size, lamps=len(case.lamps),
    )  # fmt: skip
    words = f"  {delit.words or 'light left in'}\n" + "".join(f"  {warning}\n" for warning in delit.warnings)
    return measured, words


def _cells(row: Measured) -> str:
    """A row of the printed table."""
    return (
        f"{row.kind:8s} {row.error:6.4f} {row.bias:+7.4f} {100 * row.within_one:4.0f} % {100 * row.within_two:4.0f} % "
        f"{row.nrmse:6.3f} {row.map_bias_percent:+6.1f} % {row.fluxes:3d} of {row.lamps} {100 * row.flux_error:5.1f} %"
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
    parser.add_argument(
        "--rivals", nargs="*", choices=RIVALS, help="textures that an app blends from these frames, too; all if bare"
    )
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
            run(folder, with_map=not given.no_map, rivals=RIVALS if given.rivals == [] else given.rivals or ())


if __name__ == "__main__":
    main()
