"""How far the light of surfaces that no frame shows is from what de-lighting holds of it, at points of the surfaces.

    python -m research.scenes.frames FOLDER
    python -m research.benchmarks.unseen_light FOLDER [--only large-office-night ...]

Of each scan by night: the area that no frame shows, the mean share of the light at points that is held to come from it
(`unseen_light.share_of_unseen`), the same for ceilings alone, and by how much the true light of what is unseen differs
from what is held, at single points and in the mean of the points of each surface, weighted by the square of the share:
the latter is what `UNSEEN_DEVIATION` stands for.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from unittest.mock import patch

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.hardware.phone.captures import read_capture
from lidarspectra.hardware.phone.orientation import upright_rotation
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.material.delighting.sharpened_cones import cones_of_srgb
from lidarspectra.material.delighting.unseen_light import share_of_unseen
from lidarspectra.material.frames.frame_colors import color_from_frames
from lidarspectra.room.room import find_room
from lidarspectra.workflow.materials import delighting
from research.benchmarks.delighting import read_case
from research.benchmarks.frames import without_colors
from research.benchmarks.true_faces import nearest_faces
from research.scenes.frames import FACE_LIGHT, FRAMES

SHINES = 1.5  # [1] of white in a usual frame: lamps' own surfaces, whose light is no reflected one
GREEN = 1  # of the cones
MIN_POINTS = 20  # of a surface that counts


def true_light(folder: Path, scan: Scan, held: FloatArray, told: FloatArray) -> FloatArray:
    """(face, 3) what faces truly send, on the scale of what is held of those that are told; lamps as they are held."""
    light = np.load(folder / FACE_LIGHT)[nearest_faces(scan, read_scan(folder / "scan.glb"))]
    alike = told & (light.min(axis=1) > 0)
    light = light * np.median(held[alike].mean(axis=1) / light[alike].mean(axis=1))
    return np.where(light.max(axis=1, keepdims=True) > SHINES, held, light)


def run(folder: Path) -> None:
    """Print a scan's row."""
    case = read_case(folder)
    frames = tuple(frame.moved(upright_rotation("+y")) for frame in read_capture(folder / FRAMES).frames)
    colors = color_from_frames(without_colors(case.scan), frames)
    with patch.object(delighting, "_of_faces", wraps=delighting._of_faces) as ending:
        delighting.take_light_out(colors.scan, find_room(colors.scan), case.lamps, records=colors.records)
    picture, fitted = ending.call_args.args
    evidence, fit, scan, samples = fitted.evidence, fitted.fit, picture.lights.scan, picture.surfaces.samples
    unseen = picture.surfaces.unseen.faces
    is_unseen = np.zeros(len(scan.faces), dtype=np.bool_)
    is_unseen[unseen] = True
    held = evidence.face_light(fit.tone)
    true = true_light(folder, scan, held, ~is_unseen & ~evidence.face_lamp)
    true[evidence.face_lamp] = 0.0
    share = share_of_unseen(evidence, fit, unseen)[:, GREEN]
    sent = (evidence.exchange[:, unseen] @ cones_of_srgb(true[unseen]))[:, GREEN] / fit.irradiance[:, GREEN]
    used = (evidence.group >= 0) & ~is_unseen[samples.face] & (share > 0)
    ceiling = used & evidence.ceiling
    at_points = _deviation(share[used], sent[used], np.ones(int(used.sum())))
    count, held_sum, true_sum = (
        np.bincount(evidence.group[used], weights=values) for values in (None, share[used], sent[used])
    )
    large = count >= MIN_POINTS
    of_surfaces = _deviation(
        held_sum[large] / count[large], true_sum[large] / count[large], count[large].astype(np.float64)
    )
    print(
        f"{folder.name:24s} {scan.areas[unseen].sum():4.0f} of {scan.areas.sum():4.0f} m² unseen, "
        f"{100 * share[used].mean():4.1f} % of the light, {100 * share[ceiling].mean():4.1f} % at ceilings, "
        f"off by {at_points:.2f} at points, {of_surfaces:.2f} on surfaces",
        flush=True,
    )


def _deviation(held: FloatArray, true: FloatArray, weight: FloatArray) -> float:
    """Root mean square of true over held shares of the light, less 1, weighted by the square of the share."""
    return float(np.sqrt(np.average((true / held - 1.0) ** 2, weights=weight * held**2)))


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--only", nargs="+", default=[""], help="scans whose names begin so")
    given = parser.parse_args(arguments)
    for folder in sorted(given.folder.iterdir()):
        if (folder / FRAMES).is_dir() and folder.name.startswith(tuple(given.only)):
            run(folder)


if __name__ == "__main__":
    main()
