"""`lidarspectra sensor show`: what a log holds, in words and as a picture."""

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from lidarspectra.cli.sensor_options import ColumnsOption, HeaderOption, LogArgument, SensorOption, columns_given
from lidarspectra.cli.terminal import console, print_log_notes, say
from lidarspectra.words import counted, duration_words

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike

app = typer.Typer()


@app.command()
def show(
    log: LogArgument,
    header: HeaderOption = None,
    columns: ColumnsOption = None,
    sensor: SensorOption = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", metavar="FILE.png", help="Draw the readings over time.", show_default=False)
    ] = None,
) -> None:
    """Print what a log or a table of fingerprints holds: layout, channel order, sensors, times, gaps, saturation."""
    from lidarspectra.errors import MapError, ReadingError
    from lidarspectra.hardware.sensor.identify import order_by_user
    from lidarspectra.hardware.sensor.log_layouts import one_sensor, read_sensor_log, sensors_of
    from lidarspectra.mapping.localization.fingerprint_files import NETCDF_SUFFIXES, read_fingerprints

    if log.suffix in NETCDF_SUFFIXES:
        _show_fingerprints(read_fingerprints(log), plot)
        return
    order = order_by_user(header) if header is not None else None
    try:
        held = read_sensor_log(log, order=order, columns=columns_given(columns))
    except ReadingError as error:  # a wide table of sensors with few channels is no log, but `localize` takes it
        try:
            table = read_fingerprints(log)
        except MapError:
            raise error from None
        _show_fingerprints(table, plot)
        return
    readings = held.readings if sensor is None else one_sensor(held.readings, sensor, where=str(log))
    for key, value in readings.attrs.items():
        if key != "notes":
            say(f"{key}: {value}")
    _say_times(readings)
    for name in ("gain", "integration_ms"):
        _say_values(name, readings[name].to_numpy())
    if "label" in readings.coords:
        labels = sorted(set(readings["label"].to_numpy().astype(str).tolist()))
        say(f"{counted(len(labels), 'place')}: {', '.join(labels[:12])}{' ...' if len(labels) > 12 else ''}")
    if "adc" in readings:
        say(counted(readings.sizes["cell"], "cell"))
    several = sensors_of(readings) if sensor is None else ()
    console.print(_table_of_sensors(readings, several) if len(several) > 1 else _table_of_channels(readings))
    for reason, group in held.gaps.groupby("reason"):
        lasted = (group["unix_s"] - group["since_unix_s"]).sum()
        say(
            f"{counted(len(group), 'gap')}, {lasted:.1f} s, {counted(int(group['lost'].sum()), 'reading')} known to be "
            f"lost: {reason}"
        )
    print_log_notes(readings)
    if plot is not None:
        from lidarspectra.mapping.figures.log_figure import log_figure

        _save(log_figure(readings), plot)


def _save(figure: "object", plot: Path) -> None:
    from matplotlib.figure import Figure

    from lidarspectra.mapping.figures.figure_style import save_picture

    assert isinstance(figure, Figure)
    say(str(save_picture(figure, plot)))


def _say_times(readings: "xr.Dataset") -> None:
    import numpy as np

    from lidarspectra.hardware.sensor.log_times import MIN_UNIX_S

    times = readings["unix_s"].to_numpy()
    count = counted(readings.sizes["reading"], "reading")
    if not np.isfinite(times).any():
        say(f"{count} without times")
        return
    first, last = float(np.nanmin(times)), float(np.nanmax(times))
    span = f"over {duration_words(last - first)}"
    if first < MIN_UNIX_S:
        say(f"{count} {span}, by a clock without a date")
        return
    stamp = time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime(first))
    say(f"{count} from {stamp} UTC {span}")


def _say_values(name: str, values: "ArrayLike") -> None:
    import numpy as np

    array = np.asarray(values, dtype=np.float64)
    known = np.unique(array[np.isfinite(array)])
    say(f"{name}: {', '.join(f'{value:g}' for value in known) or 'unknown'}")


