"""What a map rests on that is a guess: lamps' fluxes and spectra, and the scan's unit, upward axis, floor and ceiling.

A spectral map says so in its attribute `assumed`, a JSON text: {"flux and spectrum": ["panel 1"], "scan": ["unit"]}.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import xarray as xr

ASSUMED = "assumed"  # attribute of a spectral map
FLUX_AND_SPECTRUM, FLUX, SCAN = "flux and spectrum", "flux", "scan"  # keys of it
OF_SCAN = {"unit": "the scan's unit", "up": "the scan's upward axis", "floor": "the floor", "ceiling": "the ceiling"}
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
    scan : tuple of str
        Of 'unit', 'up', 'floor' and 'ceiling' those that are guesses.
    """

    lamps: tuple[str, ...] = ()
    fluxes: tuple[str, ...] = ()
    scan: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return bool(self.lamps or self.fluxes or self.scan)

    @property
    def all_lamps(self) -> tuple[str, ...]:
        """Names of all lamps whose flux is a guess."""
        return (*self.lamps, *self.fluxes)

    def of_lamp(self, name: str) -> str:
        """What is assumed of a lamp: 'flux and spectrum', 'flux', or an empty text."""
        return FLUX_AND_SPECTRUM if name in self.lamps else FLUX if name in self.fluxes else ""

    def without(self, names: Iterable[str]) -> Self:
        """The same where the flux and spectrum of these lamps are now given."""
        given = set(names)
        return replace(
            self,
            lamps=tuple(name for name in self.lamps if name not in given),
            fluxes=tuple(name for name in self.fluxes if name not in given),
        )

    def in_words(self) -> str:
        """What is assumed in one line, the lamps counted; empty if nothing is."""
        parts = [
            f"{what} of {len(names)} {'lamp' if len(names) == 1 else 'lamps'}"
            for what, names in ((FLUX_AND_SPECTRUM, self.lamps), (FLUX, self.fluxes))
            if names
        ]
        return ", ".join([*parts, *(OF_SCAN[each] for each in self.scan)])


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


def mark_assumed(spectral_map: xr.Dataset, assumptions: Assumptions) -> xr.Dataset:
    """The map with its attribute `assumed`."""
    parts = {FLUX_AND_SPECTRUM: assumptions.lamps, FLUX: assumptions.fluxes, SCAN: assumptions.scan}
    told = {name: list(values) for name, values in parts.items() if values}
    return spectral_map.assign_attrs({ASSUMED: json.dumps(told, ensure_ascii=False)})


def assumptions_of(spectral_map: xr.Dataset) -> Assumptions:
    """What a map says that it assumes; nothing where it does not say, as maps of measured light."""
    try:
        told: Any = json.loads(spectral_map.attrs.get(ASSUMED, "{}"))
    except (TypeError, ValueError):
        told = {}
    told = told if isinstance(told, Mapping) else {}
    lamps, fluxes, scan = (_names(told.get(name)) for name in (FLUX_AND_SPECTRUM, FLUX, SCAN))
    return Assumptions(lamps=lamps, fluxes=fluxes, scan=tuple(each for each in scan if each in OF_SCAN))


def _names(values: object) -> tuple[str, ...]:
    return tuple(value for value in values if isinstance(value, str)) if isinstance(values, list) else ()
