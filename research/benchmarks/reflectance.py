"""How well a colour gives back a reflectance: leave-one-out on spectraldb, and the office scene against its truth.

    python -m research.benchmarks.reflectance --spectraldb FILE [--every N]

Protocol: the rows of spectraldb that were measured with the specular component from 400 to 740 nm and stay below 99 %
(885 of 1288); each is taken out, its exact colour (D65, 2 degrees) is given, and the mean absolute percentage error of
what comes back is taken over 400 to 740 nm at 10 nm; in further columns over 400 to 700 nm, and over 710 to 740 nm, of
which a colour tells next to nothing. For the default method the stated deviation is held against the truth in both, and
on the surfaces of the built-in library, mostly vivid test colours, each by the others.
"""

import argparse
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import get_args
from unittest.mock import patch

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.material import matching
from lidarspectra.material.colors import color_difference, surface_colors
from lidarspectra.material.estimate import estimate_materials
from lidarspectra.material.matching import MatchMethod, match_color
from lidarspectra.material.segmentation.surface_classes import of_class, surface_class
from lidarspectra.material.views.viewpoints import ViewSettings, render_views
from lidarspectra.spectra.colorimetry import linear_srgb_to_lab
from lidarspectra.spectra.database_files import table
from lidarspectra.spectra.databases import load_reflectances, scenes_folder
from lidarspectra.spectra.reflectance_library import COLOR_GRID_NM, ReflectanceLibrary
from research.benchmarks.spectraldb import imported

PROTOCOL_NM = (400.0, 740.0)  # [nm]
DARK = 0.05  # [1] luminance of a surface that is nearly black
UNSEEN_FROM_NM = 710.0  # [nm]
COMPARED = np.isin(COLOR_GRID_NM, np.arange(PROTOCOL_NM[0], PROTOCOL_NM[1] + 1.0, 10.0))
SEEN, UNSEEN = COMPARED & (COLOR_GRID_NM < UNSEEN_FROM_NM), COMPARED & (COLOR_GRID_NM >= UNSEEN_FROM_NM)
NORMAL_SHARES = (0.6827, 0.9545)  # [1] of a normal law within one and two deviations
SCALES = (0.7, 0.85, 1.2)  # [1] of other deviations that might be stated
SMALLEST = 1e-3  # [1] a percentage error of less than a tenth of a per cent of the light says nothing

Method = Callable[[int], FloatArray]
"""From the number of a row that is taken out to the reflectance that comes back."""


def rows_of_protocol(library: ReflectanceLibrary) -> BoolArray:
    """(surface,) rows that the protocol counts."""
    return np.array(
        [
            row.matchable
            and row.range_nm[0] <= PROTOCOL_NM[0]
            and row.range_nm[1] >= PROTOCOL_NM[1]
            and "SCE" not in row.note
            for row in library.rows
        ]
    )


def linear_wiener(library: ReflectanceLibrary, wanted: FloatArray, differences: FloatArray) -> FloatArray:
    """Wiener estimate in reflectance itself over the 40 nearest, constrained to the colour."""
    near = np.argsort(differences)[:40]
    weight = (1.0 + differences[near]) ** -2.0
    weight /= weight.sum()
    mean = weight @ library.values[near]
    away = library.values[near] - mean
    spread = away.T @ (away * weight[:, None]) @ library.weights
    colors = library.weights.T @ spread
    colors += 1e-9 * np.trace(colors) * np.eye(3)
    values = mean + spread @ np.linalg.solve(colors, wanted - library.weights.T @ mean)
    return np.clip(values, 0.0, 1.0)


