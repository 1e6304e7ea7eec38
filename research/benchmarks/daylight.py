"""The clear sky held against two other sources: genssky's sun and sky, SPECTRL2's, and a Monte Carlo of photons.

SPECTRL2 (Bird and Riordan 1986, in pvlib) is a simple spectral model fitted to rigorous ones and to measurements. All
are given the same place, time, ground and aerosol optical depth. Printed are the irradiances from 380 to 780 nm, of the
sun on a plane that faces it and of the sky alone on level ground, with the sky's worst 20 nm bins; then the sky's
light over the sun's, both on level ground, at some wavelengths, where a plain Monte Carlo through a plane-parallel
atmosphere of molecules and aerosol judges between the two; and the overcast sky's luminance over the zenith's, beside
the CIE standard. `compute_sky` scales the clear sky to SPECTRL2 (`clear_sky`).

    python -m research.benchmarks.daylight

The first time it computes the tables of the air's scattering, which takes a minute or more of two cores.

References
----------
Fröhlich and Shaw, New determination of Rayleigh scattering in the terrestrial atmosphere, Applied Optics 19, 1980 (the
molecules' optical depth). Henyey and Greenstein, Astrophysical Journal 93, 1941 (the aerosol's lobe).
"""

import tempfile
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from platformdirs import user_cache_path

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.radiance.engine.engine import find_engine
from lidarspectra.radiance.scene.clear_sky import ANGSTROM_EXPONENT, BIN_NM, spectrl2_light
from lidarspectra.radiance.scene.sky import (
    ALTITUDES_DEG,
    SKY_WAVELENGTHS_NM,
    Daylight,
    Sky,
    cie_overcast,
    compute_sky,
    genssky_clear_sky,
)

PLACE = {"latitude_deg": 48.0, "longitude_deg": 11.0}
HOURS_UTC = (11, 15, 17, 18)  # [h] of 21 June
JUDGED_NM = (390.0, 450.0, 550.0, 670.0)  # [nm]
PHOTONS = 100_000  # the sky's share comes out within 1 %
SCATTERING_ALBEDO, ASYMMETRY = 0.92, 0.65  # [1] of continental aerosol in the visible
MAX_EVENTS = 200  # scatterings and reflections of a photon; after 60 less than 1e-6 of them are left


def atmosphere_light(
    wavelength_nm: float,
    *,
    sun_sine: float,
    aerosol_optical_depth: float,
    ground_reflectance: float,
    generator: np.random.Generator,
    photons: int = PHOTONS,
) -> tuple[float, float]:
    """Sky's and sun's light on level ground under a plane-parallel atmosphere, each over what enters it at the top [1].

    Photons fly free paths in optical depth, are scattered by molecules (Rayleigh) or aerosol (Henyey-Greenstein), and
    come back from the ground as from a Lambertian surface. Ozone and other absorbers are left out: they take from both.
    """
    micrometres = wavelength_nm / 1000.0
    molecules = 0.00864 * micrometres ** -(3.916 + 0.074 * micrometres + 0.05 / micrometres)
    depth = molecules + aerosol_optical_depth * (wavelength_nm / 550.0) ** -ANGSTROM_EXPONENT
    below = np.zeros(photons)  # optical depth above each photon
    direction = np.tile([np.sqrt(1.0 - sun_sine**2), 0.0, -sun_sine], (photons, 1))
    weight, scattered, flying = np.ones(photons), np.zeros(photons, dtype=bool), np.ones(photons, dtype=bool)
    sky = sun = 0.0
    for _ in range(MAX_EVENTS):
        which = np.flatnonzero(flying)
        if not which.size:
            break
        place = below[which] + np.log(generator.random(which.size)) * direction[which, 2]
        landed, gone = place > depth, place < 0
        flying[which[gone]] = False
        ground = which[landed]
        sky += float(weight[ground][scattered[ground]].sum())
        sun += float(weight[ground][~scattered[ground]].sum())
        weight[ground] *= ground_reflectance
        below[ground] = depth
        direction[ground] = _turned(
            np.tile([0.0, 0.0, 1.0], (ground.size, 1)), np.sqrt(generator.random(ground.size)), generator
        )
        inside = ~landed & ~gone
        air = which[inside]
        below[air] = place[inside]
        by_molecule = generator.random(air.size) < molecules / depth
        weight[air] *= np.where(by_molecule, 1.0, SCATTERING_ALBEDO)
        direction[air] = _turned(direction[air], _scattering_cosines(by_molecule, generator), generator)
        scattered[which[inside | landed]] = True
    return sky / photons, sun / photons


