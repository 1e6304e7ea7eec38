"""Rooms that are no boxes, and lamps that are no panels: what `init` finds, and how far reflectances and map are off.

    python -m research.benchmarks.odd_rooms FOLDER [--only vault one-globe ...] [--true-height]

    FOLDER/vault/scan.ply, scan.toml, scan.run/

Their light is found by rays alone (`research.virtual_rooms.ray_room`), with nothing of the product. `init` finds the
lamps; those that it finds get their true flux and colour, with `--true-height` their true height too, the uplight is
given, and the room is run. A row for each: lamps found of true and found where none is; of the surfaces that light
reaches, area-weighted mean error and bias of reflectances, linear sRGB, and shares whose green reflectance lies within
one and two stated deviations; the map's median and mean errors and its NRMSE, by illuminance.
"""

import argparse
import re
import shutil
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial import cKDTree

import lidarspectra
from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.scan import Scan, load_scan
from lidarspectra.material.material_map import load_materials
from lidarspectra.spectra.colorimetry import LUMINANCE_FROM_SRGB
from lidarspectra.workflow.init.init_file import write_init
from research.virtual_rooms.ray_room import RayRoom, Solved

Color = float | tuple[float, float, float]

OAK, WALNUT, CREAM = (0.42, 0.28, 0.17), (0.20, 0.11, 0.07), (0.75, 0.70, 0.58)
RED, BLUE, GREEN, BRICK = (0.45, 0.05, 0.05), (0.08, 0.14, 0.35), (0.12, 0.30, 0.12), (0.55, 0.20, 0.12)
WHITE, GRAY = 0.82, 0.45
SHADE = 0.8  # [1] reflectance of lamps
GREEN_NM = 560.0  # [nm] at which a stated deviation is held against the truth
NORMAL_WEIGHT_M = 0.1  # [m] distance equivalent to a turn of one radian, between faces of scan and truth
DARK_SHARE = 0.02  # [1] of the mean light, below which a face is one that no picture shows
NEAR_M = 0.3  # [m] of a true lamp's middle in plan
CCT_K = 6504  # [K] of the lamps, the white of linear sRGB


def flat(*corners: Sequence[float]) -> trimesh.Trimesh:
    """A polygon, of three corners or more [m]."""
    fan = [[0, k, k + 1] for k in range(1, len(corners) - 1)]
    return trimesh.Trimesh(corners, fan, process=False)


def block(low: Sequence[float], high: Sequence[float]) -> trimesh.Trimesh:
    """A box from corner to corner [m]."""
    shape: trimesh.Trimesh = trimesh.creation.box(bounds=[low, high])
    return shape


def shell(
    room: RayRoom, size: tuple[float, float, float], floor: Color, walls: Sequence[Color], ceiling: Color
) -> None:
    """Floor, ceiling and four walls, from the one at y = 0 around [m]."""
    x, y, z = size
    middle = (x / 2, y / 2, z / 2)
    corners = [(0.0, 0.0), (x, 0.0), (x, y), (0.0, y)]
    room.add(flat(*((*corner, 0.0) for corner in corners)), floor, seen_from=middle)
    room.add(flat(*((*corner, z) for corner in corners)), ceiling, seen_from=middle)
    for number, paint in enumerate(walls):
        a, b = corners[number], corners[(number + 1) % 4]
        room.add(flat((*a, 0.0), (*b, 0.0), (*b, z), (*a, z)), paint, seen_from=middle)


def table(room: RayRoom, corner: tuple[float, float], size: tuple[float, float], paint: Color) -> None:
    """A table of .74 m on four legs, from its corner [m]."""
    (x, y), (length, width) = corner, size
    room.add(block((x, y, 0.70), (x + length, y + width, 0.74)), paint)
    for a in (x + 0.03, x + length - 0.08):
        for b in (y + 0.03, y + width - 0.08):
            room.add(block((a, b, 0.0), (a + 0.05, b + 0.05, 0.70)), paint)


