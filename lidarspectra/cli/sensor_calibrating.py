"""`lidarspectra sensor calibrate | calibrations`."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from lidarspectra.cli.sensor_options import (
    GainOption,
    IntegrationOption,
    SensorOption,
    calibration_named,
    settings_given,
)
from lidarspectra.cli.terminal import console, print_log_notes, print_note, say

if TYPE_CHECKING:
    from lidarspectra.hardware.sensor.as7265x import SensorSettings
    from lidarspectra.hardware.sensor.calibration import Calibration, Observation
    from lidarspectra.hardware.sensor.readings import Signal

app = typer.Typer()


@app.command()
def calibrate(
    name: Annotated[str, typer.Argument(help="A name for the calibration.", show_default=False)],
    device: Annotated[str, typer.Option(help="Your name for the sensor.")] = "AS7265x",
    lamp: Annotated[
        list[str] | None,
        typer.Option(
            "--lamp", metavar="LOG=SPECTRUM", help="A log, and the file of the lamp's spectrum at the sensor."
        ),
    ] = None,
    dark: Annotated[
        list[Path] | None, typer.Option("--dark", metavar="LOG", help="A log taken with the sensor covered.")
    ] = None,
    unit: Annotated[
        str | None, typer.Option(help="Unit of the spectra, such as uW/cm2/nm, if their heading does not name it.")
    ] = None,
    uncertainty: Annotated[float, typer.Option(help="Relative standard uncertainty of the reference.")] = 0.05,
    field: Annotated[
        Path | None, typer.Option("--field", metavar="LOG", help="A log taken at one point of a map.")
    ] = None,
    simulated: Annotated[Path | None, typer.Option("--map", help="The simulated map (CSV), for --field.")] = None,
    at: Annotated[
        tuple[float, float, float] | None, typer.Option(help="The sensor's place x y z (m), for --field.")
    ] = None,
    sensor: SensorOption = None,
    gain: GainOption = None,
    integration: IntegrationOption = None,
) -> None:
    """Calibrate against lamps of known spectrum, or at one point of a simulated map; save by name and version."""
    from lidarspectra.hardware.robot.reference_files import simulated_light_at
    from lidarspectra.hardware.sensor.calibration import field_calibration
    from lidarspectra.hardware.sensor.calibration_files import save_calibration
    from lidarspectra.hardware.sensor.log_layouts import readings_from_csv

    if (field is None) == (not lamp):
        raise typer.BadParameter("give --lamp LOG=SPECTRUM (once or more), or --field LOG with --map and --at")
    if field is not None:
        if simulated is None or at is None:
            raise typer.BadParameter("--field goes with --map and --at")
        light, distance = simulated_light_at(simulated, at)
        readings = readings_from_csv(field, settings=settings_given(gain, integration), sensor=sensor)
        print_log_notes(readings)
        fitted = field_calibration(readings, light, name=name, device=device)
        say(f"The map's nearest point is {distance:.2f} m away.")
    else:
        fitted = _lamp_calibration(
            name, device, lamp or [], dark or [], unit, uncertainty, settings_given(gain, integration), sensor
        )
    _show(save_calibration(fitted))


def _lamp_calibration(
    name: str,
    device: str,
    lamps: list[str],
    dark: list[Path],
    unit: str | None,
    uncertainty: float,
    settings: "SensorSettings | None",
    sensor: str | None,
) -> "Calibration":
    import numpy as np

    from lidarspectra.hardware.robot.reference_files import reference_from_file
    from lidarspectra.hardware.sensor.calibration import fit_calibration, observe, settings_of
    from lidarspectra.hardware.sensor.calibration_checks import leave_one_out
    from lidarspectra.hardware.sensor.log_layouts import readings_from_csv
    from lidarspectra.hardware.sensor.readings import best_signal

    observations: list[Observation] = []
    kind: Signal | None = None
    found: list[tuple[float, float]] = []
    for pair in lamps:
        log, separator, spectrum = pair.rpartition("=")
        if not separator:
            raise typer.BadParameter(f"'{pair}' is not of the form LOG=SPECTRUM")
        readings = readings_from_csv(Path(log), settings=settings, sensor=sensor)
        print_log_notes(readings)
        kind = kind or best_signal(readings)
        found.append(settings_of(readings))
        reference = reference_from_file(Path(spectrum), unit=unit)
        observations.append(observe(readings, reference, name=Path(spectrum).stem, kind=kind, uncertainty=uncertainty))
    for path in dark:
        readings = readings_from_csv(path, settings=settings, sensor=sensor)
        print_log_notes(readings)
        observations.append(observe(readings, np.zeros(18), name=f"dark {path.stem}", kind=kind, uncertainty=0.0))
    assert kind is not None  # there is a lamp
    gain, time_ms = (values[0] if len(set(values)) == 1 else math.nan for values in zip(*found, strict=True))
    if len({f"{each:g}" for each, _ in found}) > 1:  # all unknown are one
        print_note(
            "The lamps were read at different gains, whose ratios are known within 10 % only: what is read with this "
            "calibration is as uncertain at any gain. Read all lamps at the gain of the measurement."
        )
    if len(lamps) > 1:
        say(f"Each lamp predicted from the others: {100 * leave_one_out(observations):.1f} % rms")
    return fit_calibration(observations, name=name, device=device, of_signal=kind, gain=gain, integration_ms=time_ms)


def _show(calibration: "Calibration") -> None:
    from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS, DIE_INDEX, DIES

    made_from = ", ".join(calibration.observations)
    say(f"{calibration.label}, {calibration.created}; for {calibration.signal}; from {made_from}")
    table = Table("nm", "die", "signal per W/m²/nm", "±", "dark", "source", box=None, header_style="bold")
    for c, label in enumerate(CHANNEL_LABELS):
        share = calibration.responsivity_se[c] / calibration.responsivity[c]
        source = "measured" if calibration.is_measured[c] else "die's mean factor"
        values = (f"{calibration.responsivity[c]:.4g}", f"{100 * share:.1f} %", f"{calibration.dark[c]:.3g}", source)
        table.add_row(label, DIES[DIE_INDEX[c]], *values)
    console.print(table)
    for die, factor, error in zip(DIES, calibration.die_factor, calibration.die_factor_se, strict=True):
        say(f"{die}: {factor:.2f} times the data sheet's responsivity, ± {100 * error:.0f} %")
    for note in calibration.notes:
        say(note)


@app.command()
def calibrations(
    name: Annotated[str | None, typer.Argument(help="Show this calibration, NAME or NAME@VERSION.")] = None,
) -> None:
    """List the saved calibrations, or show one."""
    from lidarspectra.hardware.sensor.calibration_files import calibration_folder, list_calibrations

    if name is not None:
        shown = calibration_named(name)
        assert shown is not None  # a name was given
        _show(shown)
        return
    saved = list_calibrations()
    for calibration in saved:
        say(f"{calibration.label}, {calibration.created}")
    say(f"{len(saved)} calibrations in {calibration_folder()}")
