"""Calibrate a run by a few readings: fluxes, reflectances and meter factors, then the run anew with what they are.

The model and its solution stand in `mapping.calibration`; here its light is traced, and what comes out is written.
"""

import json
import shutil
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np

from lidarspectra.arguments import path_of
from lidarspectra.arrays import FloatArray
from lidarspectra.config import RunFile
from lidarspectra.errors import MapError
from lidarspectra.hardware.sensor.measured_readings import Scale, Unit
from lidarspectra.io.files import write_whole
from lidarspectra.mapping.calibration.model import (
    LOCAL_SD,
    LightModel,
    Observations,
    Priors,
    error_covariance,
)
from lidarspectra.mapping.calibration.model_error import fit_with_model_error
from lidarspectra.mapping.calibration.posterior import Posterior, disagreement
from lidarspectra.mapping.figures.tables import Table, save_table
from lidarspectra.mapping.maps.light_unknowns import error_scale
from lidarspectra.mapping.maps.visible_bands import covers_vision
from lidarspectra.mapping.photovoltaics.cells import find_cell
from lidarspectra.progress import Progress, part_of, silent
from lidarspectra.radiance.sampling.transport import TRANSPORT_FILE, load_transport
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.workflow.calibration.doubts import doubts, require_inside, require_light, without_dark_channels
from lidarspectra.workflow.calibration.light import (
    RunRoom,
    TracedLight,
    coefficients,
    run_room,
    traced_light,
    weights_of,
)
from lidarspectra.workflow.calibration.readings import CURRENT, LUX, Quantity, Readings, calibration_readings
from lidarspectra.workflow.calibration.results import (
    SUMMARY,
    calibrated_run_file,
    points_table,
    readings_table,
    undetermined_note,
    unknowns_table,
)
from lidarspectra.workflow.calibration.spectra import fit_spectra
from lidarspectra.workflow.calibration.unknowns_of_run import priors_of_room
from lidarspectra.workflow.run_folder.workspace import (
    STAGES,
    StageName,
    Workspace,
    require_stage,
    stage_folder,
    writing_run,
)

FIRST_SHARE = 0.85  # of the progress: the traces of the derivatives
KEPT: tuple[StageName, ...] = STAGES[:3]  # stages that a calibrated run takes over: it changes nothing before the scene


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibration:
    """A run calibrated by readings: the factors that they determine, and the map under them.

    Parameters
    ----------
    run_file : RunFile
        With `[calibration]`.
    unknowns : Table
        Every factor with its deviation, before and after.
    readings : Table
        Every number, measured and as the model has it before and after.
    points : Table
        The run's own points, their light before and after, and its deviations.
    map_sd_before, map_sd_after : (point,) float
        Relative deviation of the light at the run's points, by fluxes, reflectances and the model's own error. [1]
    local_sd : float
        The model's own error at a place of usual light, estimated from the misfit. [1]
    lamps : tuple of str
        Names, as the first rows of the covariance.
    covariance : (lamp + part, lamp + part) float
        Of the logarithms of the factors on fluxes and reflectances, after the readings. [1]
    chi_square : float
        Of readings and priors.
    numbers : int
        That were read; about as large as chi-square if all is well.
    spectra : Table or None
        Likely lamp spectra out of the databases; None where the readings cannot tell them.
    notes : tuple of str
        As full sentences.
    """

    run_file: RunFile
    unknowns: Table
    readings: Table
    points: Table
    map_sd_before: FloatArray
    map_sd_after: FloatArray
    local_sd: float
    lamps: tuple[str, ...]
    covariance: FloatArray
    chi_square: float
    numbers: int
    spectra: Table | None
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        before, after = (100 * float(np.median(each)) for each in (self.map_sd_before, self.map_sd_after))
        return (
            f"<Calibration by {self.numbers} numbers: deviation of the map {before:.1f} % before, {after:.1f} % after, "
            f"chi-square {self.chi_square:.1f}>"
        )


