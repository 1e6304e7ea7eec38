"""A transport for lamps of another flux or spectrum than were traced (docs/concepts.md, Eq. 3)."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from lidarspectra.radiance.sampling.folding import with_slot_flux
from lidarspectra.radiance.sampling.stated_error import opening_stated, stated_error
from lidarspectra.radiance.sampling.transport import standard_error_of_sum
from lidarspectra.radiance.scene.scene_record import RadianceScene

SAME_SHAPE = 1e-9  # [1] relative difference of fluxes in slots that are those of one spectrum


def relit_transport(transport: xr.Dataset, scene: RadianceScene) -> xr.Dataset:
    """The transport under the lamps of a relit scene.

    Coefficients stay as they were traced where a lamp's flux alone differs, and are folded anew from their slots where
    its spectrum does. Errors, and what is stated of them, are those of the present light.

    Parameters
    ----------
    transport : xarray.Dataset
        Traced in the scene before it was relit.
    scene : RadianceScene
        `relit_scene`'s, of the same lamps in the same order.

    Returns
    -------
    transport : xarray.Dataset
        The same object where nothing differs.
    """
    names = [str(name) for name in transport["lamp"].to_numpy()]
    traced = transport["flux"].transpose("lamp", "band").to_numpy().astype(np.float64)
    if list(scene.lamp_names) != names:
        transport = transport.assign_coords(lamp=("lamp", list(scene.lamp_names), transport["lamp"].attrs))
    if np.array_equal(traced, scene.flux):
        return transport
    if "slot_coefficient" in transport:
        slot_flux = transport["slot_flux"].transpose("lamp", "slot").to_numpy()
        for row, (before, after) in enumerate(zip(slot_flux, scene.slot_flux, strict=True)):
            if not np.allclose(before * after.sum(), after * before.sum(), rtol=SAME_SHAPE, atol=0.0):
                transport = with_slot_flux(transport, row, after)
        transport = transport.assign(slot_flux=(("lamp", "slot"), scene.slot_flux, transport["slot_flux"].attrs))
    error = standard_error_of_sum(transport, scene.flux)
    changed: dict[str, tuple[tuple[str, ...], NDArray[np.floating]]] = {
        "flux": (("lamp", "band"), scene.flux),
        "irradiance_se": (("point", "band"), error.astype(np.float32)),
    }
    if "slot_error" in transport:
        changed["slot_error"] = (("band",), scene.slots.error)
    for name in ("truncation", "opening"):
        if f"{name}_coefficient" in transport:
            estimate = transport[f"{name}_coefficient"].transpose("lamp", "point", "band").to_numpy()
            light = np.einsum("lpb,lb->pb", estimate, scene.flux, dtype=np.float64)
            changed[name] = (("point", "band"), light.astype(np.float32))
    relit = transport.assign({name: (dims, values, transport[name].attrs) for name, (dims, values) in changed.items()})
    return _restated(relit, scene)


def _restated(transport: xr.Dataset, scene: RadianceScene) -> xr.Dataset:
    """With attributes that state the error of the present light."""
    buried = transport["buried"].to_numpy().astype(np.bool_)
    coefficient = transport["coefficient"].transpose("lamp", "point", "band").to_numpy()
    irradiance = np.einsum("lpb,lb->pb", coefficient, scene.flux, dtype=np.float64)
    counted = ~buried if not buried.all() else np.ones(buried.size, dtype=np.bool_)
    stated, missed = stated_error(
        irradiance=irradiance,
        irradiance_se=transport["irradiance_se"].transpose("point", "band").to_numpy(),
        truncation=transport["truncation"].transpose("point", "band").to_numpy() if "truncation" in transport else None,
        slot_error=scene.slots.error,
        counted=counted,
        target=float(transport.attrs["target_relative_se"]),
        each_point=transport.attrs.get("noise_of") == "point",
    )
    if missed is not None:
        transport = transport.assign(missed_target=("point", missed, transport["missed_target"].attrs))
    if "opening" in transport:
        opening = transport["opening"].transpose("point", "band").to_numpy().astype(np.float64)
        stated |= opening_stated(opening, irradiance, counted)
    return transport.assign_attrs(stated)
