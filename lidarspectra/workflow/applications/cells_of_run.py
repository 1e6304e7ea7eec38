"""Solar cells in a finished run, and beside a measured map: what the commands do."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.errors import MapError, ReadingError
from lidarspectra.geometry.scan import load_scan
from lidarspectra.hardware.sensor.photocell import M2_PER_CM2
from lidarspectra.io.csv_text import csv_text
from lidarspectra.io.files import write_whole, writing
from lidarspectra.lamps.lamps import is_daylight
from lidarspectra.mapping.figures.figure_style import save_figure
from lidarspectra.mapping.figures.floor_plan import FloorPlan
from lidarspectra.mapping.figures.tables import Table, save_table
from lidarspectra.mapping.maps.map_schema import kept_points
from lidarspectra.mapping.maps.point_values import save_points
from lidarspectra.mapping.photometry.indoor_spectra import indoor_spectra
from lidarspectra.mapping.photometry.schedule import parse_hours, read_schedule
from lidarspectra.mapping.photovoltaics.cells import Cell, find_cell
from lidarspectra.mapping.photovoltaics.current_map import area_of, current_map, current_notes, currents_table
from lidarspectra.mapping.photovoltaics.currents import unknown_share
from lidarspectra.mapping.photovoltaics.figures import currents_figure
from lidarspectra.mapping.photovoltaics.from_sensor import current_from_channels
from lidarspectra.mapping.photovoltaics.placement import best_mounts, joined, tilted_mounts, wall_mounts
from lidarspectra.room.free_space import FreeSpace
from lidarspectra.room.room import load_room
from lidarspectra.spectra.sensor_files import find_bands
from lidarspectra.workflow.run_folder.assumed import notes_of_light
from lidarspectra.workflow.run_folder.light_of_run import (
    dimmed_notes,
    light_of_table,
    plan_of_run,
    present_lamps_of_run,
    scene_of_run,
    transport_of_run,
)
from lidarspectra.workflow.run_folder.workspace import made_folder, require_stage
from lidarspectra.workflow.trace_notes import receptor_notes

CM = 1e-2  # [m]
MICRO = 1e6
UNKNOWN_SHARE = 0.05  # [1] share of a cell's response outside the channels that draws a note


@dataclass(frozen=True, kw_only=True)
class CurrentOrder:
    """Options for a cell's current in a run.

    Parameters
    ----------
    cell : str
        Database name or file.
    area_cm2 : float or None
        The cell's own if None. [cm²]
    scale : float
        On its curve. [1]
    hours : str or None
        '8:30-17', all electric lamps.
    schedule : Path or None
        See `read_schedule`.
    volt : float or None
        See `current_map`. [V]
    base : Path
        Where relative file names start.
    """

    cell: str
    area_cm2: float | None
    scale: float
    hours: str | None
    schedule: Path | None
    volt: float | None
    base: Path

    def __post_init__(self) -> None:
        _require_positive("scale", self.scale)
        _require_positive("volt", self.volt)


@dataclass(frozen=True, kw_only=True)
class PlaceOrder:
    """Options for the search of a cell's best place.

    Parameters
    ----------
    cell : str
        Database name or file.
    size_cm : (float, float)
        Width and height. [cm]
    tilts_deg, azimuths_deg : tuple of float
        To try at the run's points. [deg]
    wall_heights_m : tuple of float
        Above the floor, to try on the walls; empty leaves the walls out. [m]
    scale : float
        On its curve. [1]
    count : int
        Number of places to list.
    workers : int or None
        Processes; one a core if None.
    base : Path
        Where relative file names start.
    """

    cell: str
    size_cm: tuple[float, float]
    tilts_deg: tuple[float, ...]
    azimuths_deg: tuple[float, ...]
    wall_heights_m: tuple[float, ...]
    scale: float
    count: int
    workers: int | None
    base: Path

    def __post_init__(self) -> None:
        _require_positive("scale", self.scale)
        for degrees in (*self.tilts_deg, *self.azimuths_deg):
            if not np.isfinite(degrees):
                raise MapError(expected="angles in degrees", found=f"{degrees}", where="places for a cell")


def _require_positive(name: str, value: float | None) -> None:
    if value is not None and not 0 < value < np.inf:
        raise MapError(expected="a number above 0", found=f"{value:g}", where=f"{name} of a cell")


def current_of_run(run: Path, order: CurrentOrder) -> tuple[xr.Dataset, FloorPlan, Cell]:
    """Currents at the points of a finished run, its plan, and the cell.

    Raises
    ------
    LidarSpectraError
        If the run is not finished, or cell, area or schedule do not fit.
    """
    cell = find_cell(order.cell, order.base)
    shifts = read_schedule(order.base / order.schedule) if order.schedule else ()
    if order.hours:
        shifts = (parse_hours(order.hours),)
    lamps, transport = present_lamps_of_run(run), transport_of_run(run)
    currents = current_map(
        transport,
        {lamp.name: lamp.flux for lamp in lamps},
        cell,
        area_m2=None if order.area_cm2 is None else order.area_cm2 * M2_PER_CM2,
        scale=order.scale,
        shifts=shifts,
        daylight=[lamp.name for lamp in lamps if is_daylight(lamp)],
        volt=order.volt,
    )
    dimmed = dimmed_notes(run) if shifts else ()
    notes = [*receptor_notes(transport.attrs), *dimmed, *str(currents.attrs["notes"]).splitlines()]
    return currents.assign_attrs(notes="\n".join(notes)), plan_of_run(run), cell


def save_currents(currents: xr.Dataset, plan: FloorPlan, folder: Path) -> Path:
    """Write points.csv, the table and the maps (PNG, PDF); the folder is made if absent."""
    save_points(currents, made_folder(folder))
    save_table(currents_table(currents), folder)
    save_figure(currents_figure(currents, plan), folder, "maps")
    return folder


def places_in_run(run: Path, order: PlaceOrder) -> tuple[Table, tuple[str, ...]]:
    """Best places for a cell in the room of a finished run, best first, and caveats on them.

    Raises
    ------
    LidarSpectraError
        If the run is not finished, the cell is unknown, or nowhere is room for it.
    """
    cell = find_cell(order.cell, order.base)
    transport = transport_of_run(run)
    folder = require_stage(run, "scan")
    scan, room, lamps = load_scan(folder), load_room(folder), present_lamps_of_run(run)
    points = np.stack([transport[name].to_numpy() for name in ("x", "y", "z")], axis=1)[kept_points(transport)]
    mounts = tilted_mounts(points, order.tilts_deg, order.azimuths_deg)
    if order.wall_heights_m:
        mounts = joined(mounts, wall_mounts(room, order.wall_heights_m))
    ranked = best_mounts(
        scene_of_run(run),
        scan,
        lamps,
        mounts,
        cell,
        (order.size_cm[0] * CM, order.size_cm[1] * CM),
        count=order.count,
        accuracy=transport.attrs["accuracy"],
        workers=order.workers,
        free=FreeSpace(scan, room),
    )
    area = order.size_cm[0] * order.size_cm[1] * M2_PER_CM2
    found = ranked.mounts
    frame = pd.DataFrame(
        {
            "x [m]": found.positions[:, 0],
            "y [m]": found.positions[:, 1],
            "z [m]": found.positions[:, 2],
            "tilt [deg]": found.tilt_deg,
            "azimuth [deg]": found.azimuth_deg,
            "current [µA]": MICRO * order.scale * area * ranked.density,
            "standard error [µA]": MICRO * order.scale * area * ranked.standard_error,
            "lowest/mean over the cell": ranked.evenness,
        }
    )
    caption = (
        f"Best places for '{cell.name}' of {order.size_cm[0]:g} cm x {order.size_cm[1]:g} cm, "
        f"of {ranked.tried} places and directions."
    )
    formats = dict.fromkeys(("x [m]", "y [m]", "z [m]"), ".2f") | dict.fromkeys(frame.columns[3:5], ".0f")
    return Table(name="cell-places", caption=caption, frame=frame, formats=formats), (
        *current_notes(cell, order.scale, {lamp.name: lamp.flux for lamp in lamps}),
        *notes_of_light(run),
    )


def save_places(table: Table, folder: Path) -> Path:
    """Write the table; the folder is made if absent."""
    save_table(table, made_folder(folder))
    return folder


def predict_from_table(
    measured: Path,
    cell_name: str,
    device: str,
    *,
    lamp_kind: str | None,
    area_cm2: float | None,
    scale: float,
    base: Path,
    out: Path,
) -> tuple[Table, tuple[str, ...]]:
    """Predict a cell's current from measured channels: a file of one row per reading, a summary, and caveats.

    Raises
    ------
    LidarSpectraError
        If cell, device or table do not fit, or the file cannot be written.
    """
    _require_positive("scale", scale)
    cell = find_cell(cell_name, base)
    bands = find_bands(device, base)
    read = light_of_table(measured, bands, needs_places=False)
    light = read.light
    density, uncertainty = current_from_channels(
        light.irradiance, light.irradiance_se, bands, cell, indoor_spectra(), lamp_kind=lamp_kind
    )
    frame = pd.DataFrame({name: read.places[name].to_numpy() for name in (*read.names, "x", "y", "z")})
    frame["current_density_A_m2"], frame["SE_current_density_A_m2"] = scale * density, scale * uncertainty
    if area_cm2 is not None or cell.area_m2 is not None:
        area = area_of(cell, None if area_cm2 is None else area_cm2 * M2_PER_CM2)
        frame["current_A"] = area * frame["current_density_A_m2"]
        frame["SE_current_A"] = area * frame["SE_current_density_A_m2"]
    with writing(out, error=ReadingError):
        write_whole(out, csv_text(frame, digits=6))
    caption = (
        f"Current of the cell '{cell.name}' predicted from {len(bands)} channels at {len(frame)} places, with its "
        "standard uncertainty."
    )
    unseen = unknown_share(light, cell)
    words = (
        f"{100 * unseen:.0f} % of the response of '{cell.name}' lies outside these channels, so that its current in "
        "sunlight and under incandescent lamps is underestimated. The 18 channels of an AS7265x, up to 940 nm, cover "
        "more."
    )
    notes = (*read.notes, *cell.notes(scale), *((words,) if unseen > UNKNOWN_SHARE else ()))
    return _predicted_table(frame, caption), notes


def _predicted_table(frame: pd.DataFrame, caption: str) -> Table:
    """Mean, lowest and highest of the predictions."""
    rows = [
        (
            name,
            frame[name].mean(),
            frame[name].min(),
            frame[name].max(),
            100.0 * (frame["SE_" + name] / frame[name]).mean(),
        )
        for name in ("current_density_A_m2", "current_A")
        if name in frame
    ]
    summary = pd.DataFrame(rows, columns=["quantity", "mean", "lowest", "highest", "uncertainty [%]"])
    return Table(name="predicted-current", caption=caption, frame=summary, formats={"uncertainty [%]": ".1f"})
