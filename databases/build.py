"""Make the built-in databases from what colour-science and pvlib carry, and write MANIFEST.toml.

    python databases/build.py

The files are the same on every run; their versions are noted. Nothing is fetched.
"""

import gzip
import hashlib
import json
import re
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import colour
import numpy as np
import pvlib
from colour.characterisation import read_training_data_rawtoaces_v1
from colour.quality import cfi2017
from colour.quality.datasets.tcs import APPROXIMATE_MUNSELL_NOTATIONS_TCS_CIE2024, SDS_TCS
from colour.quality.datasets.vs import SDS_VS

from lidarspectra.arrays import FloatArray
from lidarspectra.io.files import write_whole
from lidarspectra.spectra.reflectance_library import MAX_REFLECTANCE
from lidarspectra.spectra.spectrum import AS7265X_CENTERS_NM, AS7265X_FWHM_NM, Spectrum
from lidarspectra.spectra.spectrum_files import TableRow, write_table

HERE = Path(__file__).resolve().parent
CARRIER = f"carried by colour-science {colour.__version__} (BSD-3-Clause)"
MELANOPIC_NM = np.arange(380.0, 780.1, 5.0)
MELANOPIC = (
    0.00091816, 0.0016672, 0.0030944, 0.0058804, 0.011428, 0.022811, 0.046155, 0.079477, 0.13724, 0.1871, 0.25387,
    0.32068, 0.40159, 0.474, 0.55371, 0.62965, 0.70805, 0.78522, 0.86029, 0.91773, 0.96561, 0.99062, 1, 0.99202,
    0.96595, 0.9223, 0.86289, 0.78523, 0.69963, 0.60942, 0.51931, 0.43253, 0.35171, 0.27914, 0.21572, 0.16206,
    0.11853, 0.084346, 0.058701, 0.040009, 0.026875, 0.017862, 0.01179, 0.0077343, 0.0050669, 0.0033177, 0.002177,
    0.0014331, 0.00094731, 0.00062765, 0.00041796, 0.0002798, 0.00018834, 0.00012734, 8.6575e-05, 5.9191e-05,
    4.0695e-05, 2.8132e-05, 1.9553e-05, 1.3648e-05, 9.5764e-06, 6.7542e-06, 4.788e-06, 3.4084e-06, 2.4382e-06,
    1.7525e-06, 1.2656e-06, 9.1808e-07, 6.6899e-07, 4.8953e-07, 3.5977e-07, 2.6549e-07, 1.9674e-07, 1.4637e-07,
    1.0933e-07, 8.1959e-08, 6.1675e-08, 4.6592e-08, 3.5327e-08, 2.688e-08, 2.0526e-08,
)  # fmt: skip  # [1] CIE S 026/E:2018, Table 2, s_mel, every 5 nm
MCCREE_NM = np.arange(350.0, 725.1, 25.0)
MCCREE_FIELD = (
    0.02,
    0.12,
    0.42,
    0.68,
    0.70,
    0.63,
    0.65,
    0.72,
    0.82,
    0.91,
    0.97,
    1.0,
    0.90,
    0.90,
    0.48,
    0.23,
)  # [1] McCree 1972, Table IV
MCCREE_CHAMBER = (
    0.16,
    0.45,
    0.66,
    0.76,
    0.75,
    0.68,
    0.71,
    0.74,
    0.87,
    0.95,
    1.0,
    1.0,
    0.94,
    0.92,
    0.44,
    0.20,
)  # [1] the same, Table III
ASCA_NM = AS7265X_CENTERS_NM[:15]
ASCA_GREEN = (
    1.05,
    0.93,
    0.97,
    0.99,
    0.96,
    0.97,
    1.0,
    0.97,
    0.91,
    0.82,
    0.32,
    0.05,
    0.0,
    0.0,
    0.1,
)  # [1] paper, Figure 18, digitised
ASCA_BLUE = (0.90, 0.70, 0.62, 0.57, 0.60, 0.70, 0.80, 0.90, 0.98, 0.95, 0.27, 0.0, 0.0, 0.0, 0.15)  # [1] the same
HC_OVER_Q_NM = 1239.841984  # [nm V] CODATA 2018: a photon of that wavelength has 1 eV
CELL_KELVIN = 298.15  # [K] standard test conditions (IEC 60904-3)
CIE_LICENCE = f"CIE tables; no separate licence stated with the data; {CARRIER}"


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One file of the manifest; see lidarspectra.spectra.databases.DatabaseFile."""

    path: str
    title: str
    source: str
    licence: str
    grid: str
    provenance: str
    note: str = ""
    count: int = 0


def row(
    identifier: str, name: str, category: str, wavelengths: Iterable[float], values: Iterable[float], **properties: str
) -> TableRow:
    """Make a row, with colour-science's values as they are."""
    spectrum = Spectrum(wavelengths_nm=np.array(list(wavelengths)), values=np.array(list(values)), name=name)
    return TableRow(id=identifier, name=name, category=category, spectrum=spectrum, properties=properties)


