"""Material classes of a reflectance library's surfaces, read from their names: databases sort by object instead."""

import re
from functools import lru_cache

import numpy as np

from lidarspectra.arrays import BoolArray
from lidarspectra.spectra.reflectance_library import Reflectance, ReflectanceLibrary

CLASS_WORDS: dict[str, tuple[str, ...]] = {
    "brick": ("brick", "bricks"),
    "carpet": ("carpet", "rug"),
    "ceramic": ("ceramic", "porcelain", "terracotta", "sink", "toilet"),
    "fabric": ("fabric", "textile", "cloth", "couch", "sofa", "curtain", "towel", "shirt", "upholstery", "linen"),
    "foliage": ("leaf", "leaves", "foliage", "grass", "plant"),
    "glass": ("glass",),
    "hair": ("hair",),
    "leather": ("leather",),
    "metal": ("metal", "metallic", "aluminium", "aluminum", "steel", "iron", "copper", "brass"),
    "mirror": ("mirror",),
    "painted": ("painted", "paint", "plaster", "dupont", "munsell", "lacquer"),
    "paper": ("paper", "cardboard", "poster", "book"),
    "plastic": ("plastic", "laminate", "linoleum", "vinyl", "pvc", "whiteboard"),
    "skin": ("skin",),
    "sky": ("sky",),
    "stone": ("stone", "rock", "granite", "marble", "concrete", "asphalt", "terrazzo", "cement"),
    "tile": ("tile", "tiles"),
    "wallpaper": ("wallpaper",),
    "water": ("water",),
    "wood": ("wood", "wooden", "pine", "oak", "beech", "walnut", "bark", "parquet", "bamboo"),
}  # words that name a material whatever the object; the first class of this order that has one is taken
BEFORE = ("tile", "skin", "wallpaper", "painted", "leather", "fabric", "carpet")  # 'painted wood' is paint, and so on
MIN_KNOWN = 0.5  # [1] share of a library's surfaces whose class is known, from which classes are favoured
OF_OBJECTS = {"wall": "painted", "ceiling": "painted", "plant": "foliage"}  # where no word names a material


def surface_class(surface: Reflectance) -> str | None:
    """Material class of a surface, None where it is unknown."""
    if surface.category.lower() in CLASS_WORDS:
        return surface.category.lower()
    words = set(re.findall(r"[a-z]+", surface.name.lower()))
    for name in (*BEFORE, *CLASS_WORDS):
        if words & set(CLASS_WORDS[name]):
            return name
    return OF_OBJECTS.get(surface.category.lower())


def favored_surfaces(library: ReflectanceLibrary, name: str) -> BoolArray | None:
    """Mark the surfaces that a segment of a class favours, (surface,); None in a library that knows few classes.

    Where most surfaces have no known class, those that have one stand for their database rather than for the class.
    """
    known = np.array([found is not None for found in _classes_of(library)])
    if known[library.matchable].mean() < MIN_KNOWN:
        return None
    return of_class(library, name)


def of_class(library: ReflectanceLibrary, name: str) -> BoolArray:
    """(surface,) which of a library's surfaces are of a class."""
    return np.array([found == name for found in _classes_of(library)])


@lru_cache(maxsize=1)
def _classes_of(library: ReflectanceLibrary) -> tuple[str | None, ...]:
    """(surface,) class of each, None where it is unknown."""
    return tuple(surface_class(surface) for surface in library.rows)