def panel(room: RayRoom, center: tuple[float, float, float], size: tuple[float, float], radiance: float) -> None:
    """A lamp that shines down, 2 cm below its center [m]."""
    (x, y, z), (length, width) = center, (size[0] / 2, size[1] / 2)
    low = z - 0.02
    corners = [(x - length, y - width), (x - length, y + width), (x + length, y + width), (x + length, y - width)]
    shape = flat(*((*corner, low) for corner in corners))
    room.add(shape, SHADE, radiance=radiance, seen_from=(x, y, low - 1.0))


def cylinder(center: Sequence[float], radius: float, height: float) -> trimesh.Trimesh:
    """An upright cylinder [m]."""
    shape: trimesh.Trimesh = trimesh.creation.cylinder(radius, height, sections=32)
    shape.apply_translation(center)
    return shape


def globe(room: RayRoom, center: Sequence[float], radius: float, radiance: float) -> None:
    """A lamp that shines to all sides [m]."""
    shape = trimesh.creation.icosphere(3, radius)
    shape.apply_translation(center)
    room.add(shape, SHADE, radiance=radiance)


def living_room() -> RayRoom:
    """A furnished box of 5 m x 4 m, without a lamp."""
    room = RayRoom()
    shell(room, (5.0, 4.0, 2.6), OAK, (CREAM, CREAM, BLUE, CREAM), WHITE)
    table(room, (0.6, 0.6), (1.4, 0.8), WALNUT)
    room.add(block((3.0, 3.1, 0.0), (4.9, 3.95, 0.45)), GRAY)
    room.add(block((0.05, 2.6, 0.0), (0.4, 3.9, 1.9)), WHITE)
    return room


def attic() -> RayRoom:
    """Two slopes over low walls, and lamps that hang from the ridge."""
    room = RayRoom()
    x, y, low, ridge = 4.4, 5.0, 1.0, 2.7
    middle = (x / 2, y / 2, 1.0)
    room.add(flat((0, 0, 0), (x, 0, 0), (x, y, 0), (0, y, 0)), OAK, seen_from=middle)
    for side in (0.0, x):
        room.add(flat((side, 0, 0), (side, y, 0), (side, y, low), (side, 0, low)), WHITE, seen_from=middle)
        slope = flat((side, 0, low), (side, y, low), (x / 2, y, ridge), (x / 2, 0, ridge))
        room.add(slope, WHITE, seen_from=middle)
    for end, paint in ((0.0, BLUE), (y, CREAM)):
        gable = flat((0, end, 0), (x, end, 0), (x, end, low), (x / 2, end, ridge), (0, end, low))
        room.add(gable, paint, seen_from=middle)
    for along in (0.35 * y, 0.75 * y):
        panel(room, (x / 2, along, 2.30), (0.5, 0.5), 3000.0)
        room.add(block((x / 2 - 0.25, along - 0.25, 2.29), (x / 2 + 0.25, along + 0.25, 2.33)), SHADE)
    table(room, (0.6, 1.0), (1.4, 0.7), WALNUT)
    room.add(block((2.6, 3.2, 0.0), (4.2, 4.9, 0.5)), CREAM)
    return room


def rotunda() -> RayRoom:
    """A round room under an opal drum."""
    room = RayRoom()
    radius, height, sides = 2.6, 2.7, 48
    turns = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    rim = radius * np.column_stack([np.cos(turns), np.sin(turns)])
    middle = (0.0, 0.0, 1.2)
    for number, (a, b) in enumerate(pairwise(rim)):
        paint = GREEN if number < sides // 6 else (0.60, 0.55, 0.50)
        room.add(flat((*a, 0), (*b, 0), (*b, height), (*a, height)), paint, seen_from=middle)
        room.add(flat((0, 0, 0), (*a, 0), (*b, 0)), GRAY, seen_from=middle)
        room.add(flat((0, 0, height), (*a, height), (*b, height)), WHITE, seen_from=middle)
    drum = cylinder((0.0, 0.0, height - 0.05), 0.35, 0.08)
    drum.update_faces(drum.face_normals[:, 2] < 0.5)
    room.add(drum, SHADE, radiance=2500.0)
    table(room, (-1.2, -0.4), (1.2, 0.8), OAK)
    room.add(block((0.8, 0.6, 0.0), (1.8, 1.5, 0.45)), RED)
    return room


