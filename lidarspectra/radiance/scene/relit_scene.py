"""A scene for lamps of another flux or spectrum than it was written with, without writing it again.

What a scene's octrees hold is what its lamps send in a written flux; contributions are divided by it, and the true flux
comes in afterwards (`RadianceScene.slot_flux`). So another flux is exact. Another spectrum is exact but for the
reflectances within a slot, which are weighed by the light that was written; how much that costs is predicted.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.lamps.lamp_spectra import DARK_CHANNEL
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.radiance.scene.scene_record import RadianceScene
from lidarspectra.radiance.scene.slots import MAX_OWN_ERROR
from lidarspectra.spectra.spectrum import Spectrum

ROUND_OFF = 1e-12  # [1] relative difference of ratios that are one number


def flux_ratio(before: Spectrum, after: Spectrum) -> float | None:
    """Factor between two fluxes of one spectrum [1]; None where they are of two spectra."""
    if not np.array_equal(before.wavelengths_nm, after.wavelengths_nm):
        return None
    if np.array_equal(before.values, after.values):
        return 1.0
    lit = before.values > 0
    if np.any(after.values[~lit] != 0):
        return None
    ratios = after.values[lit] / before.values[lit]
    factor = float(np.median(ratios))
    return factor if factor > 0 and np.all(np.abs(ratios - factor) <= ROUND_OFF * factor) else None


def relit_scene(scene: RadianceScene, written: Sequence[Lamp], present: Sequence[Lamp]) -> RadianceScene:
    """The scene with its lamps' present names and flux.

    Parameters
    ----------
    scene : RadianceScene
    written : sequence of Lamp
        As the scene was written with.
    present : sequence of Lamp
        The same lamps in the same places and order, with other names, fluxes or spectra.

    Returns
    -------
    scene : RadianceScene
        The same object where nothing differs. `slots.error` counts what another spectrum costs.
    """
    slot_flux, error = scene.slot_flux.copy(), scene.slots.error.copy()
    for row, (before, after) in enumerate(zip(written, present, strict=True)):
        ratio = flux_ratio(before.flux, after.flux)
        if ratio is None:
            slot_flux[row] = scene.slots.bands.band_values(after.flux, outside="zero")
            error = np.maximum(error, np.abs(relighting_error(scene, row, after.flux)))
        else:
            slot_flux[row] *= ratio
    names = tuple(lamp.name for lamp in present)
    if names == scene.lamp_names and np.array_equal(slot_flux, scene.slot_flux):
        return scene
    return replace(scene, slots=replace(scene.slots, error=error), slot_flux=slot_flux, lamp_names=names)


def relighting_error(scene: RadianceScene, row: int, flux: Spectrum) -> FloatArray:
    """Predicted relative error of a channel's reflected light if a lamp has another spectrum than was written.

    Parameters
    ----------
    scene : RadianceScene
    row : int
        The lamp's number.
    flux : Spectrum
        Its new spectral flux. [W/nm]

    Returns
    -------
    error : (band,) float
        Signed; see `reflected_light_error`. [1]
    """
    return reflected_light_error(
        power=flux.means(scene.slots.bands.wavelengths_nm),
        weights=scene.slots.bands.weights,
        matrix=scene.slots.matrix,
        mean_reflectance=scene.slots.mean_reflectance,
        slot_reflectance=scene.slot_reflectance[row],
    )


def largest_error(scene: RadianceScene) -> float:
    """Up to which predicted error a scene may be relit: what a new one would be allowed, or has here already [1]."""
    return max(MAX_OWN_ERROR, float(np.abs(scene.slots.error).max(initial=0.0)))


def knows_reflectances(scene: RadianceScene) -> bool:
    """Whether the scene says by which reflectances other spectra can be judged; those of early versions do not."""
    return bool(scene.slots.mean_reflectance.any())


def reflected_light_error(
    *,
    power: FloatArray,
    weights: FloatArray,
    matrix: FloatArray,
    mean_reflectance: FloatArray,
    slot_reflectance: FloatArray,
) -> FloatArray:
    """Relative error of the light of an integrating sphere whose reflectances another lamp has weighed.

    In a sphere of reflectance ρ̄(λ) reflected light is proportional to ρ̄/(1 - ρ̄). The error compares its value from
    the slots, whose reflectances are weighed by the traced lamp's spectrum, with the integral over wavelength.

    Parameters
    ----------
    power : (wavelength,) float
        Spectral flux of the lamp. [W/nm]
    weights : (slot, wavelength) float
        Quadrature weights of the slots' responses.
    matrix : (slot, band) float
        Shares of the slots in the channels. [1]
    mean_reflectance : (wavelength,) float
        ρ̄ of the room's area. [1]
    slot_reflectance : (slot,) float
        The same as the traced lamp has weighed it. [1]

    Returns
    -------
    error : (band,) float
        Signed; 0 in channels that the lamp hardly lights. [1]
    """
    truth = (weights @ (power * mean_reflectance / (1.0 - mean_reflectance))) @ matrix
    found = ((weights @ power) * slot_reflectance / (1.0 - slot_reflectance)) @ matrix
    sent = (weights @ power) @ matrix
    lit = (sent > DARK_CHANNEL * sent.max(initial=0.0)) & (truth > 0)
    return np.where(lit, found / np.where(lit, truth, 1.0) - 1.0, 0.0)
