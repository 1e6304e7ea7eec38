"""What is gained by settling single faces beside paints (`lidarspectra.material.delighting.beside_paints`).

    python -m research.scenes.by_day FOLDER
    python -m research.benchmarks.single_faces FOLDER [FOLDER ...] [--only office-night ...]
    python -m research.benchmarks.single_faces FOLDER --only office-night-1 --picture docs/pictures/edges.png

Of each scan: how much of its area is of no paint and what share of all error lies there; then the area-weighted mean of
the absolute reflectance error (linear sRGB, of what shows a surface), and of the single faces its median and what one
face in ten exceeds, without that step and with it. The light is the same in both. In the end, over all scans: how far
the mean log reflectance of each true material's single faces is off, over what is stated for it, with the usual
deviation of a place alone and with the doubt about what each face is of (Eq. 2). `--picture`: floor and three walls of
the first scan in the reflectances without it, with it, and in the true ones.
"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from unittest.mock import patch

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.mapping.figures.figure_style import save_picture
from lidarspectra.material.colors import surface_colors
from lidarspectra.material.delighting.beside_paints import settle_beside_paints
from lidarspectra.material.delighting.light_objective import CELL_M, LOG_SCATTER
from lidarspectra.material.delighting.one_paint import FLOOR, GREEN, Paints
from lidarspectra.room.room import find_room
from lidarspectra.spectra.colorimetry import encode_srgb
from lidarspectra.workflow.materials import delighting
from lidarspectra.workflow.materials.delighting import Delighting, take_light_out
from lidarspectra.workflow.materials.light_rounds import REFLECTANCE_RANGE
from research.benchmarks.delighting import Case, read_case, true_colors

HEADER = (
    f"{'scan':24s} {'no paint':>9s} {'of error':>9s}  {'error':>6s} {'now':>6s} {'ratio':>6s}"
    f"  {'median':>7s} {'now':>6s}  {'1 of 10':>8s} {'now':>6s}"
)
VIEWS = ((2, 1), (1, 1), (0, 1), (0, -1))  # axis along which one looks at a surface, and which way it faces
LEAST_M2 = 0.3  # [m²] of a material's single faces, whose mean is held against what is stated
FACES_US = 0.3  # [1] least cosine between a surface's normal and that
BELOW_M = 2.0  # [m] above the floor, to where one looks down from


def print_scan(folder: Path, picture: Path | None = None) -> FloatArray:
    """Print a scan's row, and draw it where a picture is asked for; (material, 2) errors over what is stated."""
    case = read_case(folder)
    before: list[Paints] = []

    def watched(scan: Scan, paints: Paints, single: BoolArray, shown: FloatArray) -> Paints:
        before.append(paints)
        return settle_beside_paints(scan, paints, single, shown)

    with patch.object(delighting, "settle_beside_paints", watched):
        delit = take_light_out(case.scan, find_room(case.scan), case.lamps)
    if delit.face_color is None or len(before[0].color) != len(case.scan.faces):
        print(f"{folder.name:24s} no row: no light taken out, or faces too large")
        return np.zeros((0, 2))
    known = surface_colors(case.scan)[1]
    single = known & (before[0].paint < 0)
    old = delit.face_color.copy()
    old[single] = np.clip(before[0].color[single], *REFLECTANCE_RANGE)
    truth, areas = true_colors(case), case.scan.areas
    was, now = (np.abs(color - truth).mean(axis=1) for color in (old, delit.face_color))
    errors = [float(np.average(error[known], weights=areas[known])) for error in (was, now)]
    marks = [np.quantile(error[single], (0.5, 0.9)) for error in (was, now)]
    print(
        f"{folder.name:24s} {100 * areas[single].sum() / areas[known].sum():7.0f} % "
        f"{100 * (areas * was)[single].sum() / (areas * was)[known].sum():7.0f} %  "
        f"{errors[0]:6.4f} {errors[1]:6.4f} {errors[1] / errors[0]:6.2f}  "
        f"{marks[0][0]:7.3f} {marks[1][0]:6.3f}  {marks[0][1]:8.3f} {marks[1][1]:6.3f}",
        flush=True,
    )
    if picture is not None:
        draw(case.scan, {"each face for itself": old, "beside paints": delit.face_color, "true": truth}, known, picture)
    return over_stated(case, delit, single)


def over_stated(case: Case, delit: Delighting, single: BoolArray) -> FloatArray:
    """(material, 2) errors of the mean log of single faces over what is stated, by the usual deviation and now [1]."""
    if delit.face_color is None or delit.face_deviation is None or delit.face_place_deviation is None:
        return np.zeros((0, 2))
    areas, rows = case.scan.areas, []
    logs = np.log(np.maximum(delit.face_color, FLOOR) / np.maximum(true_colors(case), FLOOR))[:, GREEN]
    for material in np.unique(case.face_truth[single]):
        member = single & (case.face_truth == material)
        area = float(areas[member].sum())
        if area < LEAST_M2:
            continue
        error, light, place = (
            float(np.average(each[member], weights=areas[member]))
            for each in (logs, delit.face_deviation[:, GREEN], delit.face_place_deviation)
        )
        of_places = np.array([LOG_SCATTER, place]) / np.sqrt(max(1.0, area / CELL_M**2))
        rows.append(error / np.hypot(light, of_places))
    return np.array(rows).reshape(-1, 2)


def draw(scan: Scan, colors: Mapping[str, FloatArray], known: BoolArray, path: Path) -> None:
    """Draw (face, 3) reflectances of a scan from above and three sides, a row each; black is of no surface."""
    from matplotlib.collections import PolyCollection
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 1.9 * len(colors)), layout="constrained")
    rows = figure.subplots(len(colors), len(VIEWS), squeeze=False)
    triangles, floor_m = scan.vertices[scan.faces], float(scan.vertices[:, 2].min())
    for column, (axis, way) in enumerate(VIEWS):
        seen = way * scan.normals[:, axis] > FACES_US
        if axis == 2:
            seen &= scan.centers[:, 2] < floor_m + BELOW_M
        faces = np.flatnonzero(seen)
        faces = faces[np.argsort(way * scan.centers[faces, axis], kind="stable")]
        outline = triangles[faces][:, :, [other for other in range(3) if other != axis]]
        for axes, (name, color) in zip(rows[:, column], colors.items(), strict=True):
            shown = np.where(known[faces, None], encode_srgb(np.clip(color[faces], 0.0, 1.0)), 0.0)
            axes.add_collection(PolyCollection(list(outline), facecolors=shown, antialiaseds=False, linewidths=0.0))
            axes.autoscale()
            axes.set_aspect("equal")
            axes.set_axis_off()
            if column == 0:
                axes.set_title(name, loc="left")
    save_picture(figure, path)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--only", nargs="+", default=[""], help="scans whose names begin so")
    parser.add_argument("--picture", type=Path, help="PNG of the first scan")
    given = parser.parse_args(arguments)
    print(HEADER)
    picture, rows = given.picture, []
    for folder in (scan for each in given.folders for scan in sorted(each.iterdir())):
        if (folder / "truth").is_dir() and folder.name.startswith(tuple(given.only)):
            rows.append(print_scan(folder, picture))
            picture = None
    over = np.concatenate(rows)
    for name, each in zip(("usual deviation of a place", "with the doubt of each face"), over.T, strict=True):
        within = ", ".join(f"{100 * np.mean(np.abs(each) < limit):.0f} %" for limit in (1, 2))
        rms = float(np.sqrt((each**2).mean()))
        print(f"{name}: {each.size} materials, rms {rms:.2f} of what is stated, {within} within one and two")


if __name__ == "__main__":
    main()
