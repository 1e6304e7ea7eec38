"""How often the material class of a surface is right: rooms with known truth, with and without the room's geometry.

    python -m benchmarks.segmentation [office apartment] [--textures FOLDER] [--views N]

Shares of the surface area whose class is the true one. The rooms' own surfaces are plain or nearly so. With the folder
of textures that the shipped model was trained on (see `lidarspectra.material.training`), every surface is also dressed
in a tile of its class that training never saw, 1.28 m to a tile, with the room's light left on it.
"""

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.true_faces import true_faces
from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.colorimetry import decode_srgb, encode_srgb, linear_srgb_to_lab
from lidarspectra.databases import scenes_folder
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.hardware.phone.scan import Scan
from lidarspectra.hardware.phone.textures import sample_image
from lidarspectra.hardware.room.room import find_room
from lidarspectra.material.colors import surface_colors
from lidarspectra.material.face_groups import agreement, face_adjacency
from lidarspectra.material.fusion import FaceClasses, fuse, view_votes
from lidarspectra.material.place_priors import class_prior, find_places
from lidarspectra.material.projection import pixel_grid, reverse_project
from lidarspectra.material.segmentation import Classifier
from lidarspectra.material.training.pictures import Picture
from lidarspectra.material.training.split import read_split
from lidarspectra.material.viewpoints import render_views
from lidarspectra.material.views import View, ViewSet
from lidarspectra.spectrum_files import read_table

PIXELS_PER_M = 100.0  # [px/m] of a tile, once it is on a surface
SEED = 7  # of the tiles that are drawn


def true_classes(folder: Path, classes: tuple[str, ...]) -> tuple[IntArray, IntArray]:
    """(face,) number of the true material, and of its class; -1 where the model has no such class."""
    rows = read_table(folder / "truth" / "materials.csv")
    material = true_faces(folder).material
    of_material = np.array([classes.index(row.category) if row.category in classes else -1 for row in rows])
    return material, of_material[material]


def dressed(
    views: ViewSet, scan: Scan, material: IntArray, truth: IntArray, classes: tuple[str, ...], tiles: list[Picture]
) -> tuple[ViewSet, BoolArray]:
    """The views with a tile of the right class on every surface that has one, and which faces those are."""
    random = np.random.default_rng(SEED)
    chosen: dict[int, Picture] = {}
    for number in np.unique(material):
        name = classes[truth[material == number][0]] if truth[material == number][0] >= 0 else ""
        found = [tile for tile in tiles if classes[tile.label] == name]
        if found:
            chosen[int(number)] = found[int(random.integers(len(found)))]
    shown = tuple(_dressed_view(view, scan, material, chosen) for view in views.views)
    return replace(views, views=shown), np.isin(material, list(chosen))


def _dressed_view(view: View, scan: Scan, material: IntArray, chosen: dict[int, Picture]) -> View:
    met = view.face >= 0
    pixels = pixel_grid(view.camera)[met.ravel()]
    place = reverse_project(view.camera, pixels, view.depth[met])
    face = view.face[met]
    along = np.abs(scan.normals[face]).argmax(axis=1)
    light = decode_srgb(view.image[met] / 255.0)
    for number, tile in chosen.items():
        here = np.flatnonzero(material[face] == number)
        if not here.size:
            continue
        level = light[here].mean(axis=1)
        rest = np.array([[1, 2], [0, 2], [0, 1]])[along[here]]
        tiles = PIXELS_PER_M * np.take_along_axis(place[here], rest, axis=1) / np.array(tile.image.shape[1::-1])
        color = sample_image(tile.image, tiles % 1.0)
        light[here] = color * (level / max(float(np.median(level)), 1e-6))[:, None]
    image = view.image.copy()
    image[met] = np.rint(255.0 * encode_srgb(light))
    return replace(view, image=image)


def print_shares(
    title: str, votes: FaceClasses, scan: Scan, truth: IntArray, counted: BoolArray, prior: FloatArray, lab: FloatArray
) -> None:
    """Print what each step gets right."""
    neighbors = agreement(face_adjacency(scan), lab, scan.normals)
    nothing = replace(votes, belief=np.full_like(votes.belief, 1.0 / len(votes.classes)))
    steps = {
        "pictures alone": votes,
        "pictures and neighbours": fuse(votes, neighbors),
        "geometry alone": fuse(nothing, neighbors, prior),
        "pictures, geometry and neighbours": fuse(votes, neighbors, prior),
    }
    weight = scan.areas * counted
    print(f"{title}, {weight.sum():.0f} m²")
    for name, found in steps.items():
        right = found.best == truth
        members = [counted & (truth == value) for value in np.unique(truth[counted])]
        each = [float(np.average(right[member], weights=scan.areas[member])) for member in members]
        print(
            f"  {name:36s} {100 * np.average(right, weights=weight):5.1f} % of the area, "
            f"{100 * np.mean(each):5.1f} % mean of classes"
        )


def run(folder: Path, classifier: Classifier, tiles: list[Picture], most_views: int | None) -> None:
    """Print a room's shares."""
    scan = read_scan(folder / "scan.glb")
    room = find_room(scan)
    views = render_views(scan, room)
    views = replace(views, views=views.views[:most_views])
    material, truth = true_classes(folder, classifier.classes)
    colors, known = surface_colors(scan)
    prior = class_prior(find_places(scan, room, face_adjacency(scan)), classifier.classes)
    lab = linear_srgb_to_lab(colors)
    counted = known & (truth >= 0)
    start = time.perf_counter()
    votes = view_votes(classifier, scan, views)
    print(f"\n{folder.name}: {len(views.views)} views, {time.perf_counter() - start:.1f} s for their classes")
    print_shares("as it is", votes, scan, truth, counted, prior, lab)
    if tiles:
        clad, has_tile = dressed(views, scan, material, truth, classifier.classes, tiles)
        votes = view_votes(classifier, scan, clad)
        print_shares("dressed in tiles that were held out", votes, scan, truth, counted & has_tile, prior, lab)


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scenes", nargs="*", default=["office", "apartment"])
    parser.add_argument("--textures", type=Path, help="folder with ambientcg/ and photos/")
    parser.add_argument("--views", type=int, help="classify the first so many views only; all by default")
    arguments = parser.parse_args()
    tiles = []
    if arguments.textures is not None:
        tiles = [picture for picture in read_split(arguments.textures)[1] if picture.origin == "tile"]
    classifier = Classifier()
    for name in arguments.scenes:
        run(scenes_folder() / name, classifier, tiles, arguments.views)


if __name__ == "__main__":
    main()
