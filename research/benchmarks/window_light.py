"""What a crude pattern of the windows' light costs: reflectances with the scan's own patterns, and with the true light.

    python -m research.benchmarks.window_light FOLDER ...

Of each folder that `research.scenes.by_day` made: by how much floor, ceiling, walls and furniture come out too bright
(linear sRGB, before spectra are matched), with the patterns that de-lighting makes of what is cut at white, and with
each window's true light on the true surfaces in their place, whose lobes' shares are known then.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from unittest.mock import patch

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.colors import surface_colors
from lidarspectra.material.delighting.unknown_light import LOBES, UnknownSource, source_patterns
from lidarspectra.room.room import find_room
from lidarspectra.room.surface_parts import PARTS, surface_parts
from lidarspectra.workflow.materials import picture_evidence
from lidarspectra.workflow.materials.delighting import take_light_out
from research.benchmarks.delighting import Case, read_case, true_colors
from research.scenes.by_day import CASES, FLUX_RATIO, openings_of
from research.virtual_rooms.day_light import Opening, straight_light
from research.virtual_rooms.room_plan import read_plan
from research.virtual_rooms.true_room import TrueRoom, true_room

GREEN_NM = np.array([550.0])  # one wavelength tells a pattern: all windows have one spectrum
HARDLY = 1e-6  # [1] of the first lobe, in the others: a strength needs a pattern


def true_patterns(room: TrueRoom, opening: Opening, positions: FloatArray, normals: FloatArray) -> FloatArray:
    """(lobe, point) light of a window on the true surfaces nearest to points of a scan, all of it in the first lobe."""
    faces = room.nearest_faces(positions, normals)
    true_normals = room.normals[faces]
    off = np.einsum("nc,nc->n", positions - room.scan.corners[faces, 0], true_normals)
    light = straight_light(room, [opening], positions - off[:, None] * true_normals, true_normals)[:, 0]
    return np.stack([light, *[HARDLY * light] * (LOBES - 1)])


def levels(case: Case) -> FloatArray:
    """(part,) estimated over true reflectance, less 1."""
    found = take_light_out(case.scan, find_room(case.scan), case.lamps)
    assert found.face_color is not None
    part = surface_parts(case.scan, find_room(case.scan))
    areas = case.scan.areas * surface_colors(case.scan)[1]
    total = [
        np.bincount(part, weights=areas * color.mean(axis=1), minlength=len(PARTS))
        for color in (found.face_color, true_colors(case))
    ]
    return np.asarray(total[0] / np.maximum(total[1], 1e-9) - 1.0, dtype=np.float64)


def print_scan(folder: Path) -> None:
    """Print a scan's two rows."""
    scene, name, _ = folder.name.rsplit("-", 2)
    case, plan = read_case(folder), read_plan(folder / "plan.toml")
    room, openings = true_room(plan), openings_of(FLUX_RATIO[scene], CASES[name], plan, folder, GREEN_NM)
    middles = np.array([opening.corner + 0.5 * (opening.along + opening.up) for opening in openings])

    def patterns(
        scan: Scan,
        caster: RayCaster,
        source: UnknownSource,
        positions: FloatArray,
        normals: FloatArray,
        generator: np.random.Generator,
    ) -> FloatArray:
        if not source.is_pane:
            return source_patterns(scan, caster, source, positions, normals, generator)
        nearest = openings[int(np.linalg.norm(middles - source.center, axis=1).argmin())]
        return true_patterns(room, nearest, positions, normals)

    print_row(folder.name, "its own", levels(case))
    with patch.object(picture_evidence, "source_patterns", patterns):
        print_row(folder.name, "true", levels(case))


def print_row(name: str, light: str, off: FloatArray) -> None:
    """Print by how much each part's level is off."""
    words = ", ".join(f"{part} {100 * each:+5.1f} %" for part, each in zip(PARTS, off, strict=True))
    print(f"{name:24s} {light:8s} {words}", flush=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folders", type=Path, nargs="+")
    for folder in parser.parse_args(arguments).folders:
        print_scan(folder)


if __name__ == "__main__":
    main()