def vault() -> RayRoom:
    """A barrel vault, under which two boxes of light hang."""
    room = RayRoom()
    x, y, spring = 4.0, 6.0, 2.0
    middle = (x / 2, y / 2, 1.0)
    room.add(flat((0, 0, 0), (x, 0, 0), (x, y, 0), (0, y, 0)), (0.5, 0.4, 0.3), seen_from=middle)
    for side in (0.0, x):
        room.add(flat((side, 0, 0), (side, y, 0), (side, y, spring), (side, 0, spring)), 0.62, seen_from=middle)
    turns = np.linspace(0.0, np.pi, 25)
    arch = np.column_stack([x / 2 * (1.0 + np.cos(turns)), spring + 1.2 * np.sin(turns)])
    for (a, z_a), (b, z_b) in pairwise(arch):
        room.add(flat((a, 0, z_a), (a, y, z_a), (b, y, z_b), (b, 0, z_b)), 0.72, seen_from=middle)
    for end in (0.0, y):
        room.add(flat((0, end, 0), (x, end, 0), *((a, end, z) for a, z in arch)), BRICK, seen_from=middle)
    for along in (1.5, 4.5):
        room.add(block((x / 2 - 0.1, along - 0.6, 2.5), (x / 2 + 0.1, along + 0.6, 2.56)), SHADE, radiance=1800.0)
    room.add(block((0.2, 2.0, 0.0), (1.0, 4.0, 0.8)), WALNUT)
    return room


def columns() -> RayRoom:
    """Two columns among six panels."""
    room = RayRoom()
    shell(room, (7.0, 5.0, 2.8), (0.30, 0.30, 0.32), (CREAM,) * 4, WHITE)
    for x, y in ((2.2, 2.0), (4.6, 3.0)):
        room.add(block((x, y, 0.0), (x + 0.5, y + 0.5, 2.8)), 0.6)
    for x in (1.2, 3.5, 5.8):
        for y in (1.2, 3.8):
            panel(room, (x, y, 2.8), (0.6, 0.6), 1200.0)
    for x in (0.4, 5.2):
        table(room, (x, 0.4), (1.4, 0.7), OAK)
    room.add(block((3.0, 4.4, 0.0), (6.0, 4.95, 1.8)), WALNUT)
    return room


def two_floors() -> RayRoom:
    """A platform of .45 m over half of the plan."""
    room = RayRoom()
    shell(room, (7.0, 4.0, 3.0), OAK, (CREAM, CREAM, BLUE, CREAM), WHITE)
    room.add(block((3.5, 0.0, 0.0), (7.0, 4.0, 0.45)), GRAY)
    for x in (1.75, 5.25):
        panel(room, (x, 2.0, 3.0), (0.6, 0.6), 2000.0)
    table(room, (0.5, 0.5), (1.2, 0.7), WHITE)
    return room


def red_room() -> RayRoom:
    """Four walls of a deep red."""
    room = RayRoom()
    shell(room, (4.0, 3.5, 2.6), OAK, (RED,) * 4, WHITE)
    panel(room, (2.0, 1.75, 2.6), (0.6, 0.6), 2000.0)
    table(room, (0.5, 0.5), (1.2, 0.7), WHITE)
    room.add(block((2.6, 2.2, 0.0), (3.9, 3.4, 0.5)), GRAY)
    return room