def lamp(identifier: str, category: str, provenance: str, shape: colour.SpectralDistribution) -> TableRow:
    """Make a lamp's row; numerical dust below 1e-7 of the peak is written as zero."""
    values = np.where(shape.values < 1e-7 * shape.values.max(), 0.0, shape.values)
    return row(identifier, identifier, category, shape.wavelengths, values, provenance=provenance)


def cie_category(name: str) -> tuple[str, str]:
    """Category and provenance of a CIE illuminant from its designation."""
    if name.startswith("FL"):
        return "fluorescent", "measured"
    if name.startswith("HP"):
        return "discharge", "measured"
    if name.startswith("LED"):
        return "led", "measured"
    if name in ("A", "B"):
        return "incandescent" if name == "A" else "daylight", "modelled"
    return ("equal-energy" if name == "E" else "daylight"), "modelled"


def illuminant_a() -> TableRow:
    """CIE illuminant A from its own formula, 300 to 1000 nm (CIE 15:2018, Eq. 4.1, stated there up to 830 nm)."""
    grid = np.arange(300.0, 1000.1, 5.0)
    c2_over_t = 1.435e7 / 2848.0  # [nm] the constants that the definition fixes
    values = 100 * (560 / grid) ** 5 * np.expm1(c2_over_t / 560) / np.expm1(c2_over_t / grid)
    return row("A", "A", "incandescent", grid, values, provenance="modelled")


def build_lamps() -> list[Entry]:
    """Write lamps/*.csv."""
    cie = [illuminant_a()]
    for name, distribution in colour.SDS_ILLUMINANTS.items():
        # ISO 7589's sources end at 560 to 690 nm and several include a lens: no lamps for a 760 nm channel.
        if not name.startswith("ISO") and name != "A":
            cie.append(lamp(name, *cie_category(name), distribution))
    write_table(HERE / "lamps" / "cie-illuminants.csv", cie)
    sources = [
        lamp(name, *light_category(name), distribution)
        for name, distribution in colour.SDS_LIGHT_SOURCES.items()
        if name not in ("SA", "SC")  # CIE A and C once more
    ]
    write_table(HERE / "lamps" / "light-sources.csv", sources)
    return [
        Entry(
            path="lamps/cie-illuminants.csv",
            title="CIE standard and typical illuminants",
            source="CIE 15:2018 and CIE 15:2004 tables; A from its formula, extended from 830 to 1000 nm by the same",
            licence=CIE_LICENCE,
            grid="380-780 nm at 5 nm (A 300-1000, D 300-780 or 830, C 300-780)",
            provenance="modelled (A to E), representative of measured lamps (FL, HP, LED)",
            count=len(cie),
            note="relative power; nothing is known beyond a lamp's own range",
        ),
        Entry(
            path="lamps/light-sources.csv",
            title="Lamps of trade: fluorescent, discharge, incandescent, LED; and simulated LED mixtures",
            source="NIST CQS simulation 7.4 (Ohno, Davis 2008); RIT PointerData.xls (Pointer 1980); Houston 2015",
            licence=f"no licence stated with the spreadsheets; {CARRIER}",
            grid="380-780 nm at 5 nm (Kinoton 75P at 2 nm)",
            provenance="measured, but for the n-LED and PHOS series, which are modelled",
            count=len(sources),
            note="relative power",
        ),
    ]