def leave_one_out(library: ReflectanceLibrary, every: int) -> None:
    """Print the error of every method on a library."""
    differences = np.array([color_difference(lab, library.lab) for lab in library.lab])
    np.fill_diagonal(differences, np.inf)
    category = np.array(library.categories)
    in_type = np.where(category[:, None] == category[None, :], differences, np.inf)
    builtin = load_reflectances()

    def nearest_five(row: int) -> FloatArray:
        near = np.argsort(differences[row])[:5]
        weight = (0.3 + differences[row, near]) ** -2.0
        return np.asarray(weight @ library.values[near] / weight.sum())

    def ours(row: int) -> FloatArray:
        others = np.arange(len(library)) != row
        found = match_color(library.xyz[row], library, among=others).spectrum
        return found.at(COLOR_GRID_NM, outside="nearest")

    def as_the_mean_has_it(row: int) -> FloatArray:
        with patch.object(matching, "with_usual_rise", lambda values, *near: values):
            return ours(row)

    def from_builtin_as_the_mean_has_it(row: int) -> FloatArray:
        with patch.object(matching, "with_usual_rise", lambda values, *near: values):
            return from_builtin(row)

    def from_builtin(row: int) -> FloatArray:
        return match_color(library.xyz[row], builtin).spectrum.at(COLOR_GRID_NM, outside="nearest")

    def as_light_as_they_are(row: int) -> FloatArray:
        with patch.object(matching, "SCALING", 1e9):
            return from_builtin(row)

    def scaled(row: int) -> FloatArray:
        others = np.arange(len(library)) != row
        found = match_color(library.xyz[row], library, method="nearest", among=others).spectrum
        return found.at(COLOR_GRID_NM, outside="nearest")

    methods: dict[str, Method] = {
        "nearest in its type (the paper)": lambda row: library.values[in_type[row].argmin()],
        "nearest of all": lambda row: library.values[differences[row].argmin()],
        "nearest of all, to its luminance ('nearest')": scaled,
        "five nearest, weighted": nearest_five,
        "Wiener over 40 nearest, in reflectance": lambda row: linear_wiener(
            library, library.xyz[row], differences[row]
        ),
        "Wiener over 80 nearest, in logit ('wiener')": ours,
        "the same, beyond 690 nm as the mean": as_the_mean_has_it,
        "the same, built-in library only": from_builtin,
        "and beyond 690 nm as the mean": from_builtin_as_the_mean_has_it,
        "built-in, none brought to the luminance seen": as_light_as_they_are,
    }
    rows = range(0, len(library), every)
    known = [row for row in range(len(library)) if surface_class(library.rows[row]) is not None]
    masks = {name: of_class(library, name) for name in {surface_class(library.rows[row]) or "" for row in known}}
    random = np.random.default_rng(0)
    drawn = {row: str(random.choice(sorted(masks))) for row in known}

    def favoring(row: int, method: MatchMethod, names: Mapping[int, str | None]) -> FloatArray:
        others, name = np.arange(len(library)) != row, names[row]
        favored = None if name is None else masks[name]
        found = match_color(library.xyz[row], library, method=method, among=others, favored=favored).spectrum
        return found.at(COLOR_GRID_NM, outside="nearest")

    def within(row: int) -> FloatArray:
        others = (np.arange(len(library)) != row) & masks[surface_class(library.rows[row]) or ""]
        return match_color(
            library.xyz[row], library, method="nearest", among=others if others.any() else None
        ).spectrum.at(COLOR_GRID_NM, outside="nearest")

    own = {row: surface_class(library.rows[row]) for row in known}
    choices: dict[str, Mapping[int, str | None]] = {
        "no class": dict.fromkeys(known),
        "its class favoured": own,
        "a class drawn at random favoured": drawn,
    }
    of_known: dict[str, Method] = {
        f"'{kind}', {words}": partial(favoring, method=kind, names=names)
        for kind in get_args(MatchMethod)
        for words, names in choices.items()
    }
    of_known["'nearest', within its class alone (the paper)"] = within
    print(
        f"{'leave-one-out on ' + str(len(rows)) + ' surfaces':46s} {'MAPE':>7s} {'median':>7s} {'90 %':>7s} "
        f"{'to 700':>7s} {'beyond':>7s} {'ms':>6s}"
    )
    for name, method in methods.items():
        print_errors(name, method, rows, library)
    print_coverage("'wiener'", library, library, rows)
    print_coverage("built-in library only", library, builtin, rows)
    test_colors = builtin.subset(builtin.matchable)
    print_coverage(f"the built-in library's own {len(test_colors)}", test_colors, test_colors, range(len(test_colors)))
    print(f"the {len(known[::every])} whose names tell their material class:")
    for name, method in of_known.items():
        print_errors(name, method, known[::every], library)


def print_errors(name: str, method: Method, rows: Sequence[int], library: ReflectanceLibrary) -> None:
    """Print a method's errors on some rows of a library."""
    start = time.perf_counter()
    found = [method(row) for row in rows]
    each = 1e3 * (time.perf_counter() - start) / len(rows)
    errors, seen, unseen = (
        [percentage_error(values, library.values[row], part) for values, row in zip(found, rows, strict=True)]
        for part in (COMPARED, SEEN, UNSEEN)
    )
    low, high = np.percentile(errors, [50, 90])
    print(
        f"{name:46s} {np.mean(errors):6.2f}% {low:6.2f}% {high:6.2f}% {np.mean(seen):6.2f}% {np.mean(unseen):6.2f}% "
        f"{each:6.1f}",
        flush=True,
    )


