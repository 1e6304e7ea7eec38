"""Solar cells: what part of the photons of each wavelength becomes current, and the circuit that makes power of it.

References
----------
The paper, Eq. 10 and 11, and Figure 18. De Soto, Klein, Beckman 2006, Solar Energy 80, 78-88 (the circuit).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from scipy import constants

from lidarspectra.errors import DatabaseError
from lidarspectra.hardware.sensor.photocell import M2_PER_CM2
from lidarspectra.spectra.database_files import list_databases, table
from lidarspectra.spectra.databases import FILE_SUFFIXES
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.spectra.spectrum_files import TableRow, finite_number, read_spectrum_file, read_text

Quantity = Literal["efficiency", "relative"]

AMPERE_PER_WATT_NM = float(constants.e / (constants.h * constants.c) * 1e-9)
"""q/hc: current of a watt of photons of 1 nm, each giving an electron. [A/(W nm)]"""
STEP_NM = 1.0  # [nm] λ x a(λ) is no straight line between the samples of a
PERCENT_ABOVE = 1.5  # [1] a curve of efficiencies that exceeds it is in per cent


@dataclass(frozen=True, kw_only=True)
class Circuit:
    """One diode, a series and a shunt resistance, of a square metre of cell at 25 °C.

    Parameters
    ----------
    saturation_current_A_m2 : float
        Of the diode. [A/m²]
    ideality : float
        Of the diode. [1]
    series_ohm_m2 : float
        [Ω m²]
    shunt_volt : float
        Shunt resistance times photocurrent, which De Soto's model holds constant from sun to shade. [V]
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
        Database name or file; what it is; its kind; 'measured', 'digitised', 'modelled' or 'assigned'.
    quantity : 'efficiency' or 'relative'
        Whether the curve is a quantum efficiency, or one up to an unknown factor, as an absorption is.
    efficiency : Spectrum
        EQE(λ), or a(λ) of the paper's Eq. 11; zero beyond its ends. [1]
    area_m2 : float or None
        [m²]
    circuit : Circuit or None
        For power; None leaves only the current known.
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
                todo="Divide per cent by 100; call a curve without a scale 'relative'.",
            )
        if self.area_m2 is not None and not self.area_m2 > 0:
            raise DatabaseError(expected="a positive area", found=f"{self.area_m2:g} m²", where=f"cell '{self.name}'")

    @cached_property
    def responsivity(self) -> Spectrum:
        """S(λ) = (q/hc) λ a(λ), the current of a watt of light [A/W]."""
        first, last = self.efficiency.range_nm
        even = np.arange(np.ceil(first), np.floor(last) + STEP_NM / 2, STEP_NM)
        grid = np.union1d(even, self.efficiency.wavelengths_nm)
        values = AMPERE_PER_WATT_NM * grid * self.efficiency.at(grid, outside="zero")
        return Spectrum(wavelengths_nm=grid, values=values, name=self.name)

    def notes(self, scale: float = 1.0) -> tuple[str, ...]:
        """What a user must know of its numbers, with a factor on its curve from a calibration [1]."""
        if self.quantity == "relative" and scale == 1.0:
            return (
                f"'{self.name}' has a relative curve: currents are those of a cell that turns each photon it counts "
                "into an electron; calibrate with --scale, or scale in the run file",
            )
        if self.provenance == "modelled":
            return (f"'{self.name}' is a model, no product: an upper limit for cells of its gap",)
        return ()


def list_cells() -> tuple[Cell, ...]:
    """Every cell of the databases."""
    files = [file for file in list_databases() if file.kind == "cells"]
    return tuple(_cell(row, file.path) for file in files for row in table(file.path))


def find_cell(name_or_file: str, base_folder: Path | None = None) -> Cell:
    """A cell by its database name, or from a file of two columns, wavelength [nm] and quantum efficiency.

    Parameters
    ----------
    name_or_file : str
        'silicon', 'organic-green' ...; what ends in .csv, .txt, .tsv or .dat is a file. A file whose values exceed 1.5
        is in per cent. A file whose heading says 'relative' or 'absorption' has no scale; one that says 'A/W' holds
        responsivities.
    base_folder : Path, optional
        Where relative file names start.

    Raises
    ------
    DatabaseError
        If there is neither such a name nor such a file, or it is malformed or an absorbance, which is a logarithm.
    """
    known = {cell.name.casefold(): cell for cell in list_cells()}
    wanted = name_or_file.strip()
    if wanted.casefold() in known:
        return known[wanted.casefold()]
    if Path(wanted).suffix.lower() in FILE_SUFFIXES:
        return _cell_of_file(Path(wanted) if base_folder is None else base_folder / wanted)
    raise DatabaseError(
        expected=f"a cell ({', '.join(cell.name for cell in known.values())}) or a .csv file",
        found=f"'{name_or_file}'",
        where="cell",
        todo="A file has two columns, wavelength_nm and efficiency.",
    )


def _cell_of_file(path: Path) -> Cell:
    read = read_spectrum_file(path)
    heading = _heading(path)
    grid, values = read.spectrum.wavelengths_nm, read.spectrum.values
    if "a/w" in heading.replace(" ", ""):
        values = values / (AMPERE_PER_WATT_NM * grid)
    elif "%" in heading or "percent" in heading or values.max() > PERCENT_ABOVE:
        values = values / 100.0
    if "absorbance" in heading:
        raise DatabaseError(
            expected="a quantum efficiency, an absorption or a responsivity",
            found="an absorbance, which is a logarithm",
            where=str(path),
            todo="Absorption is 1 - 10^-absorbance.",
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
    """First line that is no comment, in small letters; a table without a heading gives its first numbers."""
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
