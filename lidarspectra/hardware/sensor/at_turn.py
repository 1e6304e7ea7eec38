"""One turn of the AT firmware's driver: what was gathered for a reading, and whether its parts belong together."""

from collections import deque

import numpy as np

from lidarspectra.arrays import ByteArray, FloatArray
from lidarspectra.hardware.sensor.as7265x import (
    CHANNEL_COUNT,
    FLAG_DISAGREES,
    UART_ORDER,
    SensorSettings,
    mask_counts,
    mask_module_values,
)
from lidarspectra.hardware.sensor.sensor_records import Moment, Reading, no_values

AGREEMENT = 0.1  # largest relative difference of count and module value beyond rounding: light may change in between
FACTOR_MEMORY = 31  # latest readings whose median gives the usual factor


class ModuleFactors:
    """The constant ratio of module value to count per channel, estimated from readings at the same settings."""

    def __init__(self) -> None:
        self._ratios: deque[FloatArray] = deque(maxlen=FACTOR_MEMORY)

    def disagreeing(self, counts: FloatArray, module: FloatArray) -> ByteArray:
        """(18,) bool as uint8: where count and module value contradict each other."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = module / counts
            ratio = np.where(counts >= 5, ratio, np.nan)  # below, rounding alone makes 10 % and more
        self._ratios.append(ratio)
        if len(self._ratios) < 5:
            return np.zeros(CHANNEL_COUNT, dtype=np.uint8)
        known = np.array(self._ratios)
        known_enough = np.isfinite(known).sum(axis=0) >= 5
        usual = np.nanmedian(np.where(known_enough, known, 1.0), axis=0)
        slack = 1.0 / np.maximum(counts, 1.0)
        off = np.abs(ratio / usual - 1.0) > AGREEMENT + slack
        return np.asarray(off & known_enough, dtype=np.uint8)


class Turn:
    """The replies collected for one reading."""

    def __init__(self, settings: SensorSettings) -> None:
        self.settings = settings
        self.counts: list[tuple[list[int], Moment, bool]] = []
        self.module: list[float] | None = None
        self.temperatures: tuple[float, ...] | None = None
        self._confirmed: dict[str, int] = {}
        self._doubted: dict[str, int] = {}

    def read_back(self, kind: str, value: int) -> bool:
        """Compare a setting with the one that was set; a difference counts once it was read twice."""
        if value == self._wanted(kind) or self._doubted.get(kind) == value:
            self._confirmed[kind] = value
            return True
        self._doubted[kind] = value
        return False

    def _wanted(self, kind: str) -> int:
        return self.settings.gain_code if kind == "gain" else self.settings.integration_steps

    @property
    def lost_settings(self) -> bool:
        """Whether the module reports other settings than those that were set."""
        return any(value != self._wanted(kind) for kind, value in self._confirmed.items())

    @property
    def is_confirmed(self) -> bool:
        """Whether gain and integration time were read back as they were set."""
        return len(self._confirmed) == 2 and not self.lost_settings

    def lost_words(self) -> str:
        """The settings that differ, in words."""
        return ", ".join(
            f"{kind} {self._wanted(kind)} was set, {value} is read" for kind, value in self._confirmed.items()
        )

    def reading(self, counts: list[int], moment: Moment, is_sure: bool, factors: ModuleFactors) -> Reading:
        """One reading of this turn; gain and time are NaN unless both were read back as set, and nothing set since."""
        masked, flags = mask_counts(UART_ORDER.ascending(counts))
        module = no_values()
        sure = is_sure and self.is_confirmed
        gain = self.settings.gain if sure else float("nan")
        integration_ms = self.settings.integration_ms if sure else float("nan")
        if self.module is not None and len(self.counts) == 1:
            module, _ = mask_module_values(UART_ORDER.ascending(self.module))
            if sure:
                off = factors.disagreeing(masked, module)
                flags = np.bitwise_or(flags, off * FLAG_DISAGREES).astype(np.uint8)
                masked = np.where(off == 1, np.nan, masked)
                module = np.where(off == 1, np.nan, module)
        degrees = self.temperatures if self.temperatures is not None else (float("nan"),) * 3
        return Reading(
            moment=moment,
            counts=masked,
            module_values=module,
            flags=flags,
            gain=gain,
            integration_ms=integration_ms,
            temperatures_c=(float(degrees[0]), float(degrees[1]), float(degrees[2])),
        )