def percentage_error(values: FloatArray, truth: FloatArray, part: BoolArray) -> float:
    """Mean absolute percentage error over some wavelengths [%]."""
    return float(100.0 * np.mean(np.abs(values[part] - truth[part]) / np.maximum(truth[part], SMALLEST)))


def print_coverage(words: str, library: ReflectanceLibrary, among: ReflectanceLibrary, rows: Sequence[int]) -> None:
    """Print which share of the truth lies within one and two stated deviations, dark surfaces apart."""
    off, dark = [], []
    for row in rows:
        others = np.arange(len(library)) != row if among is library else None
        match = match_color(library.xyz[row], among, among=others)
        estimate, stated = (each.at(COLOR_GRID_NM, outside="nearest") for each in (match.spectrum, match.uncertainty))
        off.append(np.abs(estimate - library.values[row]) / stated)
        dark.append(library.xyz[row, 1] < DARK)
    some, is_dark = np.array(off), np.array(dark)
    for kind, chosen in {"all": np.ones_like(is_dark), f"below {DARK}": is_dark}.items():
        shares = [f"{(some[chosen][:, part] <= times).mean():4.0%}" for part in (SEEN, UNSEEN) for times in (1, 2)]
        print(f"{words}, {kind}: within one and two {' '.join(shares[:2])}, beyond 700 nm {' '.join(shares[2:])}")
    print(f"{words}: {shape_of_errors(some[:, SEEN])}")


def shape_of_errors(off: FloatArray) -> str:
    """How far absolute errors over stated deviations are from the normal law, and what other deviations would hold."""
    one, two = np.quantile(off, NORMAL_SHARES)
    kurtosis = float((off**4).mean() / (off**2).mean() ** 2)
    scales = ", ".join(f"x {scale:g} {(off <= scale).mean():.0%} {(off <= 2 * scale).mean():.0%}" for scale in SCALES)
    return (
        f"to 700 nm {NORMAL_SHARES[0]:.0%} within {one:.2f}, {NORMAL_SHARES[1]:.0%} within {two:.2f} deviations, ratio "
        f"{two / one:.1f} (normal 2), kurtosis {kurtosis:.0f} (normal 3); deviations {scales}"
    )


def office() -> None:
    """Print the area-weighted reflectance error of the estimate on scenes/office, texture's light left in."""
    folder = scenes_folder() / "office"
    scan = read_scan(folder / "scan.glb")
    truth = {row.id: row.spectrum for row in table(folder / "truth" / "materials.csv")}
    faces = np.genfromtxt(folder / "truth" / "faces.csv.gz", delimiter=",", dtype=str, skip_header=1)[:, 0]
    start = time.perf_counter()
    views = render_views(scan, settings=ViewSettings(width=256, height=256))
    looked = time.perf_counter()
    found = estimate_materials(scan, views)
    done = time.perf_counter()
    grid = COLOR_GRID_NM[COMPARED]
    true_values = np.stack([truth[name].at(grid, outside="nearest") for name in faces])
    spectra = np.stack([material.reflectance.at(grid, outside="nearest") for material in found.materials])
    error = np.abs(spectra[found.face_material] - true_values).mean(axis=1)
    colors, known = surface_colors(scan)
    off = color_difference(
        linear_srgb_to_lab(np.array([m.color for m in found.materials]))[found.face_material],
        linear_srgb_to_lab(colors),
    )
    print(f"\nscenes/office: {len(found.materials)} materials")
    print(f"  views {looked - start:.1f} s, materials {done - looked:.1f} s")
    print(f"  area seen {views.area_coverage:.3f}, points seen {views.point_coverage:.3f} (T = {views.threshold})")
    print(f"  mean absolute reflectance error {np.average(error, weights=scan.areas):.3f} (the room's light is in it)")
    print(f"  CIEDE2000 of faces to their material {np.average(off[known], weights=scan.areas[known]):.2f}")


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--spectraldb", type=Path, required=True, help="the table of spectraldb.com, as CSV")
    parser.add_argument("--every", type=int, default=1, help="take every N-th row only")
    arguments = parser.parse_args()
    with imported(arguments.spectraldb) as spectraldb:
        library = load_reflectances([spectraldb])
        leave_one_out(library.subset(rows_of_protocol(library)), arguments.every)
        office()


if __name__ == "__main__":
    main()
