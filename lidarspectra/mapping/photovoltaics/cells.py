"""Solar cells: quantum efficiency, from which current follows, and the equivalent circuit, from which power follows.

References
----------
The paper, Eq. 10 and 11, and Figure 18. De Soto, Klein, Beckman 2006, Solar Energy 80, 78-88 (the circuit).
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Literal

import numpy as np
from scipy import constants

from lidarspectra.arguments import path_of
from lidarspectra.errors import DatabaseError
from lidarspectra.hardware.sensor.photocell import M2_PER_CM2
from lidarspectra.mapping.photovoltaics.cell_fit_files import FIT_SUFFIX, efficiency_of_fit, load_fit
from lidarspectra.spectra.database_files import list_databases, table
from lidarspectra.spectra.databases import FILE_SUFFIXES
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.spectra.spectrum_files import TableRow, finite_number, read_spectrum_file, read_text

Quantity = Literal["efficiency", "relative"]

AMPERE_PER_WATT_NM = float(constants.e / (constants.h * constants.c) * 1e-9)
"""q/hc: current per watt and nm of wavelength at a quantum efficiency of 1. [A/(W nm)]"""
MILLI = 1e-3
OF_PHOTONS = ("efficiency", "quantum", "eqe", "iqe", "ipce", "absor")  # in a heading: of photons, not of watts
STEP_NM = 1.0  # [nm] of the grid: λ x a(λ) is not linear between the samples of a
PERCENT_ABOVE = 1.5  # [1] a curve of efficiencies that exceeds it is taken as per cent

_PER_WATT = re.compile(
    r"(?<![a-z])(?P<milli>m?)a(?:\s*/\s*|_|\s+per\s+|[\s·*.]*(?=w\s*\^?\(?[-−⁻]\s*[1¹]))w(?:att)?(?![a-z])"
)
"""A/W, mA/W, A_W, A per W, A W^-1, in small letters."""


@dataclass(frozen=True, kw_only=True)
class Circuit:
    """Single-diode equivalent circuit per square metre of cell, at 25 °C.

    Parameters
    ----------
    saturation_current_A_m2 : float
        Of the diode. [A/m²]
    ideality : float
        Of the diode. [1]
    series_ohm_m2 : float
        [Ω m²]
    shunt_volt : float
        Shunt resistance times photocurrent, which is constant in De Soto's model. [V]
    """

    saturation_current_A_m2: float  # noqa: N815 - amperes are A
    ideality: float
    series_ohm_m2: float = 0.0
    shunt_volt: float = float("inf")

    def __post_init__(self) -> None:
        positive = min(self.saturation_current_A_m2, self.ideality, self.shunt_volt) > 0
        if not (positive and self.series_ohm_m2 >= 0 and np.isfinite(self.ideality)):
            raise DatabaseError(
                expected="a positive saturation current, ideality and shunt, and no negative resistance",
                found=f"{self.saturation_current_A_m2:g} A/m², {self.ideality:g}, {self.shunt_volt:g} V, "
                f"{self.series_ohm_m2:g} ohm m²",
                where="circuit of a cell",
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class Cell:
    """A solar cell.

    Parameters
    ----------
    name, words, category, provenance : str
        Database name or file; what it is; its kind; 'measured', 'digitised', 'fitted', 'modelled' or 'assigned'.
    quantity : 'efficiency' or 'relative'
        Whether the curve is a quantum efficiency, or known only up to a factor, as an absorption is.
    efficiency : Spectrum
        EQE(λ), or a(λ) of the paper's Eq. 11; zero beyond its ends. [1]
    area_m2 : float or None
        [m²]
    circuit : Circuit or None
        For power; None if only the current can be computed.
    """

    name: str
    words: str
    category: str
    provenance: str
    quantity: Quantity
    efficiency: Spectrum
    area_m2: float | None = None
    circuit: Circuit | None = None

    def __post_init__(self) -> None:
        values = self.efficiency.values
        if values.min() < 0 or values.max() <= 0 or (self.quantity == "efficiency" and values.max() > 1.0):
            raise DatabaseError(
                expected="quantum efficiencies from 0 to 1",
                found=f"{values.min():g} to {values.max():g}",
                where=f"cell '{self.name}'",
                todo="Divide values in per cent by 100; mark a curve without an absolute scale as 'relative'.",
            )
        if self.area_m2 is not None and not self.area_m2 > 0:
            raise DatabaseError(expected="a positive area", found=f"{self.area_m2:g} m²", where=f"cell '{self.name}'")

    @cached_property
    def responsivity(self) -> Spectrum:
        """Spectral responsivity S(λ) = (q/hc) λ a(λ) [A/W]."""
        first, last = self.efficiency.range_nm
        even = np.arange(np.ceil(first), np.floor(last) + STEP_NM / 2, STEP_NM)
        grid = np.union1d(even, self.efficiency.wavelengths_nm)
        values = AMPERE_PER_WATT_NM * grid * self.efficiency.at(grid, outside="zero")
        return Spectrum(wavelengths_nm=grid, values=values, name=self.name)

    def is_relative(self, scale: float = 1.0) -> bool:
        """Whether only ratios of its currents have a meaning, with a factor on its curve from a calibration [1]."""
        return self.quantity == "relative" and scale == 1.0

    def notes(self, scale: float = 1.0) -> tuple[str, ...]:
        """Caveats on its currents, with a factor on its curve from a calibration [1]; full sentences."""
        if self.is_relative(scale):
            return (
                *self._identifiable(),
                f"The response curve of '{self.name}' is known only up to a factor, and is taken as its quantum "
                "efficiency: only ratios of these currents are meaningful. Calibrate the cell against a measured "
                "current, and give the factor with --scale, or as scale in the run file.",
            )
        if self.provenance == "fitted":
            return self._identifiable()
        if self.provenance == "modelled":
            return (
                f"'{self.name}' is an ideal model of a material, not a product: its currents are an upper limit. For a "
                "real cell, give its measured quantum efficiency as a file.",
            )
        return ()

    def _identifiable(self) -> tuple[str, ...]:
        if self.provenance != "fitted":
            return ()
        under_one_lamp = (
            f"The response of '{self.name}' was fitted beside a sensor. Under one kind of lamp a curve is not "
            "identifiable: currents under lamps of another kind, or in daylight, may be off. Fit it under more."
        )
        if self.quantity != "relative":
            return (under_one_lamp,)
        return (
            under_one_lamp,
            f"The fit of '{self.name}' is no quantum efficiency: its readings are no irradiances, its circuit was not "
            "given, or it would make more than one electron of a photon, as can be where the sensor was not "
            "calibrated. Fit it with --calibration, --reference and --shunt.",
        )


def list_cells() -> tuple[Cell, ...]:
    """Every cell of the databases."""
    files = [file for file in list_databases() if file.kind == "cells"]
    return tuple(_cell(row, file.path) for file in files for row in table(file.path))


def find_cell(name_or_file: str | PathLike[str], base_folder: str | PathLike[str] | None = None) -> Cell:
    """A cell by its database name, or from a file of two columns, wavelength [nm] and quantum efficiency.

    Parameters
    ----------
    name_or_file : str or path
        'silicon', 'organic-green' ...; a name that ends in .csv, .txt, .tsv or .dat is a file, one that ends in .json a
        fit of `cells fit`. A file whose values
        exceed 1.5 is taken as per cent. A file whose heading contains 'relative' or 'absorption' has no absolute scale;
        one that contains 'A/W' or 'mA/W' holds responsivities.
    base_folder : str or path, optional
        Where relative file names start.

    Raises
    ------
    DatabaseError
        If there is neither such a name nor such a file, or it is malformed, an absorbance, which is a logarithm, or a
        response of which the heading does not say whether it is per watt or per photon.
    """
    known = {cell.name.casefold(): cell for cell in list_cells()}
    meaning = "a cell's name, or the name of a file"
    wanted = str(path_of(name_or_file, name="name_or_file", meaning=meaning)).strip()
    if wanted.casefold() in known:
        return known[wanted.casefold()]
    if Path(wanted).suffix.lower() == FIT_SUFFIX:
        return _cell_of_fit(Path(base_folder or "", wanted))
    if Path(wanted).suffix.lower() in FILE_SUFFIXES:
        return _cell_of_file(Path(base_folder or "", wanted))
    raise DatabaseError(
        expected=f"a cell ({', '.join(cell.name for cell in known.values())}), a .csv file, or a fit (.json)",
        found=f"'{name_or_file}'",
        where="cell",
        todo="A file has two columns, wavelength_nm and efficiency.",
    )


def _cell_of_fit(path: Path) -> Cell:
    """The cell of a fit: a quantum efficiency where its readings were irradiances and its circuit is known."""
    saved = load_fit(path)
    wavelengths, efficiency, is_absolute = efficiency_of_fit(saved)
    return Cell(
        name=saved.name,
        words=f"fitted, {path.name}",
        category="unknown",
        provenance="fitted",
        quantity="efficiency" if is_absolute else "relative",
        efficiency=Spectrum(wavelengths_nm=wavelengths, values=efficiency, name=saved.name),
        area_m2=None if saved.circuit is None else saved.circuit.area_cm2 * M2_PER_CM2,
    )


def _cell_of_file(path: Path) -> Cell:
    read = read_spectrum_file(path)
    heading = _heading(path)
    grid, values = read.spectrum.wavelengths_nm, read.spectrum.values
    per_watt = _PER_WATT.search(heading)
    if per_watt is not None:
        values = values / (AMPERE_PER_WATT_NM * grid) * (MILLI if per_watt["milli"] else 1.0)
    elif "respons" in heading and not any(word in heading for word in OF_PHOTONS):
        raise DatabaseError(
            expected="a heading that says whether a response is in A/W or a quantum efficiency",
            found=f"'{heading[:60]}'",
            where=str(path),
            todo="Write A/W there, with 'relative' if the curve has no absolute scale; or efficiency, if it is that.",
        )
    elif "%" in heading or "percent" in heading or values.max() > PERCENT_ABOVE:
        values = values / 100.0
    if "absorbance" in heading:
        raise DatabaseError(
            expected="a quantum efficiency, an absorption or a responsivity",
            found="an absorbance, which is a logarithm",
            where=str(path),
            todo="Convert it to absorption, 1 - 10^-absorbance.",
        )
    relative = "relative" in heading or "absorption" in heading
    return Cell(
        name=path.stem,
        words=f"from {path.name}",
        category="unknown",
        provenance="assigned",
        quantity="relative" if relative else "efficiency",
        efficiency=Spectrum(wavelengths_nm=grid, values=values, name=path.stem),
    )


def _heading(path: Path) -> str:
    """First line that is not a comment, in lower case; for a table without a heading, its first numbers."""
    lines = (line.strip() for line in read_text(path).splitlines())
    return next((line for line in lines if line and not line.startswith("#")), "").lower()


def _cell(row: TableRow, path: Path) -> Cell:
    properties = row.properties
    area = _number(properties, "area_cm2", row, path)
    saturation = _number(properties, "saturation_current_A_m2", row, path)
    circuit = None
    if saturation is not None:
        shunt = _number(properties, "shunt_volt", row, path)
        circuit = Circuit(
            saturation_current_A_m2=saturation,
            ideality=_number(properties, "ideality", row, path) or 1.0,
            series_ohm_m2=_number(properties, "series_ohm_m2", row, path) or 0.0,
            shunt_volt=float("inf") if shunt is None else shunt,
        )
    return Cell(
        name=row.id,
        words=row.name,
        category=row.category,
        provenance=properties.get("provenance", "measured"),
        quantity="relative" if properties.get("quantity") == "relative" else "efficiency",
        efficiency=row.spectrum,
        area_m2=None if area is None else area * M2_PER_CM2,
        circuit=circuit,
    )


def _number(properties: Mapping[str, str], name: str, row: TableRow, path: Path) -> float | None:
    if name not in properties:
        return None
    return finite_number(properties[name], where=f"{path}, id {row.id}, column {name}")
