"""The key figures above the room: mean illuminance with its error, uniformity, melanopic EDI, and what is assumed."""

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.figures.figure_style import irradiance_unit, prefix_of
from lidarspectra.mapping.maps.assumptions import assumptions_of
from lidarspectra.mapping.maps.interpolation import map_planes, plan_places
from lidarspectra.mapping.maps.light_unknowns import error_bars, uncertainty_in_words
from lidarspectra.mapping.maps.map_schema import kept_points
from lidarspectra.mapping.photometry import covers_vision, light_of_lamps, light_of_map
from lidarspectra.mapping.photometry.quantities import light_quantity
from lidarspectra.mapping.report import report_page as html
from lidarspectra.mapping.report.report_input import ReportInput
from lidarspectra.mapping.report.report_page import Fact
from lidarspectra.mapping.report.trust import trust_card
from lidarspectra.words import counted, digits

TRUST = "trust"  # anchor of the table


def key_figures(report: ReportInput) -> str:
    """Three numbers and the card of trust, as HTML."""
    name, value, remark = trust_card(report)
    trust = Fact(name=name, value=value, remark=remark, link=TRUST)
    can_see = covers_vision(report.spectral_map["band"].to_numpy())
    return html.facts((*(_facts_of_eye(report) if can_see else _facts_of_channels(report)), trust))


def _facts_of_eye(report: ReportInput) -> tuple[Fact, ...]:
    fluxes = {lamp.name: lamp.flux for lamp in report.lamps}
    is_known = all(str(name) in fluxes for name in report.transport["lamp"].to_numpy())
    light = light_of_lamps(report.transport, fluxes) if is_known else light_of_map(report.spectral_map)
    light = light.at(kept_points(report.spectral_map))
    lux, error = light.weigh(light_quantity("illuminance_lx").response)
    melanopic = light.weigh(light_quantity("melanopic_edi_lx").response)[0]
    ratio = f", {melanopic.mean() / lux.mean():.2f} of the illuminance" if lux.mean() > 0 else ""
    assumed = assumptions_of(report.spectral_map)
    guessed = ", from an assumed flux" if assumed.of_flux else ""
    colors = ", by an assumed spectrum" if assumed.of_spectrum else ""
    return (
        Fact(
            name="Mean illuminance",
            value=f"{digits(float(lux.mean()), '.3g')} lx",
            remark=f"{_uncertain(report, float(error.mean()))}; {lux.min():.0f} to {lux.max():.0f} lx{guessed}",
            fact="mean",
            key="illuminance_lx",
            number=float(lux.mean()),
            unit="lx",
        ),
        _uniformity(lux, report, key="illuminance_lx", of="the illuminance"),
        Fact(
            name="Melanopic EDI",
            value=f"{digits(float(melanopic.mean()), '.3g')} lx",
            remark=f"mean{ratio}{colors}",
            fact="mean",
            key="melanopic_edi_lx",
            number=float(melanopic.mean()),
            unit="lx",
        ),
    )


def _uncertain(report: ReportInput, simulated_lx: float) -> str:
    return uncertainty_in_words(report.spectral_map.attrs) or f"± {simulated_lx:.2g} lx by the simulation"


def _facts_of_channels(report: ReportInput) -> tuple[Fact, ...]:
    kept = kept_points(report.spectral_map)
    values = report.spectral_map["irradiance"].to_numpy()[kept]
    bars, _ = error_bars(report.spectral_map)
    error = bars[kept]
    prefix, centers = prefix_of(values), report.spectral_map["band"].to_numpy()
    return (
        Fact(
            name="Mean irradiance",
            value=f"{values.mean() * prefix.factor:.3g}",
            remark=f"± {error.mean() * prefix.factor:.2g} {irradiance_unit(prefix)} at a point, over points and bands",
        ),
        _uniformity(values.mean(axis=1), report, key="", of="the irradiance"),
        Fact(name="Bands", value=f"{centers.size}", remark=f"{centers[0]:g} to {centers[-1]:g} nm"),
    )


def _uniformity(values: FloatArray, report: ReportInput, *, key: str, of: str) -> Fact:
    mean = float(np.mean(values))
    share = float(np.min(values)) / mean if mean > 0 else 0.0
    places = plan_places(report.spectral_map)[kept_points(report.spectral_map)]
    rooms = np.unique(report.plan.room_of(places)).size
    mixed = f" of {rooms} rooms together" if rooms > 1 else ""
    mixed += ", which differ in height or direction" if len(map_planes(report.spectral_map)) > 1 else ""
    return Fact(
        name="Uniformity U0",
        value=f"{share:.2f}" if mean > 0 else "–",
        remark=f"lowest over mean of {of} at {counted(values.size, 'point')}{mixed}",
        fact="uniformity" if key else "",
        key=key,
        number=share,
    )
