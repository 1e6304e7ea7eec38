"""How often the material class of a surface is right: rooms with known truth, with and without the room's geometry.

    python -m research.benchmarks.segmentation [office apartment] [--textures FOLDER] [--draws N] [--views N] [--wrong]
                                      [--spectraldb FILE] [--model FILE] [--scales S ...]

Shares of the surface area whose class is the true one. The rooms' own surfaces are plain or nearly so. With the folder
of textures that the shipped model was trained on (see `research.training`), every surface is also dressed
in a tile of its class that training never saw, 1.28 m to a tile, with the room's light left on it: several times, with
other tiles, because one tile covers a wall. `--wrong` prints what other values of `fusion.WRONG` make of a room. With
spectraldb, how blue and how green measured surfaces of each class are (`material.segmentation.color_priors`).
"""

import argparse
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.sparse import csr_array

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.geometry.textures import sample_image
from lidarspectra.hardware.phone.readers import read_scan
from lidarspectra.material.colors import surface_colors
from lidarspectra.material.segmentation.color_priors import color_likelihood
from lidarspectra.material.segmentation.face_groups import agreement, face_adjacency
from lidarspectra.material.segmentation.fusion import FaceClasses, fuse, view_votes
from lidarspectra.material.segmentation.place_priors import class_prior, find_places
from lidarspectra.material.segmentation.segmentation import SHIPPED_MODEL, Classifier
from lidarspectra.material.segmentation.surface_classes import surface_class
from lidarspectra.material.views.projection import pixel_grid, reverse_project
from lidarspectra.material.views.viewpoints import render_views
from lidarspectra.material.views.views import View, ViewSet
from lidarspectra.room.room import find_room
from lidarspectra.spectra.colorimetry import decode_srgb, encode_srgb, linear_srgb_to_lab
from lidarspectra.spectra.databases import load_reflectances, scenes_folder
from lidarspectra.spectra.spectrum_files import read_table
from research.benchmarks.spectraldb import imported
from research.benchmarks.true_faces import true_faces
from research.training.pictures import Picture
from research.training.split import read_split

PIXELS_PER_M = 100.0  # [px/m] of a tile, once it is on a surface
SEED = 7  # of the tiles that are drawn
WRONG_SHARES = (0.3, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95)  # [1] that are tried for `fusion.WRONG`


def true_classes(folder: Path, classes: tuple[str, ...]) -> tuple[IntArray, IntArray]:
    """(face,) number of the true material, and of its class; -1 where the model has no such class."""
    rows = read_table(folder / "truth" / "materials.csv")
    material = true_faces(folder).material
    of_material = np.array([classes.index(row.category) if row.category in classes else -1 for row in rows])
    return material, of_material[material]


def dressed(
    views: ViewSet,
    scan: Scan,
    material: IntArray,
    truth: IntArray,
    classes: tuple[str, ...],
    tiles: list[Picture],
    random: np.random.Generator,
) -> tuple[ViewSet, BoolArray]:
    """The views with a tile of the right class on every surface that has one, and which faces those are."""
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


@dataclass(frozen=True, kw_only=True, eq=False)
class KnownRoom:
    """A room whose classes are known, and what its geometry and colours say of them."""

    scan: Scan
    truth: IntArray
    neighbors: csr_array
    place: FloatArray
    color: FloatArray


def shares(votes: FaceClasses, room: KnownRoom, counted: BoolArray) -> dict[str, tuple[float, float]]:
    """Share that each step gets right: of the area, and as the mean over the classes [0-1]."""
    nothing = replace(votes, belief=np.full_like(votes.belief, 1.0 / len(votes.classes)))
    steps = {
        "pictures alone": votes,
        "pictures and neighbours": fuse(votes, room.neighbors),
        "pictures, colour and neighbours": fuse(votes, room.neighbors, room.color),
        "geometry alone": fuse(nothing, room.neighbors, room.place),
        "geometry and colour": fuse(nothing, room.neighbors, room.place * room.color),
        "pictures, geometry and neighbours": fuse(votes, room.neighbors, room.place),
        "all": fuse(votes, room.neighbors, room.place * room.color),
    }
    weight = room.scan.areas * counted
    members = [counted & (room.truth == value) for value in np.unique(room.truth[counted])]
    result = {}
    for name, found in steps.items():
        right = found.best == room.truth
        each = [float(np.average(right[member], weights=room.scan.areas[member])) for member in members]
        result[name] = (float(np.average(right, weights=weight)), float(np.mean(each)))
    return result