def light_category(name: str) -> tuple[str, str]:
    """Category and provenance of one of colour-science's light sources from its name."""
    if name.startswith(("3-LED", "4-LED", "PHOS")):
        return "led", "modelled"
    if name.startswith(("Luxeon", "Phosphor")):
        return "led", "measured"
    if "Incandescent" in name or name.startswith("60 A/W"):
        return "incandescent", "measured"
    if any(word in name for word in ("HPS", "LPS", "Mercury", "Metal Halide", "MHC", "Kinoton")):
        return "discharge", "measured"
    return "fluorescent", "measured"


def slug(words: str) -> str:
    """Lower-case words joined by '-', for an ID."""
    return re.sub(r"[^a-z0-9]+", "-", words.lower()).strip("-")


def chart(chart_name: str, prefix: str, words: str) -> list[TableRow]:
    """Rows of a colour chart: paint on paper."""
    return [
        row(
            f"{prefix}-{slug(re.sub('[(].*', '', name))}",
            f"{words} {name}",
            "painted",
            distribution.wavelengths,
            distribution.values,
            provenance="measured",
        )
        for name, distribution in colour.SDS_COLOURCHECKERS[chart_name].items()
    ]


def test_samples() -> list[TableRow]:
    """Rows of the CIE's and NIST's test colour samples; those of CQS 9.0 that CQS 7.4 has are left out."""
    munsell = APPROXIMATE_MUNSELL_NOTATIONS_TCS_CIE2024
    rows = [
        row(name.lower(), f"CIE {name} {munsell.get(name, '')}".strip(), "painted", d.wavelengths, d.values)
        for name, d in SDS_TCS["CIE 2024"].items()
    ]
    seen: set[tuple[float, ...]] = set()
    for version, prefix in (("NIST CQS 7.4", "vs74"), ("NIST CQS 9.0", "vs90")):
        for name, distribution in SDS_VS[version].items():
            part = distribution.copy().trim(colour.SpectralShape(380, 780, 5))
            shape = tuple(np.round(part.values, 3))
            if shape not in seen:
                seen.add(shape)
                key = f"{prefix}-{int(name.removeprefix('VS')):02d}"
                rows.append(row(key, f"{version} {name}", "painted", part.wavelengths, part.values))
    return rows


def evaluation_samples() -> list[TableRow]:
    """Rows of the 99 colour evaluation samples of CIE 224:2017."""
    path = Path(cfi2017.ROOT_RESOURCES_CIE2017) / "tcs_cfi2017_5_nm.csv.gz"
    with gzip.open(path, "rt", encoding="utf-8") as lines:
        table = np.loadtxt(lines, delimiter=",")
    return [
        row(f"ces{i:02d}", f"CIE 224 CES{i:02d}", "unknown", table[:, 0], table[:, i]) for i in range(1, table.shape[1])
    ]


def training_patches() -> list[TableRow]:
    """Rows of the ACES camera training patches; samples below 1e-6 at either end were not measured.

    Patches above 0.99 anywhere are left out: they glow (fluorescence) or are scaled.
    """
    patches = read_training_data_rawtoaces_v1()
    rows = []
    for index, name in enumerate(patches.labels):
        values = patches.values[:, index]
        known = np.flatnonzero(values > 1e-6)
        measured = slice(int(known[0]), int(known[-1]) + 1)
        if values.max() <= MAX_REFLECTANCE:
            number = int(name.removeprefix("patch"))
            wavelengths = patches.wavelengths[measured]
            rows.append(
                row(
                    f"aces-{number:03d}",
                    f"ACES training patch {number}",
                    "unknown",
                    wavelengths,
                    np.maximum(values[measured], 0.0),
                )
            )
    return rows


