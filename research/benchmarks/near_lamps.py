"""Sensors close to a bulb and to a disc, against direct integrals: by the engine's shadow rays alone, and as we trace.

    python -m research.benchmarks.near_lamps [--seeds 4]

Printed for each distance: the largest deviation from the integral over directions, places beside the axis and tilts,
the largest stated standard error, and the share of points within two of these. Each seed is a trace of its own at
`fine`, in a second of its own, since the engine turns a disc's sample points once a process, by the clock.
"""

import argparse
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.scan import bare_scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Bulb, Disc, Shape
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.scene.scene import write_scene
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.spectrum import Spectrum
from research.benchmarks.glass import material
from research.benchmarks.rooms_and_walls import BANDS, RANGE_NM
from research.benchmarks.true_faces import materials_on

RADIUS_M = 0.15
CELLS = 1_000  # of the integral, along each side
DISTANCES = {"bulb": (1.1, 1.5, 2.0, 5.0), "disc": (0.1, 0.3, 1.0, 2.0)}  # [radii] from the middle; from the surface
TILTS_DEG = (0.0, 60.0)
BESIDE = (0.0, 0.5, 0.9, 1.0)  # [radii] of the disc


def places(shape: str, distance: float) -> tuple[FloatArray, FloatArray]:
    """(point, 3) positions, in radii from the lamp's middle, and unit normals."""
    positions, normals = [], []
    for tilt in np.radians(TILTS_DEG):
        if shape == "bulb":
            for way in np.array([[0, 0, 1], [0, 0.6, 0.8], [0.5774, 0.5774, 0.5774]]):
                side = np.cross(way, [1.0, 0.0, 0.0])
                positions.append(-distance * way / np.linalg.norm(way))
                normals.append(np.cos(tilt) * way + np.sin(tilt) * side / np.linalg.norm(side))
        else:
            for beside in BESIDE:
                positions.append(np.array([beside, 0.0, -distance]))
                normals.append(np.array([-np.sin(tilt), 0.0, np.cos(tilt)]))
    return np.array(positions), np.array(normals)


def integral(shape: str, positions: FloatArray, normals: FloatArray) -> FloatArray:
    """(point,) E/M: of a unit disc that faces down, by area; of a unit sphere, over the cone that it fills."""
    share = (np.arange(CELLS) + 0.5) / CELLS
    turn = 2.0 * np.pi * share
    found = []
    for position, normal in zip(positions, normals, strict=True):
        if shape == "disc":
            radius = np.sqrt(share)[:, None]
            way = np.stack(np.broadcast_arrays(radius * np.cos(turn), radius * np.sin(turn), 0.0), axis=-1) - position
            square = (way**2).sum(axis=-1)
            found.append((np.maximum(way @ normal, 0.0) * way[..., 2] / square**2).mean())
        else:
            distance = np.linalg.norm(position)
            axis = -position / distance
            slant = axis @ normal
            sine = np.sqrt(share)[:, None] / distance
            level = np.sqrt(max(1.0 - slant**2, 0.0))
            cosine = np.sqrt(1.0 - sine**2)
            found.append((np.maximum(slant * cosine + level * sine * np.cos(turn), 0.0) / cosine).mean() / distance**2)
    return np.array(found)


def judge(shape: str, distances: Sequence[float], folder: Path, *, seeds: int) -> None:
    """Trace some times and print how far it is off."""
    form: Shape = Bulb(2.0 * RADIUS_M) if shape == "bulb" else Disc(2.0 * RADIUS_M)
    flux = Spectrum(wavelengths_nm=RANGE_NM, values=np.ones(2))
    lamp = Lamp(name=shape, shape=form, center=np.zeros(3), flux=flux)
    far = bare_scan(np.array([[0, 0, -100.0], [0.01, 0, -100.0], [0, 0.01, -100.0]]), np.array([[0, 1, 2]]))
    black = materials_on([material("black", 0.0)], np.zeros(1, dtype=np.int64))
    scene = write_scene(far, black, [lamp], BANDS, folder)
    for distance in distances:
        positions, normals = places(shape, distance)
        truth = integral(shape, positions, normals) / form.area
        count = len(positions)
        points = SensorPoints(positions=RADIUS_M * positions, normals=normals, buried=np.zeros(count, np.bool_))
        line = f"{shape} {distance:4.1f} radii"
        for label, tried in (("engine alone", replace(scene, shining=())), ("as we trace", scene)):
            off, within, stated = [], [], []
            for seed in range(seeds):
                run = trace(tried, points, accuracy="low", noise="fine", seed=seed)
                light, error = run["coefficient"].to_numpy()[0, :, 0], run["irradiance_se"].to_numpy()[:, 0]
                off.append(light / truth - 1.0)
                within.append(np.abs(light - truth) <= 2.0 * error)
                stated.append(error / truth)
                time.sleep(1.0)
            line += f"   {label}: off by {np.abs(off).max():6.2%}, stated {np.max(stated):5.2%}, {np.mean(within):4.0%}"
        print(line, flush=True)


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=4)
    options = parser.parse_args()
    for shape, distances in DISTANCES.items():
        with tempfile.TemporaryDirectory(prefix="lidarspectra-") as folder:
            judge(shape, distances, Path(folder), seeds=options.seeds)


if __name__ == "__main__":
    main()
