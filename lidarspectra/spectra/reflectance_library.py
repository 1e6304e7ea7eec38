"""Reflectance spectra that surfaces are matched against, with their precomputed colours."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.errors import DatabaseError
from lidarspectra.spectra.colorimetry import xyz_to_lab, xyz_to_linear_srgb
from lidarspectra.spectra.spectrum import Spectrum

MAX_REFLECTANCE = 0.99  # above it interreflections converge too slowly; at 1.0, in a closed room, not at all
MAX_FLUORESCENT = 1.5  # [1] of white paper in light with ultraviolet, and of no surface in per cent
VISIBLE_NM = (380.0, 780.0)  # [nm] in some of which a reflectance must be known
COLOR_GRID_NM = np.arange(360.0, 780.1, 5.0)  # [nm] colours are integrated here (CIE 15:2018, 7.1.1: 5 nm suffices)


@dataclass(frozen=True, kw_only=True, eq=False)
class Reflectance:
    """One surface of a database.

    Parameters
    ----------
    database, id : str
        Together its key; names may repeat, keys do not.
    name, category : str
        Words for a reader, and class ('painted', 'Wall', ...; 'unknown' where the source has none).
    spectrum : Spectrum
        Total hemispherical reflectance, 0 to `MAX_REFLECTANCE`, over what was measured. [1]
    provenance : str
        'measured' or 'modelled'.
    kind : str
        How it scatters, in Radiance's terms: 'plastic' or 'metal'.
    specularity, roughness : float
        As the source gives them; 0 where it gives none. [0-1]
    matchable : bool
        False for ideal surfaces and for rows whose source is at fault: they are found by name only.
    note : str
        What was changed in importing.
    """

    database: str
    id: str
    name: str
    category: str
    spectrum: Spectrum
    provenance: str
    kind: str = "plastic"
    specularity: float = 0.0
    roughness: float = 0.0
    matchable: bool = True
    note: str = ""

    def __post_init__(self) -> None:
        values = self.spectrum.values
        if values.min() < 0 or values.max() > MAX_REFLECTANCE:
            raise DatabaseError(
                expected=f"a reflectance from 0 to {MAX_REFLECTANCE}, as a fraction",
                found=f"{values.min():g} to {values.max():g}",
                where=self.key,
                todo="Write a spectrometer's noise below 0 as 0."
                if values.min() < 0
                else "Divide percent by 100."
                if values.max() > MAX_FLUORESCENT
                else f"Cut it at {MAX_REFLECTANCE}: more is fluorescence, or an error of the measurement.",
            )

    @property
    def key(self) -> str:
        """Database and ID, 'builtin:cc-orange'."""
        return f"{self.database}:{self.id}"

    @property
    def range_nm(self) -> tuple[float, float]:
        """Range that was measured [nm]; beyond it the reflectance is extrapolated."""
        return self.spectrum.range_nm


@dataclass(frozen=True, kw_only=True, eq=False)
class ReflectanceLibrary:
    """Surfaces of one or more databases, and their colours under D65 for the CIE 1931 observer.

    Parameters
    ----------
    rows : tuple of Reflectance
        Keys are unique.
    weights : (wavelength, 3) float
        XYZ of a reflectance on `COLOR_GRID_NM` (see `colorimetry.tristimulus_weights`). [1]
    sha256 : tuple of str
        Of the files that it was read from, for the run's record.
    """

    rows: tuple[Reflectance, ...]
    weights: FloatArray
    sha256: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        keys = [row.key for row in self.rows]
        if not keys or len(set(keys)) < len(keys):
            raise DatabaseError(
                expected="one or more surfaces, each key once",
                found=f"{len(keys)} surfaces, {len(set(keys))} keys",
                where="reflectance library",
            )

    def __len__(self) -> int:
        return len(self.rows)

    @cached_property
    def values(self) -> FloatArray:
        """(surface, wavelength) reflectance on `COLOR_GRID_NM`, held at its end values beyond its range [1]."""
        return np.stack([row.spectrum.at(COLOR_GRID_NM, outside="nearest") for row in self.rows])

    @cached_property
    def xyz(self) -> FloatArray:
        """(surface, 3) XYZ under D65; white has Y = 1."""
        return np.asarray(self.values @ self.weights, dtype=np.float64)

    @cached_property
    def lab(self) -> FloatArray:
        """(surface, 3) CIE L*a*b* under D65."""
        return xyz_to_lab(self.xyz)

    @cached_property
    def linear_srgb(self) -> FloatArray:
        """(surface, 3) linear sRGB; may lie outside 0 to 1 where the surface is more vivid than a display."""
        return xyz_to_linear_srgb(self.xyz)

    @cached_property
    def matchable(self) -> BoolArray:
        """(surface,) which ones a colour may be matched to."""
        return np.array([row.matchable for row in self.rows], dtype=np.bool_)

    @cached_property
    def categories(self) -> tuple[str, ...]:
        """(surface,) class of each."""
        return tuple(row.category for row in self.rows)

    def find(self, name: str) -> Reflectance:
        """Surface of a key ('builtin:white-wall') or of an ID alone, in the order of the databases.

        Raises
        ------
        DatabaseError
            If there is none; near ones are named.
        """
        wanted = name.strip().casefold()
        for row in self.rows:
            if wanted in (row.key.casefold(), row.id.casefold()):
                return row
        raise DatabaseError(
            expected="the ID of a reflectance in the databases that the run file names",
            found=f"'{name}'",
            todo=_near(wanted, self.rows) + "'lidarspectra databases list' shows every ID.",
        )

    def subset(self, keep: BoolArray) -> "ReflectanceLibrary":
        """A library of some of the surfaces, for leave-one-out tests and matching within a class."""
        rows = tuple(row for row, kept in zip(self.rows, keep, strict=True) if kept)
        return ReflectanceLibrary(rows=rows, weights=self.weights, sha256=self.sha256)


def _near(wanted: str, rows: Sequence[Reflectance]) -> str:
    names = [row.id for row in rows if wanted in row.id.casefold() or wanted in row.name.casefold()][:3]
    return f"Did you mean {', '.join(names)}? " if names else ""
