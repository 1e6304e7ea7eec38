"""The page of a year of daylight: metrics, maps of them, and the hours of the year."""

from pathlib import Path

import pandas as pd
import xarray as xr

from lidarspectra.errors import MapError
from lidarspectra.io.files import writing
from lidarspectra.mapping.figures.annual_figures import carpet_figure
from lidarspectra.mapping.figures.floor_plan import FloorPlan
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.photometry.annual_metrics import COLUMNS, OCCUPIED_H, OCCUPIED_HOURS, SUMMER_TIME
from lidarspectra.mapping.photometry.figures import point_maps
from lidarspectra.mapping.report import report_page as html
from lidarspectra.mapping.report.report_writer import ReportWriter
from lidarspectra.words import digits

PAGE = "index.html"
MAPPED = {
    "DA300": "DA300 [%]",
    "UDI_100_3000": "UDI useful [%]",
    "UDI_above_3000": "UDI exceeded [%]",
    "sun_hours": "sun hours [h]",
    "melanopic_hours": "melanopic [h]",
}
ON_CARDS = ("sDA300/50%", "ASE1000,250h", "UDI 100-3000 lx", "UDI above 3000 lx", "melanopic hours", "mean illuminance")
PLACES = ("x", "y", "z", "nx", "ny", "nz", "buried")


def write_annual_page(
    folder: Path,
    year: xr.Dataset,
    points: pd.DataFrame,
    room: pd.DataFrame,
    plan: FloorPlan,
    *,
    title: str,
    notes: tuple[str, ...] = (),
) -> Path:
    """Write the page, and its figures and tables beside it.

    Parameters
    ----------
    folder : Path
        Made if absent.
    year : xarray.Dataset
        Of `annual_light`.
    points, room : pandas.DataFrame
        Of `point_metrics` and `room_metrics`.
    plan : FloorPlan
    title : str
        Of the room.
    notes : tuple of str
        What a reader must know before using the numbers: full sentences.

    Returns
    -------
    page : Path

    Raises
    ------
    MapError
        If the folder cannot be written.
    """
    writer = ReportWriter(folder)
    summary = _summary(room, writer, notes, str(year.attrs.get(SUMMER_TIME, "")))
    sections = [
        html.Section(
            anchor="summary",
            title="Summary",
            content=summary,
        ),
        html.Section(anchor="maps", title="Maps", content=_maps(year, points, plan, writer)),
        html.Section(anchor="hours", title="Hours of the year", content=_hours(year, writer)),
        html.Section(anchor="points", title="All points", content=_points(year, points, writer)),
    ]
    lead = (
        f"A year of daylight at {year.sizes['point']} points, {year.sizes['hour']} hours with light of "
        f"8760, by the weather of {year.attrs['weather']} ({_place(year)})."
    )
    page = html.page(title=f"Annual daylight: {title}", lead=lead, sections=sections, footer="Made by LiDARSpectra.")
    path = folder / PAGE
    with writing(folder, error=MapError):
        path.write_text(page, encoding="utf-8", newline="\n")
    return path


def _place(year: xr.Dataset) -> str:
    latitude, longitude = float(year.attrs["latitude_deg"]), float(year.attrs["longitude_deg"])
    across, along = "south" if latitude < 0 else "north", "west" if longitude < 0 else "east"
    return f"{abs(latitude):.2f}° {across}, {abs(longitude):.2f}° {along}"


def _summary(room: pd.DataFrame, writer: ReportWriter, notes: tuple[str, ...], summer_time: str) -> str:
    texts = room[["value", "low", "high"]].map(lambda value: digits(value, ".3g"))
    entries = [
        (str(row.metric), f"{text.value} {row.unit}", f"{text.low} to {text.high} within the noise")
        for row, text in zip(room.itertuples(), texts.itertuples(), strict=True)
        if row.metric in ON_CARDS
    ]
    words = (
        f"All is counted over {OCCUPIED_HOURS} occupied hours, from {OCCUPIED_H[0]} to {OCCUPIED_H[1]} h "
        f"{_clock_words(summer_time)} on every day, and for daylight alone: electric lamps are no part of it, and no "
        "blinds are drawn. The ranges are those of two standard errors of the simulation; weather, scan and materials "
        "are uncertain besides."
    )
    table = Table(name="annual-room", caption="Metrics of the room.", frame=room, formats={"value": ".4g"})
    return html.cards(entries) + html.warning_box(notes) + html.paragraph(words) + writer.table(table)


def _clock_words(summer_time: str) -> str:
    """By which clock hours are counted, of "03-31 10-27" or nothing."""
    if not summer_time:
        return "local standard time, without summer time (summer_time in [daylight] has it)"
    first, last = summer_time.split()
    return f"by the clock, which shows summer time from {first} to {last}"


def _maps(year: xr.Dataset, points: pd.DataFrame, plan: FloorPlan, writer: ReportWriter) -> str:
    coordinates = {name: year[name] for name in PLACES}
    values = xr.Dataset({name: ("point", points[name].to_numpy()) for name in MAPPED}, coords=coordinates)
    caption = (
        "Metrics of every point over the year's occupied hours, each on its own scale. DA300: share of hours with 300 "
        "lx or more. UDI useful: with 100 to 3000 lx; exceeded: with more. Sun hours: above 1000 lx straight from the "
        "sun. Melanopic: hours with 250 lx melanopic EDI or more."
    )
    return writer.figure("annual-maps", point_maps(values, plan, MAPPED), caption)


def _hours(year: xr.Dataset, writer: ReportWriter) -> str:
    caption = "Illuminance by daylight, mean over the points, in every hour of the year: days from left to right."
    return writer.figure("annual-hours", carpet_figure(year), caption)


def _points(year: xr.Dataset, points: pd.DataFrame, writer: ReportWriter) -> str:
    table = Table(
        name="annual-points",
        caption="Metrics of every point over the occupied hours.",
        frame=annual_table(year, points).rename(columns=COLUMNS),
    )
    return html.details(f"Table of {len(points)} points", writer.table(table, max_rows=1000))


def annual_table(year: xr.Dataset, points: pd.DataFrame) -> pd.DataFrame:
    """Places of the points beside their metrics."""
    places = pd.DataFrame({name: year[name].to_numpy() for name in PLACES})
    return pd.concat([places, points], axis=1)
