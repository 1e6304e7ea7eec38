"""How far reflectances move when nothing changes that matters: linear algebra, seeds, round-off in a scan.

    python -m research.scenes.by_day FOLDER
    python -m research.benchmarks.fit_stability FOLDER|poly.toml ... [--only office-day ...] [--changes kernel ...]

Materials are estimated of each scan as it is, without classes, and again under harmless changes: other kernels of
linear algebra than the processor's own (OpenBLAS, and numpy without wide registers), faces in another order, texture
values off by one level at random, and other seeds: of the samples and rays, and of what sorts colours. Of each change,
against the scan as it is: by how many stated standard deviations the reflectance of faces moves at 555 nm, the root of
the area-weighted mean square and what 1 % of the area exceeds; by how much the level moves (mean of the logarithm); the
share of the area that moves by more than half of what is stated; and the tone curve. The last line of a scan has the
worst of each.
"""

import argparse
import os
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.colors import surface_colors
from lidarspectra.material.delighting import colored_light, surface_hues
from lidarspectra.material.estimate import estimate_materials
from lidarspectra.material.views.viewpoints import ViewSettings, render_views
from lidarspectra.room.room import Room, find_room
from lidarspectra.workflow import stages
from lidarspectra.workflow.materials import picture_evidence
from lidarspectra.workflow.materials.delighting import take_light_out
from lidarspectra.workflow.materials.light_uncertainty import with_light_uncertainty
from lidarspectra.workflow.pipeline import run
from research.benchmarks.delighting import read_case

KERNELS = {  # by what is set before a process loads its libraries
    "kernel Sandybridge": {"OPENBLAS_CORETYPE": "Sandybridge"},
    "kernel Nehalem": {"OPENBLAS_CORETYPE": "Nehalem"},
    "kernel Prescott": {"OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4"},
}
ORDERS = {"order of faces 1": 1, "order of faces 2": 2}
TEXTURES = {"texture off by a level 1": 1, "texture off by a level 2": 2}
SAMPLE_SEEDS = {"seed of samples 1": 1, "seed of samples 2": 2, "seed of samples 3": 3}
SORTING_SEEDS = {"seed of sorting 1": 1, "seed of sorting 2": 2, "seed of sorting 3": 3}
AS_IT_IS = "as it is"
CHANGED = 0.5  # [1] of a stated deviation, by which a face counts as changed
REFERENCE_NM = 555.0  # [nm]


@dataclass(frozen=True, kw_only=True, eq=False)
class Picture:
    """What light is taken out of: arguments of `take_light_out`.

    Parameters
    ----------
    scan : Scan
    room : Room
    lamps : sequence of Lamp
    options : dict
    """

    scan: Scan
    room: Room
    lamps: Sequence[Lamp]
    options: dict[str, Any]


@dataclass(frozen=True, kw_only=True, eq=False)
class Taken:
    """Reflectances of one fit, faces in the scan's order.

    Parameters
    ----------
    logs, stated : (face,) float
        Log reflectance at `REFERENCE_NM`, and its standard deviation. [1]
    weight : (face,) float
        Area; 0 for what shows no surface. [m²]
    tone : str
        Family, power, shoulder.
    kernel : str
        Of the linear algebra that found them.
    """

    logs: FloatArray
    stated: FloatArray
    weight: FloatArray
    tone: str
    kernel: str


def picture_of(path: Path) -> Picture:
    """Of a folder with a scan whose truth is known, or of a run file."""
    if path.is_dir():
        case = read_case(path)
        return Picture(scan=case.scan, room=find_room(case.scan), lamps=case.lamps, options={})
    seen: list[Picture] = []

    def remember(scan: Scan, room: Room, lamps: Sequence[Lamp], **options: Any) -> Any:
        options.pop("progress")
        seen.append(Picture(scan=scan, room=room, lamps=lamps, options=options))
        raise _SeenError

    with (
        tempfile.TemporaryDirectory() as folder,
        patch.object(stages, "take_light_out", remember),
        suppress(_SeenError),
    ):
        run(path, Path(folder) / "made.run", last="materials")
    return seen[0]


class _SeenError(Exception):
    """The materials stage need not go on."""


@contextmanager
def other_seeds(samples: int, sorting: int) -> Iterator[None]:
    """Seeds of samples and rays, and of what sorts colours, moved by so many."""
    with ExitStack() as stack:
        stack.enter_context(patch.object(picture_evidence, "SEED", picture_evidence.SEED + samples))
        for module in (surface_hues, colored_light):
            stack.enter_context(patch.object(module, "SEED", module.SEED + sorting))
        yield


def changed(scan: Scan, change: str) -> tuple[Scan, IntArray]:
    """A scan under a harmless change, and (face,) where each of its faces was."""
    order: IntArray = np.arange(len(scan.faces), dtype=np.int64)
    if change in ORDERS:
        order = np.random.default_rng(ORDERS[change]).permutation(order)
        return replace(scan, faces=scan.faces[order], appearance=scan.appearance.select(order)), order
    if change in TEXTURES:
        generator = np.random.default_rng(TEXTURES[change])
        images = tuple(
            np.clip(image.astype(np.int16) + generator.integers(-1, 2, image.shape), 0, 255).astype(np.uint8)
            if image.dtype == np.uint8
            else image
            for image in scan.appearance.images
        )
        corners = scan.appearance.corner_color
        corners = np.clip(corners + generator.integers(-1, 2, corners.shape) / 255.0, 0.0, 1.0)
        return replace(scan, appearance=replace(scan.appearance, images=images, corner_color=corners)), order
    return scan, order