def black_studio() -> RayRoom:
    """Black walls and a dark floor, from which hardly any light comes back."""
    room = RayRoom()
    shell(room, (6.0, 4.5, 3.0), 0.22, (0.05,) * 4, 0.75)
    for x in (1.2, 3.0, 4.8):
        panel(room, (x, 2.2, 3.0), (0.2, 1.4), 2000.0)
    table(room, (1.0, 1.0), (1.6, 0.8), OAK)
    room.add(block((4.0, 3.0, 0.0), (5.5, 4.3, 0.8)), WHITE)
    return room


def bathroom() -> RayRoom:
    """1.8 m x 2.4 m of white tiles over a dark floor."""
    room = RayRoom(edge_m=0.05)
    shell(room, (1.8, 2.4, 2.4), (0.12, 0.12, 0.13), (0.72,) * 4, WHITE)
    panel(room, (0.9, 1.2, 2.4), (0.3, 0.3), 2500.0)
    room.add(block((0.0, 1.6, 0.0), (1.8, 2.4, 0.55)), 0.85)
    room.add(block((0.0, 0.2, 0.75), (0.5, 0.9, 0.9)), 0.85)
    return room


def corridor() -> RayRoom:
    """1.4 m x 8 m under four small panels."""
    room = RayRoom(edge_m=0.07)
    shell(room, (1.4, 8.0, 2.5), (0.35, 0.20, 0.12), ((0.62, 0.64, 0.58),) * 4, WHITE)
    for y in (1.0, 3.0, 5.0, 7.0):
        panel(room, (0.7, y, 2.5), (0.3, 0.3), 1800.0)
    room.add(block((0.0, 3.4, 0.0), (0.35, 4.6, 0.9)), WHITE)
    return room


def warehouse() -> RayRoom:
    """15 m x 10 m with shelves, under six strips that hang."""
    room = RayRoom(edge_m=0.18)
    shell(room, (15.0, 10.0, 5.0), 0.35, ((0.55, 0.57, 0.60),) * 4, (0.50, 0.50, 0.52))
    for x in (2.5, 7.5, 12.5):
        for y in (2.5, 7.5):
            panel(room, (x, y, 4.6), (0.25, 1.5), 2500.0)
            room.add(block((x - 0.125, y - 0.75, 4.6), (x + 0.125, y + 0.75, 4.65)), SHADE)
    for x in (3.5, 7.0, 10.5):
        for z in (0.2, 1.2, 2.2):
            room.add(block((x, 1.5, z), (x + 0.9, 8.5, z + 0.05)), BLUE)
        room.add(block((x + 0.1, 2.0, 0.25), (x + 0.8, 5.0, 0.9)), OAK)
        room.add(block((x + 0.1, 4.0, 1.25), (x + 0.8, 8.0, 1.9)), OAK)
    return room


def one_globe() -> RayRoom:
    """A globe of 36 cm that hangs in the middle of a living room."""
    room = living_room()
    globe(room, (2.5, 2.0, 2.0), 0.18, 1400.0)
    return room


def three_globes() -> RayRoom:
    """Three of 16 cm over the table, and a panel."""
    room = living_room()
    for x in (1.0, 1.3, 1.6):
        globe(room, (x, 1.0, 1.55), 0.08, 3000.0)
    panel(room, (3.5, 2.0, 2.6), (0.6, 0.6), 800.0)
    return room


def shades() -> RayRoom:
    """A floor lamp on a stem, and a smaller shade over the table."""
    room = living_room()
    room.add(cylinder((4.3, 0.6, 1.5), 0.2, 0.3), SHADE, radiance=1200.0)
    room.add(cylinder((4.3, 0.6, 0.675), 0.015, 1.35), 0.3)
    room.add(cylinder((0.9, 1.0, 1.1), 0.12, 0.2), SHADE, radiance=1200.0)
    return room


