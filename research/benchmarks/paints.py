"""Of a run: which materials its walls got, and how much of the scan was held at the reflectance of fresh white paint.

    lidarspectra materials poly.toml
    python -m research.benchmarks.paints poly.toml

Of each wall of the room, the area, the two materials that have most of it, with their reflectance at 555 nm, and the
area of faces whose colour is at the limit; then that area within the room's plan, of it on the ceiling (faces that look
downwards), and behind the room's walls and panes.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lidarspectra.arrays import BoolArray
from lidarspectra.geometry.scan import Scan, load_scan
from lidarspectra.material.colors import surface_colors
from lidarspectra.material.delighting.light_objective import BRIGHTEST_REFLECTANCE
from lidarspectra.material.material_map import MaterialMap, load_materials
from lidarspectra.room.room import Room, load_room
from lidarspectra.room.room_planes import Wall
from lidarspectra.workflow.run_folder.workspace import stage_folder

REFERENCE_NM = 555.0  # [nm]
FACING, NEAR_M = 0.9, 0.1  # [1] cosine, [m]: faces of a wall
ROUNDING = 1e-3  # [1] of a colour at the limit


def faces_of(wall: Wall, scan: Scan) -> BoolArray:
    """(face,) which lie in a wall's plane and look as it does."""
    near = np.abs(scan.centers @ wall.normal - wall.offset_m) < NEAR_M
    return np.asarray(near & (scan.normals @ wall.normal > FACING), dtype=np.bool_)


def wall_in_words(wall: Wall, scan: Scan, found: MaterialMap) -> str:
    """Area of a wall, its two commonest materials, and how much of it is at the limit."""
    member = faces_of(wall, scan)
    area = np.bincount(found.face_material[member], weights=scan.areas[member], minlength=len(found.materials))
    words = [
        f"{area[number]:.1f} m² {found.materials[number].name}, "
        f"{float(found.materials[number].reflectance.at([REFERENCE_NM], outside='nearest')[0]):.2f}"
        for number in np.argsort(-area)[:2]
    ]
    azimuth = np.degrees(np.arctan2(wall.normal[1], wall.normal[0]))
    held = scan.areas[member & at_limit(scan, found)].sum()
    return (
        f"wall that looks towards {azimuth:4.0f}°: {area.sum():4.1f} m²: {'; '.join(words)}; {held:.1f} m² held at "
        "fresh white"
    )


def at_limit(scan: Scan, found: MaterialMap) -> BoolArray:
    """(face,) which are as bright as fresh white paint, of those that have a colour in the scan."""
    bright = found.face_color.max(axis=1) > BRIGHTEST_REFLECTANCE - ROUNDING
    return np.asarray(bright & surface_colors(scan)[1], dtype=np.bool_)


def held_areas(scan: Scan, room: Room, found: MaterialMap) -> list[float]:
    """Areas of faces at the limit [m²]: within the room's plan, of these on the ceiling, and beyond the plan."""
    bright, inside = at_limit(scan, found), room.in_plan(scan.centers[:, :2])
    downwards = scan.normals[:, 2] < -FACING
    return [
        float(scan.areas[chosen].sum()) for chosen in (bright & inside, bright & inside & downwards, bright & ~inside)
    ]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("run_file", type=Path)
    given = parser.parse_args(arguments)
    run = given.run_file.with_suffix(".run")
    scan, room = load_scan(stage_folder(run, "scan")), load_room(stage_folder(run, "scan"))
    found = load_materials(stage_folder(run, "materials"))
    for wall in room.walls:
        print(wall_in_words(wall, scan, found))
    within, above, beyond = held_areas(scan, room, found)
    print(
        f"held at fresh white: {within:.1f} m² within the room, {above:.1f} m² of it ceiling; "
        f"{beyond:.1f} m² behind its walls and panes"
    )


if __name__ == "__main__":
    main()
