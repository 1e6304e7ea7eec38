"""How often the stated deviations of reflectances hold the truth, pooled over scans whose truth is known.

    python -m research.scenes.by_day FOLDER ...
    python -m research.benchmarks.stated_deviations FOLDER [FOLDER ...] [--only office-day ...]

Shares are those of area and wavelengths (400 to 700 nm) whose truth lies within z stated deviations: of all scans
pooled, and of each room. Then the factor on all deviations with which `WANTED` of the truth would be within one, chosen
on all rooms but one, and what it makes of the room left out; and the same with the matching's and the light's parts by
themselves. A normal law would have 68 and 95 % within one and two.
"""

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.material.colors import surface_colors
from lidarspectra.material.estimate import estimate_materials
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.material.views.viewpoints import ViewSettings, render_views
from lidarspectra.room.room import find_room
from lidarspectra.spectra.databases import load_reflectances
from lidarspectra.spectra.reflectance_library import COLOR_GRID_NM
from lidarspectra.workflow.materials.delighting import take_light_out
from lidarspectra.workflow.materials.light_uncertainty import with_light_uncertainty
from research.benchmarks.delighting import VISIBLE, Case, on_color_grid, read_case
from research.scenes.by_day import CASES

TIMES = (0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0)
WANTED = 0.68  # [1] of the truth within one deviation
CASE_NAMES = (*CASES, "night", "day")


@dataclass(frozen=True, kw_only=True, eq=False)
class Apart:
    """Estimates against the truth.

    Parameters
    ----------
    error : (n,) float
        Absolute difference of reflectance. [1]
    matching, light : (n,) float
        Stated deviation of the colour's spectrum, and of the light taken out. [1]
    weight : (n,) float
        Area. [m²]
    """

    error: FloatArray
    matching: FloatArray
    light: FloatArray
    weight: FloatArray

    def stated(self) -> FloatArray:
        """(n,) both parts of the deviation together [1]."""
        return np.asarray(np.hypot(self.matching, self.light), dtype=np.float64)

    def within(self, times: float) -> float:
        """Share within so many stated deviations [1]."""
        return float(np.average(self.error <= times * self.stated(), weights=self.weight))

    def factor(self) -> float:
        """Factor on the deviations with which `WANTED` would be within one [1]."""
        ratio = self.error / np.maximum(self.stated(), 1e-12)
        return float(np.quantile(ratio, WANTED, weights=self.weight, method="inverted_cdf"))


def joined(parts: Sequence[Apart]) -> Apart:
    """All of some, pooled."""
    return Apart(
        error=np.concatenate([part.error for part in parts]),
        matching=np.concatenate([part.matching for part in parts]),
        light=np.concatenate([part.light for part in parts]),
        weight=np.concatenate([part.weight for part in parts]),
    )


def room_of(scan: str) -> str:
    """Name of a scan's room: what is before its case and its seed."""
    name = scan.rpartition("-")[0]
    return next((name.removesuffix(f"-{case}") for case in CASE_NAMES if name.endswith(f"-{case}")), name)


def apart_of(matched: MaterialMap, stated: MaterialMap, case: Case) -> Apart:
    """Errors and deviations of the materials of a scan, before and after the light's uncertainty was added."""
    estimate, truth = on_color_grid(matched.materials), on_color_grid(case.truth)
    areas = case.scan.areas * surface_colors(case.scan)[1]
    pair = matched.face_material * len(truth) + case.face_truth
    area = np.bincount(pair, weights=areas)
    pairs = np.flatnonzero(area > 0)
    found, true = pairs // len(truth), pairs % len(truth)
    own, all_in_all = (_deviations(each)[found][:, VISIBLE].ravel() for each in (matched, stated))
    return Apart(
        error=np.abs(estimate[found] - truth[true])[:, VISIBLE].ravel(),
        matching=own,
        light=np.sqrt(np.maximum(all_in_all**2 - own**2, 0.0)),
        weight=np.repeat(area[pairs], int(VISIBLE.sum())),
    )


def _deviations(materials: MaterialMap) -> FloatArray:
    """(material, wavelength) stated deviations, 0 where none is stated."""
    deviation = np.zeros((len(materials.materials), COLOR_GRID_NM.size))
    for row, material in enumerate(materials.materials):
        if material.uncertainty is not None:
            deviation[row] = material.uncertainty.at(COLOR_GRID_NM, outside="nearest")
    return deviation


def estimated(folder: Path) -> Apart:
    """The materials of a scan as a run estimates them, against its truth."""
    case = read_case(folder)
    views = render_views(case.scan, settings=ViewSettings(width=128, height=128))
    delit = take_light_out(case.scan, find_room(case.scan), case.lamps)
    matched = estimate_materials(case.scan, views, library=load_reflectances(), face_color=delit.face_color)
    return apart_of(matched, with_light_uncertainty(matched, delit, case.scan.areas), case)


def print_shares(rooms: Mapping[str, Apart]) -> None:
    """Print the shares of each room and of all, then what a factor chosen without each room would make of it."""
    print(f"\n{'within z deviations':20s}", *(f"{times:6.2f}" for times in TIMES))
    everything = joined(list(rooms.values()))
    for name, apart in (*rooms.items(), ("all", everything)):
        print(f"{name:20s}", *(f"{100 * apart.within(times):4.0f} %" for times in TIMES))
    for words, part in (("matching alone", "matching"), ("light alone", "light")):
        alone = Apart(
            error=everything.error,
            matching=everything.matching if part == "matching" else 0.0 * everything.matching,
            light=everything.light if part == "light" else 0.0 * everything.light,
            weight=everything.weight,
        )
        print(f"{words:20s}", *(f"{100 * alone.within(times):4.0f} %" for times in TIMES))
    if len(rooms) < 2:
        return
    print(f"\n{'left out':20s} factor of the others   within one   within two")
    for name, apart in (*rooms.items(), ("none", everything)):
        factor = joined([other for each, other in rooms.items() if each != name]).factor()
        shares = "   ".join(f"{100 * apart.within(times * factor):8.0f} %" for times in (1, 2))
        print(f"{name:20s} {factor:20.2f}   {shares}")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--only", nargs="+", default=[""], help="scans whose names begin so")
    given = parser.parse_args(arguments)
    found: dict[str, list[Apart]] = {}
    for folder in (scan for each in given.folders for scan in sorted(each.iterdir())):
        if (folder / "scan.glb").is_file() and folder.name.startswith(tuple(given.only)):
            apart = estimated(folder)
            found.setdefault(room_of(folder.name), []).append(apart)
            print(f"{folder.name:24s} {100 * apart.within(1):4.0f} % {100 * apart.within(2):4.0f} %", flush=True)
    print_shares({name: joined(parts) for name, parts in found.items()})


if __name__ == "__main__":
    main()