def default_materials() -> list[TableRow]:
    """Rows of the paper's five default materials: simple models of ours, smooth in wavelength.

    The whites are a titanium-dioxide paint: flat, with rutile's absorption edge at 405 nm, a little lower in the blue
    for an aged binder. The wood rises from blue to red as lignin absorbs less.
    """
    grid = np.arange(360.0, 1000.1, 10.0)
    edge = 1 / (1 + np.exp(-(grid - 405) / 8))
    flat = np.ones_like(grid)
    models = {
        "white-plastic": ("White plastic", "plastic", 0.06 + 0.80 * edge - 0.02 * edge * np.exp(-(grid - 420) / 60)),
        "white-wall": ("White wall paint", "painted", 0.06 + 0.74 * edge - 0.05 * edge * np.exp(-(grid - 420) / 60)),
        "wooden-cabinet": ("Wooden cabinet", "wood", 0.08 + 0.42 / (1 + np.exp(-(grid - 585) / 55))),
        "fully-reflective": ("Fully reflective, as far as a steady state allows", "ideal", MAX_REFLECTANCE * flat),
        "non-reflective": ("Non-reflective", "ideal", 0.0 * flat),
    }
    return [
        row(key, name, category, grid, values, provenance="modelled", matching="no")
        for key, (name, category, values) in models.items()
    ]


def build_reflectances() -> list[Entry]:
    """Write reflectance/*.csv."""
    tables: list[tuple[Entry, list[TableRow]]] = [
        (
            Entry(
                path="reflectance/default-materials.csv",
                title="The five default materials of the paper",
                source="models of this project (see databases/build.py)",
                licence="BSD-3-Clause",
                grid="360-1000 nm at 10 nm",
                provenance="modelled",
                note="given by name only, never matched to a colour",
            ),
            default_materials(),
        ),
        (
            Entry(
                path="reflectance/colorchecker-ohta.csv",
                title="ColorChecker Classic, measured by Ohta (the same as ISO 17321-1)",
                source="Ohta 1997, through Munsell Color Science MacbethColorChecker.xls",
                licence=f"no licence stated with the spreadsheet; {CARRIER}",
                grid="380-780 nm at 5 nm",
                provenance="measured",
            ),
            chart("ColorChecker N Ohta", "cc", "ColorChecker"),
        ),
        (
            Entry(
                path="reflectance/preferred-memory-colors.csv",
                title="Preferred memory colour chart",
                source="Luo 2024, Color Research and Application, doi 10.1002/col.22940",
                licence=f"no licence stated with the data; {CARRIER}",
                grid="400-700 nm at 10 nm",
                provenance="measured",
                note="patches are named for what they remind of; they are paint",
            ),
            chart("PMC", "pmc", "Memory colour"),
        ),
        (
            Entry(
                path="reflectance/test-color-samples.csv",
                title="CIE test colour samples 1 to 15, NIST CQS 7.4 and 9.0 samples (Munsell paints)",
                source="CIE 13.3 and CIE DS 7chm7z5h (2024); NIST CQS simulation 7.4 and 9.0 (Ohno, Davis)",
                licence=f"no licence stated with the spreadsheets; {CARRIER}",
                grid="360-830 and 380-780 nm at 5 nm",
                provenance="measured",
            ),
            test_samples(),
        ),
        (
            Entry(
                path="reflectance/color-evaluation-samples.csv",
                title="The 99 colour evaluation samples of CIE 224:2017 and ANSI/IES TM-30",
                source="CIE 224:2017: nature, skin, textiles, paints, plastics, prints, colour systems",
                licence=f"no licence stated with the data; {CARRIER}",
                grid="380-780 nm at 5 nm",
                provenance="measured",
                note="the CIE extrapolated samples that were measured from 400 to 700 nm only",
            ),
            evaluation_samples(),
        ),
        (
            Entry(
                path="reflectance/aces-training-patches.csv",
                title="Camera training patches of the Academy Color Encoding System",
                source="Dyer, Forsythe, Irons, Mansencal, Zhu 2017, RAW to ACES",
                licence=f"Apache-2.0 (rawtoaces-data); {CARRIER}",
                grid="380-780 nm at 5 nm",
                provenance="measured",
                note="surfaces unnamed; patches above 0.99 left out",
            ),
            training_patches(),
        ),
    ]
    for entry, rows in tables:
        write_table(HERE / entry.path, rows)
    return [replace(entry, count=len(rows)) for entry, rows in tables]