def taken(picture: Picture, change: str) -> Taken:
    """Take the light out under a change."""
    from threadpoolctl import threadpool_info

    scan, order = changed(picture.scan, change)
    with other_seeds(SAMPLE_SEEDS.get(change, 0), SORTING_SEEDS.get(change, 0)):
        found = take_light_out(scan, picture.room, picture.lamps, **picture.options)
    if found.face_color is None or found.face_deviation is None or found.fit is None:
        raise SystemExit(f"The light could not be taken out, {change}: {' '.join(found.warnings)}")
    views = render_views(scan, settings=ViewSettings(width=128, height=128))
    matched = estimate_materials(scan, views, face_color=found.face_color, model=None)
    materials = with_light_uncertainty(matched, found, scan.areas)
    value, deviation = (
        np.array([0.1 if each is None else float(each.at([REFERENCE_NM], outside="nearest")[0]) for each in spectra])
        for spectra in (
            [each.reflectance for each in materials.materials],
            [each.uncertainty for each in materials.materials],
        )
    )
    of_face = materials.face_material[np.argsort(order)]
    fit = found.fit
    return Taken(
        logs=np.log(value)[of_face],
        stated=(deviation / value)[of_face],
        weight=picture.scan.areas * surface_colors(picture.scan)[1],
        tone=f"{fit.tone_family:6s} {fit.tone.power:5.2f} {fit.tone.shoulder:8.2f} "
        f"{100 * fit.family_probability:9.0f} %",
        kernel=str(next(each["architecture"] for each in threadpool_info() if "architecture" in each)),
    )


def all_taken(path: Path, changes: Sequence[str]) -> dict[str, Taken]:
    """Of each change; runs in a process of its own, whose linear algebra is chosen by its environment."""
    picture = picture_of(path)
    return {change: taken(picture, change) for change in changes}


def in_process(path: Path, changes: Sequence[str], environment: dict[str, str]) -> dict[str, Taken]:
    """As `all_taken`, in a new process with some variables set."""
    with patch.dict(os.environ, environment), ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        return pool.submit(all_taken, path, list(changes)).result()


def moved(base: Taken, now: Taken) -> FloatArray:
    """Root mean square and 99th percentile of moves [stated deviations]; that of the level [%]; area that moved [%]."""
    apart = now.logs - base.logs
    ratio = np.abs(apart) / base.stated
    weight = base.weight / base.weight.sum()
    most = float(np.quantile(ratio, 0.99, weights=weight, method="inverted_cdf"))
    level = 100.0 * float(np.expm1(weight @ apart))
    return np.array([float(np.sqrt(weight @ ratio**2)), most, level, 100.0 * float(weight @ (ratio > CHANGED))])


def row(words: str, values: FloatArray, tone: str = "") -> str:
    """A line of a table."""
    rms, most, level, area = values
    return f"  {words:26s} {rms:6.2f} {most:6.2f} {level:+7.2f} % {area:5.1f} %   {tone}".rstrip()


def report(path: Path, groups: Sequence[str]) -> FloatArray:
    """Print a scan's table, and give the worst of each column."""
    here = [
        change for change in (*ORDERS, *TEXTURES, *SAMPLE_SEEDS, *SORTING_SEEDS) if change.startswith(tuple(groups))
    ]
    found = in_process(path, [AS_IT_IS, *here], {})
    base = found.pop(AS_IT_IS)
    for change, environment in KERNELS.items():
        if change.startswith(tuple(groups)):
            found[change] = in_process(path, [AS_IT_IS], environment)[AS_IT_IS]
    stated = float(np.average(base.stated, weights=base.weight))
    print(f"\n{path.name}: kernel {base.kernel}, {base.tone}; {100 * stated:.0f} % stated")
    print(f"  {'':26s} {'rms':>6s} {'99 %':>6s} {'level':>9s} {'moved':>7s}   family power shoulder probability")
    values = {change: moved(base, now) for change, now in found.items()}
    for change, now in found.items():
        print(row(change, values[change], now.tone + (f" {now.kernel}" if change in KERNELS else "")))
    worst = np.abs(np.array(list(values.values()))).max(axis=0)
    print(row("worst", worst), flush=True)
    return np.asarray(worst, dtype=np.float64)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("paths", type=Path, nargs="+")
    parser.add_argument("--only", nargs="+", default=[""], help="scans whose names begin so")
    parser.add_argument("--changes", nargs="+", default=[""], help="changes whose names begin so")
    given = parser.parse_args(arguments)
    paths = [each for path in given.paths for each in (sorted(path.iterdir()) if path.is_dir() else [path])]
    scans = [each for each in paths if each.is_file() or (each / "scan.glb").is_file()]
    worst = [report(each, given.changes) for each in scans if each.name.startswith(tuple(given.only))]
    print(f"\n{row('mean of the worst', np.mean(worst, axis=0))}\n{row('worst of all', np.max(worst, axis=0))}")


if __name__ == "__main__":
    main()
