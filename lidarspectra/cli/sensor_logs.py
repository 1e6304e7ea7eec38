"""`lidarspectra sensor convert | join | rehearse | cells`: commands on recorded logs."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lidarspectra.cli.sensor_options import (
    CalibrationOption,
    ColumnsOption,
    GainOption,
    HeaderOption,
    IntegrationOption,
    LogArgument,
    SensorOption,
    calibration_named,
    columns_given,
    settings_given,
)
from lidarspectra.cli.terminal import print_log_notes, print_note, say
from lidarspectra.words import counted

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from lidarspectra.hardware.sensor.photocell import CellCircuit

app = typer.Typer()
SAME_HEIGHT_M = 0.15  # [m] within which `evaluate` takes a reading for one of a point


@app.command()
def convert(
    log: LogArgument,
    out: Annotated[Path, typer.Option("--out", metavar="TABLE.csv", show_default=False)],
    calibration: CalibrationOption = None,
    header: HeaderOption = None,
    columns: ColumnsOption = None,
    sensor: SensorOption = None,
    gain: GainOption = None,
    integration: IntegrationOption = None,
) -> None:
    """Convert a log of any known layout into one table: counts, settings, spectral irradiance and its uncertainty."""
    from lidarspectra.hardware.sensor.calibrated_light import spectral_irradiance
    from lidarspectra.hardware.sensor.identify import order_by_user
    from lidarspectra.hardware.sensor.log_layouts import one_sensor, read_sensor_log
    from lidarspectra.hardware.sensor.readings import write_readings

    order = order_by_user(header) if header is not None else None
    held = read_sensor_log(log, order=order, settings=settings_given(gain, integration), columns=columns_given(columns))
    readings = held.readings
    if sensor is not None or calibration is not None:  # a calibration is of one device
        readings = one_sensor(readings, sensor, where=str(log))
    light = spectral_irradiance(readings, calibration_named(calibration))
    write_readings(readings, out, light=light)
    print_log_notes(readings)
    say(f"{out}: {readings.sizes['reading']} readings, E in W/m²/nm by {light.attrs['calibration']}")


@app.command()
def join(
    log: LogArgument,
    poses: Annotated[
        Path, typer.Option("--poses", help="CSV, 'ros2 topic echo' output, or a ROS 2 bag.", show_default=False)
    ],
    out: Annotated[Path, typer.Option("--out", metavar="PLACED.csv", show_default=False)],
    topic: Annotated[str | None, typer.Option(help="Topic of the bag.")] = None,
    align: Annotated[
        Path | None, typer.Option("--align", help="CSV of points: name, robot_x, robot_y, scan_x, scan_y (m).")
    ] = None,
    offset: Annotated[
        float | None, typer.Option(metavar="S", help="Added to the readings' times. Default: estimated.")
    ] = None,
    mount: Annotated[tuple[float, float, float], typer.Option(help="Sensor on the robot: forward, left, up (m).")] = (
        0.0,
        0.0,
        0.0,
    ),
    simulated: Annotated[
        Path | None, typer.Option("--map", help="Simulated map (CSV), to choose between possible time offsets.")
    ] = None,
    locations: Annotated[
        Path | None, typer.Option("--locations", help="CSV x, y, z (m): average the readings near each.")
    ] = None,
    measured: Annotated[
        Path | None, typer.Option("--measured", metavar="MEASURED.csv", help="File for those averages.")
    ] = None,
    radius: Annotated[
        float | None, typer.Option(metavar="M", min=0.001, help="Largest distance of a reading from its location.")
    ] = None,
    calibration: CalibrationOption = None,
    columns: ColumnsOption = None,
    sensor: SensorOption = None,
    gain: GainOption = None,
    integration: IntegrationOption = None,
) -> None:
    """Give readings their positions in the scan's frame, and average them at given locations."""
    from lidarspectra.hardware.robot.alignment import align as fit
    from lidarspectra.hardware.robot.alignment import read_point_pairs
    from lidarspectra.hardware.robot.poses import read_poses
    from lidarspectra.hardware.robot.reference_files import map_light
    from lidarspectra.hardware.robot.robot import grid_readings, place_readings, read_locations, write_measured
    from lidarspectra.hardware.sensor.calibrated_light import spectral_irradiance
    from lidarspectra.hardware.sensor.log_layouts import readings_from_csv
    from lidarspectra.hardware.sensor.readings import write_readings

    settings = settings_given(gain, integration)
    readings = readings_from_csv(log, settings=settings, columns=columns_given(columns), sensor=sensor)
    print_log_notes(readings)
    light = spectral_irradiance(readings, calibration_named(calibration))
    alignment = None
    if align is not None:
        names, robot, scan = read_point_pairs(align)
        alignment = fit(robot, scan, names=names)
    placement = place_readings(
        readings,
        read_poses(poses, topic=topic),
        light=light["irradiance"].to_numpy(),
        offset_s=offset,
        mount=mount,
        alignment=alignment,
        expected=map_light(simulated) if simulated is not None else None,
    )
    for words in placement.words:
        say(words)
    placed = light.assign_coords({name: placement.readings[name] for name in ("x", "y", "z")})
    write_readings(placement.readings, out, light=placed)
    say(str(out))
    if locations is None:
        return
    wanted = read_locations(locations)
    target = measured if measured is not None else out.with_name(f"{out.stem}.measured.csv")
    gridded = grid_readings(placed, wanted, radius_m=radius)
    count = write_measured(gridded, target)
    say(f"{target}: {count} of {len(wanted)} locations, E in W/m²/nm by {light.attrs['calibration']}")
    higher_m = gridded.attrs["heights_apart_m"]
    if abs(higher_m) > SAME_HEIGHT_M:
        print_note(
            f"The readings' places are {abs(higher_m):.2f} m {'above' if higher_m > 0 else 'below'} the locations, "
            "which are compared on the floor alone. Say at which height the sensor rode (--mount), and give locations "
            "at it."
        )


