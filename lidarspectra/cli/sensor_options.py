"""Options that several sensor commands share."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from lidarspectra.hardware.sensor.as7265x import SensorSettings
    from lidarspectra.hardware.sensor.calibration import Calibration
    from lidarspectra.hardware.sensor.identify import Wishes

PortArgument = Annotated[
    str, typer.Argument(metavar="PORT", help="COM3, /dev/ttyUSB0, socket://host:port ...", show_default=False)
]
LogArgument = Annotated[Path, typer.Argument(metavar="LOG", help="A log of the sensor.", show_default=False)]
BaudOption = Annotated[int | None, typer.Option("--baud", help="Baud rate. Default: 115200, then 9600.")]
HeaderOption = Annotated[
    str | None,
    typer.Option(
        "--header", metavar="A,B,...", help="Channel letters in the order of the columns, if the log has no header."
    ),
]
ColumnsOption = Annotated[
    str | None,
    typer.Option(
        "--columns",
        metavar="NAME=MEANING,...",
        help="What columns mean: time, time_ms, sensor, label, a channel (410 or its letter), cell_1, ignore.",
        show_default=False,
    ),
]
SensorOption = Annotated[
    str | None, typer.Option("--sensor", metavar="NAME", help="Which sensor of a log of several.", show_default=False)
]
GainOption = Annotated[float | None, typer.Option("--gain", help="Gain: 1, 3.7, 16 or 64.")]
IntegrationOption = Annotated[
    float | None, typer.Option("--integration", metavar="MS", help="Integration time, 2.8 to 714 ms.")
]
CalibrationOption = Annotated[
    str | None, typer.Option("--calibration", metavar="NAME[@VERSION]", help="A saved calibration of this device.")
]


def settings_given(gain: float | None, integration: float | None) -> "SensorSettings | None":
    """Settings that the user gave, or None; if only one of the pair is given, the other is the default."""
    from lidarspectra.hardware.sensor.as7265x import DEFAULT_SETTINGS, settings_for

    if gain is None and integration is None:
        return None
    return settings_for(
        gain if gain is not None else DEFAULT_SETTINGS.gain,
        integration if integration is not None else DEFAULT_SETTINGS.integration_ms,
    )


def columns_given(text: str | None) -> dict[str, str] | None:
    """What the user calls columns, or None."""
    from lidarspectra.hardware.sensor.log_columns import columns_by_user

    return None if text is None else columns_by_user(text)


def wishes_given(rate: float, header: str | None, gain: float | None, integration: float | None) -> "Wishes":
    """What the user asks of the device."""
    from lidarspectra.hardware.sensor.identify import Wishes, order_by_user

    return Wishes(
        period_s=1.0 / rate,
        settings=settings_given(gain, integration),
        order=order_by_user(header) if header is not None else None,
    )


def calibration_named(name: str | None) -> "Calibration | None":
    """A saved calibration by NAME or NAME@VERSION."""
    from lidarspectra.hardware.sensor.calibration_files import calibration_by_label

    return None if name is None else calibration_by_label(name)
