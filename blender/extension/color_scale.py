"""From values to colours and back to words: the scale of the map, its ticks, and the numbers that sum it up."""

import math
from dataclasses import dataclass

import numpy as np

from .room_file import Floats

NEAR = 0.5  # [1] of the highest value: where the lowest is above it, the scale begins below the lowest
TICK_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)  # [1] times a power of ten
MAX_TICKS = 6
PREFIXES = ((1.0, ""), (1e-3, "m"), (1e-6, "µ"), (1e-9, "n"))


@dataclass(frozen=True, kw_only=True)
class Scale:
    """Values of the lowest and the highest colour, in the unit of the layer."""

    low: float
    high: float

    def share(self, values: Floats) -> Floats:
        """Where values stand on the scale [0-1]."""
        return np.asarray(np.clip((values - self.low) / (self.high - self.low), 0.0, 1.0))

    def colors(self, values: Floats, table: Floats) -> Floats:
        """(n, 4) scene-linear colours of (n,) values; `table` is the scale in sRGB, (color, 3)."""
        places = self.share(values) * (len(table) - 1)
        encoded = np.stack([np.interp(places, np.arange(len(table)), table[:, k]) for k in range(3)], axis=1)
        return np.concatenate([decode_srgb(encoded), np.ones((len(encoded), 1))], axis=1)

    def ticks(self) -> list[float]:
        """Round values on the scale, at most `MAX_TICKS`."""
        span = self.high - self.low
        power = 10.0 ** math.floor(math.log10(span))
        steps = [each * power * scale for scale in (0.1, 1.0) for each in TICK_STEPS]
        step = next(each for each in steps if span / each <= MAX_TICKS - 1)
        first = math.ceil(self.low / step - 1e-9)
        last = math.floor(self.high / step + 1e-9)
        return [step * number for number in range(first, last + 1)]


def scale_of(values: Floats) -> Scale:
    """A scale from zero, or from a little below the lowest value where all are alike; as the report's figures have it.

    Parameters
    ----------
    values : (n,) float
        Of points that are not buried.
    """
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 1.0)
    if high <= 0:
        return Scale(low=0.0, high=1.0)
    return Scale(low=0.0 if low < NEAR * high or low == high else low - 0.05 * (high - low), high=high)


def decode_srgb(encoded: Floats) -> Floats:
    """Linear values of sRGB [0-1] (IEC 61966-2-1)."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def prefixed(highest: float, unit: str) -> tuple[float, str]:
    """Factor and unit that bring the highest value to 1 or more: (1e3, 'mW/m²/nm') for 0.004 W/m²/nm."""
    if not unit.startswith("W/") or highest <= 0:
        return 1.0, unit
    size, letter = next((each for each in PREFIXES if highest >= each[0]), PREFIXES[-1])
    return 1.0 / size, f"{letter}{unit}"


@dataclass(frozen=True, kw_only=True)
class Summary:
    """Numbers of a layer over the points that are not buried, in its unit; uniformity is U0 = lowest / mean [1]."""

    mean: float
    lowest: float
    highest: float

    @property
    def uniformity(self) -> float:
        """U0 [1]."""
        return self.lowest / self.mean if self.mean > 0 else 0.0


def summary_of(values: Floats) -> Summary:
    """Mean, lowest and highest of (n,) values; zeros where there are none."""
    if not values.size:
        return Summary(mean=0.0, lowest=0.0, highest=0.0)
    return Summary(mean=float(values.mean()), lowest=float(values.min()), highest=float(values.max()))
