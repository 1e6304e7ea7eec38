"""What two runs of one room give differently, for changes that should change nothing: materials by face, and the map.

Told by `python -m research.benchmarks.same_runs BEFORE.run NOW.run`.
"""

import argparse
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.scan import load_scan
from lidarspectra.mapping.maps.map_files import MAP_FILE, load_map
from lidarspectra.material.material_map import MaterialMap, load_materials
from lidarspectra.workflow.run_folder.workspace import stage_folder

WAVELENGTHS_NM = np.arange(420.0, 761.0, 20.0)  # [nm] at which reflectances are compared


def of_faces(materials: MaterialMap) -> tuple[FloatArray, FloatArray]:
    """(face, wavelength) reflectance, and what its material states for its standard deviation."""
    values = [each.reflectance.at(WAVELENGTHS_NM, outside="nearest") for each in materials.materials]
    stated = [
        np.zeros(WAVELENGTHS_NM.size)
        if each.uncertainty is None
        else each.uncertainty.at(WAVELENGTHS_NM, outside="nearest")
        for each in materials.materials
    ]
    return np.array(values)[materials.face_material], np.array(stated)[materials.face_material]


def main() -> None:
    """Print the differences."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("runs", nargs=2, type=Path)
    before, now = parser.parse_args().runs
    areas = load_scan(stage_folder(before, "scan")).areas
    materials = [load_materials(stage_folder(run, "materials")) for run in (before, now)]
    (was, stated), (came, _) = (of_faces(each) for each in materials)
    names = [np.array([m.category for m in each.materials])[each.face_material] for each in materials]
    apart = np.abs(came - was)
    in_deviations = apart / np.maximum(stated, 1e-3)
    print(f"materials: {len(materials[0].materials)} and {len(materials[1].materials)}")
    print(f"one class on {np.average(names[0] == names[1], weights=areas):.1%} of the area")
    print(f"reflectance differs by {np.average(apart.mean(axis=1), weights=areas):.4f}, mean over area and wavelength;")
    print(f"  that is {np.average(in_deviations.mean(axis=1), weights=areas):.2f} of its stated standard deviation")
    maps = [load_map(stage_folder(run, "map") / MAP_FILE)["irradiance"].to_numpy() for run in (before, now)]
    ratio = maps[1].mean(axis=0) / maps[0].mean(axis=0)
    rms = np.sqrt(((maps[1] - maps[0]) ** 2).mean(axis=0)) / maps[0].mean(axis=0)
    print(f"map: means of the channels differ by {100 * (ratio.min() - 1):+.2f} to {100 * (ratio.max() - 1):+.2f} %,")
    print(f"  points by {rms.mean():.2%} of the channel's mean (rms)")


if __name__ == "__main__":
    main()
