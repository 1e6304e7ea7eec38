"""How far a few channels suffice for light for people and plants: error against the whole spectrum.

    python -m research.benchmarks.photometry [--surfaces 24] [--out FOLDER]

Protocol: every lamp of the built-in databases (equal-energy light left out), straight, halved with and wholly thrown
back by surfaces of the built-in library, taken evenly from dark to bright. Of each spectrum the whole is known at 1 nm;
the channels read it through their responses, without noise. Three ways back: 'lines' (straight lines between the
channels), 'learned' (weights on the channels, fitted without the lamp that they are tried on), 'lamps' (each lamp's
spectrum is known and the channels tell what the room did to it, as in a map from a run). Told is what the absolute
error stays below for half and for 95 % of the spectra of a kind of lamp.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.mapping.figures.tables import Table, save_table, table_markdown
from lidarspectra.mapping.photometry.channel_color import channel_color, tristimulus_responses
from lidarspectra.mapping.photometry.channel_estimate import KINDS, Method, channel_estimate
from lidarspectra.mapping.photometry.color_quality import (
    COLOR_GRID_NM,
    ColorQuality,
    color_quality,
    temperature_of_tristimulus,
)
from lidarspectra.mapping.photometry.indoor_spectra import GRID_NM, IndoorSpectra, indoor_spectra
from lidarspectra.mapping.photometry.point_light import LampShare, PointLight
from lidarspectra.mapping.photometry.quantities import light_quantities
from lidarspectra.spectra.sensor_files import find_bands
from lidarspectra.spectra.spectrum import BandSet, Spectrum

DEVICES = ("as7265x-14", "as7265x-18", "full-spectrum")
METHODS: tuple[Method, ...] = ("lines", "learned", "lamps")
COLOR_DEVICES = ("as7265x-14", "full-spectrum")
COLOR_EVERY = 31  # of the ensemble: colour rendering takes 50 ms a spectrum


def integral_table(ensemble: IndoorSpectra, device: str) -> Table:
    """Quantities that are integrals: one line a quantity and method."""
    bands = find_bands(device, Path.cwd())
    rows = []
    for quantity in light_quantities():
        if quantity.name.endswith("_irradiance_W_m2"):
            continue  # the same error as its EDI
        for method in METHODS:
            found = channel_estimate(ensemble, bands, quantity.response, method=method)
            rows.append(
                (quantity.words, method, *(_pair(found.relative_errors[found.category == kind]) for kind in KINDS))
            )
    caption = f"{device}: relative error, half / 95 % of {len(ensemble.values)} spectra stay below [%]."
    return Table(
        name=f"integrals-{device}", caption=caption, frame=pd.DataFrame(rows, columns=["quantity", "way", *KINDS])
    )


def color_table(ensemble: IndoorSpectra, device: str, chosen: IntArray, truth: ColorQuality) -> Table:
    """Colour temperature and rendering, which are no integrals: one line a number and method."""
    bands = find_bands(device, Path.cwd())
    white = np.isfinite(truth.cct_k)
    rows = []
    for method in ("lines", "lamps"):
        light = _light(ensemble, bands, chosen) if method == "lamps" else None
        spectra = _by_lamps(light, ensemble, chosen) if light else _by_lines(ensemble, bands, chosen)
        found = color_quality(spectra)
        for words, name, scale in (
            ("CCT [K]", "cct_k", 1.0),
            ("Duv [0.001]", "duv", 1e3),
            ("Ra [1]", "cri_ra", 1.0),
            ("TM-30 Rf [1]", "tm30_rf", 1.0),
            ("TM-30 Rg [1]", "tm30_rg", 1.0),
        ):
            off = scale * (_field(found, name) - _field(truth, name))
            cells = [_pair_of(off[white & (ensemble.category[chosen] == kind)]) for kind in KINDS]
            rows.append((words, method, *cells))
    told = channel_color(ensemble, bands, method="learned")
    kelvin, duv = temperature_of_tristimulus(_learned_tristimulus(ensemble, bands)[chosen])
    for words, off in (("CCT [K]", kelvin - truth.cct_k), ("Duv [0.001]", 1e3 * (duv - truth.duv))):
        cells = [_pair_of(off[white & (ensemble.category[chosen] == kind)]) for kind in KINDS]
        rows.append((words, "learned", *cells))
    print(f"{device}: colour temperature by learned weights, 95 % of all: {told.cct_error_percent:.1f} %")
    caption = f"{device}: absolute error, half / 95 % of {int(white.sum())} spectra that are white stay below."
    return Table(name=f"colour-{device}", caption=caption, frame=pd.DataFrame(rows, columns=["number", "way", *KINDS]))


def _learned_tristimulus(ensemble: IndoorSpectra, bands: BandSet) -> FloatArray:
    """(spectrum, 3) X, Y, Z by weights that were fitted without the spectrum's lamp."""
    values = [
        ensemble.weigh(response) * (1.0 + channel_estimate(ensemble, bands, response).relative_errors)
        for response in tristimulus_responses()
    ]
    return np.stack(values, axis=1)