def uplight() -> RayRoom:
    """A bowl that shines at the ceiling alone."""
    room = living_room()
    room.add(block((4.4, 0.4, 1.75), (4.6, 0.6, 1.8)), 0.3)
    room.add(block((4.48, 0.48, 0.0), (4.52, 0.52, 1.75)), 0.3)
    bowl = flat((4.42, 0.42, 1.805), (4.58, 0.42, 1.805), (4.58, 0.58, 1.805), (4.42, 0.58, 1.805))
    room.add(bowl, SHADE, radiance=22000.0, seen_from=(4.5, 0.5, 2.6))
    return room


def sconces() -> RayRoom:
    """Two half cylinders of opal glass on a wall."""
    room = living_room()
    for x in (1.4, 3.6):
        half = cylinder((x, 0.0, 1.825), 0.1, 0.25)
        half.update_faces(half.triangles_center[:, 1] > 0.0)
        room.add(half, SHADE, radiance=2500.0)
    return room


ROOMS: dict[str, Callable[[], RayRoom]] = {
    "attic": attic, "rotunda": rotunda, "vault": vault, "columns": columns, "two-floors": two_floors,
    "red-room": red_room, "black-studio": black_studio, "bathroom": bathroom, "corridor": corridor,
    "warehouse": warehouse, "one-globe": one_globe, "three-globes": three_globes, "shades": shades, "uplight": uplight,
    "sconces": sconces,
}  # fmt: skip


GIVEN = {"uplight": 'shape = "panel"\ncenter = [4.5, 0.5, 1.81]\nsize = [0.16, 0.16]\nnormal = [0, 0, 1]\n'}
"""Lamps that `init` does not find, as a user would write them."""


def with_true_light(text: str, room: RayRoom, *, true_height: bool = False) -> tuple[str, int, int]:
    """A run file whose lamps have the flux of the true ones nearest in plan; how many are right, and how many none."""
    head, *tables = re.split(r"(?m)^(?=\[\[lamps\]\])", text)
    lamps, right = room.lamps, set()
    for number, block_text in enumerate(tables):
        found = re.search(r"^center = \[(.*?)\]", block_text, re.MULTILINE)
        assert found is not None
        plan = np.array([float(word) for word in found[1].split(",")[:2]])
        apart = [float(np.linalg.norm(center[:2] - plan)) for center, _ in lamps]
        nearest = int(np.argmin(apart))
        flux = lamps[nearest][1] if apart[nearest] <= NEAR_M else 0.0
        right |= {nearest} if flux else set()
        given = re.sub(r"(?m)^spectrum = .*$", f"cct_k = {CCT_K}", block_text)
        given = re.sub(r"(?m)^assumed = .*\n", "", given)
        if true_height:
            height = f"{lamps[nearest][0][2]:.3f}"
            given = re.sub(r"(?m)^(center = \[[^,]*,[^,]*,) [^\]]*", rf"\g<1> {height}", given)
        given = re.sub(r"(?m)^luminous_flux_lm = .*$", f"luminous_flux_lm = {max(flux, 1e-3):.1f}", given)
        tables[number] = given if flux else re.sub(r"(?m)^rotation_deg", "dim = 0\nrotation_deg", given)
    return head + "".join(tables), len(right), len(tables) - len(right)


def nearest_true_faces(scan: Scan, true: Solved) -> IntArray:
    """(face,) of the truth that each face of a scan shows."""
    place = np.hstack([true.mesh.triangles_center, NORMAL_WEIGHT_M * true.mesh.face_normals])
    return np.asarray(cKDTree(place).query(np.hstack([scan.centers, NORMAL_WEIGHT_M * scan.normals]))[1])


def lit_faces(true: Solved) -> BoolArray:
    """(face,) that are no lamps, and that light reaches: no picture shows the floor under a chest, nor its back."""
    light = true.irradiance @ LUMINANCE_FROM_SRGB
    mean = np.average(light, weights=true.mesh.area_faces)
    return np.asarray((true.own == 0) & (light > DARK_SHARE * mean))


