"""Reflectance in coloured light: a spectral correction of the three-channel estimate.

Under light of the colour of its own surroundings (an orange wall in a corner of orange walls) a surface reflects a
larger share of what a cone sees than under daylight: light and reflectance are high at the same wavelengths. The
apparent reflectance of a cone of response s is

    ρ' = ∫ s ρ E dλ / ∫ s E dλ          against          ρ = ∫ s ρ D65 dλ / ∫ s D65 dλ,

by up to 50 %. The spectra come from the estimates so far: reflectances by colour matching, light by iterating the
radiosity equation; only the ratio ρ'/ρ is taken from them, so that their errors have little influence.

References
----------
CIE 159:2004 for the cones (see `sharpened_cones`). Worthey, Brill (1986) Heuristic analysis of von Kries color
constancy, JOSA A 3, 1708 (why overlapping cones err).
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, csr_array
from scipy.spatial import cKDTree

from lidarspectra.arrays import FloatArray
from lidarspectra.material.delighting.sharpened_cones import CONES_FROM_XYZ
from lidarspectra.material.k_means import k_means
from lidarspectra.material.matching import match_color
from lidarspectra.spectra.colorimetry import lab_to_xyz, linear_srgb_to_lab
from lidarspectra.spectra.reflectance_library import ReflectanceLibrary
from lidarspectra.spectra.spectrum import Spectrum, uniform_bands

PALETTE = 32  # colours whose spectra are looked up
PALETTE_DIGITS = 3  # decimals of L*a*b* that tell colours apart
PALETTE_POINTS = 2_000  # that K-means is run on
THINNED = slice(8, 69, 4)  # of `COLOR_GRID_NM`: 400 to 700 nm in steps of 20 nm
BANDS = uniform_bands(390.0, 710.0, 16)  # [nm] about these wavelengths
REFLECTIONS = 4  # after which the light's colour has settled
RATIO_RANGE = (0.5, 2.0)  # [1] of ρ'/ρ; outside it the spectra are unreliable
MIN_LIGHT = 1e-9  # [1] of the mean direct light
SEED = 20240902  # of K-means


@dataclass(frozen=True, kw_only=True, eq=False)
class Exchange:
    """Light exchange between samples and faces.

    Parameters
    ----------
    seen : (sample, face + 1) sparse float
        See `light_exchange.exchange_matrix`.
    spread : (face, sample) sparse float
        From the samples to the faces, rows summing to 1.
    direct : (sample, wavelength) float
        Direct light in `BANDS`. [any]
    """

    seen: csr_array
    spread: csr_array
    direct: FloatArray


def apparent_ratio(
    sample_color: FloatArray,
    face_color: FloatArray,
    exchange: Exchange,
    library: ReflectanceLibrary,
    daylight: Spectrum,
) -> FloatArray:
    """Ratio of apparent to daylight reflectance in each cone, at every sample.

    Parameters
    ----------
    sample_color, face_color : (sample, 3), (face, 3) float
        Reflectance so far, linear sRGB. Faces that send no light but their own have 0. [0-1]
    exchange : Exchange
    library : ReflectanceLibrary
        Where spectra are matched.
    daylight : Spectrum
        D65. [any]

    Returns
    -------
    ratio : (sample, 3) float
        ρ'/ρ. [1]
    """
    centers, spectra = _palette(sample_color, library)
    tree = cKDTree(centers)
    sample_spectra = spectra[tree.query(linear_srgb_to_lab(sample_color))[1]]
    face_spectra = spectra[tree.query(linear_srgb_to_lab(face_color))[1]]
    face_spectra = face_spectra * (face_color.max(axis=1) > 0)[:, None]
    light, seen = exchange.direct, csc_array(exchange.seen[:, :-1])  # products by columns take half the time
    for _ in range(REFLECTIONS):
        sent = face_spectra * (exchange.spread @ light)
        light = exchange.direct + seen @ sent
    sensitivity = (library.weights @ CONES_FROM_XYZ.T)[THINNED]
    relative = light / BANDS.band_values(daylight, outside="nearest")
    apparent = ((sample_spectra * relative) @ sensitivity) / np.maximum(relative @ sensitivity, MIN_LIGHT)
    plain = (sample_spectra @ sensitivity) / sensitivity.sum(axis=0)
    return np.asarray(np.clip(apparent / plain, *RATIO_RANGE), dtype=np.float64)


def _palette(color: FloatArray, library: ReflectanceLibrary) -> tuple[FloatArray, FloatArray]:
    """(palette, 3) colours in L*a*b* that stand for (n, 3) linear ones, and their (palette, band) reflectances."""
    lab = linear_srgb_to_lab(color)
    some = lab[:: max(1, len(lab) // PALETTE_POINTS)].round(PALETTE_DIGITS)  # round-off makes no colours
    centers = k_means(some, min(PALETTE, len(np.unique(some, axis=0))), seed=SEED).centers
    spectra = [match_color(np.maximum(lab_to_xyz(center), 0.0), library).spectrum for center in centers]
    return centers, np.stack([BANDS.band_values(spectrum, outside="nearest") for spectrum in spectra])