def calibrate_run(
    run: str | PathLike[str],
    measured: str | PathLike[str],
    *,
    unit: Unit = "W/m2/nm",
    scale: Scale = "none",
    cell: str | None = None,
    area_cm2: float | None = None,
    despite_doubts: bool = False,
    workers: int | None = None,
    progress: Progress = silent,
) -> Calibration:
    """Estimate lamp fluxes, reflectances and meter factors of a run from readings.

    Parameters
    ----------
    run : str or path
        Run folder with a finished trace. It stays as it is.
    measured : str or path
        CSV of readings; see `calibration_readings`.
    unit : str
        Of channels.
    scale : 'none', 'one', 'die' or 'channel'
        Meter factors that are not known.
    cell : str, optional
        Database name or file of the cell whose current_mA was read.
    area_cm2 : float, optional
        Its area; the database's by default. [cm²]
    despite_doubts : bool
        Go on with readings that look swapped, turned over, in another unit or of another room.
    workers : int, optional
        Processes; one a core by default.
    progress : callable

    Returns
    -------
    calibration : Calibration

    Raises
    ------
    MapError
        If the readings cannot be read, lie outside the room, or contradict the model in one of the ways above.
    WorkspaceError
        If the run has no finished trace.
    """
    run, measured = path_of(run, name="run"), path_of(measured, name="measured")
    room = run_room(run)
    readings = calibration_readings(measured, room.bands.labels, unit=unit, scale=scale, has_cell=cell is not None)
    require_inside(readings, room, measured)
    priors = priors_of(room, readings.meter_sd)
    points = _points(readings, run)
    light = traced_light(room, points, workers=workers, progress=part_of(progress, 0.0, FIRST_SHARE))
    spectra = fit_spectra(room, readings, light, priors, scale)
    room = spectra.room
    readings = without_dark_channels(readings, room, measured)
    weights = _weights(readings, room, cell, area_cm2)
    model = light.model(weights, readings.numbers.row)
    require_light(model, readings, measured)
    first_point = 2 * len(readings.names)
    readings = replace(readings, numbers=_with_model_error(readings, model, light, weights, first_point))
    reverse = light.model(weights, readings.numbers.row + len(readings.names))
    said = doubts(model, reverse, readings, priors, measured, despite=despite_doubts)
    first = fit_with_model_error(model, readings.numbers, priors)
    first_light = light
    light = _about(first, room, points, light, workers=workers, progress=part_of(progress, FIRST_SHARE, 1.0))
    exact = light.model(weights, readings.numbers.row)
    posterior = fit_with_model_error(exact, readings.numbers, priors)
    on_map = map_model(room, light, first_point=first_point)
    own_error = own_error_on(on_map)
    map_sd_before = np.hypot(posterior.light_sd(on_map, before=True), LOCAL_SD * own_error)
    map_sd_after = np.hypot(posterior.light_sd(on_map), posterior.local_sd * own_error)
    return Calibration(
        run_file=calibrated_run_file(room, posterior, measured, spectra.names),
        unknowns=unknowns_table(room, readings, posterior),
        readings=readings_table(readings, model, exact, posterior, disagreement(exact, readings.numbers, priors), room),
        points=points_table(
            points.positions[first_point:],
            (map_model(room, first_light, first_point=first_point), on_map),
            posterior,
            (map_sd_before, map_sd_after),
            room,
        ),
        map_sd_before=map_sd_before,
        map_sd_after=map_sd_after,
        local_sd=posterior.local_sd,
        lamps=tuple(lamp.name for lamp in room.lamps),
        covariance=posterior.covariance[: posterior.lamps + posterior.parts, : posterior.lamps + posterior.parts],
        chi_square=posterior.chi_square,
        numbers=readings.numbers.value.size,
        spectra=spectra.table,
        notes=(
            *readings.notes,
            *_receptor_notes(room, readings),
            *spectra.notes,
            *said,
            *undetermined_note(room, posterior),
        ),
    )


def save_calibration(calibration: Calibration, run: str | PathLike[str], *, force: bool = False) -> tuple[Path, Path]:
    """Write the calibrated run file beside the run's, and a run folder for it with all that it can take over.

    Parameters
    ----------
    calibration : Calibration
    run : str or path
        The folder that was calibrated.
    force : bool
        Replace a run file that is there.

    Returns
    -------
    run_file, tables : Path
        The run file, to be run, and the folder of tables in its run folder.

    Raises
    ------
    RunFileError, WorkspaceError
        If there is such a run file already, or something cannot be written.
    """
    run = path_of(run, name="run")
    given = calibration.run_file
    path = given.save(given.folder / f"{given.name}.toml", force=force)
    target = path.with_suffix(".run")
    with Workspace(target), writing_run(target):
        for stage in KEPT:
            if not stage_folder(target, stage).exists():
                shutil.copytree(require_stage(run, stage), stage_folder(target, stage))
        folder = target / "calibration"
        folder.mkdir(parents=True, exist_ok=True)
        write_whole(folder / SUMMARY, summary_text(calibration))
    for table in (calibration.unknowns, calibration.readings, calibration.points, calibration.spectra):
        if table is not None:
            save_table(table, folder)
    return path, folder


def _receptor_notes(room: RunRoom, readings: Readings) -> tuple[str, ...]:
    """A note where channels were read whose sensor, by the run file, has another response than the cosine."""
    sensors = room.run_file.sensors
    read = {quantity for quantity in readings.quantities if quantity not in (LUX, CURRENT)}
    if not read or (sensors.receptor is None and sensors.field_of_view_deg is None):
        return ()
    return (
        "Readings are taken as those of a sensor that sees by the cosine, with a diffuser: field_of_view_deg and "
        "receptor in [sensors] have no say here, and channels that were read without one mislead the calibration.",
    )


