"""The report's sections, each as HTML; an empty one is left out of the page."""

from dataclasses import dataclass

import numpy as np
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.figures.channel_figures import (
    choose_points,
    contact_sheet,
    reflectances_figure,
    spectra_figure,
)
from lidarspectra.mapping.figures.figure_style import irradiance_unit, prefix_of
from lidarspectra.mapping.figures.map_figures import (
    error_figure,
    illuminance_figure,
    maps_figure,
    plan_figure,
    relative_error,
)
from lidarspectra.mapping.figures.material_figures import light_figure, segmentation_figure
from lidarspectra.mapping.maps.interpolation import leave_one_out, map_planes
from lidarspectra.mapping.maps.spectral_map import kept_points
from lidarspectra.mapping.photometry import covers_vision, illuminance, illuminance_from_map
from lidarspectra.mapping.report import report_page as html
from lidarspectra.mapping.report import report_tables as tables
from lidarspectra.mapping.report.applications import Application
from lidarspectra.mapping.report.report_input import ReportInput
from lidarspectra.mapping.report.report_writer import ReportWriter
from lidarspectra.mapping.report.room_view import MAX_FACES, MAX_POINTS

MAX_POINT_ROWS = 500  # [1] rows of the table of points in the page; the file has all
TESTED_POINTS = 64  # [1] left out in turn; their median is known within a tenth then
MAX_VIEWS = 12  # [1] pictures in the page


@dataclass(frozen=True, kw_only=True, eq=False)
class ReportLight:
    """What several sections tell of.

    Parameters
    ----------
    illuminance_lx : (point,) float or None
        None where the bands do not tell it. [lx]
    route : str
        How it was got, or why not; a sentence.
    """

    illuminance_lx: FloatArray | None
    route: str


def summary_section(report: ReportInput, light: ReportLight, writer: ReportWriter) -> str:
    """Key figures, warnings, and what each stage took."""
    dataset = report.spectral_map
    kept = kept_points(dataset)
    mean = dataset["irradiance"].to_numpy()[kept].mean()
    prefix = prefix_of(mean)
    entries = [
        ("Sensor points", f"{dataset.sizes['point']}", _buried_words(dataset)),
        ("Bands", f"{dataset.sizes['band']}", _band_words(dataset)),
        ("Mean irradiance", f"{mean * prefix.factor:.3g}", f"{irradiance_unit(prefix)}, over points and bands"),
    ]
    if light.illuminance_lx is not None:
        lux = light.illuminance_lx[kept]
        entries.append(("Mean illuminance", f"{lux.mean():.0f} lx", f"{lux.min():.0f} to {lux.max():.0f} lx"))
    entries.append(("Standard error", f"{_achieved_percent(report):.2g} %", _target_words(report)))
    entries.append(("Lamps", f"{len(report.lamps)}", ""))
    surface = f"on {report.material_areas_m2.sum():.0f} m² of surface"
    entries.append(("Materials", f"{len(report.materials)}", surface))
    stages = writer.table(tables.stages_table(report.stages)) if report.stages else ""
    total = sum(row.seconds for row in report.stages)
    told = html.paragraph(f"All stages together took {total:.0f} s.") if report.stages else ""
    return html.cards(entries) + html.warning_box(report.warnings) + told + stages


def room_section(report: ReportInput) -> str:
    """The 3D view and how to read it."""
    said = [
        "Dots are the sensor points, and between neighbours on one level the ground is filled; grey dots are buried. "
        "Walls seen from behind are left out, and all surfaces are shaded a little so that edges show. Bars in the "
        "spectrum are two standard errors to either side, of a reflectance two standard deviations of its estimate."
    ]
    count = report.spectral_map.sizes["point"]
    if count > MAX_POINTS:
        said.append(f"Of {count} points {MAX_POINTS} are here, evenly chosen from their list.")
    if report.surfaces is not None and report.surfaces.faces.shape[0] > MAX_FACES:
        said.append(
            f"The mesh of {report.surfaces.faces.shape[0]} triangles is made coarser here; nothing else uses that."
        )
    return html.room_view() + html.paragraph(" ".join(said), css_class="notes")