def _table_of_channels(readings: "xr.Dataset") -> Table:
    import numpy as np

    from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS, FLAG_SATURATED

    saturated = (readings["flag"].to_numpy() & FLAG_SATURATED).astype(bool).sum(axis=0)
    values = [readings[name].to_numpy() for name in ("counts", "module_value")]
    if "irradiance" in readings and not np.isfinite(values).any():
        return _table_of_irradiances(readings)
    missing = readings.sizes["reading"] - (np.isfinite(values[0]) | np.isfinite(values[1])).sum(axis=0) - saturated
    table = Table("nm", "count, median", "module value, median", "missing", "saturated", box=None, header_style="bold")
    for c, label in enumerate(CHANNEL_LABELS):
        medians = [_median(each[:, c]) for each in values]
        table.add_row(label, *medians, str(missing[c] or ""), str(saturated[c] or ""))
    return table


def _table_of_irradiances(readings: "xr.Dataset") -> Table:
    import numpy as np

    from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS

    light = readings["irradiance"].to_numpy()
    table = Table("nm", "irradiance, median [W/m²/nm]", "missing", box=None, header_style="bold")
    for c, label in enumerate(CHANNEL_LABELS):
        table.add_row(label, _median(light[:, c]), str(int((~np.isfinite(light[:, c])).sum()) or ""))
    return table


def _table_of_sensors(readings: "xr.Dataset", sensors: tuple[str, ...]) -> Table:
    import numpy as np

    from lidarspectra.hardware.sensor.as7265x import FLAG_SATURATED

    table = Table(
        "sensor", "readings", "seconds apart", "longest pause", "median of channels", "missing", "saturated", box=None,
        header_style="bold",
    )  # fmt: skip
    names = readings["sensor"].to_numpy().astype(str)
    values = np.where(
        np.isfinite(readings["counts"].to_numpy()), readings["counts"].to_numpy(), readings["module_value"].to_numpy()
    )
    if "irradiance" in readings and not np.isfinite(values).any():
        values = readings["irradiance"].to_numpy()
    used = np.isfinite(values).any(axis=0)
    saturated = (readings["flag"].to_numpy() & FLAG_SATURATED).astype(bool)
    for sensor in sensors:
        own = names == sensor
        steps = np.diff(np.sort(readings["unix_s"].to_numpy()[own]))
        steps = steps[np.isfinite(steps)]
        pause = (f"{np.median(steps):.3g}", f"{steps.max():.3g}") if steps.size else ("", "")
        missing = 100.0 * float((~np.isfinite(values[own][:, used]) & ~saturated[own][:, used]).mean())
        full = 100.0 * float(saturated[own][:, used].mean())
        table.add_row(sensor, str(own.sum()), *pause, _median(values[own]), _percent(missing), _percent(full))
    return table


def _percent(share: float) -> str:
    return f"{share:.2g} %" if share > 0 else ""


def _show_fingerprints(table: "xr.Dataset", plot: Path | None) -> None:
    """Summary of a table of fingerprints."""
    import numpy as np

    from lidarspectra.mapping.localization.fingerprint_table import quantity_of

    quantity = quantity_of(table)
    labels = set(table["label"].to_numpy().astype(str).tolist())
    say(f"fingerprints: {table.sizes['fingerprint']} at {len(labels)} places, in {quantity}")
    say(f"empty room: {'yes' if 'empty' in table else 'no'}")
    shown = Table("sensor", f"median {quantity}", "missing", box=None, header_style="bold")
    for name in table["sensor"].to_numpy().astype(str):
        values = table[quantity].sel(sensor=name).to_numpy()
        shown.add_row(name, _median(values), _percent(100.0 * float(np.isnan(values).mean())))
    console.print(shown)
    if plot is not None:
        from lidarspectra.mapping.figures.log_figure import sensors_figure

        values = table[quantity].mean("band").to_numpy()
        names = table["sensor"].to_numpy().astype(str).tolist()
        _save(sensors_figure(np.arange(float(len(values))), values.T, names, "fingerprint"), plot)


def _median(values: "ArrayLike") -> str:
    import numpy as np

    array = np.asarray(values, dtype=np.float64)
    known = array[np.isfinite(array)]
    return f"{np.median(known):g}" if known.size else ""
