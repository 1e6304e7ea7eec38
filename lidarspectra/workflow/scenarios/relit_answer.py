"""What changed lamps do to a room, in words and tables: before and after, the illuminance first."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.lamps.lamp_spectra import DARK_CHANNEL, luminous_flux_lm
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.maps.interpolation import point_planes
from lidarspectra.mapping.maps.map_schema import kept_points
from lidarspectra.mapping.maps.visible_bands import covers_vision
from lidarspectra.mapping.photometry.point_light import PointLight
from lidarspectra.mapping.photometry.quantities import light_quantity
from lidarspectra.words import counted

ALSO = ("melanopic_edi_lx", "ppfd_umol_m2_s")  # quantities beside the illuminance
AS_TRACED, NOW, CHANGE = "as traced", "now", "change [%]"


def answer_table(before: PointLight, after: PointLight, places: xr.Dataset) -> Table:
    """Light before and after, over the points that are not buried.

    Parameters
    ----------
    before, after : PointLight
        At the points of `places`.
    places : xarray.Dataset
        The map, with `buried`.

    Returns
    -------
    table : Table
        Illuminance, its uniformity, melanopic EDI and PPFD where the channels cover V(λ); the mean irradiance always.
    """
    kept = kept_points(places)
    rows: list[tuple[str, float, float]] = []
    if covers_vision(before.centers_nm):
        was, now = (_values(light, "illuminance_lx")[kept] for light in (before, after))
        rows += [
            ("mean illuminance [lx]", float(was.mean()), float(now.mean())),
            ("lowest illuminance [lx]", float(was.min()), float(now.min())),
            ("highest illuminance [lx]", float(was.max()), float(now.max())),
            (f"uniformity U0, lowest over mean{_mixed(places)} [1]", _uniformity(was), _uniformity(now)),
        ]
        for name in ALSO:
            quantity = light_quantity(name)
            means = [float(_values(light, name)[kept].mean()) for light in (before, after)]
            rows.append((f"mean {quantity.words} [{quantity.unit}]", means[0], means[1]))
    irradiance = [1e3 * float(light.irradiance[kept].mean()) for light in (before, after)]
    rows.append(("mean irradiance over the channels [mW/m²/nm]", irradiance[0], irradiance[1]))
    frame = pd.DataFrame(rows, columns=["light", AS_TRACED, NOW])
    frame[CHANGE] = changes_percent(frame[AS_TRACED].to_numpy(), frame[NOW].to_numpy())
    formats = {AS_TRACED: ".3g", NOW: ".3g", CHANGE: "+.1f"}
    return Table(
        name="answer",
        caption=f"Light at {counted(kept.size, 'point')}, before and after.",
        frame=frame,
        formats=formats,
    )


def lamps_table(before: Sequence[Lamp], after: Sequence[tuple[str, float, float]]) -> Table:
    """Flux and spectrum of every lamp before and after.

    Parameters
    ----------
    before : sequence of Lamp
    after : sequence of (str, float, float)
        For each: its spectrum's name, its full flux [lm] and its dimming [1].
    """
    rows = [
        (lamp.name, luminous_flux_lm(lamp.flux), dim * lumens, lamp.flux.name, spectrum)
        for lamp, (spectrum, lumens, dim) in zip(before, after, strict=True)
    ]
    columns = ["lamp", "as traced [lm]", "now [lm]", "spectrum as traced", "spectrum now"]
    formats = {"as traced [lm]": ".0f", "now [lm]": ".0f"}
    frame = pd.DataFrame(rows, columns=columns)
    return Table(name="lamps", caption="The lamps, before and after.", frame=frame, formats=formats)


def channels_table(before: PointLight, after: PointLight, places: xr.Dataset) -> Table:
    """Mean irradiance of every channel before and after, over the points that are not buried.

    A channel that was dark beside the brightest has no change: of nothing it would be any.
    """
    kept = kept_points(places)
    means = [1e3 * light.irradiance[kept].mean(axis=0) for light in (before, after)]
    columns = {"channel [nm]": before.centers_nm, "as traced [mW/m²/nm]": means[0], "now [mW/m²/nm]": means[1]}
    lit = np.where(means[0] > DARK_CHANNEL * means[0].max(), means[0], 0.0)
    frame = pd.DataFrame({**columns, CHANGE: changes_percent(lit, means[1])})
    formats = {"channel [nm]": "g", "as traced [mW/m²/nm]": ".3g", "now [mW/m²/nm]": ".3g", CHANGE: "+.1f"}
    return Table(name="channels", caption="Mean irradiance by channel, before and after.", frame=frame, formats=formats)


def changes_percent(before: FloatArray, after: FloatArray) -> FloatArray:
    """Changes in per cent; NaN from nothing."""
    safe = np.where(before > 0, before, np.nan)
    return np.asarray(100.0 * (after / safe - 1.0), dtype=np.float64)


def _values(light: PointLight, name: str) -> FloatArray:
    return light.weigh(light_quantity(name).response)[0]


def _mixed(places: xr.Dataset) -> str:
    return " of points that differ in height or direction" if len(point_planes(places)) > 1 else ""


def _uniformity(lux: FloatArray) -> float:
    mean = float(lux.mean())
    return float(lux.min()) / mean if mean > 0 else float("nan")
