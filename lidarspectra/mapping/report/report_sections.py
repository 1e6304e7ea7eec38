"""The report's sections, each as HTML; an empty one is left out of the page."""

from dataclasses import dataclass
from functools import partial

import numpy as np
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.figures.channel_figures import (
    choose_points,
    reflectances_figure,
    spectra_figure,
)
from lidarspectra.mapping.figures.figure_style import irradiance_unit, prefix_of, svg_text
from lidarspectra.mapping.figures.floor_plan import FloorPlan
from lidarspectra.mapping.figures.map_figures import (
    error_figure,
    illuminance_figure,
    maps_figure,
    plan_figure,
    relative_error,
)
from lidarspectra.mapping.figures.material_figures import light_figure, segmentation_figure
from lidarspectra.mapping.maps.assumptions import assumptions_of
from lidarspectra.mapping.maps.interpolation import grid_map, leave_one_out, map_planes, plan_places
from lidarspectra.mapping.maps.light_unknowns import error_bars, uncertainty_in_words
from lidarspectra.mapping.maps.map_schema import dark_bands, kept_points
from lidarspectra.mapping.photometry import covers_vision, illuminance, illuminance_from_map
from lidarspectra.mapping.report import report_page as html
from lidarspectra.mapping.report import report_tables as tables
from lidarspectra.mapping.report.applications import Application
from lidarspectra.mapping.report.key_figures import TRUST
from lidarspectra.mapping.report.report_input import ReportInput
from lidarspectra.mapping.report.report_writer import ReportWriter
from lidarspectra.mapping.report.room_view import MAX_FACES, MAX_POINTS
from lidarspectra.mapping.report.trust import trust_table
from lidarspectra.radiance.sampling.stated_error import opening_in_words
from lidarspectra.words import counted, two_digits

MAX_POINT_ROWS = 500  # rows of the table of points in the page; the file has all
TESTED_POINTS = 64  # left out in turn, enough for a median within 10 %
MAX_VIEWS = 12  # pictures in the page
MAX_MISSED_NAMED = 8  # points above a target of their own that the page names


@dataclass(frozen=True, kw_only=True, eq=False)
class ReportLight:
    """Illuminance for several sections.

    Parameters
    ----------
    illuminance_lx : (point,) float or None
        None where the bands do not cover V(λ). [lx]
    route : str
        How it was computed, or why it was not; a sentence.
    """

    illuminance_lx: FloatArray | None
    route: str


def summary_section(report: ReportInput, writer: ReportWriter) -> str:
    """What a reader must know first, the size of it all, and what it rests on."""
    dataset = report.spectral_map
    assumed = assumptions_of(dataset)
    guessed = ", from an assumed flux" if assumed.of_flux else ""
    kept = kept_points(dataset)
    mean = dataset["irradiance"].to_numpy()[kept].mean()
    prefix = prefix_of(mean)
    entries = [
        ("Sensor points", f"{dataset.sizes['point']}", _buried_words(dataset)),
        ("Bands", f"{dataset.sizes['band']}", _band_words(dataset)),
        (
            "Mean irradiance",
            f"{mean * prefix.factor:.3g}",
            f"{irradiance_unit(prefix)}, over points and bands{guessed}",
        ),
    ]
    knows = "of the simulation alone, not of what is assumed" if assumed else "of the simulation alone"
    error = f"{_target_words(report)}; {knows}"
    entries.append(("Standard error", f"{two_digits(_achieved_percent(report))} %", error))
    groups = ((assumed.of_flux, "flux"), (assumed.spectra, "spectrum"))
    lamps = ", ".join(f"{len(names)} with an assumed {what}" for names, what in groups if names)
    entries.append(("Lamps", f"{len(report.lamps)}", lamps))
    surface = f"on {report.material_areas_m2.sum():.0f} m² of surface"
    entries.append(("Materials", f"{len(report.materials)}", surface))
    trust = f'<div id="{TRUST}">{writer.table(trust_table(report))}</div>'
    return html.warning_box(report.warnings) + html.cards(entries) + trust


def time_section(report: ReportInput, writer: ReportWriter) -> str:
    """Time and memory of each stage."""
    if not report.stages:
        return ""
    total = sum(row.seconds for row in report.stages)
    words = html.paragraph(f"The stages before this report took {total:.0f} s together.")
    return words + writer.table(tables.stages_table(report.stages))


