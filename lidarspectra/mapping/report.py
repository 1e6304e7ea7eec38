"""The report: maps, spectra, materials, accuracy and provenance of a run on one page, with its figures and tables."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.errors import MapError
from lidarspectra.hardware.phone.scan import ScanRecord
from lidarspectra.mapping import report_page as html
from lidarspectra.mapping import report_tables as tables
from lidarspectra.mapping.applications import Application
from lidarspectra.mapping.figure_style import inline_svg, irradiance_unit, prefix_of, save_figure
from lidarspectra.mapping.figures import (
    ReportView,
    choose_points,
    contact_sheet,
    reflectances_figure,
    spectra_figure,
)
from lidarspectra.mapping.floor_plan import FloorPlan
from lidarspectra.mapping.interpolation import leave_one_out, map_planes
from lidarspectra.mapping.map_figures import (
    error_figure,
    illuminance_figure,
    maps_figure,
    plan_figure,
    relative_error,
)
from lidarspectra.mapping.material_figures import MaterialPictures, light_figure, segmentation_figure
from lidarspectra.mapping.photometry import covers_vision, illuminance, illuminance_from_map
from lidarspectra.mapping.report_tables import StageRow
from lidarspectra.mapping.room_view import MOST_FACES, MOST_POINTS, RoomSurfaces, room_view_data
from lidarspectra.mapping.spectral_map import check_map, kept_points
from lidarspectra.mapping.tables import Table, save_table, table_html
from lidarspectra.material.material_map import Material
from lidarspectra.progress import Progress, silent
from lidarspectra.radiance.lamps import Lamp

PAGE = "index.html"
MOST_POINT_ROWS = 500  # [1] rows of the table of points in the page; the file has all
TESTED_POINTS = 64  # [1] left out in turn; their median is known within a tenth then
MOST_VIEWS = 12  # [1] pictures in the page

__all__ = ["PAGE", "FloorPlan", "ReportInput", "ReportView", "StageRow", "write_report"]


@dataclass(frozen=True, kw_only=True, eq=False)
class ReportInput:
    """All that the report tells of.

    Parameters
    ----------
    title : str
        Name of the room or run file.
    spectral_map : xarray.Dataset
        See `spectral_map`.
    transport : xarray.Dataset
        The traced coefficients; its attributes tell accuracy and noise.
    plan : FloorPlan
        Outline of the room and silhouettes of its furniture.
    scan : ScanRecord
        What was read and repaired.
    materials : tuple of Material
        See `MaterialMap`.
    material_areas_m2 : (material,) float
        [m²]
    lamps : tuple of Lamp
        In the order of the transport's lamps, or of the run file.
    surfaces : RoomSurfaces, optional
        The room's mesh, for the 3D view.
    views : tuple of ReportView
        Pictures of the room, the six of the first viewpoint first.
    view_notes : str
        One sentence on coverage.
    material_pictures : MaterialPictures, optional
        How the materials were found.
    floor_z_m : float
        Height of the floor in the scan's coordinates. [m]
    room_notes : str
        One sentence on the room that was found.
    stages : tuple of StageRow
        Time and memory.
    warnings : tuple of str
        What a reader should know first.
    provenance : mapping of str to str
        Versions, database hashes, seeds.
    run_file : str
        Text of the run file.
    """

    title: str
    spectral_map: xr.Dataset
    transport: xr.Dataset
    plan: FloorPlan
    scan: ScanRecord
    materials: tuple[Material, ...]
    material_areas_m2: FloatArray
    lamps: tuple[Lamp, ...]
    surfaces: RoomSurfaces | None = None
    views: tuple[ReportView, ...] = ()
    view_notes: str = ""
    material_pictures: MaterialPictures | None = None
    floor_z_m: float = 0.0
    room_notes: str = ""
    stages: tuple[StageRow, ...] = ()
    warnings: tuple[str, ...] = ()
    provenance: Mapping[str, str] = field(default_factory=dict)
    run_file: str = ""
    applications: tuple[Application, ...] = ()

    def __post_init__(self) -> None:
        check_map(self.spectral_map, where="map of the report")
        areas = float_array(self.material_areas_m2, name="ReportInput.material_areas_m2", shape=(len(self.materials),))
        object.__setattr__(self, "material_areas_m2", areas)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Light:
    """What several sections tell of: illuminance and how it was got."""

    illuminance_lx: FloatArray | None
    route: str


class _Writer:
    """Numbers figures, writes figures and tables beside the page, and gives their HTML."""

    def __init__(self, folder: Path) -> None:
        self._figures, self._tables = folder / "figures", folder / "tables"
        self._number = 0
        try:
            self._figures.mkdir(parents=True, exist_ok=True)
            self._tables.mkdir(parents=True, exist_ok=True)
        except OSError as cause:
            raise _unwritable(folder, cause) from cause

    def figure(self, name: str, figure: Figure, caption: str) -> str:
        """Save a figure and give it as an element."""
        self._number += 1
        save_figure(figure, self._figures, name)
        svg = inline_svg(figure, name=name, label=caption)
        return html.figure(svg, number=self._number, caption=caption, name=name)

    def save(self, name: str, figure: Figure) -> None:
        """Save a figure that the page shows in another form."""
        save_figure(figure, self._figures, name)

    def table(self, table: Table, *, most_rows: int | None = None) -> str:
        """Save a table and give it as an element."""
        save_table(table, self._tables)
        links = html.files(f"tables/{table.name}", ("csv", "md", "html"))
        return table_html(table, most_rows=most_rows) + f'<p class="files">{links}</p>'


def write_report(folder: Path, report: ReportInput, *, progress: Progress = silent) -> Path:
    """Write the report: `index.html`, and its figures (PNG, PDF) and tables (CSV, Markdown, HTML) in folders beside it.

    Parameters
    ----------
    folder : Path
        Made if absent.
    report : ReportInput
        What to tell.
    progress : callable
        See `lidarspectra.progress`.

    Returns
    -------
    page : Path
        The page; it shows everything without any other file.

    Raises
    ------
    MapError
        If the folder cannot be written.
    """
    writer = _Writer(folder)
    light = _light(report)
    makers: tuple[tuple[str, Callable[[], str]], ...] = (
        ("Summary", lambda: _summary(report, light, writer)),
        ("Room in 3D", lambda: _room(report)),
        ("Spectral maps", lambda: _maps(report, writer)),
        ("Spectra", lambda: _spectra(report, writer)),
        ("Illuminance", lambda: _illuminance(report, light, writer)),
        ("Accuracy", lambda: _accuracy(report, writer)),
        ("Lamps and sensors", lambda: _lamps(report, writer)),
        *((each.title, partial(_application, each, writer)) for each in report.applications),
        ("Materials", lambda: _materials(report, writer)),
        ("Views", lambda: _views(report, writer)),
        ("Scan", lambda: _scan(report, writer)),
        ("All points", lambda: _points(report, writer)),
        ("Provenance", lambda: _provenance(report, writer)),
    )
    sections = []
    for number, (title, make) in enumerate(makers):
        progress(number / len(makers), title.lower())
        content = make()
        if content:
            sections.append(html.Section(anchor=title.lower().replace(" ", "-"), title=title, content=content))
    data = room_view_data(
        report.spectral_map,
        report.surfaces,
        report.materials,
        report.material_areas_m2,
        report.lamps,
        illuminance_lx=light.illuminance_lx,
    )
    page = html.page(title=report.title, lead=_lead(report), sections=sections, footer=_footer(report), room_data=data)
    path = folder / PAGE
    try:
        path.write_text(page, encoding="utf-8", newline="\n")
    except OSError as cause:
        raise _unwritable(folder, cause) from cause
    progress(1.0, "report written")
    return path


def _lead(report: ReportInput) -> str:
    dataset = report.spectral_map
    centers = dataset["band"].to_numpy()
    return (
        f"Spectral irradiance at {dataset.sizes['point']} points in {dataset.sizes['band']} bands from "
        f"{centers[0]:g} to {centers[-1]:g} nm, computed from the scan {report.scan.file}."
    )


def _footer(report: ReportInput) -> str:
    return f"Made by LiDARSpectra {report.provenance.get('lidarspectra', '')}".rstrip() + ". Irradiance in W m⁻² nm⁻¹."


def _summary(report: ReportInput, light: _Light, writer: _Writer) -> str:
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


def _room(report: ReportInput) -> str:
    said = [
        "Dots are the sensor points, and between neighbours on one level the ground is filled; grey dots are buried. "
        "Walls seen from behind are left out, and all surfaces are shaded a little so that edges show. Bars in the "
        "spectrum are two standard errors to either side, of a reflectance two standard deviations of its estimate."
    ]
    count = report.spectral_map.sizes["point"]
    if count > MOST_POINTS:
        said.append(f"Of {count} points {MOST_POINTS} are here, evenly chosen from their list.")
    if report.surfaces is not None and report.surfaces.faces.shape[0] > MOST_FACES:
        said.append(
            f"The mesh of {report.surfaces.faces.shape[0]} triangles is made coarser here; nothing else uses that."
        )
    return html.room_view() + html.paragraph(" ".join(said), css_class="notes")


def _maps(report: ReportInput, writer: _Writer) -> str:
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


def _spectra(report: ReportInput, writer: _Writer) -> str:
    points = choose_points(report.spectral_map, report.plan.furniture)
    if not points:
        return html.paragraph("All points are buried: there is no spectrum that could be trusted.")
    caption = "Spectral irradiance at chosen points; bars are two standard errors of the simulation to either side."
    figure = writer.figure("spectra", spectra_figure(report.spectral_map, points), caption)
    return figure + html.details("The numbers", writer.table(tables.chosen_points_table(report.spectral_map, points)))


def _illuminance(report: ReportInput, light: _Light, writer: _Writer) -> str:
    if light.illuminance_lx is None:
        return html.paragraph(light.route)
    lux = light.illuminance_lx[kept_points(report.spectral_map)]
    even = f" Uniformity, lowest over mean, is {lux.min() / lux.mean():.2f}." if lux.mean() > 0 else ""
    figure = illuminance_figure(report.spectral_map, report.plan, light.illuminance_lx)
    return writer.figure("illuminance", figure, f"Illuminance. {light.route}{even}")


def _accuracy(report: ReportInput, writer: _Writer) -> str:
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


def _lamps(report: ReportInput, writer: _Writer) -> str:
    caption = "The room from above: walls, sensor points and lamps in their true size."
    if report.plan.furniture:
        caption = "The room from above: walls, silhouettes of furniture, sensor points and lamps in their true size."
    figure = writer.figure("plan", plan_figure(report.spectral_map, report.plan, report.lamps), caption)
    return figure + (writer.table(tables.lamps_table(report.lamps)) if report.lamps else "")


def _application(application: Application, writer: _Writer) -> str:
    content = "".join(html.paragraph(words) for words in application.words)
    content += "".join(writer.figure(each.name, each.figure, each.caption) for each in application.figures)
    return content + "".join(writer.table(table) for table in application.tables)


def _materials(report: ReportInput, writer: _Writer) -> str:
    if not report.materials:
        return ""
    centers = report.spectral_map["band"].to_numpy()
    low, high = min(380.0, float(centers[0])), max(780.0, float(centers[-1]))
    figure = reflectances_figure(report.materials, report.material_areas_m2, range_nm=(low, high))
    caption = "Reflectance of the materials with the largest areas, in the colour that the scan shows; dashed beyond "
    table = tables.materials_table(report.materials, report.material_areas_m2, centers)
    drawn = writer.figure("reflectances", figure, caption + "what was measured.")
    return drawn + _material_pictures(report, writer) + writer.table(table)


def _material_pictures(report: ReportInput, writer: _Writer) -> str:
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


def _views(report: ReportInput, writer: _Writer) -> str:
    if not report.views:
        return ""
    writer.save("views", contact_sheet(report.views[:6]))
    shown = report.views[:MOST_VIEWS]
    more = len(report.views) - len(shown)
    told = report.view_notes + (f" {more} more views are in the run's folder." if more else "")
    links = f'<p class="files">{html.files("figures/views", ("png", "pdf"))}</p>'
    return html.paragraph(told.strip()) + html.pictures([(view.name, view.image) for view in shown]) + links


def _scan(report: ReportInput, writer: _Writer) -> str:
    notes = "".join(html.paragraph(note) for note in (report.room_notes, *report.scan.notes) if note)
    return notes + writer.table(tables.scan_table(report.scan))


def _points(report: ReportInput, writer: _Writer) -> str:
    table = tables.points_table(report.spectral_map)
    element = writer.table(table, most_rows=MOST_POINT_ROWS)
    count = len(table.frame)
    cut = f", the first {MOST_POINT_ROWS} of them" if count > MOST_POINT_ROWS else ""
    told = "Every point with its spectrum lies in tables/points.csv beside this page."
    return html.paragraph(told) + html.details(f"Table of {count} points{cut}", element)


def _provenance(report: ReportInput, writer: _Writer) -> str:
    content = ""
    if report.provenance:
        content += writer.table(tables.pairs_table("provenance", "What the numbers were made with.", report.provenance))
    if report.run_file:
        content += html.details("The run file", html.code(report.run_file))
    return content


def _light(report: ReportInput) -> _Light:
    """Illuminance by the better route that is open, and a sentence on it."""
    if not covers_vision(report.spectral_map["band"].to_numpy()):
        return _Light(illuminance_lx=None, route="The bands do not cover what the eye sees: no illuminance is told.")
    fluxes = {lamp.name: lamp.flux for lamp in report.lamps}
    if all(str(name) in fluxes for name in report.transport["lamp"].to_numpy()):
        route = "From the lamps' whole spectra; only the room's effect on them is taken from the bands."
        return _Light(illuminance_lx=illuminance(report.transport, fluxes), route=route)
    route = "From the bands alone, with the spectrum linear between them: for lamps with lines this may be far off."
    return _Light(illuminance_lx=illuminance_from_map(report.spectral_map), route=route)


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


def _unwritable(folder: Path, cause: OSError) -> MapError:
    return MapError(
        expected="a folder that can be written",
        found=str(cause.strerror or cause),
        where=str(folder),
        todo="Check its permissions and the free disk space.",
    )