def _scattering_cosines(by_molecule: BoolArray, generator: np.random.Generator) -> FloatArray:
    """Cosine of the angle of each scattering, drawn from its phase function by inversion."""
    drawn = generator.random(by_molecule.size)
    root = 2.0 * (2.0 * drawn - 1.0)
    wide = np.hypot(root, 1.0)
    rayleigh = np.cbrt(root + wide) + np.cbrt(root - wide)
    part = (1.0 - ASYMMETRY**2) / (1.0 - ASYMMETRY + 2.0 * ASYMMETRY * drawn)
    aerosol = (1.0 + ASYMMETRY**2 - part**2) / (2.0 * ASYMMETRY)
    return np.clip(np.where(by_molecule, rayleigh, aerosol), -1.0, 1.0)


def _turned(direction: FloatArray, cosine: FloatArray, generator: np.random.Generator) -> FloatArray:
    """Directions at an angle to the given ones, turned about them evenly."""
    helper = np.where(np.abs(direction[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    first = np.cross(direction, helper)
    first /= np.linalg.norm(first, axis=1)[:, None]
    second = np.cross(direction, first)
    turn, sine = 2.0 * np.pi * generator.random(cosine.size), np.sqrt(1.0 - cosine**2)
    aside = np.cos(turn)[:, None] * first + np.sin(turn)[:, None] * second
    turned: FloatArray = np.asarray(cosine[:, None] * direction + sine[:, None] * aside, dtype=np.float64)
    return turned


def sky_part(sky: Sky) -> FloatArray:
    """(wavelength,) horizontal irradiance of the sky alone [W/m²/nm]."""
    return replace(sky, sun_direction=None).horizontal_irradiance


def clear_rows(day: Daylight, sky: Sky) -> tuple[str, list[str]]:
    """A row of the table of totals, and rows of that by wavelength."""
    if sky.sun_direction is None:
        raise ValueError("the sun is down")
    sun, diffuse, altitude = spectrl2_light(day)
    ours, sine = sky_part(sky), float(sky.sun_direction[2])
    ratio = ours / diffuse - 1
    low, high = int(ratio.argmin()), int(ratio.argmax())
    total = (
        f"| {altitude:.0f}° | {BIN_NM * sky.sun_irradiance.sum():.0f} | {BIN_NM * sun.sum():.0f} "
        f"| {100 * (sky.sun_irradiance.sum() / sun.sum() - 1):+.0f} % "
        f"| {BIN_NM * ours.sum():.1f} | {BIN_NM * diffuse.sum():.1f} | {100 * (ours.sum() / diffuse.sum() - 1):+.0f} % "
        f"| {100 * ratio[low]:+.0f} % at {SKY_WAVELENGTHS_NM[low]:.0f} nm, "
        f"{100 * ratio[high]:+.0f} % at {SKY_WAVELENGTHS_NM[high]:.0f} nm |"
    )
    judged = []
    for wavelength in JUDGED_NM:
        index = int(np.abs(SKY_WAVELENGTHS_NM - wavelength).argmin())
        of_sky, of_sun = atmosphere_light(
            wavelength,
            sun_sine=sine,
            aerosol_optical_depth=day.aerosol_optical_depth,
            ground_reflectance=day.ground_reflectance,
            generator=np.random.default_rng(1),
        )
        genssky, spectrl2 = ours[index] / sky.sun_irradiance[index] / sine, diffuse[index] / sun[index] / sine
        judged.append(
            f"| {altitude:.0f}° | {wavelength:.0f} nm | {of_sky / of_sun:.3f} | {spectrl2:.3f} | {genssky:.3f} |"
        )
    return total, judged


def main() -> None:
    """Print the tables."""
    engine, atmosphere = find_engine(), user_cache_path("lidarspectra") / "atmosphere"
    judged: list[str] = []
    print("| sun's altitude | sun, genssky | SPECTRL2 | | sky, genssky | SPECTRL2 | | sky's worst bins |")
    print("|---|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as name:
        for hour in HOURS_UTC:
            day = Daylight(**PLACE, time=datetime(2024, 6, 21, hour, tzinfo=UTC))
            total, rows = clear_rows(day, genssky_clear_sky(day, Path(name) / f"{hour}", engine, atmosphere=atmosphere))
            print(total)
            judged += rows
        day = Daylight(**PLACE, time=datetime(2024, 6, 21, HOURS_UTC[0], tzinfo=UTC), cloud_cover=1.0)
        overcast = compute_sky(day, Path(name) / "overcast", engine, atmosphere=atmosphere)
    print("\n| sun's altitude | sky over sun | Monte Carlo | SPECTRL2 | genssky |\n|---|---|---|---|---|")
    print("\n".join(judged))
    print("\n| altitude | overcast sky over its zenith | CIE |\n|---|---|---|")
    rings = overcast.radiance.mean(axis=(0, 2))
    for altitude in (0.01, 7.51, 12.5, 32.5, 62.5, 90.0):
        index = int(np.abs(ALTITUDES_DEG - altitude).argmin())
        standard = float(cie_overcast(ALTITUDES_DEG[index : index + 1])[0])
        print(f"| {ALTITUDES_DEG[index]:.1f}° | {rings[index] / rings[-1]:.3f} | {standard:.3f} |")


if __name__ == "__main__":
    main()