@app.command()
def rehearse(
    simulated: Annotated[Path, typer.Argument(metavar="MAP.csv", help="Map of a run, as CSV.", show_default=False)],
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder for the files.", show_default=False)],
    faults: Annotated[float, typer.Option(min=0.0, max=0.5, help="Share of the messages that get a fault.")] = 0.05,
    seed: int = 0,
) -> None:
    """Rehearse a day of measuring with a virtual robot and sensor, in the light of a simulated map."""
    from lidarspectra.hardware.robot.robot import read_locations
    from lidarspectra.hardware.virtual.robot import rehearse as walk

    made = walk(simulated, folder, fault_rate=faults, seed=seed)
    _say_next(made.log.parent, simulated, height_m=float(read_locations(simulated)[:, 2].mean()))
    say(
        f"{counted(made.summary.readings, 'reading')}, {counted(made.summary.gaps, 'gap')}, "
        f"{counted(made.summary.lost, 'reading')} known to be lost"
    )


def _say_next(folder: Path, simulated: Path, *, height_m: float) -> None:
    from shlex import join as command

    calibrate = [
        *("lidarspectra", "sensor", "calibrate", "rehearsal"),
        *("--lamp", f"{folder / 'lamp-log.csv'}={folder / 'lamp.csv'}", "--dark", str(folder / "dark-log.csv")),
    ]
    place = [
        *("lidarspectra", "sensor", "join", str(folder / "log.csv"), "--poses", str(folder / "poses.csv")),
        *("--align", str(folder / "points.csv"), "--mount", "0", "0", f"{height_m:.2f}"),
        *("--calibration", "rehearsal", "--map", str(simulated)),
        *("--locations", str(simulated), "--measured", str(folder / "measured.csv")),
        *("--out", str(folder / "placed.csv")),
    ]
    evaluate = ["lidarspectra", "evaluate", "RUN", "--measured", str(folder / "measured.csv")]
    for words in (calibrate, place, evaluate):
        say(command(words))


@app.command()
def cells(
    log: LogArgument,
    reference: Annotated[float, typer.Option(help="Reference voltage of the A/D converter (V).", show_default=False)],
    shunt: Annotated[float, typer.Option(help="Resistor across the cell (ohm).", show_default=False)],
    area: Annotated[float, typer.Option(help="Area of the cell (cm²).")] = 36.0,
    bits: int = 10,
    dark: Annotated[float, typer.Option(help="Count with the cell covered.")] = 0.0,
    open_circuit: Annotated[float | None, typer.Option(help="Its open-circuit voltage (V), for a check.")] = None,
    out: Annotated[Path | None, typer.Option("--out", metavar="CURRENTS.csv")] = None,
    columns: ColumnsOption = None,
    sensor: SensorOption = None,
) -> None:
    """Compute currents of solar cells from the counts of an A/D converter."""
    from lidarspectra.hardware.sensor.log_layouts import readings_from_csv
    from lidarspectra.hardware.sensor.photocell import CellCircuit

    circuit = CellCircuit(
        reference_volt=reference,
        shunt_ohm=shunt,
        area_cm2=area,
        bits=bits,
        dark_count=dark,
        open_circuit_volt=open_circuit,
    )
    readings = readings_from_csv(log, columns=columns_given(columns), sensor=sensor)
    print_log_notes(readings)
    if "adc" not in readings:
        from lidarspectra.errors import ReadingError

        raise ReadingError(
            expected="a log with counts of solar cells",
            found="a log without",
            where=str(log),
            todo="Record the board that the cells are connected to.",
        )
    _show_currents(readings["adc"].to_numpy(), readings["unix_s"].to_numpy(), circuit, out)


def _show_currents(adc: "ArrayLike", unix_s: "ArrayLike", circuit: "CellCircuit", out: Path | None) -> None:
    import numpy as np
    import pandas as pd

    from lidarspectra.errors import ReadingError
    from lidarspectra.hardware.sensor.photocell import cell_current, cell_current_density, loading
    from lidarspectra.io.csv_text import csv_text
    from lidarspectra.io.files import write_whole, writing

    counts = np.asarray(adc, dtype=np.float64)
    columns = {"unix_s": np.asarray(unix_s, dtype=np.float64)}
    for cell in range(counts.shape[1]):
        current, error = cell_current(counts[:, cell], circuit)
        density, _ = cell_current_density(counts[:, cell], circuit)
        columns |= {f"I_{cell + 1}_A": current, f"SE_{cell + 1}_A": error, f"J_{cell + 1}_A_m2": density}
        typical = f"{1e6 * np.nanmedian(current):.3g} ± {1e6 * np.nanmedian(error):.2g} µA"
        load = loading(counts[:, cell], circuit)
        note = f", at most {100 * load:.0f} % of its open-circuit voltage" if load is not None else ""
        say(f"cell {cell + 1}: median {typical}, {np.nanmedian(density):.3g} A/m²{note}")
    if out is not None:
        with writing(out, error=ReadingError):
            write_whole(out, csv_text(pd.DataFrame(columns)))
        say(str(out))