def room_section(report: ReportInput) -> str:
    """The 3D view and how to read it."""
    bars = error_bars(report.spectral_map)[1]
    notes = [
        "Dots are the sensor points, and the plane between neighbouring points on one level is coloured in; grey dots "
        "are buried in furniture or walls, and their values are meaningless. Walls seen from behind are hidden, and "
        f"surfaces are shaded slightly so that edges show. Error bars of an irradiance are ± 2 {bars}, those of a "
        "reflectance ± 2 standard deviations of its estimate."
    ]
    count = report.spectral_map.sizes["point"]
    if count > MAX_POINTS:
        notes.append(f"The view shows {MAX_POINTS} of the {count} points, chosen evenly; the tables have all of them.")
    if report.surfaces is not None and report.surfaces.faces.shape[0] > MAX_FACES:
        notes.append(
            f"The mesh of {report.surfaces.faces.shape[0]} triangles is simplified for this view only; the simulation "
            "used all of them."
        )
    return html.room_view() + html.paragraph(" ".join(notes), css_class="notes")


def maps_section(report: ReportInput, writer: ReportWriter) -> str:
    """A map of every band."""
    dataset = report.spectral_map
    planes = map_planes(dataset)
    chosen = planes[0] if planes else np.arange(dataset.sizes["point"])
    height = float(np.median(dataset["z"].to_numpy()[chosen])) - report.floor_z_m
    caption = (
        f"Spectral irradiance at {counted(chosen.size, 'point')} {height:.2f} m above the floor, interpolated "
        "linearly, never across a wall, and left empty (hatched) where no point is near. "
        f"{_interpolation_words(dataset, report.plan)}"
    )
    note = ""
    if len(planes) > 1:
        note = html.paragraph(
            f"The points form {len(planes)} groups that differ in height or direction; the maps show the largest, of "
            f"{chosen.size} points. The table at the end of the page has all points."
        )
    own = writer.figure("maps", maps_figure(dataset, report.plan), caption + " Each band has its own scale.")
    return note + own


def compared_maps(report: ReportInput, writer: ReportWriter) -> str:
    """The same maps on one scale, and by what differs between the channels; of the section before."""
    dataset = report.spectral_map
    shared = writer.figure(
        "maps-shared", maps_figure(dataset, report.plan, scale="shared"), "The same maps on one scale for all bands."
    )
    content = html.details("The maps on one shared scale", shared)
    if dataset.sizes["band"] > 1:
        words = "What differs between the channels: each over its own mean, against the mean of that over all channels."
        if dark_bands(dataset).any():
            words += " Channels with next to no light are left out."
        shape = writer.figure("maps-shape", maps_figure(dataset, report.plan, scale="shape"), words)
        content += html.details("What differs between the channels", shape)
    return content


def bands_section(report: ReportInput, writer: ReportWriter) -> str:
    """A table of the bands; of the same section."""
    return writer.table(tables.bands_table(report.spectral_map))


def spectra_section(report: ReportInput, writer: ReportWriter) -> str:
    """Spectra at chosen points."""
    points = choose_points(report.spectral_map, report.under_furniture)
    if not points:
        return html.paragraph(
            "All sensor points are buried in furniture or walls, so that no spectrum is meaningful. Move them into "
            "free air: change the height of the grid, or the points, under [sensors] in the run file."
        )
    caption = f"Spectral irradiance at chosen points; error bars are ± 2 {error_bars(report.spectral_map)[1]}."
    figure = writer.figure("spectra", spectra_figure(report.spectral_map, points), caption)
    return figure + html.details("The numbers", writer.table(tables.chosen_points_table(report.spectral_map, points)))


def illuminance_section(report: ReportInput, light: ReportLight, writer: ReportWriter) -> str:
    """The illuminance map, or why there is none."""
    if light.illuminance_lx is None:
        return html.paragraph(light.route)
    planes = map_planes(report.spectral_map)
    drawn = planes[0] if planes else kept_points(report.spectral_map)
    lux = light.illuminance_lx[drawn]
    of = f" at the {counted(drawn.size, 'point')} of this level and direction" if len(planes) > 1 else ""
    rooms = np.unique(report.plan.room_of(plan_places(report.spectral_map)[drawn])).size
    of += f", {rooms} rooms together" if rooms > 1 else ""
    even = (
        f" Its uniformity U0, the minimum over the mean{of}, is {lux.min() / lux.mean():.2f}." if lux.mean() > 0 else ""
    )
    figure = illuminance_figure(report.spectral_map, report.plan, light.illuminance_lx)
    return writer.figure("illuminance", figure, f"Illuminance. {light.route}{even}")