def build_observers() -> list[Entry]:
    """Write observers/*.csv: what colours of reflectances are computed with."""
    functions = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(colour.SpectralShape(360, 780, 5))
    rows = [
        row(axis, f"CIE 1931 {axis}-bar", "observer", functions.wavelengths, functions.values[:, index])
        for index, axis in enumerate("xyz")
    ]
    write_table(HERE / "observers" / "cie-1931-2-degree.csv", rows)
    write_table(HERE / "observers" / "alpha-opic.csv", alpha_opic())
    write_table(HERE / "observers" / "plants.csv", plants())
    return [
        Entry(
            path="observers/cie-1931-2-degree.csv",
            title="CIE 1931 colour-matching functions, 2 degrees",
            source="CIE 15:2018",
            licence=CIE_LICENCE,
            grid="360-780 nm at 5 nm",
            provenance="standard",
            count=len(rows),
        ),
        Entry(
            path="observers/alpha-opic.csv",
            title="α-opic action spectra: what light does to the five kinds of receptor in the eye",
            source="CIE S 026/E:2018, Table 2 (doi 10.25039/CIE.DS.vqqhzp5a): cones CIE 2006, 10 degrees; rods V'",
            licence=f"{CIE_LICENCE}, but for the melanopic row, whose numbers stand in databases/build.py",
            grid="380-780 nm at 5 nm (cones from 390)",
            provenance="standard",
            count=5,
            note="of energy, each with a peak of 1",
        ),
        Entry(
            path="observers/plants.csv",
            title="Relative quantum yield of photosynthesis in crop leaves, field and growth chamber",
            source="McCree 1972, Agricultural Meteorology 9, 191-216 (doi 10.1016/0002-1571(71)90022-7)",
            licence="facts",
            grid="350-725 nm at 25 nm",
            provenance="measured",
            count=2,
            note="of photons; means over the species",
        ),
    ]


def alpha_opic() -> list[TableRow]:
    """Rows of the five α-opic action spectra (CIE S 026/E:2018)."""
    cones = colour.MSDS_CMFS["Stockman & Sharpe 10 Degree Cone Fundamentals"].copy()
    cones.trim(colour.SpectralShape(390, 780, 5))
    grid = cones.wavelengths % 5 == 0
    rods = colour.SDS_LEFS["CIE 1951 Scotopic Standard Observer"].copy().trim(colour.SpectralShape(380, 780, 5))
    every = rods.wavelengths % 5 == 0
    rows = [
        row(f"{name}-cone", f"{name.upper()}-cone-opic", "receptor", cones.wavelengths[grid], cones.values[grid, index])
        for index, name in ((2, "s"), (1, "m"), (0, "l"))
    ]
    rows.append(row("rod", "Rhodopic", "receptor", rods.wavelengths[every], rods.values[every]))
    rows.append(row("melanopsin", "Melanopic", "receptor", MELANOPIC_NM, MELANOPIC))
    return rows


def plants() -> list[TableRow]:
    """Rows of McCree's mean action spectra."""
    return [
        row("mccree-field", "Crops grown in the field, mean", "photosynthesis", MCCREE_NM, MCCREE_FIELD),
        row("mccree-chamber", "Crops grown in chambers, mean", "photosynthesis", MCCREE_NM, MCCREE_CHAMBER),
    ]