def with_given_lamp(text: str, lamp: str, room: RayRoom) -> str:
    """A run file with a lamp of the user's in place of the panels that were proposed."""
    head, *tables = re.split(r"(?m)^(?=\[\[lamps\]\])", text)
    rest = tables[-1][tables[-1].index("[materials]") :]
    light = f"cct_k = {CCT_K}\nluminous_flux_lm = {room.lamps[0][1]:.1f}\n"
    return head + f'[[lamps]]\nname = "given"\n{lamp}{light}\n' + re.sub(r"(?m)^delight = false.*\n", "", rest)


def of_reflectances(run: Path, true: Solved) -> tuple[float, float, float, float]:
    """Error and bias of reflectances [1], and shares of the area within one and two stated deviations."""
    scan, materials = load_scan(run / "1-scan"), load_materials(run / "3-materials")
    nearest = nearest_true_faces(scan, true)
    found = np.array([material.color for material in materials.materials])[materials.face_material]
    stated = np.array(
        [
            0.0 if each.uncertainty is None else float(each.uncertainty.at(np.array([GREEN_NM]), outside="nearest")[0])
            for each in materials.materials
        ]
    )[materials.face_material]
    apart = found - true.reflectance[nearest]
    areas = scan.areas * lit_faces(true)[nearest]
    within = [float(np.average(np.abs(apart[:, 1]) <= times * stated, weights=areas)) for times in (1, 2)]
    return (
        float(np.average(np.abs(apart).mean(axis=1), weights=areas)),
        float(np.average(apart.mean(axis=1), weights=areas)),
        *within,
    )  # type: ignore[return-value]


def of_map(run: Path, true: Solved) -> tuple[float, float, float]:
    """Median and mean error of the map's illuminance, and its NRMSE [1]."""
    light = lidarspectra.load_map(run / "6-map" / "map.nc")
    kept = light["buried"].to_numpy() == 0
    places: FloatArray = np.column_stack([light[axis].to_numpy() for axis in "xyz"])[kept]
    found, right = light["illuminance"].to_numpy()[kept], true.illuminance(places)
    nrmse = float(np.sqrt(((found - right) ** 2).mean()) / right.mean())
    return float(np.median(found / right) - 1.0), float(found.mean() / right.mean() - 1.0), nrmse


def row(name: str, folder: Path, *, true_height: bool) -> str:
    """The row of a room."""
    folder.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(folder / "scan.run", ignore_errors=True)
    room = ROOMS[name]()
    true = room.solved()
    true.save_scan(folder / "scan.ply")
    run_file = folder / "scan.toml"
    summary = write_init(folder / "scan.ply", run_file, force=True)
    text, right, wrong = with_true_light(run_file.read_text(encoding="utf-8"), room, true_height=true_height)
    found = f"{right} of {len(room.lamps)} | {wrong}"
    if summary.panels is not None:
        found = f"0 of {len(room.lamps)}, given | {wrong} proposed"
        if name not in GIVEN:
            return f"| {name} | 0 of {len(room.lamps)} | {wrong} proposed | | | | | | | |"
        text = with_given_lamp(run_file.read_text(encoding="utf-8"), GIVEN[name], room)
    run_file.write_text(text, encoding="utf-8")
    lidarspectra.run(run_file)
    error, bias, one, two = of_reflectances(folder / "scan.run", true)
    median, mean, nrmse = of_map(folder / "scan.run", true)
    return (
        f"| {name} | {found} | {error:.3f} | {bias:+.3f} "
        f"| {100 * one:.0f} | {100 * two:.0f} | {100 * median:+.1f} | {100 * mean:+.1f} | {nrmse:.3f} |"
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", choices=sorted(ROOMS), default=list(ROOMS))
    parser.add_argument("--true-height", action="store_true", help="lamps hang where they do in truth")
    given = parser.parse_args(arguments)
    print("| room | lamps found | no lamps | error | bias | one, % | two, % | median, % | mean, % | NRMSE |")
    print("|" + "---|" * 10)
    for name in given.only:
        print(row(name, given.folder / name, true_height=given.true_height), flush=True)


if __name__ == "__main__":
    main()