def maps_section(report: ReportInput, writer: ReportWriter) -> str:
    """A map for every band, and what they come to."""
    dataset = report.spectral_map
    planes = map_planes(dataset)
    chosen = planes[0] if planes else np.arange(dataset.sizes["point"])
    height = float(np.median(dataset["z"].to_numpy()[chosen])) - report.floor_z_m
    caption = (
        f"Spectral irradiance at {chosen.size} points {height:.2f} m above the floor, linear between the points and "
        f"left empty where none is near. {_interpolation_words(dataset)}"
    )
    told = ""
    if len(planes) > 1:
        told = html.paragraph(
            f"The points lie on {len(planes)} levels or look in several directions; the maps show the {chosen.size} "
            "of the largest group. The table at the end has all."
        )
    own = writer.figure("maps", maps_figure(dataset, report.plan), caption + " Each band has its own scale.")
    shared = writer.figure(
        "maps-shared", maps_figure(dataset, report.plan, scale="shared"), "The same maps on one scale for all bands."
    )
    bands = writer.table(tables.bands_table(dataset))
    return told + own + html.details("The maps on one shared scale", shared) + bands


def spectra_section(report: ReportInput, writer: ReportWriter) -> str:
    """Spectra at chosen points."""
    points = choose_points(report.spectral_map, report.plan.furniture)
    if not points:
        return html.paragraph("All points are buried: there is no spectrum that could be trusted.")
    caption = "Spectral irradiance at chosen points; bars are two standard errors of the simulation to either side."
    figure = writer.figure("spectra", spectra_figure(report.spectral_map, points), caption)
    return figure + html.details("The numbers", writer.table(tables.chosen_points_table(report.spectral_map, points)))


def illuminance_section(report: ReportInput, light: ReportLight, writer: ReportWriter) -> str:
    """What the eye sees, or why that cannot be told."""
    if light.illuminance_lx is None:
        return html.paragraph(light.route)
    lux = light.illuminance_lx[kept_points(report.spectral_map)]
    even = f" Uniformity, lowest over mean, is {lux.min() / lux.mean():.2f}." if lux.mean() > 0 else ""
    figure = illuminance_figure(report.spectral_map, report.plan, light.illuminance_lx)
    return writer.figure("illuminance", figure, f"Illuminance. {light.route}{even}")


def accuracy_section(report: ReportInput, writer: ReportWriter) -> str:
    """How sure the numbers are."""
    attrs = report.transport.attrs
    target = attrs.get("target_relative_se")
    rows = {
        "accuracy": f"{attrs.get('accuracy', 'not said')}, at most {attrs.get('bounces', 'an unknown number of')} "
        "reflections",
        "noise": f"{attrs.get('noise', 'not said')}; {_target_words(report)}",
        "achieved standard error": f"{_achieved_percent(report):.2g} % of the mean irradiance",
    }
    if "seconds" in attrs:
        rows["tracing time"] = f"{float(attrs['seconds']):.1f} s"
    caption = (
        "Standard error of the simulation, from independent repeats, as a share of the band's mean irradiance. It says "
        "nothing on errors of the scan, the materials or the lamps."
    )
    figure = error_figure(report.spectral_map, report.plan, target=None if target is None else float(target))
    return html.pairs(rows) + writer.figure("standard-error", figure, caption)


def lamps_section(report: ReportInput, writer: ReportWriter) -> str:
    """Where lamps and sensors are."""
    caption = "The room from above: walls, sensor points and lamps in their true size."
    if report.plan.furniture:
        caption = "The room from above: walls, silhouettes of furniture, sensor points and lamps in their true size."
    figure = writer.figure("plan", plan_figure(report.spectral_map, report.plan, report.lamps), caption)
    return figure + (writer.table(tables.lamps_table(report.lamps)) if report.lamps else "")


def application_section(application: Application, writer: ReportWriter) -> str:
    """What an application tells."""
    content = "".join(html.paragraph(words) for words in application.words)
    content += "".join(writer.figure(each.name, each.figure, each.caption) for each in application.figures)
    return content + "".join(writer.table(table) for table in application.tables)


def materials_section(report: ReportInput, writer: ReportWriter) -> str:
    """What every surface was taken for, and how that was found."""
    if not report.materials:
        return ""
    centers = report.spectral_map["band"].to_numpy()
    low, high = min(380.0, float(centers[0])), max(780.0, float(centers[-1]))
    figure = reflectances_figure(report.materials, report.material_areas_m2, range_nm=(low, high))
    caption = "Reflectance of the materials with the largest areas, in the colour that the scan shows; dashed beyond "
    table = tables.materials_table(report.materials, report.material_areas_m2, centers)
    drawn = writer.figure("reflectances", figure, caption + "what was measured.")
    return drawn + _material_pictures(report, writer) + writer.table(table)


