"""Why reflectances and maps of rooms that are no boxes are off: one cause after the other taken away.

    python -m research.benchmarks.odd_rooms FOLDER
    python -m research.benchmarks.odd_room_causes FOLDER [--only columns ...]

A row for each room that was run. Area-weighted bias of reflectances, linear sRGB: of all surfaces, of those that light
reaches (no picture shows the others), of these before their colours are matched to spectra, and as they are shown where
the fit is told that the camera has no tone curve. The mean of the map over the true one: as it was run, with the true
reflectances on the scan's mesh, and of the true room itself where its lamps reflect nothing, as Radiance's do.
"""

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np

import lidarspectra
from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.config import read_run_file
from lidarspectra.geometry.scan import Scan, load_scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.maps.spectral_map import spectral_map
from lidarspectra.material.delighting.tone_curve import TonePrior
from lidarspectra.material.matching import match_color
from lidarspectra.material.material_map import Material, MaterialMap, load_materials
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.scene.scene import write_scene
from lidarspectra.room.room import find_room
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.colorimetry import linear_srgb_to_xyz
from lidarspectra.spectra.databases import load_reflectances
from lidarspectra.spectra.spectrum import sensor_bands
from lidarspectra.workflow.materials import picture_evidence
from lidarspectra.workflow.materials.delighting import take_light_out
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps
from research.benchmarks.odd_rooms import ROOMS, lit_faces, nearest_true_faces
from research.benchmarks.true_faces import materials_on
from research.virtual_rooms.ray_room import RayRoom, Solved

LINEAR = TonePrior(power_deviation=0.003, shoulder=0.0, shoulder_deviation=0.003)


def of_reflectances(run: Path, true: Solved, scan: Scan, lamps: Sequence[Lamp]) -> list[float]:
    """Biases of the module's first four columns [1]."""
    nearest = nearest_true_faces(scan, true)
    truth, lit = true.reflectance[nearest], lit_faces(true)[nearest]
    own = true.own[nearest] > 0
    materials = load_materials(run / "3-materials")
    matched = np.array([material.color for material in materials.materials])[materials.face_material]
    told = take_light_out(scan, find_room(scan), lamps).face_color
    with patch.object(picture_evidence, "tone_priors_of", lambda linear: (LINEAR,)):
        camera_told = take_light_out(scan, find_room(scan), lamps).face_color

    def bias(color: FloatArray | None, faces: BoolArray) -> float:
        if color is None:
            return np.nan
        areas = scan.areas * faces * (color < 1.0).all(axis=1)
        return float(np.average((color - truth).mean(axis=1), weights=areas))

    return [bias(matched, ~own), bias(matched, lit), bias(told, lit), bias(camera_told, lit)]


def true_materials(room: RayRoom, part: IntArray) -> MaterialMap:
    """A spectrum of each part's true colour, on triangles of (face,) parts."""
    library = load_reflectances()
    materials = [
        Material(
            name=f"part {number}",
            category="modelled",
            reflectance=match_color(linear_srgb_to_xyz(np.array(each.reflectance)), library).spectrum,
            source="truth",
            provenance="modelled",
            confidence=1.0,
            measured_range_nm=(380.0, 780.0),
            color=each.reflectance,
        )
        for number, each in enumerate(room.parts)
    ]
    return materials_on(materials, part)


def of_map(run: Path, room: RayRoom, true: Solved, scan: Scan, lamps: Sequence[Lamp]) -> list[float]:
    """Means over the true one less 1, of the module's last three columns [1]."""
    light = lidarspectra.load_map(run / "6-map" / "map.nc")
    kept = light["buried"].to_numpy() == 0
    positions = np.column_stack([light[axis].to_numpy() for axis in "xyz"])[kept]
    right = true.illuminance(positions).mean()
    parts = np.repeat(np.arange(len(room.parts)), [len(each.mesh.faces) for each in room.parts])
    with tempfile.TemporaryDirectory() as scratch:
        materials = true_materials(room, parts[nearest_true_faces(scan, true)])
        scene = write_scene(scan, materials, lamps, sensor_bands("as7265x-14"), Path(scratch))
        transport = trace(scene, SensorPoints(positions=positions), noise="standard", seed=1)
    traced = spectral_map(transport)["illuminance"].to_numpy().mean()
    black = [replace(each, reflectance=(0.0, 0.0, 0.0)) if each.radiance > 0 else each for each in room.parts]
    of_black = RayRoom(edge_m=room.edge_m, parts=black).solved().illuminance(positions).mean()
    as_run = light["illuminance"].to_numpy()[kept].mean()
    return [float(each / right - 1.0) for each in (as_run, traced, of_black)]


def row(name: str, folder: Path) -> str:
    """The row of a room."""
    run, room = folder / "scan.run", ROOMS[name]()
    true, scan = room.solved(), load_scan(run / "1-scan")
    lamps = resolve_lamps(read_run_file(folder / "scan.toml").lamps, folder)
    biases = " | ".join(f"{each:+.3f}" for each in of_reflectances(run, true, scan, lamps))
    means = " | ".join(f"{100 * each:+.1f}" for each in of_map(run, room, true, scan, lamps))
    return f"| {name} | {biases} | {means} |"


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", choices=sorted(ROOMS), default=list(ROOMS))
    given = parser.parse_args(arguments)
    print("| room | all | lit | unmatched | camera told | map, % | true reflectances, % | black lamps, % |")
    print("|" + "---|" * 8)
    for name in given.only:
        if (given.folder / name / "scan.run" / "6-map" / "map.nc").is_file():
            print(row(name, given.folder / name), flush=True)


if __name__ == "__main__":
    main()
