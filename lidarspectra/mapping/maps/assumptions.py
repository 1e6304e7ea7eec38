"""What a map rests on that is a guess: lamps' fluxes and spectra, and of the scan what stands in `OF_SCAN`.

A spectral map says so in its attribute `assumed`, a JSON text: {"flux and spectrum": ["panel 1"], "scan": ["unit"]};
its table in a column of that name, in words.
"""

import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    import xarray as xr  # loads slowly; who starts a run file needs the words alone

ASSUMED = "assumed"  # attribute of a spectral map
FLUX_AND_SPECTRUM, FLUX, SPECTRUM, PLACE, SCAN = "flux and spectrum", "flux", "spectrum", "place", "scan"  # its keys
OF_LAMP = (FLUX_AND_SPECTRUM, FLUX, SPECTRUM)
OF_SCAN = {
    "unit": "the scan's unit",
    "up": "the scan's upward axis",
    "floor": "the floor",
    "ceiling": "the ceiling",
    "panes": "its glass, mirrors and screens",
}
MAX_NAMED = 6  # lamps named in one sentence


@dataclass(frozen=True, kw_only=True)
class Assumptions:
    """What is assumed, not known, behind a map; false if nothing is.

    Parameters
    ----------
    lamps : tuple of str
        Names of lamps whose flux and spectrum are guesses.
    fluxes : tuple of str
        Names of lamps whose flux alone is one.
    spectra : tuple of str
        Names of lamps whose spectrum alone is one.
    places : tuple of str
        Names of lamps that stand in place of the room's own, whatever else of them is a guess.
    scan : tuple of str
        Of 'unit', 'up', 'floor', 'ceiling' and 'panes' those that are guesses.
    """

    lamps: tuple[str, ...] = ()
    fluxes: tuple[str, ...] = ()
    spectra: tuple[str, ...] = ()
    places: tuple[str, ...] = ()
    scan: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.lamps or self.fluxes or self.spectra or self.places or self.scan)

    @classmethod
    def of_lamps(cls, guesses: Mapping[str, Collection[str]]) -> Self:
        """Of lamps by name, each with what is assumed of it: some of 'flux', 'spectrum' and 'place', or none."""
        kinds = {
            name: " and ".join(each for each in (FLUX, SPECTRUM) if each in what) for name, what in guesses.items()
        }
        of_kind = {kind: tuple(name for name in kinds if kinds[name] == kind) for kind in OF_LAMP}
        places = tuple(name for name, what in guesses.items() if PLACE in what)
        return cls(lamps=of_kind[FLUX_AND_SPECTRUM], fluxes=of_kind[FLUX], spectra=of_kind[SPECTRUM], places=places)

    @property
    def of_flux(self) -> tuple[str, ...]:
        """Names of all lamps whose flux is a guess."""
        return (*self.lamps, *self.fluxes)

    @property
    def of_spectrum(self) -> tuple[str, ...]:
        """Names of all lamps whose spectrum is a guess."""
        return (*self.lamps, *self.spectra)

    @property
    def all_lamps(self) -> tuple[str, ...]:
        """Names of all lamps of which anything is a guess."""
        return tuple(dict.fromkeys((*self.lamps, *self.fluxes, *self.spectra, *self.places)))

    def of_lamp(self, name: str) -> str:
        """What is assumed of a lamp: 'flux and spectrum', 'flux', 'spectrum', or an empty text."""
        parts = {FLUX_AND_SPECTRUM: self.lamps, FLUX: self.fluxes, SPECTRUM: self.spectra}
        return next((what for what, names in parts.items() if name in names), "")

    def without(self, *, fluxes: Iterable[str] = (), spectra: Iterable[str] = ()) -> Self:
        """The same where the fluxes and the spectra of these lamps are now given."""
        given = {FLUX: set(fluxes), SPECTRUM: set(spectra)}
        left = {
            name: [what for what in given if what in self.of_lamp(name) and name not in given[what]]
            for name in self.all_lamps
        }
        return replace(self.of_lamps(left), places=self.places, scan=self.scan)

    def in_words(self, between: str = ", ") -> str:
        """What is assumed in one line, the lamps counted; empty if nothing is."""
        parts = [
            f"{what} of {len(names)} {'lamp' if len(names) == 1 else 'lamps'}"
            for what, names in (
                (FLUX_AND_SPECTRUM, self.lamps),
                (FLUX, self.fluxes),
                (SPECTRUM, self.spectra),
                (PLACE, self.places),
            )
            if names
        ]
        return between.join([*parts, *(OF_SCAN[each] for each in self.scan)])


def counted_lamps(names: tuple[str, ...], of: int) -> str:
    """'all 12 lamps', 'both lamps', '3 of 12 lamps', 'the lamp'."""
    if of == 1:
        return "the lamp"
    every = "both lamps" if of == 2 else f"all {of} lamps"
    return every if len(names) == of else f"{len(names)} of {of} lamps"


def named_lamps(names: tuple[str, ...]) -> str:
    """Names in quotes, the first few."""
    more = len(names) - MAX_NAMED
    return ", ".join(f"'{name}'" for name in names[:MAX_NAMED]) + (f" and {more} more" if more > 0 else "")


def mark_assumed(spectral_map: "xr.Dataset", assumptions: Assumptions) -> "xr.Dataset":
    """The map with its attribute `assumed`."""
    parts = {
        FLUX_AND_SPECTRUM: assumptions.lamps,
        FLUX: assumptions.fluxes,
        SPECTRUM: assumptions.spectra,
        PLACE: assumptions.places,
        SCAN: assumptions.scan,
    }
    stated = {name: list(values) for name, values in parts.items() if values}
    return spectral_map.assign_attrs({ASSUMED: json.dumps(stated, ensure_ascii=False)})


def assumptions_of(spectral_map: "xr.Dataset") -> Assumptions:
    """What a map says that it assumes; nothing where it does not say, as maps of measured light."""
    try:
        stated: Any = json.loads(spectral_map.attrs.get(ASSUMED, "{}"))
    except (TypeError, ValueError):
        stated = {}
    stated = stated if isinstance(stated, Mapping) else {}
    lamps, fluxes, spectra, places, scan = (_names(stated.get(name)) for name in (*OF_LAMP, PLACE, SCAN))
    guesses = tuple(each for each in scan if each in OF_SCAN)
    return Assumptions(lamps=lamps, fluxes=fluxes, spectra=spectra, places=places, scan=guesses)


def _names(values: object) -> tuple[str, ...]:
    return tuple(value for value in values if isinstance(value, str)) if isinstance(values, list) else ()
