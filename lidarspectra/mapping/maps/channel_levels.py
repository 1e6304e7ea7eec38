"""Light of a map by channel in words: how much, where next to none, and where the lamps' spectra tell nothing."""

from collections.abc import Sequence

import numpy as np
import xarray as xr

from lidarspectra.lamps.lamp_spectra import partly_known, unknown_channels
from lidarspectra.lamps.lamps import Lamp, is_daylight
from lidarspectra.mapping.maps.assumptions import named_lamps
from lidarspectra.mapping.maps.map_schema import UNKNOWN_CHANNELS, dark_bands, kept_points
from lidarspectra.spectra.spectrum import BandSet


def levels_in_words(light_map: xr.Dataset) -> str:
    """Means over the points that are not buried: of the darkest and the brightest channel, and of the illuminance.

    Channels with next to no light are named apart.
    """
    kept = light_map.isel(point=kept_points(light_map))
    mean = kept["irradiance"].mean("point").to_numpy()
    dark = dark_bands(kept)
    lit = mean[~dark]
    span = (f"{float(end):.3g}" for end in (lit.min(), lit.max())[: lit.size])
    words = f"mean {' to '.join(span)} W/m²/nm"
    if dark.any():
        words += f", next to none in {', '.join(map(str, light_map['band_label'].to_numpy()[dark]))} nm"
    return words + (f", {float(kept['illuminance'].mean()):.0f} lx" if "illuminance" in light_map else "")


def mark_partly_known(light_map: xr.Dataset, lamps: Sequence[Lamp], bands: BandSet) -> xr.Dataset:
    """The map with its attribute `UNKNOWN_CHANNELS`, if the lamps' spectra tell but a part of any (`partly_known`)."""
    labels = np.array(bands.labels)[partly_known([lamp.flux for lamp in lamps], bands)].tolist()
    return light_map.assign_attrs({UNKNOWN_CHANNELS: "\n".join(labels)}) if labels else light_map


def beyond_notes(lamps: Sequence[Lamp], bands: BandSet) -> tuple[str, ...]:
    """Notes on channels of which spectra of lamps tell nothing, since they end before them and still in light."""
    groups: dict[tuple[bool, tuple[float, float], tuple[str, ...]], list[str]] = {}
    for lamp in lamps:
        labels = tuple(np.array(bands.labels)[unknown_channels(lamp.flux, bands)].tolist())
        if labels:
            groups.setdefault((is_daylight(lamp), lamp.flux.range_nm, labels), []).append(lamp.name)
    return tuple(
        f"The spectrum of {named_lamps(tuple(names))} goes from {first:g} to {last:g} nm and not into the dark: what "
        f"comes of it in {'channel' if len(labels) == 1 else 'channels'} {', '.join(labels)} nm is not known. The map "
        "has there what the spectrum tells; its uncertainty reaches as far as light that goes on as at the end. "
        + ("Daylight is computed no farther." if of_sky else "Give a spectrum that reaches as far if it matters.")
        for (of_sky, (first, last), labels), names in groups.items()
    )