def accuracy_section(report: ReportInput, writer: ReportWriter) -> str:
    """Standard errors and how they were reached."""
    attrs = report.transport.attrs
    target = attrs.get("target_relative_se")
    followed = "all" if attrs.get("accuracy") == "all" else f"at most {attrs.get('bounces', 'an unknown number of')}"
    plain = attrs.get("method") == "rtrace"
    rows = {
        "method": "plain runs of rtrace" if plain else "adaptive sampling",
        "accuracy": f"{attrs.get('accuracy', 'not recorded')}, {followed} reflections",
        "noise": f"{attrs.get('noise', 'not recorded')}; {_target_words(report)}",
        "achieved standard error": f"{two_digits(_achieved_percent(report))} % of the mean irradiance",
    }
    if uncertainty := uncertainty_in_words(report.spectral_map.attrs):
        rows["uncertainty for all causes"] = f"{uncertainty}; see the table of trust"
    if assumed := assumptions_of(report.spectral_map).in_words():
        rows["guesses that no standard error knows of"] = assumed
    if "missed_target" in report.transport:
        rows["points above the target"] = _missed_words(report)
    if "truncated_share" in attrs:
        rows["light beyond the last reflection"] = (
            f"about {float(attrs['truncated_share']):.2%} of the mean irradiance in the worst channel, which is missing"
            + (
                ", more than the target"
                if target is not None and float(attrs["truncated_share"]) > float(target)
                else ""
            )
        )
    elif plain:
        rows["light beyond the last reflection"] = "missing, and not estimated by plain runs of rtrace"
    if opening := opening_in_words(report.spectral_map.attrs):
        rows["what was not scanned"] = opening
    if "slot_error" in attrs:
        rows["change of reflectances within a channel"] = (
            f"leaves about {float(attrs['slot_error']):.2%} of the reflected light in the worst channel uncertain"
        )
    if "seconds" in attrs:
        rows["tracing time"] = f"{float(attrs['seconds']):.1f} s"
    caption = (
        "Standard error of the Monte Carlo simulation, from independent repeats, relative to the band's mean "
        "irradiance. It does not include errors of the scan, the materials or the lamps."
    )
    figure = error_figure(report.spectral_map, report.plan, target=None if target is None else float(target))
    return html.pairs(rows) + writer.figure("standard-error", figure, caption)


def lamps_section(report: ReportInput, writer: ReportWriter) -> str:
    """The plan of lamps and sensors, and the table of lamps."""
    caption = "The room from above: walls, sensor points and lamps in their true size."
    if report.plan.furniture:
        caption = "The room from above: walls, silhouettes of furniture, sensor points and lamps in their true size."
    figure = writer.figure("plan", plan_figure(report.spectral_map, report.plan, report.lamps), caption)
    return figure + (
        writer.table(tables.lamps_table(report.lamps, assumptions_of(report.spectral_map))) if report.lamps else ""
    )


def application_section(application: Application, writer: ReportWriter) -> str:
    """The section of an application."""
    content = "".join(html.paragraph(words) for words in application.words)
    content += "".join(writer.figure(each.name, each.figure, each.caption) for each in application.figures)
    return content + "".join(writer.table(table) for table in application.tables)


def materials_section(report: ReportInput, writer: ReportWriter) -> str:
    """The material of every surface, and how it was found."""
    if not report.materials:
        return ""
    centers = report.spectral_map["band"].to_numpy()
    low, high = min(380.0, float(centers[0])), max(780.0, float(centers[-1]))
    figure = reflectances_figure(report.materials, report.material_areas_m2, range_nm=(low, high))
    caption = "Reflectance of the materials with the largest areas, in the colour that the scan shows; dashed outside "
    table = tables.materials_table(report.materials, report.material_areas_m2, centers)
    drawn = writer.figure("reflectances", figure, caption + "the range in which it was measured.")
    return drawn + _material_pictures(report, writer) + writer.table(table)


def _material_pictures(report: ReportInput, writer: ReportWriter) -> str:
    """How the materials were found: views by kind of surface, and the scan's colours before and after de-lighting."""
    pictures = report.material_pictures
    if pictures is None:
        return ""
    names = tuple(material.name for material in report.materials)
    content = writer.figure(
        "light-taken-out",
        light_figure(names, report.material_areas_m2, pictures.shown, pictures.found),
        "De-lighting of the main materials: the mean colour in the scan, which contains the room's light and the "
        "camera's response, and the colour of the estimated reflectance in even daylight. The numbers are luminances; "
        "white is 1.",
    )
    if report.segmentation_svg or pictures.views:
        content += writer.drawn(
            "segmentation",
            report.segmentation_svg or svg_text(segmentation_figure(pictures)),
            partial(segmentation_figure, pictures),
            f"The first views in three rows: in the scan's own colours; by {pictures.code.kind} of surface; and in the "
            "colours that the estimated reflectances have in even daylight.",
        )
    return content


def views_section(report: ReportInput, writer: ReportWriter) -> str:
    """The pictures taken inside the scan."""
    if not report.views:
        return ""
    shown = report.views[:MAX_VIEWS]
    more = len(report.views) - len(shown)
    note = report.view_notes + (f" {more} more views are in the run folder." if more else "")
    return html.paragraph(note.strip()) + html.pictures([(view.name, view.image) for view in shown])


def scan_section(report: ReportInput, writer: ReportWriter) -> str:
    """What the scan contained, and every repair."""
    notes = "".join(html.paragraph(note) for note in (report.room_notes, *report.scan.notes) if note)
    return notes + writer.table(tables.scan_table(report.scan))


