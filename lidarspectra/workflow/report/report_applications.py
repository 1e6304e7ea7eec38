"""The applications that a run file asks its report for: solar cells, light for people and plants."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import xarray as xr

from lidarspectra.config import CellSection, PeopleAndPlantsSection, RunFile
from lidarspectra.hardware.sensor.photocell import M2_PER_CM2
from lidarspectra.lamps.lamps import Lamp, is_daylight
from lidarspectra.mapping.figures.floor_plan import FloorPlan
from lidarspectra.mapping.photometry.figures import quantities_figure
from lidarspectra.mapping.photometry.people_and_plants import light_at_points, summary_table
from lidarspectra.mapping.photometry.point_light import light_of_lamps
from lidarspectra.mapping.photometry.schedule import Shift, parse_hours
from lidarspectra.mapping.photovoltaics.cells import Cell, find_cell
from lidarspectra.mapping.photovoltaics.current_map import area_of, current_map, currents_table
from lidarspectra.mapping.photovoltaics.figures import currents_figure
from lidarspectra.mapping.report.applications import Application, ApplicationFigure
from lidarspectra.progress import Progress, silent
from lidarspectra.spectra.spectrum import BandSet, Spectrum

TYPICAL_CELL = "silicon"  # crystalline silicon is what most modules are of


def check_cell(section: CellSection, *, base: Path) -> None:
    """Refuse a cell that no report could show, before anything is traced.

    Parameters
    ----------
    section : CellSection
        Of the run file.
    base : Path
        Where relative file names start.

    Raises
    ------
    LidarSpectraError
        If the cell is unknown, has no area, or its hours are none.
    """
    area_of(find_cell(section.cell, base), _area_m2(section))
    _shifts(section)


def report_applications(
    room: RunFile,
    transport: xr.Dataset,
    lamps: Sequence[Lamp],
    bands: BandSet,
    plan: FloorPlan,
    *,
    base: Path,
    progress: Progress = silent,
) -> tuple[Application, ...]:
    """Sections of a report, as the run file wants them.

    Parameters
    ----------
    room : RunFile
    transport : xarray.Dataset
        Traced coefficients.
    lamps : sequence of Lamp
        That were traced.
    bands : BandSet
        The run's channels.
    plan : FloorPlan
    base : Path
        Where relative file names start.
    progress : callable
        See `lidarspectra.progress`.

    Raises
    ------
    LidarSpectraError
        If a cell is unknown or its hours are none.
    """
    sections = []
    fluxes = {lamp.name: lamp.flux for lamp in lamps}
    if room.people_and_plants is not None:
        sections.append(_people_and_plants(room.people_and_plants, transport, fluxes, bands, plan, progress))
    sections += [
        _cell(number, section, transport, lamps, plan, base) for number, section in enumerate(room.cells, start=1)
    ]
    return tuple(sections)


def _people_and_plants(
    section: PeopleAndPlantsSection,
    transport: xr.Dataset,
    fluxes: Mapping[str, Spectrum],
    bands: BandSet,
    plan: FloorPlan,
    progress: Progress,
) -> Application:
    light = light_of_lamps(transport, fluxes)
    quantities = light_at_points(light, transport, bands, rendering=section.rendering, progress=progress)
    caption = "Illuminance, melanopic equivalent daylight illuminance, colour temperature and photons for plants."
    return Application(
        title="People and plants",
        figures=(
            ApplicationFigure(name="people-and-plants", figure=quantities_figure(quantities, plan), caption=caption),
        ),
        tables=(summary_table(quantities),),
    )


def _cell(
    number: int,
    section: CellSection,
    transport: xr.Dataset,
    lamps: Sequence[Lamp],
    plan: FloorPlan,
    base: Path,
) -> Application:
    cell = find_cell(section.cell, base)
    currents = current_map(
        transport,
        {lamp.name: lamp.flux for lamp in lamps},
        cell,
        area_m2=_area_m2(section),
        scale=section.scale,
        shifts=_shifts(section),
        daylight=[lamp.name for lamp in lamps if is_daylight(lamp)],
        volt=section.volt,
    )
    name = f"cell-{number}-" + (re.sub(r"[^a-z0-9]+", "-", cell.name.lower()).strip("-") or "own")
    caption = f"A solar cell, '{cell.name}', at every point, facing as the sensors do."
    return Application(
        title=f"Solar cell {number}: {cell.name}",
        words=tuple(str(currents.attrs["notes"]).splitlines()),
        figures=(ApplicationFigure(name=name, figure=currents_figure(currents, plan), caption=caption),),
        tables=(replace(currents_table(currents), name=name),),
    )


def shown_cells(sections: Sequence[CellSection], *, base: Path) -> tuple[tuple[Cell, float], ...]:
    """Cells whose current the page shows, each with the factor on its curve: the run file's, or else a typical one."""
    found = tuple((find_cell(section.cell, base), section.scale) for section in sections)
    return found or ((find_cell(TYPICAL_CELL), 1.0),)


def _area_m2(section: CellSection) -> float | None:
    return None if section.area_cm2 is None else section.area_cm2 * M2_PER_CM2


def _shifts(section: CellSection) -> tuple[Shift, ...]:
    return () if section.hours is None else (parse_hours(section.hours),)