def print_shares(title: str, results: list[dict[str, tuple[float, float]]]) -> None:
    """Print the mean over draws, and how far they go where there are several."""
    print(title)
    for name in results[0]:
        of_area, of_classes = 100.0 * np.array([result[name] for result in results]).T
        span = f", {of_area.min():.1f} to {of_area.max():.1f}" if len(results) > 1 else ""
        print(f"  {name:36s} {of_area.mean():5.1f} % of the area{span}; {of_classes.mean():5.1f} % mean of classes")


def print_wrong_shares(votes: FaceClasses, room: KnownRoom, counted: BoolArray) -> None:
    """Print the share of the area that all steps together get right, by how lightly pictures are taken."""
    for wrong in WRONG_SHARES:
        right = fuse(votes, room.neighbors, room.place * room.color, wrong=wrong).best == room.truth
        share = float(np.average(right, weights=room.scan.areas * counted))
        print(f"  all, WRONG = {wrong:.2f}  {100.0 * share:5.1f} % of the area")


def run(
    folder: Path,
    classifier: Classifier,
    tiles: list[Picture],
    draws: int,
    *,
    max_views: int | None,
    wrong_shares: bool,
) -> None:
    """Print a room's shares."""
    scan = read_scan(folder / "scan.glb")
    room = find_room(scan)
    views = render_views(scan, room)
    views = replace(views, views=views.views[:max_views])
    material, truth = true_classes(folder, classifier.classes)
    colors, known = surface_colors(scan)
    lab = linear_srgb_to_lab(colors)
    adjacency = face_adjacency(scan)
    known_room = KnownRoom(
        scan=scan,
        truth=truth,
        neighbors=agreement(adjacency, lab, scan.normals),
        place=class_prior(find_places(scan, room, adjacency), classifier.classes),
        color=color_likelihood(lab, classifier.classes),
    )
    counted = known & (truth >= 0)
    start = time.process_time()
    votes = view_votes(classifier, scan, views)
    seconds = time.process_time() - start
    print(
        f"\n{folder.name}: {scan.areas[counted].sum():.0f} m², {len(views.views)} views, {seconds:.1f} s of processor"
    )
    print_shares("as it is", [shares(votes, known_room, counted)])
    if wrong_shares:
        print_wrong_shares(votes, known_room, counted)
    if tiles:
        # The tiles have colours of their own, which the scan's do not show: colour has nothing to say.
        colorless = replace(known_room, color=np.ones_like(known_room.color))
        random = np.random.default_rng(SEED)
        results = []
        for _ in range(draws):
            clad, has_tile = dressed(views, scan, material, truth, classifier.classes, tiles, random)
            results.append(shares(view_votes(classifier, scan, clad), colorless, counted & has_tile))
        print_shares(f"dressed {draws} times in tiles that were held out", results)


def print_class_colors(file: Path) -> None:
    """Print how blue (-b*) and green (-a*) the measured surfaces of each class go."""
    with imported(file) as spectraldb:
        library = load_reflectances([spectraldb])
    names = np.array([surface_class(surface) or "unknown" for surface in library.rows])
    print(f"\n{'class':12s} surfaces  least b*  least a*  second least a*")
    for name in np.unique(names):
        a, b = np.sort(library.lab[names == name, 1:], axis=0).T
        print(f"{name:12s} {len(a):8d} {b[0]:9.1f} {a[0]:9.1f} {a[min(1, len(a) - 1)]:9.1f}")


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scenes", nargs="*", default=["office", "apartment"])
    parser.add_argument("--textures", type=Path, help="folder with ambientcg/ and photos/")
    parser.add_argument("--draws", type=int, default=4, help="times that the surfaces are dressed in other tiles")
    parser.add_argument("--spectraldb", type=Path, help="the table of spectraldb.com, as CSV: colours of each class")
    parser.add_argument("--views", type=int, help="classify the first so many views only; all by default")
    parser.add_argument("--model", type=Path, default=SHIPPED_MODEL, help="ONNX file with its card; the shipped one")
    parser.add_argument("--scales", type=float, nargs="+", help="of the views; by default those of the model's card")
    parser.add_argument("--wrong", action="store_true", help="try other values of fusion.WRONG as well")
    arguments = parser.parse_args()
    tiles = []
    if arguments.textures is not None:
        tiles = [picture for picture in read_split(arguments.textures)[1] if picture.origin == "tile"]
    classifier = Classifier(arguments.model)
    if arguments.scales is not None:
        classifier.card = classifier.card.model_copy(update={"scales": tuple(arguments.scales)})
    for name in arguments.scenes:
        run(
            scenes_folder() / name,
            classifier,
            tiles,
            arguments.draws,
            max_views=arguments.views,
            wrong_shares=arguments.wrong,
        )
    if arguments.spectraldb is not None:
        print_class_colors(arguments.spectraldb)


if __name__ == "__main__":
    main()