def _material_pictures(report: ReportInput, writer: ReportWriter) -> str:
    """How the materials were found: views by kind of surface, and what was light in the scan's colours."""
    pictures = report.material_pictures
    if pictures is None:
        return ""
    names = tuple(material.name for material in report.materials)
    content = writer.figure(
        "light-taken-out",
        light_figure(names, report.material_areas_m2, pictures.shown, pictures.found),
        "The main materials before and after: the mean colour that the scan shows, light and camera in it, and the "
        "reflectance's own colour in even daylight; the numbers are luminances, of white 1.",
    )
    if pictures.views:
        content += writer.figure(
            "segmentation",
            segmentation_figure(pictures),
            f"The first views as the phone coloured them; their surfaces by {pictures.code.kind}; each surface in the "
            "colour that its estimated reflectance has in even daylight.",
        )
    return content


def views_section(report: ReportInput, writer: ReportWriter) -> str:
    """The pictures taken inside the scan."""
    if not report.views:
        return ""
    writer.save("views", contact_sheet(report.views[:6]))
    shown = report.views[:MAX_VIEWS]
    more = len(report.views) - len(shown)
    told = report.view_notes + (f" {more} more views are in the run's folder." if more else "")
    links = f'<p class="files">{html.files("figures/views", ("png", "pdf"))}</p>'
    return html.paragraph(told.strip()) + html.pictures([(view.name, view.image) for view in shown]) + links


def scan_section(report: ReportInput, writer: ReportWriter) -> str:
    """What the scan held, and every change to it."""
    notes = "".join(html.paragraph(note) for note in (report.room_notes, *report.scan.notes) if note)
    return notes + writer.table(tables.scan_table(report.scan))


def points_section(report: ReportInput, writer: ReportWriter) -> str:
    """Every point with its spectrum."""
    table = tables.points_table(report.spectral_map)
    element = writer.table(table, max_rows=MAX_POINT_ROWS)
    count = len(table.frame)
    cut = f", the first {MAX_POINT_ROWS} of them" if count > MAX_POINT_ROWS else ""
    told = "Every point with its spectrum lies in tables/points.csv beside this page."
    return html.paragraph(told) + html.details(f"Table of {count} points{cut}", element)


def provenance_section(report: ReportInput, writer: ReportWriter) -> str:
    """What the numbers were made with."""
    content = ""
    if report.provenance:
        content += writer.table(tables.pairs_table("provenance", "What the numbers were made with.", report.provenance))
    if report.run_file:
        content += html.details("The run file", html.code(report.run_file))
    return content


def light_of_report(report: ReportInput) -> ReportLight:
    """Illuminance by the better route that is open, and a sentence on it."""
    if not covers_vision(report.spectral_map["band"].to_numpy()):
        return ReportLight(
            illuminance_lx=None, route="The bands do not cover what the eye sees: no illuminance is told."
        )
    fluxes = {lamp.name: lamp.flux for lamp in report.lamps}
    if all(str(name) in fluxes for name in report.transport["lamp"].to_numpy()):
        route = "From the lamps' whole spectra; only the room's effect on them is taken from the bands."
        return ReportLight(illuminance_lx=illuminance(report.transport, fluxes), route=route)
    route = "From the bands alone, with the spectrum linear between them: for lamps with lines this may be far off."
    return ReportLight(illuminance_lx=illuminance_from_map(report.spectral_map), route=route)


def _achieved_percent(report: ReportInput) -> float:
    told = report.transport.attrs.get("achieved_relative_se")
    if told is not None:
        return 100.0 * float(told)
    return 100.0 * float(np.median(relative_error(report.spectral_map)[kept_points(report.spectral_map)]))


def _target_words(report: ReportInput) -> str:
    target = report.transport.attrs.get("target_relative_se")
    if target is None:
        return "no target given"
    held = _achieved_percent(report) <= 100.0 * float(target)
    return f"target {100.0 * float(target):g} %, {'held' if held else 'not reached'}"


def _interpolation_words(dataset: xr.Dataset) -> str:
    try:
        error = leave_one_out(dataset, most=TESTED_POINTS)
    except MapError:
        return "There are too few points, or they lie on a line: only they are shown."
    return (
        f"Left out one by one, points are told by their neighbours with a median error of {error.median_percent:.2g} %."
    )


def _buried_words(dataset: xr.Dataset) -> str:
    buried = int(dataset["buried"].to_numpy().sum())
    return f"{buried} buried, flagged" if buried else "none buried"


def _band_words(dataset: xr.Dataset) -> str:
    centers = dataset["band"].to_numpy()
    return f"{centers[0]:g} to {centers[-1]:g} nm"
