"""How far the reflectance of a wall, floor or ceiling is off that no picture shows: it is taken to be like another one.

    python -m research.benchmarks.unseen_planes [FOLDER ...]

Of each scene, those that come with the package by default, each large plane of the room is blackened in turn, as an app
leaves what it has no picture of. Printed are its area, true mean reflectance, that of the faces which it is then taken
to be like, and the logarithm of their ratio; last the root mean square of these: `unseen_faces.GUESS_DEVIATION`.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lidarspectra.arrays import BoolArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.colors import surface_colors
from lidarspectra.material.unseen_faces import unseen_faces
from lidarspectra.room.room import find_room
from lidarspectra.spectra.database_files import scenes_folder
from research.benchmarks.delighting import read_case, true_colors

SHIPPED = ("office", "apartment", "large-office")
MIN_M2 = 2.0  # of a plane
NEAR_M, FLAT = 0.06, 0.9  # [m], [1] cosine: of its faces


def planes(scan: Scan) -> Iterator[tuple[str, BoolArray]]:
    """Name and (face,) members of each plane of the room."""
    room = find_room(scan)
    height, up = scan.centers[:, 2], scan.normals[:, 2]
    yield "floor", (up > FLAT) & (np.abs(height - room.floor_z) < NEAR_M)
    yield "ceiling", (up < -FLAT) & (np.abs(height - room.ceiling_z) < NEAR_M)
    for number, wall in enumerate(room.walls, start=1):
        near = np.abs(scan.centers @ wall.normal - wall.offset_m) < NEAR_M
        yield f"wall {number}", near & (np.abs(scan.normals @ wall.normal) > FLAT)


def run(folder: Path) -> list[float]:
    """Print a scene's rows; logarithms of guessed over true reflectance."""
    case = read_case(folder)
    scan, true = case.scan, true_colors(case).mean(axis=1)
    found = []
    for name, member in planes(scan):
        black = replace(scan, appearance=scan.appearance.darkened(member))
        unseen = unseen_faces(black, surface_colors(black)[1])
        if unseen.guessed is None:
            continue
        guessed = np.flatnonzero(member[unseen.faces] & unseen.guessed)
        areas = scan.areas[unseen.faces[guessed]]
        if areas.sum() < MIN_M2:
            continue
        own, like = (float(np.average(true[each[guessed]], weights=areas)) for each in (unseen.faces, unseen.like))
        found.append(float(np.log(like / own)))
        print(f"{folder.name:14s} {name:8s} {areas.sum():6.1f} m2  {own:.2f} {like:.2f} {found[-1]:+.2f}", flush=True)
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", nargs="*", type=Path, default=[scenes_folder() / name for name in SHIPPED])
    logs = np.array([each for folder in parser.parse_args(arguments).folders for each in run(folder)])
    print(f"rms {np.sqrt(np.mean(logs**2)):.2f}, median {np.median(np.abs(logs)):.2f}, of {logs.size} planes")


if __name__ == "__main__":
    main()
