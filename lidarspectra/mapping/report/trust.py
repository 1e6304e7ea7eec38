"""What a map rests on: what was measured, estimated, given, computed and assumed, and what each does to the map."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import pandas as pd

from lidarspectra.lamps.lamps import is_daylight
from lidarspectra.lamps.make_lamp import EXITANCE_LM_M2
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.maps.assumptions import Assumptions, assumptions_of, counted_lamps
from lidarspectra.mapping.maps.light_unknowns import ALL_CAUSES, CAUSES, OF_CAUSE
from lidarspectra.mapping.maps.map_schema import kept_points
from lidarspectra.mapping.report.report_input import ReportInput
from lidarspectra.material.pane_materials import OF_PANE

Known = Literal["measured", "estimated", "given", "computed", "assumed"]
WORTH_SAYING = 0.01  # [1] of all directions that leave the scan: less is cracks of the mesh
REFERENCE_NM = 555.0  # [nm] where the reflectances' deviation is taken: the eye is most sensitive there


@dataclass(frozen=True, kw_only=True)
class TrustRow:
    """One thing that a map rests on.

    Parameters
    ----------
    what : str
        The thing.
    known : str
        How it is known.
    how : str
        From where, and how surely.
    effect : str
        What it does to the map.
    """

    what: str
    known: Known
    how: str
    effect: str


def trust_rows(report: ReportInput) -> tuple[TrustRow, ...]:
    """Everything that the map of a report rests on, from the scan to the simulation."""
    assumed = assumptions_of(report.spectral_map)
    return (
        *_scan_rows(report, assumed),
        *_surface_rows(report, assumed),
        *_opening_rows(report),
        *_material_rows(report, assumed),
        *_lamp_rows(report, assumed),
        _simulation_row(report),
        *_total_rows(report),
    )


def trust_table(report: ReportInput) -> Table:
    """The rows as a table."""
    rows = trust_rows(report)
    frame = pd.DataFrame(
        {
            "what": [row.what for row in rows],
            "known": [row.known for row in rows],
            "how": [row.how for row in rows],
            "what it does to the map": [row.effect for row in rows],
        }
    )
    return Table(
        name="trust",
        caption="Trust: what was measured, estimated, given, computed or assumed, and what each does to the map.",
        frame=frame,
    )


def trust_card(report: ReportInput) -> tuple[str, str, str]:
    """Name, value and remark of the card that sums it up."""
    assumed = assumptions_of(report.spectral_map)
    stated = report.spectral_map.attrs.get(ALL_CAUSES)
    value = "guesses" if assumed else "no guesses"
    if stated is not None:
        value = f"± {_percent(float(stated))}{' by guesses' if assumed else ''}"
    if not assumed:
        return (
            "Trust",
            value,
            "at a point (1 standard uncertainty); no guesses" if stated is not None else "see the table below",
        )
    share = _light_share(report, assumed.all_lamps)
    lamps = replace(assumed, scan=()).in_words()
    light = f"{lamps} ({_percent(share)} of the light)" if lamps else ""
    return "Trust", value, ", ".join(words for words in (light, Assumptions(scan=assumed.scan).in_words()) if words)


def _scan_rows(report: ReportInput, assumed: Assumptions) -> Iterator[TrustRow]:
    scan = report.scan
    yield TrustRow(
        what="shape of the room",
        known="measured",
        how=f"by the scan: {scan.faces_kept} triangles, {scan.area_m2:.0f} m²",
        effect="where light falls, and what shades it",
    )
    if scan.hole_area_m2 > 0:
        yield TrustRow(
            what="holes of the scan",
            known="assumed",
            how=f"{scan.holes_closed} closed like their surroundings: {scan.hole_area_m2:.2f} m², "
            f"{_percent(scan.hole_area_m2 / scan.area_m2, digits=1)} of the surface",
            effect="what is truly there may shade or reflect otherwise, most of all near by",
        )
    parts = (
        ("unit", "unit of the scan", scan.unit, scan.unit_confidence, "all lengths scale with it"),
        ("up", "upward axis", scan.up_axis, scan.up_confidence, "floor, ceiling and sensors follow from it"),
    )
    for name, what, value, confidence, effect in parts:
        detected = f"{_percent(confidence)} sure" if confidence < 1.0 else "by the run file"
        is_guess = name in assumed.scan
        yield TrustRow(
            what=what,
            known="assumed" if is_guess else "given" if confidence == 1.0 else "estimated",
            how=f"{value}, {detected}",
            effect=effect + ("; if it is wrong, nothing here holds" if is_guess else ""),
        )


def _surface_rows(report: ReportInput, assumed: Assumptions) -> Iterator[TrustRow]:
    for name, share in (("floor", report.floor_scanned), ("ceiling", report.ceiling_scanned)):
        if share is None:
            continue
        is_guess = name in assumed.scan
        yield TrustRow(
            what=name,
            known="assumed" if is_guess else "measured",
            how=f"{_percent(share)} of the plan was scanned",
            effect="light that it reflects"
            + (
                ": as what was scanned of it or a typical one where it was closed, none where it is open"
                if is_guess
                else ""
            ),
        )
    if report.scan.closed_area_m2 > 0:
        yield TrustRow(
            what="closed surfaces",
            known="assumed",
            how=f"{report.scan.closed_area_m2:.1f} m² of ceiling, floor or sides that were not scanned, with typical "
            "reflectances",
            effect="light that they reflect; in truth they may be of other materials, or the room goes on there",
        )
    if report.scan.open_share >= WORTH_SAYING:
        yield TrustRow(
            what="open sides",
            known="measured",
            how=f"{_percent(report.scan.open_share, digits=1)} of all directions leave the scan",
            effect="light that goes there is lost, and the map too dark; by how much at most, is in the next row"
            if float(report.spectral_map.attrs.get("opening_share", 0.0)) > 0.0
            else "light that goes there is lost, and the map too dark",
        )


def _material_rows(report: ReportInput, assumed: Assumptions) -> Iterator[TrustRow]:
    total = float(report.material_areas_m2.sum())
    if not report.materials or total <= 0:
        return
    kinds: dict[Known, list[int]] = {"estimated": [], "given": [], "assumed": []}
    panes: list[int] = []
    for number, material in enumerate(report.materials):
        if material.source.startswith(OF_PANE):
            panes.append(number)
            continue
        kind: Known = {"assigned": "given", "default": "assumed"}.get(material.provenance, "estimated")  # type: ignore[assignment]
        kinds[kind].append(number)
    how = {
        "estimated": "from the scan's colours",
        "given": "assigned by hand",
        "assumed": "a default or typical material",
    }
    for kind, numbers in kinds.items():
        area = float(report.material_areas_m2[numbers].sum())
        if area > 0:
            effect = _reflected_effect(report, numbers) if kind != "given" else "light that these surfaces reflect"
            yield TrustRow(
                what="reflectances",
                known=kind,
                how=f"{how[kind]}, for {_percent_or_less(area / total)} of the surface",
                effect=effect,
            )
    pane_area = float(report.material_areas_m2[panes].sum())
    if pane_area > 0:
        is_guess = "panes" in assumed.scan
        yield TrustRow(
            what="glass, mirrors and screens",
            known="assumed" if is_guess else "given",
            how=f"{pane_area:.1f} m², {_percent_or_less(pane_area / total)} of the surface, by the run file"
            + (": some or all by signs in the scan" if is_guess else ""),
            effect="light that they mirror or let through; false images behind them are cut off the scan",
        )


def _reflected_effect(report: ReportInput, numbers: list[int]) -> str:
    """How much reflected light changes if all these reflectances are off alike by their stated deviation.

    The light in a closed room after all reflections goes as r / (1 - r) with its mean reflectance r (integrating
    sphere), so a deviation d of r changes it by d / (r (1 - r)).
    """
    areas = report.material_areas_m2 / report.material_areas_m2.sum()
    at = [REFERENCE_NM]
    mean = sum(
        share * float(material.reflectance.at(at, outside="nearest")[0])
        for share, material in zip(areas, report.materials, strict=True)
    )
    known = [number for number in numbers if report.materials[number].uncertainty is not None]
    if not known or not 0 < mean < 1:
        return "light that these surfaces reflect; how far off is not known"
    deviation = sum(
        float(areas[number]) * float(uncertainty.at(at, outside="nearest")[0])
        for number in known
        if (uncertainty := report.materials[number].uncertainty) is not None
    )
    change = deviation / (mean * (1.0 - mean))
    return f"reflected light, by some ± {_percent(change)} if all are off alike (1 standard deviation)"


def _opening_rows(report: ReportInput) -> Iterator[TrustRow]:
    attrs = report.spectral_map.attrs
    effect = float(attrs.get("opening_share", 0.0))
    if effect <= 0.0:
        return
    share = _percent(float(attrs["open_share"]), digits=1)
    closed = bool(attrs.get("opening_closed"))
    yield TrustRow(
        what="beyond the scan",
        known="assumed",
        how=f"{share} of what the sensors see: {'closed by default walls' if closed else 'dark, with nothing there'}",
        effect=f"{_percent(effect, digits=1)} of the light comes by way of those walls; less if all is dark there"
        if closed
        else f"up to {_percent(effect, digits=1)} more light if a bright wall is there; more if light comes in",
    )


def _lamp_rows(report: ReportInput, assumed: Assumptions) -> Iterator[TrustRow]:
    traced = tuple(str(name) for name in report.transport["lamp"].to_numpy())
    given = tuple(name for name in traced if not assumed.of_lamp(name))
    both = "it scales with the flux, and has the colours of the spectrum"
    has_sky = any(is_daylight(lamp) for lamp in report.lamps)
    lit = f"marked so in the run file, or {EXITANCE_LM_M2:,.0f} lm for each m² of a lamp lit in the scan"
    groups: tuple[tuple[tuple[str, ...], str, Known, str, str], ...] = (
        (given, "flux and spectrum", "given", f"by the run file{'; daylight by a model of the sky' * has_sky}", both),
        (assumed.lamps, "flux and spectrum", "assumed", "marked as assumed in the run file", both),
        (assumed.fluxes, "flux", "assumed", f"{lit}; the spectrum was given", "it scales with the flux"),
        (assumed.spectra, "flux", "given", "by the run file or by readings", "it scales with the flux"),
        (assumed.spectra, "spectrum", "assumed", "marked as assumed in the run file", "it has the spectrum's colours"),
    )
    if assumed.places:
        yield TrustRow(
            what=f"place of {counted_lamps(assumed.places, len(traced))}",
            known="assumed",
            how="in place of the room's own, which nothing in the scan tells",
            effect=f"{_percent(_light_share(report, assumed.places))} of the light: where it falls, and how much it is",
        )
    for names, what, known, how, effect in groups:
        if names:
            yield TrustRow(
                what=f"{what} of {counted_lamps(names, len(traced))}",
                known=known,
                how=how,
                effect=f"{_percent(_light_share(report, names))} of the light: {effect}",
            )


def _light_share(report: ReportInput, names: tuple[str, ...]) -> float:
    """Share of these lamps in the mean irradiance over points and bands [1]."""
    kept = kept_points(report.spectral_map)
    coefficient = report.transport["coefficient"].transpose("lamp", "point", "band").to_numpy()[:, kept]
    flux = report.transport["flux"].transpose("lamp", "band").to_numpy()
    by_lamp = np.einsum("lpb,lb->l", coefficient, flux)
    chosen = np.isin([str(name) for name in report.transport["lamp"].to_numpy()], names)
    return float(by_lamp[chosen].sum() / by_lamp.sum()) if by_lamp.sum() > 0 else 0.0


def _simulation_row(report: ReportInput) -> TrustRow:
    attrs = report.transport.attrs
    error = attrs.get("achieved_relative_se")
    missing = attrs.get("truncated_share")
    return TrustRow(
        what="simulation",
        known="computed",
        how=f"{attrs.get('accuracy', 'unknown')} accuracy, {attrs.get('noise', 'unknown')} noise",
        effect=("" if error is None else f"± {_percent(float(error), digits=2)} of the mean (1 standard error)")
        + ("" if missing is None else f"; {_percent(float(missing), digits=2)} left out beyond the last reflection"),
    )


def _total_rows(report: ReportInput) -> Iterator[TrustRow]:
    """What all of the above do together, as far as it has a number."""
    attrs = report.spectral_map.attrs
    if ALL_CAUSES not in attrs:
        return
    shares = {cause: float(attrs.get(f"{OF_CAUSE}{cause}", 0.0)) for cause in CAUSES}
    parts = [f"{cause} {_percent(share, digits=1)}" for cause, share in shares.items() if share > 0]
    yield TrustRow(
        what="all together",
        known="computed",
        how=f"root mean square over points: {', '.join(parts)} of the mean light",
        effect=f"± {_percent(float(attrs[ALL_CAUSES]))} at a point (1 standard uncertainty); an error of a lamp or of "
        "a wall is the same all over the map",
    )


def _percent_or_less(share: float) -> str:
    """Per cent of what is there, and so more than none."""
    return "less than 1 %" if share < 0.005 else _percent(share)


def _percent(share: float, *, digits: int = 0) -> str:
    return f"{100.0 * share:.{digits}f} %"
