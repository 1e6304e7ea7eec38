"""The report: maps, spectra, materials, accuracy and provenance of a run on one page, with its figures and tables."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from lidarspectra.beside import beside
from lidarspectra.errors import MapError
from lidarspectra.io.files import writing
from lidarspectra.mapping.figures.channel_figures import ReportView
from lidarspectra.mapping.figures.floor_plan import FloorPlan
from lidarspectra.mapping.report import PAGE
from lidarspectra.mapping.report import report_page as html
from lidarspectra.mapping.report import report_sections as parts
from lidarspectra.mapping.report.applications import Application
from lidarspectra.mapping.report.key_figures import key_figures
from lidarspectra.mapping.report.lamp_light import lamp_light
from lidarspectra.mapping.report.report_input import ReportInput
from lidarspectra.mapping.report.report_tables import StageRow
from lidarspectra.mapping.report.report_writer import ReportWriter
from lidarspectra.mapping.report.room_view import room_view_data, shown_points
from lidarspectra.progress import Progress, shares, silent
from lidarspectra.words import counted

ROOM = "Room in 3D"
MAPS = "Spectral maps"
WAITING_SHARE = 0.5  # of the time, in the unit of the parts' shares: for what is made beside them
ROOM_SHARE = 0.02  # of the time: the room in 3D and the page itself

__all__ = ["PAGE", "FloorPlan", "ReportInput", "ReportView", "StageRow", "write_report"]


def write_report(folder: Path, report: ReportInput, *, workers: int | None = None, progress: Progress = silent) -> Path:
    """Write the report: `index.html`, and its figures and tables (CSV, Markdown, HTML) in folders beside it.

    Parameters
    ----------
    folder : Path
        Made if absent.
    report : ReportInput
        Content of the report.
    workers : int, optional
        Processor cores that may be used; all if left out.
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
    making, joining = shares(progress, (1.0 - ROOM_SHARE, ROOM_SHARE))
    # What is drawn for files of other kinds, after the page, has to be drawn here.
    cores = workers if writer.only_svg else 1
    listed = _parts(report, light, writer)
    with beside(lambda _: [part.make() for part in listed if part.beside], words="figures", workers=cores) as drawn:
        sections = _sections(listed, drawn, making)
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
        partitions=report.plan.partitions,
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


@dataclass(frozen=True, kw_only=True)
class _Part:
    """Some HTML of a section; all parts of one title are a section, in their order.

    Parameters
    ----------
    title : str
    share : float
        Of the time, in any unit.
    make : callable
        Gives the HTML; empty if there is nothing to say.
    beside : bool
        Whether it is made while the others are; these take about as long together.
    """

    title: str
    share: float
    make: Callable[[], str]
    beside: bool = False


def _parts(report: ReportInput, light: parts.ReportLight, writer: ReportWriter) -> tuple[_Part, ...]:
    """Of the page, in their order."""

    def made(section: Callable[..., str], **more: parts.ReportLight) -> Callable[[], str]:
        return partial(section, report, writer=writer, **more)

    frames = () if report.frames is None else (report.frames,)
    return (
        _Part(title=ROOM, share=0.0, make=lambda: parts.room_section(report)),
        _Part(title="Summary", share=0.1, make=made(parts.summary_section)),
        _Part(title="Illuminance", share=0.5, make=made(parts.illuminance_section, light=light)),
        _Part(title=MAPS, share=1.2, make=made(parts.maps_section)),
        _Part(title=MAPS, share=2.3, make=made(parts.compared_maps), beside=True),
        _Part(title=MAPS, share=0.1, make=made(parts.bands_section)),
        _Part(title="Spectra", share=0.5, make=made(parts.spectra_section)),
        _Part(title="Accuracy", share=0.7, make=made(parts.accuracy_section), beside=True),
        _Part(title="Lamps and sensors", share=0.2, make=made(parts.lamps_section)),
        *(_application(each, writer) for each in report.applications),
        _Part(title="Materials", share=0.6, make=made(parts.materials_section), beside=True),
        _Part(title="Views", share=0.1, make=made(parts.views_section)),
        *(_application(each, writer) for each in frames),
        _Part(title="Scan", share=0.0, make=made(parts.scan_section)),
        _Part(title="All points", share=0.1, make=made(parts.points_section)),
        _Part(title="Provenance", share=0.1, make=made(parts.provenance_section)),
        _Part(title="Time and memory", share=0.0, make=made(parts.time_section)),
    )


def _application(application: Application, writer: ReportWriter) -> _Part:
    return _Part(title=application.title, share=0.5, make=partial(parts.application_section, application, writer))


def _sections(
    listed: Sequence[_Part], drawn: Callable[[Progress], list[str]], progress: Progress
) -> list[html.Section]:
    """Make the parts, ask for those that are made beside them, and join them; an empty section is left out."""
    here = [number for number, part in enumerate(listed) if not part.beside]
    *listeners, waiting = shares(progress, [*(listed[number].share for number in here), WAITING_SHARE])
    made = {}
    for number, tell in zip(here, listeners, strict=True):
        tell(0.0, listed[number].title.lower())
        made[number] = listed[number].make()
    made |= zip((number for number, part in enumerate(listed) if part.beside), drawn(waiting), strict=True)
    contents: dict[str, str] = {}
    for number, part in enumerate(listed):
        contents[part.title] = contents.get(part.title, "") + made[number]
    return [
        html.Section(anchor=title.lower().replace(" ", "-"), title=title, content=content)
        for title, content in contents.items()
        if content
    ]


def _lead(report: ReportInput) -> str:
    dataset = report.spectral_map
    centers = dataset["band"].to_numpy()
    span = f"at {centers[0]:g}" if centers.size == 1 else f"from {centers[0]:g} to {centers[-1]:g}"
    return (
        f"Spectral irradiance at {counted(dataset.sizes['point'], 'point')} in {counted(centers.size, 'band')} {span} "
        f"nm, computed from the scan {report.scan.file}."
    )


def _footer(report: ReportInput) -> str:
    return f"Made by LiDARSpectra {report.provenance.get('lidarspectra', '')}".rstrip() + ". Irradiance in W m⁻² nm⁻¹."
