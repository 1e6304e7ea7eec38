"""What frames tell of gloss: specularity and roughness found and true, and matt surfaces that are taken for glossy.

    python -m research.scenes.frames FOLDER --case night --gloss --frames 96
    python -m research.benchmarks.gloss FOLDER [--only office-night ...] [--materials]

A row for each true material that frames show: its area, true and found specularity and roughness with their standard
deviations, by how many of them each is off, or why it counts as matt. Scans without `gloss.csv` are matt throughout. By
the materials of a run, with `--materials`, in place of the true ones: a part is then what the estimate took for one.
Frames are read, light is taken out and gloss is fitted as in a run.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.captures import read_capture
from lidarspectra.hardware.phone.orientation import upright_rotation
from lidarspectra.material.estimate import estimate_materials
from lidarspectra.material.frames.frame_colors import color_from_frames
from lidarspectra.material.frames.gloss import GlossOfPart
from lidarspectra.material.views.viewpoints import ViewSettings, render_views
from lidarspectra.room.room import find_room
from lidarspectra.spectra.databases import load_reflectances
from lidarspectra.workflow.materials.delighting import Delighting, take_light_out
from lidarspectra.workflow.materials.gloss_of_run import gloss_of_faces
from research.benchmarks.delighting import Case, read_case
from research.scenes.frames import FRAMES, GLOSS

MIN_AREA_M2 = 0.1  # [m²] of a row
HEADER = (
    f"{'scan':22s} {'material':20s} {'m²':>5s}   {'specularity: true, found':30s} {'off':>5s}   "
    f"{'roughness: true, found':28s} {'off':>5s}"
)


@dataclass
class Tally:
    """What rows come to.

    Glossy ones found, all glossy ones, area of matt ones taken for glossy, of all matt ones, and by how many deviations
    specularities and roughnesses are off.
    """

    found: int = 0
    glossy: int = 0
    false_m2: float = 0.0
    matt_m2: float = 0.0
    off: tuple[tuple[float, float], ...] = ()

    def words(self) -> str:
        """One line."""
        off = np.abs(np.array(self.off)).reshape(-1, 2)
        within = ", ".join(
            f"{name}: {(off[:, column] < 1).sum()} within one deviation, {(off[:, column] < 2).sum()} within two"
            for column, name in enumerate(("specularity", "roughness"))
        )
        return (
            f"{self.found} of {self.glossy} glossy materials found; {within}; {self.false_m2:.1f} of "
            f"{self.matt_m2:.1f} m² of matt surface taken for glossy"
        )


def true_gloss(case: Case) -> FloatArray:
    """(material, 2) true specularity and roughness [1]."""
    path, values = case.folder / GLOSS, np.zeros((len(case.truth), 2))
    if path.is_file():
        rows = [line.split(",") for line in path.read_text(encoding="utf-8").splitlines()[1:]]
        named = {name: (float(specularity), float(roughness)) for name, specularity, roughness in rows}
        values = np.array([named.get(material.name, (0.0, 0.0)) for material in case.truth])
    return values


def run(folder: Path, tally: Tally, *, by_materials: bool) -> None:
    """Print a scan's rows."""
    case, capture = read_case(folder), read_capture(folder / FRAMES)
    colors = color_from_frames(case.scan, tuple(frame.moved(upright_rotation("+y")) for frame in capture.frames))
    delit = take_light_out(colors.scan, find_room(colors.scan), case.lamps, records=colors.records)
    if delit.fit is None or colors.records is None:
        print(f"{folder.name}: no light was found")
        return
    part, names = case.face_truth, [material.name for material in case.truth]
    true = true_gloss(case)
    if by_materials:
        part, names, true = _as_estimated(case, colors.scan, delit, true)
    found = gloss_of_faces(colors.records, colors.scan, part, len(names), delit.fit, delit.lit)
    areas = np.bincount(part, weights=case.scan.areas * colors.face_seen, minlength=len(names))
    for number in np.argsort(-areas):
        if areas[number] > MIN_AREA_M2:
            _row(folder.name, names[number], float(areas[number]), true[number], found[number], tally)


def _as_estimated(
    case: Case, scan: Scan, delit: Delighting, true: FloatArray
) -> tuple[IntArray, list[str], FloatArray]:
    """(face,) estimated material, their names, and the true gloss of what most of each is."""
    views = render_views(scan, settings=ViewSettings(width=128, height=128))
    found = estimate_materials(scan, views, library=load_reflectances(), face_color=delit.face_color)
    count = len(found.materials)
    shared = np.zeros((count, len(case.truth)))
    np.add.at(shared, (found.face_material, case.face_truth), case.scan.areas)
    return found.face_material, [material.name for material in found.materials], true[shared.argmax(axis=1)]


def _row(scan: str, name: str, area_m2: float, true: FloatArray, found: GlossOfPart, tally: Tally) -> None:
    words = found.matt
    glossy = true[0] > 0
    if not found.matt:
        off = (
            (found.specularity - true[0]) / found.specularity_deviation,
            (found.roughness - true[1]) / found.roughness_deviation,
        )
        words = (
            f"{true[0]:.3f} {found.specularity:10.4f} ± {found.specularity_deviation:.4f}         {off[0]:+5.1f}   "
            f"{true[1]:.3f} {found.roughness:10.3f} ± {found.roughness_deviation:.3f}        {off[1]:+5.1f}"
        )
        if glossy:
            tally.off = (*tally.off, off)
    elif glossy:
        words = f"{true[0]:.3f}, {true[1]:.3f}, but {found.matt} (gain {found.gain:.0f})"
    tally.glossy += glossy
    tally.found += glossy and not found.matt
    tally.matt_m2 += 0.0 if glossy else area_m2
    tally.false_m2 += 0.0 if glossy or found.matt else area_m2
    print(f"{scan:22s} {name[:20]:20s} {area_m2:5.1f}   {words}", flush=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", default=[""], help="scans whose names begin so")
    parser.add_argument("--materials", action="store_true", help="parts are a run's materials")
    given = parser.parse_args(arguments)
    print(HEADER)
    tally = Tally()
    for folder in sorted(given.folder.iterdir()):
        if (folder / FRAMES).is_dir() and folder.name.startswith(tuple(given.only)):
            run(folder, tally, by_materials=given.materials)
    print(tally.words())


if __name__ == "__main__":
    main()
