"""The report: maps, spectra, materials, accuracy and provenance of a run on one page, with its figures and tables."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from lidarspectra.errors import MapError
from lidarspectra.io.files import writing
from lidarspectra.mapping.figures.channel_figures import ReportView
from lidarspectra.mapping.figures.floor_plan import FloorPlan
from lidarspectra.mapping.report import PAGE
from lidarspectra.mapping.report import report_page as html
from lidarspectra.mapping.report import report_sections as parts
from lidarspectra.mapping.report.key_figures import key_figures
from lidarspectra.mapping.report.lamp_light import lamp_light
from lidarspectra.mapping.report.report_input import ReportInput
from lidarspectra.mapping.report.report_tables import StageRow
from lidarspectra.mapping.report.report_writer import ReportWriter
from lidarspectra.mapping.report.room_view import room_view_data, shown_points
from lidarspectra.progress import Progress, shares, silent

ROOM = "Room in 3D"
ROOM_SHARE = 0.1  # of the time, in the unit of the sections' shares: the room in 3D and the page itself

__all__ = ["PAGE", "FloorPlan", "ReportInput", "ReportView", "StageRow", "write_report"]


def write_report(folder: Path, report: ReportInput, *, progress: Progress = silent) -> Path:
    """Write the report: `index.html`, and its figures and tables (CSV, Markdown, HTML) in folders beside it.

    Parameters
    ----------
    folder : Path
        Made if absent.
    report : ReportInput
        Content of the report.
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
    writer = ReportWriter(folder, report.figure_files)
    light = parts.light_of_report(report)
    frames = () if report.frames is None else (report.frames,)
    makers: tuple[tuple[str, float, Callable[[], str]], ...] = (  # title, share of the time, content
        (ROOM, 0.0, lambda: parts.room_section(report)),
        ("Summary", 0.1, lambda: parts.summary_section(report, writer)),
        ("Illuminance", 0.5, lambda: parts.illuminance_section(report, light, writer)),
        ("Spectral maps", 3.4, lambda: parts.maps_section(report, writer)),
        ("Spectra", 0.5, lambda: parts.spectra_section(report, writer)),
        ("Accuracy", 0.7, lambda: parts.accuracy_section(report, writer)),
        ("Lamps and sensors", 0.2, lambda: parts.lamps_section(report, writer)),
        *((each.title, 0.5, partial(parts.application_section, each, writer)) for each in report.applications),
        ("Materials", 2.6, lambda: parts.materials_section(report, writer)),
        ("Views", 2.0, lambda: parts.views_section(report, writer)),
        *((each.title, 0.5, partial(parts.application_section, each, writer)) for each in frames),
        ("Scan", 0.0, lambda: parts.scan_section(report, writer)),
        ("All points", 0.1, lambda: parts.points_section(report, writer)),
        ("Provenance", 0.1, lambda: parts.provenance_section(report, writer)),
        ("Time and memory", 0.0, lambda: parts.time_section(report, writer)),
    )
    sections = []
    *listeners, joining = shares(progress, [*(share for _, share, _ in makers), ROOM_SHARE])
    for (title, _, make), tell in zip(makers, listeners, strict=True):
        tell(0.0, title.lower())
        content = make()
        if content:
            sections.append(html.Section(anchor=title.lower().replace(" ", "-"), title=title, content=content))
    joining(0.0, "room in 3d")
    data = room_view_data(
        report.spectral_map,
        report.surfaces,
        report.materials,
        report.material_areas_m2,
        report.lamps,
        illuminance_lx=light.illuminance_lx,
        light=lamp_light(
            report.transport,
            report.lamps,
            report.bands,
            report.cells,
            shown_points(report.spectral_map.sizes["point"]),
        ),
        run=report.run,
    )
    page = html.page(
        title=report.title,
        lead=_lead(report),
        sections=sections,
        footer=_footer(report),
        room_data=data,
        key_figures=key_figures(report),
    )
    path = folder / PAGE
    with writing(folder, error=MapError):
        path.write_text(page, encoding="utf-8", newline="\n")
    writer.finish()
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