def step_cell(gap_ev: float) -> tuple[FloatArray, FloatArray]:
    """Wavelengths and quantum efficiency of a model cell: 0.9 above its gap, falling over some 30 nm at it."""
    grid = np.arange(300.0, 1000.1, 10.0)
    return grid, 0.9 / (1.0 + np.exp((gap_ev - HC_OVER_Q_NM / grid) / 0.015))


def radiative_saturation(wavelengths: FloatArray, efficiency: FloatArray) -> float:
    """Saturation current density of a cell that loses light only by glowing, J0 = q ∫ EQE φ_bb dE [A/m²].

    Rau 2007, Phys. Rev. B 76, 085303, Eq. 3: with it a cell has the highest voltage that its efficiency allows.
    """
    energy = HC_OVER_Q_NM / wavelengths[::-1]  # [eV]
    kt = CELL_KELVIN * 8.617333262e-5  # [eV] Boltzmann's constant, CODATA 2018
    photons = 2 * np.pi * (energy * 1.602176634e-19) ** 2 / (6.62607015e-34**3 * 299792458.0**2) / np.expm1(energy / kt)
    # [1/(m² s J)] over a half space; dE in J cancels q in A
    return float(1.602176634e-19 * np.trapezoid(efficiency[::-1] * photons, energy * 1.602176634e-19))


def silicon() -> tuple[FloatArray, FloatArray, dict[str, str]]:
    """Crystalline silicon as pvlib has it: its response, and the circuit of the median module of its CEC list.

    pvlib's response is relative; it is scaled to the median module's short-circuit current under AM1.5G.
    """
    response = pvlib.spectrum.get_example_spectral_response(np.arange(300.0, 1190.1, 10.0))
    sun = pvlib.spectrum.get_reference_spectra(standard="ASTM G173-03")["global"]
    modules = pvlib.pvsystem.retrieve_sam("CECMod").T
    modules = modules[modules["Technology"] == "Mono-c-Si"]
    columns = ("A_c", "N_s", "I_sc_ref", "a_ref", "V_oc_ref", "R_s", "R_sh_ref", "I_L_ref")
    area, cells, current, slope, voltage, series, shunt, light = (modules[name].astype(float) for name in columns)
    density = float((current * cells / area).median())  # [A/m²] cells of a module are in series
    grid = np.asarray(response.index, dtype=np.float64)
    power = np.interp(grid, sun.index, sun.to_numpy())
    scale = density / np.trapezoid(response.to_numpy() * power, grid)
    efficiency = response.to_numpy() * scale * HC_OVER_Q_NM / grid
    step = float((slope / cells).median())  # [V] n k T / q of a cell
    open_circuit = float((voltage / cells).median())
    circuit = {
        "saturation_current_A_m2": f"{density / np.expm1(open_circuit / step):.4g}",
        "ideality": f"{step / (CELL_KELVIN * 8.617333262e-5):.4g}",
        "series_ohm_m2": f"{float((series * area / cells**2).median()):.4g}",
        "shunt_volt": f"{float((shunt * light / cells).median()):.4g}",
    }
    return grid, np.maximum(efficiency, 0.0), circuit