def points_section(report: ReportInput, writer: ReportWriter) -> str:
    """Every point with its spectrum."""
    table = tables.points_table(report.spectral_map)
    element = writer.table(table, max_rows=MAX_POINT_ROWS)
    count = len(table.frame)
    cut = f", the first {MAX_POINT_ROWS} of them" if count > MAX_POINT_ROWS else ""
    note = "The file tables/points.csv beside this page has every point with its spectrum."
    return html.paragraph(note) + html.details(f"Table of {counted(count, 'point')}{cut}", element)


def provenance_section(report: ReportInput, writer: ReportWriter) -> str:
    """Versions, settings and the run file behind the numbers."""
    content = ""
    if report.provenance:
        content += writer.table(
            tables.pairs_table("provenance", "Versions and settings that the numbers depend on.", report.provenance)
        )
    if report.run_file:
        content += html.details("The run file", html.code(report.run_file))
    return content


def light_of_report(report: ReportInput) -> ReportLight:
    """Illuminance from the lamps' spectra if they are known, else from the bands, and a sentence on that."""
    if not covers_vision(report.spectral_map["band"].to_numpy()):
        return ReportLight(
            illuminance_lx=None,
            route="The channels do not cover the eye's sensitivity V(λ), so that no illuminance can be computed. "
            "Choose a device whose channels reach from 430 to 680 nm ([sensors] device in the run file).",
        )
    fluxes = {lamp.name: lamp.flux for lamp in report.lamps}
    if all(str(name) in fluxes for name in report.transport["lamp"].to_numpy()):
        route = (
            "It is computed from the lamps' full spectra; only the room's effect on them is taken from the channels."
        )
        return ReportLight(illuminance_lx=illuminance(report.transport, fluxes), route=route)
    route = (
        "It is computed from the channels alone, with the spectrum linear between them; for lamps with narrow lines, "
        "such as fluorescent tubes, it can be far off."
    )
    return ReportLight(illuminance_lx=illuminance_from_map(report.spectral_map), route=route)


def _achieved_percent(report: ReportInput) -> float:
    achieved = report.transport.attrs.get("achieved_relative_se")
    if achieved is not None:
        return 100.0 * float(achieved)
    return 100.0 * float(np.median(relative_error(report.spectral_map)[kept_points(report.spectral_map)]))


def _target_words(report: ReportInput) -> str:
    target = report.transport.attrs.get("target_relative_se")
    if target is None:
        return "no target given"
    if "missed_target" in report.transport:
        met, of = not report.transport["missed_target"].any(), " of each point's own light"
    else:
        met, of = _achieved_percent(report) <= 100.0 * float(target), ""
    return f"target {100.0 * float(target):g} %{of}, {'met' if met else 'not met'}"


def _missed_words(report: ReportInput) -> str:
    """How many points missed a target that was asked of each, and where the first of them are."""
    missed = np.flatnonzero(report.transport["missed_target"].to_numpy())
    if not missed.size:
        return f"none of {report.transport.sizes['point']}"
    places = np.stack([report.transport[axis].to_numpy()[missed[:MAX_MISSED_NAMED]] for axis in "xyz"], axis=1)
    named = ", ".join(
        f"{number} at ({x:.2f}, {y:.2f}, {z:.2f}) m" for number, (x, y, z) in zip(missed + 1, places, strict=False)
    )
    more = missed.size - MAX_MISSED_NAMED
    return (
        f"{missed.size} of {report.transport.sizes['point']}, numbered as in the room in 3D: {named}"
        + (f", and {more} more (missed_target in transport.nc)" if more > 0 else "")
        + ". Their values are right within their error bars."
    )


def _interpolation_words(dataset: xr.Dataset, plan: FloorPlan) -> str:
    try:
        grid_map(dataset)
    except MapError:
        return "There are too few points for an interpolated map, or they lie on one line: only the points are drawn."
    try:
        chosen = map_planes(dataset)[0]
        level_m = float(np.median(dataset["z"].to_numpy()[chosen]))
        error = leave_one_out(dataset, points=chosen, most=TESTED_POINTS, between=plan.between_at(level_m))
    except MapError:
        return "No point lies among others on all sides, so that nothing tells how far the map between them is off."
    percent = two_digits(error.median_percent)
    return f"A point predicted from its neighbours alone is off by {percent} % (median over points)."


def _buried_words(dataset: xr.Dataset) -> str:
    buried = int(dataset["buried"].to_numpy().sum())
    return f"{buried} buried in furniture or walls" if buried else "none buried"


def _band_words(dataset: xr.Dataset) -> str:
    centers = dataset["band"].to_numpy()
    return f"{centers[0]:g} to {centers[-1]:g} nm"
