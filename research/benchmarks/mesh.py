"""The mesh's own share of a map's error: a scan with the true materials, against the light in the true room.

    python -m research.benchmarks.mesh [office apartment ... or folders made by research/scenes/build.py]

    scanned      repaired, holes closed
    flat         and made flat (what a run does)
    true legs    and the legs of tables and chairs replaced by the true ones
    on truth     scanned, and each vertex put on the true surface's nearest point: the best that moving vertices can do

"area" is the share of the true surface's area that the mesh has, of all and of legs; the other columns are as in
research/benchmarks/delighting.py.
"""

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.geometry.scan import bare_scan
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.mapping.maps.metrics import compare_maps
from lidarspectra.spectra.databases import scenes_folder
from research.benchmarks.delighting import Case, flattening_words, light, read_case, true_light
from research.benchmarks.true_faces import materials_on, nearest_faces, true_faces
from research.virtual_rooms.room_plan import read_plan
from research.virtual_rooms.true_room import TrueRoom, true_room

LEGS = "/legs"  # [1] how the plan's parts name them
SURFACE_POINTS = 1_500_000  # of the true surface, among which the nearest face is looked for: 5 mm apart
CANDIDATES = 6  # points whose faces are tried
SEED = 5


def scanned_parts(case: Case) -> BoolArray:
    """(face,) whether a face of the repaired scan stands for a leg."""
    raw = read_scan(case.folder / "scan.glb")
    legs = np.array([part.endswith(LEGS) for part in true_faces(case.folder).part], dtype=np.bool_)
    return np.asarray(legs[nearest_faces(case.scan, raw)])


def true_legs(room: TrueRoom) -> BoolArray:
    """(face,) whether a face of the true room is a leg's."""
    return np.array([room.surfaces[number].part.endswith(LEGS) for number in room.face_surface], dtype=np.bool_)


def with_true_legs(case: Case, room: TrueRoom) -> Case:
    """The scan without its legs, and the true ones in their place."""
    kept, added = np.flatnonzero(~scanned_parts(case)), np.flatnonzero(true_legs(room))
    number = {material.name: index for index, material in enumerate(case.truth)}
    truth = np.array([number[room.materials[index].name] for index in room.face_material[added]], dtype=np.int64)
    faces = np.vstack([case.scan.faces[kept], room.faces[added] + len(case.scan.vertices)])
    scan = bare_scan(np.vstack([case.scan.vertices, room.vertices]), faces)
    return replace(case, scan=scan, face_truth=np.concatenate([case.face_truth[kept], truth]))


def on_truth(case: Case, room: TrueRoom) -> Case:
    """The scan with its vertices on the true surface."""
    return replace(case, scan=replace(case.scan, vertices=nearest_points(room, case.scan.vertices)))


def nearest_points(room: TrueRoom, points: FloatArray) -> FloatArray:
    """(point, 3) nearest points of the true surface [m]."""
    mesh = trimesh.Trimesh(vertices=room.vertices, faces=room.faces, process=False)
    samples, face = trimesh.sample.sample_surface(mesh, SURFACE_POINTS, seed=SEED)
    _, near = cKDTree(samples).query(points, k=CANDIDATES)
    corners = room.vertices[room.faces]
    triangles: Any = trimesh.triangles  # trimesh types only a part of itself
    tried = np.stack([triangles.closest_point(corners[face[near[:, k]]], points) for k in range(CANDIDATES)], axis=1)
    best = np.linalg.norm(tried - points[:, None], axis=2).argmin(axis=1)
    return np.asarray(tried[np.arange(len(points)), best], dtype=np.float64)


def run(folder: Path) -> None:
    """Print a scene's table."""
    room = true_room(read_plan(folder / "plan.toml"))
    scanned, flat = read_case(folder, flatten=False), read_case(folder)
    reference = true_light(scanned)
    legs = true_legs(room)
    leg_area, area = room.scan.areas[legs].sum(), room.scan.areas.sum()
    print(f"\n{folder.name}: {flattening_words(flat.scan)}")
    print(
        f"{'':10s} {'area':>7s} {'of legs':>8s} {'NRMSE':>7s} {'noise':>7s} {'median':>8s} {'bias':>8s} {'angle':>7s}"
    )
    variants = {
        "scanned": scanned,
        "flat": flat,
        "true legs": with_true_legs(flat, room),
        "on truth": on_truth(scanned, room),
    }
    for name, case in variants.items():
        traced = light(case.scan, materials_on(case.truth, case.face_truth), case)
        found = compare_maps(traced.irradiance, reference.irradiance)
        noise = np.sqrt((traced.deviation**2 + reference.deviation**2).mean()) / reference.irradiance.mean()
        kept = leg_area if name == "true legs" else case.scan.areas[scanned_parts(case)].sum()
        print(
            f"{name:10s} {100 * case.scan.areas.sum() / area:5.1f} % {100 * kept / max(leg_area, 1e-9):6.0f} % "
            f"{found.nrmse_all:7.4f} {noise:7.4f} {found.mape_median:6.2f} % {found.bias_percent:+6.2f} % "
            f"{found.angle_mean_deg:6.2f}°",
            flush=True,
        )


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scenes", nargs="*", default=["office", "apartment"])
    for name in parser.parse_args().scenes:
        known = scenes_folder() / name
        run(known if known.is_dir() else Path(name))


if __name__ == "__main__":
    main()