def build_cells() -> list[Entry]:
    """Write cells/*.csv: what part of the photons of each wavelength becomes current."""
    grid, efficiency, circuit = silicon()
    organic = "two semi-transparent organic cells"
    rows = [
        row("organic-green", f"Green one of the paper's {organic}", "organic", ASCA_NM, ASCA_GREEN,
            provenance="digitised", quantity="relative", area_cm2="36"),
        row("organic-blue", f"Blue one of the paper's {organic}", "organic", ASCA_NM, ASCA_BLUE,
            provenance="digitised", quantity="relative", area_cm2="36"),
        row("silicon", "Crystalline silicon, median module", "crystalline silicon", grid, efficiency,
            provenance="measured", quantity="efficiency", **circuit),
    ]  # fmt: skip
    for key, name, gap in (
        ("model-gaas", "Model: gap of gallium arsenide, 1.42 eV", 1.42),
        ("model-perovskite", "Model: gap of methylammonium lead iodide, 1.6 eV", 1.6),
        ("model-indoor", "Model: gap of 1.9 eV, near the best for white LEDs", 1.9),
    ):
        grid, efficiency = step_cell(gap)
        rows.append(
            row(key, name, "model", grid, efficiency, provenance="modelled", quantity="efficiency",
                saturation_current_A_m2=f"{radiative_saturation(grid, efficiency):.4g}", ideality="1")
        )  # fmt: skip
    write_table(HERE / "cells" / "cells.csv", rows)
    return [
        Entry(
            path="cells/cells.csv",
            title="Solar cells: external quantum efficiency, or absorption for the organic two",
            source="organic: paper, Figure 18, digitised at 15 wavelengths; silicon: pvlib's spectral response "
            "(Driesse, Stein 2020) and CEC module list; models: steps at the gap (databases/build.py)",
            licence=f"facts; pvlib {pvlib.__version__} is BSD-3-Clause; models BSD-3-Clause",
            grid="410-810 nm (organic), 300-1190 nm at 10 nm (silicon), 300-1000 nm at 10 nm (models)",
            provenance="digitised, measured or modelled, as each row says",
            count=len(rows),
            note="relative curves give currents only after a calibration; models are upper limits, no products",
        )
    ]


def build_sensors() -> list[Entry]:
    """Write sensors/as7265x.csv: which letter is which wavelength, on which die."""
    letters = "ABCDEFGHRISJTUVWKL"  # ascending wavelength
    dies = {"ABCDEF": "AS72653", "GHIJKL": "AS72652", "RSTUVW": "AS72651"}
    lines = ["channel,center_nm,fwhm_nm,die"]
    for letter, center in zip(letters, AS7265X_CENTERS_NM, strict=True):
        die = next(name for members, name in dies.items() if letter in members)
        lines.append(f"{letter},{center:g},{AS7265X_FWHM_NM:g},{die}")
    (HERE / "sensors").mkdir(exist_ok=True)
    write_whole(HERE / "sensors" / "as7265x.csv", "\n".join(lines) + "\n")
    return [
        Entry(
            path="sensors/as7265x.csv",
            title="Channels of the AS7265x: letter, centre, full width at half maximum, die",
            source="ams AS7265x datasheet DS000612",
            licence="facts",
            grid="410-940 nm, 18 channels",
            provenance="nominal (datasheet)",
            count=len(letters),
        )
    ]


def write_manifest(entries: Sequence[Entry]) -> None:
    """Write MANIFEST.toml and say what is in it."""
    lines = ["# Written by databases/build.py; every file, where it comes from, and under which licence.", ""]
    for entry in entries:
        digest = hashlib.sha256((HERE / entry.path).read_bytes()).hexdigest()
        fields = {
            "path": entry.path,
            "title": entry.title,
            "source": entry.source,
            "licence": entry.licence,
            "grid": entry.grid,
            "provenance": entry.provenance,
            "count": entry.count,
            "sha256": digest,
            "note": entry.note,
        }
        # A JSON string of printable text is a TOML basic string.
        lines += [
            "[[file]]",
            *(f"{key} = {json.dumps(value, ensure_ascii=False)}" for key, value in fields.items()),
            "",
        ]
        size = (HERE / entry.path).stat().st_size
        sys.stdout.write(f"{entry.path}: {entry.count} spectra, {size} bytes, {digest[:12]}\n")
    write_whole(HERE / "MANIFEST.toml", "\n".join(lines))


def main() -> None:
    """Write every file and the manifest."""
    for folder in ("lamps", "observers", "sensors", "reflectance", "cells"):
        (HERE / folder).mkdir(exist_ok=True)
    write_manifest([*build_reflectances(), *build_lamps(), *build_observers(), *build_sensors(), *build_cells()])


if __name__ == "__main__":
    main()
