"""Records of a sensor on a serial line: readings, cell readings, and the faults between them."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from lidarspectra.arrays import ByteArray, FloatArray
from lidarspectra.hardware.sensor.as7265x import CHANNEL_COUNT

Reason = Literal[
    "disconnected", "reset", "settings lost", "flood", "damaged", "device error", "silence", "repeat", "lost"
]
"""Why a reading is missing or was received with a fault; the most severe first."""
REASONS: tuple[Reason, ...] = (
    "disconnected", "reset", "settings lost", "flood", "damaged", "device error", "silence", "repeat", "lost",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Moment:
    """A point in time on both clocks of the computer.

    Parameters
    ----------
    unix_s : float
        Wall clock; it may be set while recording. [s since 1970]
    monotonic_s : float
        Clock that only runs forward; differences of it are durations. [s]
    """

    unix_s: float
    monotonic_s: float

    def earlier(self, seconds: float) -> "Moment":
        """The moment so many seconds before."""
        return Moment(unix_s=self.unix_s - seconds, monotonic_s=self.monotonic_s - seconds)


def no_values() -> FloatArray:
    """(18,) NaN: no channel has a number."""
    return np.full(CHANNEL_COUNT, np.nan)


@dataclass(frozen=True, kw_only=True, eq=False)
class Reading:
    """One reading of all channels, by wavelength; NaN is what is not known.

    Parameters
    ----------
    moment : Moment
        When it was measured, as well as is known.
    counts : (18,) float
        Masked counts. [count]
    module_values : (18,) float
        The module's own corrected values (its "calibrated" data), masked. [1]
    flags : (18,) uint8
        Bits of `as7265x.FLAG_NAMES`.
    gain : float
        Gain factor the device says it measured with. [1]
    integration_ms : float
        Likewise the integration time. [ms]
    temperatures_c : tuple of 3 float
        Of the dies AS72651, AS72652, AS72653. [°C]
    boot, sequence, device_ms : int or None
        Number of the device's start, of the reading since then, and the device's clock, if it reports them. [ms]
    """

    moment: Moment
    counts: FloatArray
    module_values: FloatArray
    flags: ByteArray
    gain: float = float("nan")
    integration_ms: float = float("nan")
    temperatures_c: tuple[float, float, float] = (float("nan"), float("nan"), float("nan"))
    boot: int | None = None
    sequence: int | None = None
    device_ms: int | None = None


@dataclass(frozen=True, kw_only=True)
class CellReading:
    """One reading of the cells' analog-digital converter.

    Parameters
    ----------
    moment : Moment
        When.
    counts : tuple of float
        One count a cell; NaN where there is none. [count]
    boot, sequence, device_ms : int or None
        As in `Reading`.
    """

    moment: Moment
    counts: tuple[float, ...]
    boot: int | None = None
    sequence: int | None = None
    device_ms: int | None = None


@dataclass(frozen=True, kw_only=True)
class Trouble:
    """A fault on the line or in the device.

    Parameters
    ----------
    moment : Moment
        When it was noticed.
    reason : Reason
        What kind.
    detail : str
        In words, for the log.
    lost : int
        Readings that are known to be lost by it.
    stream : str
        'spectrum' or 'cells'.
    """

    moment: Moment
    reason: Reason
    detail: str = ""
    lost: int = 0
    stream: Literal["spectrum", "cells"] = "spectrum"


@dataclass(frozen=True, kw_only=True)
class Note:
    """An event without fault to be logged: a header, settings read back, a reconnection."""

    moment: Moment
    text: str


Item = Reading | CellReading | Trouble | Note