def _by_lines(ensemble: IndoorSpectra, bands: BandSet, chosen: IntArray) -> FloatArray:
    values = ensemble.band_values(bands)[chosen]
    light = PointLight(centers_nm=bands.centers_nm, irradiance=values, irradiance_se=np.zeros_like(values))
    return light.spectra(COLOR_GRID_NM)


def _light(ensemble: IndoorSpectra, bands: BandSet, chosen: IntArray) -> list[PointLight]:
    """Light of every lamp of the ensemble that is among the chosen spectra."""
    factors, values = ensemble.band_factors(bands)[chosen], ensemble.band_values(bands)[chosen]
    lights = []
    for number in range(len(ensemble.names)):
        own = ensemble.lamp[chosen] == number
        flux = Spectrum(wavelengths_nm=GRID_NM, values=ensemble.lamps[number])
        lights.append(
            PointLight(
                centers_nm=bands.centers_nm,
                irradiance=values[own],
                irradiance_se=np.zeros_like(values[own]),
                lamps=(LampShare(flux=flux, coefficient=factors[own]),),
            )
        )
    return lights


def _by_lamps(lights: Sequence[PointLight], ensemble: IndoorSpectra, chosen: IntArray) -> FloatArray:
    spectra = np.empty((chosen.size, COLOR_GRID_NM.size))
    for number, light in enumerate(lights):
        spectra[ensemble.lamp[chosen] == number] = light.spectra(COLOR_GRID_NM)
    return spectra


def _field(quality: ColorQuality, name: str) -> FloatArray:
    return np.asarray(getattr(quality, name), dtype=np.float64)


def _pair(relative: FloatArray) -> str:
    return _pair_of(100.0 * relative)


def _pair_of(off: FloatArray) -> str:
    known = np.abs(off[np.isfinite(off)])
    if not known.size:
        return "none"
    half, most = np.percentile(known, [50.0, 95.0])
    return f"{half:.2g} / {most:.2g}" if most < 100 else f"{half:.0f} / {most:.0f}"


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--surfaces", type=int, default=24, help="taken from the library")
    parser.add_argument("--out", type=Path, default=Path("photometry-results"))
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    ensemble = indoor_spectra(arguments.surfaces)
    kinds = ", ".join(f"{ensemble.categories.count(kind)} {kind}" for kind in KINDS)
    print(f"{len(ensemble.names)} lamps ({kinds}), {len(ensemble.values)} spectra")
    chosen = np.arange(0, len(ensemble.values), COLOR_EVERY)
    truth = color_quality(ensemble.values[chosen][:, np.isin(GRID_NM, COLOR_GRID_NM)])
    tables = [integral_table(ensemble, device) for device in DEVICES]
    tables += [color_table(ensemble, device, chosen, truth) for device in COLOR_DEVICES]
    for table in tables:
        save_table(table, arguments.out)
        print(f"\n{table.caption}\n\n{table_markdown(table)}", flush=True)


if __name__ == "__main__":
    main()