def summary_text(calibration: Calibration) -> str:
    """What the report tells of it besides its tables, as JSON, with the factors that it is of."""
    section = calibration.run_file.calibration
    assert section is not None  # since a calibrated run file has it
    return json.dumps(
        {
            "factors": section.model_dump(mode="json"),
            "chi_square": calibration.chi_square,
            "numbers": calibration.numbers,
            "local_sd": calibration.local_sd,
            "lamps": calibration.lamps,
            "covariance": calibration.covariance.tolist(),
            "map_sd": [float(each.mean()) for each in (calibration.map_sd_before, calibration.map_sd_after)],
            "notes": list(calibration.notes),
        },
        indent=1,
    )


def priors_of(room: RunRoom, meter_sd: FloatArray) -> Priors:
    """How well a run knows its lamps and reflectances (`unknowns_of_run.priors_of_room`), and its user the meter."""
    known = priors_of_room(
        room.run_file, [lamp.name for lamp in room.lamps], room.materials, room.part, room.scan.areas
    )
    return replace(known, meter_sd=meter_sd)


def _weights(readings: Readings, room: RunRoom, cell: str | None, area_cm2: float | None) -> FloatArray:
    if cell is None:
        return weights_of(readings.quantities, room)
    found = find_cell(cell)
    area_m2 = found.area_m2 if area_cm2 is None else area_cm2 / 1e4
    if area_m2 is None:
        raise MapError(expected="the cell's area", found="none", where=f"cell '{cell}'", todo="Give --area in cm².")
    return weights_of(readings.quantities, room, cell=found, area_m2=area_m2)


def _with_model_error(
    readings: Readings, model: LightModel, light: TracedLight, weights: FloatArray, first_point: int
) -> Observations:
    """The numbers with the covariance of the model's own error, larger where it is darker than the map's mean."""
    points = np.arange(first_point, light.base.shape[1])
    firsts = {quantity: index for index, quantity in reversed(list(enumerate(readings.quantities)))}
    typical = {quantity: light.base_light(weights[index], points).mean() for quantity, index in firsts.items()}
    usual = np.array([typical[quantity] for quantity in readings.quantities])
    rows = readings.numbers.row
    scale = error_scale(model.light.sum(axis=1), usual)
    covariance = error_covariance(readings.positions[rows], readings.normals[rows], scale)
    return replace(readings.numbers, model_error=covariance)


def own_error_on(on_map: LightModel) -> FloatArray:
    """(point,) by how much the model's own error is larger at the map's points than where light is usual [1]."""
    light = on_map.light.sum(axis=1)
    return error_scale(light, float(light.mean()))


def _points(readings: Readings, run: Path) -> SensorPoints:
    """Where light is traced: at the readings, there with the sensor turned over, and at the run's own points."""
    transport = load_transport(require_stage(run, "trace") / TRANSPORT_FILE)
    places = [np.stack([transport[name].to_numpy() for name in names], axis=1) for names in ("xyz", ("nx", "ny", "nz"))]
    return SensorPoints(
        positions=np.concatenate([readings.positions, readings.positions, places[0]]),
        normals=np.concatenate([readings.normals, -readings.normals, places[1]]),
    )


def _about(
    first: Posterior,
    room: RunRoom,
    points: SensorPoints,
    light: TracedLight,
    *,
    workers: int | None,
    progress: Progress,
) -> TracedLight:
    """The light model about a first solution: exact there, with the slopes as they were (Gauss and Newton's step)."""
    there = coefficients(room, points, np.exp(first.reflectance), workers=workers, progress=progress)
    with np.errstate(divide="ignore", invalid="ignore"):
        changed = np.nan_to_num(light.base / light.lowered, nan=1.0, posinf=1.0)  # (part, lamp, point, band)
    back = np.prod(changed ** (-first.reflectance[:, None, None, None] / light.step), axis=0)
    base = there * back
    return TracedLight(base=base, lowered=base / changed, step=light.step)


def map_model(room: RunRoom, light: TracedLight, *, first_point: int) -> LightModel:
    """Light at the run's own points: their illuminance, or the sum over channels where those do not cover vision."""
    points = np.arange(first_point, light.base.shape[1])
    quantity: Quantity = LUX
    if covers_vision(room.bands.centers_nm):
        return light.model(weights_of([quantity] * points.size, room), points)
    channels = weights_of(list(range(len(room.bands))), room).sum(axis=0)
    return light.model(np.broadcast_to(channels, (points.size, *channels.shape)), points)
