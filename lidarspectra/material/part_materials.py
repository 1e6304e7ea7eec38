"""What the name of a part says of its material: typical reflectances, and prior probabilities of classes.

A model of a room names its parts and colours them as a program likes; what was closed in a scan has no colour at all.
Such faces get the typical, spectrally flat reflectance of such things, with a deviation that says how little that is.

The reflectances are the middle of the ranges that lighting standards recommend for such surfaces, and the deviations
half of their width or more, as rooms are often outside of them. What the standard does not name is our judgement.

References
----------
EN 12464-1:2011, 4.2.2: ceiling 0.7 to 0.9, walls 0.5 to 0.8, floor 0.2 to 0.4, major objects 0.2 to 0.7.
"""

from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.appearance import PHOTOGRAPHED, Appearance
from lidarspectra.material.material_map import Material
from lidarspectra.spectra.spectrum import Spectrum

SOURCE = "typical"  # of such a material: "typical:wall"
GREY_NM = (300.0, 1100.0)  # [nm] where a flat reflectance is defined: beyond all channels


@dataclass(frozen=True, kw_only=True)
class Typical:
    """Typical reflectance of a kind of part, its standard deviation, and the likely class of its material.

    Parameters
    ----------
    reflectance, deviation : float
        Spectrally flat. [0-1]
    category : str
        Material class; 'unknown' where several are as likely.
    """

    reflectance: float
    deviation: float
    category: str = "unknown"


FURNITURE = Typical(reflectance=0.45, deviation=0.2)
TYPICAL: dict[str, Typical] = {
    "wall": Typical(reflectance=0.65, deviation=0.15, category="painted"),
    "floor": Typical(reflectance=0.3, deviation=0.12),
    "ceiling": Typical(reflectance=0.8, deviation=0.1, category="painted"),
    "door": Typical(reflectance=0.45, deviation=0.2),
    "window": Typical(reflectance=0.15, deviation=0.15, category="glass"),  # 0.1 the pane at night, 0.5 a drawn blind
    "screen": Typical(reflectance=0.06, deviation=0.04),
    "sanitary": Typical(reflectance=0.75, deviation=0.1, category="ceramic"),
    "closed ceiling": Typical(reflectance=0.8, deviation=0.1, category="painted"),
    "closed floor": Typical(reflectance=0.3, deviation=0.12),
    "closed side": Typical(reflectance=0.65, deviation=0.2, category="painted"),
}  # [1] all other kinds are `FURNITURE`

NAMED_PRIORS: dict[str, dict[str, float]] = {
    "door": {"wood": 0.45, "painted": 0.35, "glass": 0.08, "metal": 0.05, "plastic": 0.03},
    "window": {"glass": 0.6, "fabric": 0.17, "painted": 0.08, "plastic": 0.06, "wood": 0.03, "metal": 0.02},
    "table": {"wood": 0.55, "plastic": 0.17, "metal": 0.08, "glass": 0.05, "stone": 0.05, "painted": 0.05},
    "chair": {"fabric": 0.35, "wood": 0.25, "plastic": 0.17, "leather": 0.1, "metal": 0.08},
    "sofa": {"fabric": 0.7, "leather": 0.25},
    "bed": {"fabric": 0.9, "wood": 0.05},
    "storage": {"wood": 0.5, "painted": 0.17, "metal": 0.12, "plastic": 0.1, "paper": 0.05, "glass": 0.02},
    "screen": {"glass": 0.5, "plastic": 0.43},
    "appliance": {"metal": 0.5, "painted": 0.25, "plastic": 0.15, "glass": 0.04},
    "sanitary": {"ceramic": 0.8, "plastic": 0.08, "metal": 0.06, "stone": 0.03},
    "stairs": {"wood": 0.5, "stone": 0.2, "carpet": 0.14, "painted": 0.06, "metal": 0.04},
    "fireplace": {"stone": 0.4, "brick": 0.35, "tile": 0.08, "metal": 0.06, "painted": 0.05},
}  # [1] our judgement, as `place_priors.PRIORS`; walls, floors and ceilings have the prior of their place


def typical_materials(appearance: Appearance, wanted: BoolArray) -> tuple[tuple[Material, ...], IntArray]:
    """Typical materials of parts that are known by name alone.

    Parameters
    ----------
    appearance : Appearance
        Of the scan.
    wanted : (face,) bool
        Faces that have no material yet.

    Returns
    -------
    materials : tuple of Material
        One for each kind of part that is needed, with its uncertainty.
    number : (face,) int
        Which of them a face gets; -1 where it was not wanted, has a photographed colour, or is of no known kind.
    """
    chosen = wanted & (appearance.sources != PHOTOGRAPHED) & (appearance.face_kinds >= 0)
    number = np.full(len(chosen), -1, dtype=np.int64)
    places = np.unique(appearance.face_kinds[chosen])
    for new, place in enumerate(places):
        number[chosen & (appearance.face_kinds == place)] = new
    return tuple(typical_material(appearance.kinds[place]) for place in places), number


def typical_material(kind: str) -> Material:
    """Material of a kind of part ('wall', 'table', 'closed ceiling', ...) of which nothing but its name is known."""
    typical = TYPICAL.get(kind, FURNITURE)
    wavelengths = np.array(GREY_NM)
    return Material(
        name=f"typical {kind}",
        category=typical.category,
        reflectance=Spectrum(
            wavelengths_nm=wavelengths, values=np.full(2, typical.reflectance), name=f"typical {kind}"
        ),
        source=f"{SOURCE}:{kind}",
        provenance="default",
        confidence=0.0,
        measured_range_nm=GREY_NM,
        color=(typical.reflectance,) * 3,
        uncertainty=Spectrum(wavelengths_nm=wavelengths, values=np.full(2, typical.deviation)),
    )


def typical_in_words(kind: str) -> str:
    """Typical reflectance of a kind of part, with its deviation: '0.65 ± 0.15'."""
    typical = TYPICAL.get(kind, FURNITURE)
    return f"{typical.reflectance:.2f} ± {typical.deviation:.2f}"


def named_prior(appearance: Appearance, classes: tuple[str, ...], prior: FloatArray) -> FloatArray:
    """A prior over material classes with what the names of parts say.

    Parameters
    ----------
    appearance : Appearance
        Of the scan.
    classes : tuple of str
        Of the model.
    prior : (face, class) float
        By the faces' places (`place_priors.class_prior`).

    Returns
    -------
    prior : (face, class) float
        Faces of a kind in `NAMED_PRIORS` have its probabilities; its other classes share what is left to 1.
    """
    changed = prior.copy()
    for kind, named in NAMED_PRIORS.items():
        rest = (1.0 - sum(named.values())) / max(1, sum(name not in named for name in classes))
        row = np.array([named.get(name, rest) for name in classes])
        changed[appearance.of_kind(kind)] = row / row.sum()
    return changed
