"""A library's surfaces have the class that their names tell, and matching favours it a little."""

import numpy as np
import pytest

from lidarspectra.material.matching import match_color
from lidarspectra.material.segmentation.surface_classes import favored_surfaces, of_class, surface_class
from lidarspectra.spectra.databases import load_reflectances
from lidarspectra.spectra.reflectance_library import COLOR_GRID_NM, Reflectance
from lidarspectra.spectra.spectrum import Spectrum


def surface(name: str, category: str = "unknown") -> Reflectance:
    flat = Spectrum(wavelengths_nm=np.array([400.0, 700.0]), values=np.array([0.5, 0.5]))
    return Reflectance(database="d", id=name, name=name, category=category, spectrum=flat, provenance="measured")


@pytest.mark.parametrize(
    ("name", "category", "wanted"),
    [
        ("White Painted Room Walls", "Wall", "painted"),
        ("Dark Grey Floor Tiles", "Floor", "tile"),
        ("Brown wooden door", "Door", "wood"),
        ("painted wood", "unknown", "painted"),
        ("Leather couch", "Furniture", "leather"),
        ("Corridor", "Wall", "painted"),
        ("Woodpecker", "Others", None),
        ("anything", "wood", "wood"),
    ],
)
def test_names_tell_material_classes(name, category, wanted):
    assert surface_class(surface(name, category)) == wanted


def test_the_favoured_class_bends_the_estimate_towards_it_and_keeps_the_color():
    library = load_reflectances()
    painted = of_class(library, "painted")
    assert 50 < painted.sum() < len(library)
    wanted = library.xyz[np.flatnonzero(painted & library.matchable)[20]]
    plain, favored = match_color(wanted, library), match_color(wanted, library, favored=painted)
    values = [match.spectrum.at(COLOR_GRID_NM, outside="nearest") for match in (plain, favored)]
    assert np.abs(values[0] - values[1]).max() > 0
    for match in (plain, favored):
        assert match.color_error < 0.01  # both are held to the colour; Newton steps end at 1e-6


def test_classes_are_favoured_only_in_a_library_that_knows_most():
    library = load_reflectances()
    assert favored_surfaces(library, "painted") is None
    painted = library.subset(of_class(library, "painted"))
    favored = favored_surfaces(painted, "painted")
    assert favored is not None
    assert favored.all()


def test_nearest_takes_a_favoured_surface_only_within_a_just_noticeable_difference():
    library = load_reflectances()
    for row in np.flatnonzero(library.matchable)[::40]:
        plain = match_color(library.xyz[row], library, method="nearest")
        favored = match_color(library.xyz[row], library, method="nearest", favored=of_class(library, "painted"))
        assert favored.difference <= plain.difference + 1.0
