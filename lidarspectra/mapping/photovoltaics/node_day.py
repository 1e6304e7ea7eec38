"""A sensor node's day on a solar cell: what it needs to sleep, wake and send, and how many hours of light that takes.

    Q = I_sleep 24 h + n (I_wake t_wake + I_send t_send)           charge a day at the node's voltage
    h = Q U / (η U_cell I_cell)  =  Q / (η' I_cell)                 hours of light at the cell's current

with η the share of the cell's charge that reaches the node (converter and store). The uncertainty of h follows from
those of the current, of η and of the node's own charge, independent and on logarithms, since each is a factor.
"""

from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError

DAY_S = 86400.0  # [s]
DAY_H = 24.0  # [h]
COVERED = 1.645  # [1] standard deviations of the interval in which nine of ten lie


@dataclass(frozen=True, kw_only=True)
class NodeDay:
    """What a node does in a day.

    Parameters
    ----------
    sleep_ampere : float
        All day. [A]
    wake_ampere, wake_s : float
        To measure, each time. [A], [s]
    send_ampere, send_s : float
        To send, each time. [A], [s]
    period_s : float
        Between two readings. [s]
    volt : float
        Of the node. [V]
    relative_error : float
        Standard uncertainty of its charge. [1]
    """

    sleep_ampere: float
    wake_ampere: float
    wake_s: float
    send_ampere: float
    send_s: float
    period_s: float
    volt: float
    relative_error: float = 0.1

    def __post_init__(self) -> None:
        given = (self.sleep_ampere, self.wake_ampere, self.wake_s, self.send_ampere, self.send_s, self.relative_error)
        if min(given) < 0 or self.period_s < self.wake_s + self.send_s or self.volt <= 0:
            raise MapError(
                expected="currents and times of 0 or more, a voltage above 0, and a period longer than wake and send",
                found=f"{self.wake_s:g} s and {self.send_s:g} s every {self.period_s:g} s at {self.volt:g} V",
                where="a node's day",
            )

    @property
    def charge_coulomb(self) -> float:
        """Charge of a day [C]."""
        each = self.wake_ampere * self.wake_s + self.send_ampere * self.send_s
        return self.sleep_ampere * DAY_S + each * DAY_S / self.period_s

    @property
    def energy_joule(self) -> float:
        """Energy of a day [J]."""
        return self.charge_coulomb * self.volt


@dataclass(frozen=True, kw_only=True, eq=False)
class LightHours:
    """Hours of light that a node needs a day.

    Parameters
    ----------
    hours : (place,) float
        The most probable; above 24 there is no such day, infinite without current. [h]
    low, high : (place,) float
        Nine of ten lie between them. [h]
    suffices : (place,) float
        Probability that the hours of light that there are suffice. [0-1]
    """

    hours: FloatArray
    low: FloatArray
    high: FloatArray
    suffices: FloatArray


def light_hours(
    node: NodeDay,
    current_ampere: FloatArray,
    relative_error: FloatArray,
    *,
    cell_volt: float,
    efficiency: float,
    efficiency_error: float,
    lit_h: float,
) -> LightHours:
    """Hours of light a day that a cell needs to feed a node.

    Parameters
    ----------
    node : NodeDay
    current_ampere : (place,) float
        Of the cell under the light. [A]
    relative_error : (place,) float
        Its standard uncertainty. [1]
    cell_volt : float
        At which the cell is held. [V]
    efficiency, efficiency_error : float
        Of converter and store together, and its standard uncertainty. [1]
    lit_h : float
        Hours of light that there are a day. [h]

    Returns
    -------
    hours : LightHours

    Raises
    ------
    MapError
        If the efficiency, the voltage or the hours are impossible.
    """
    if not (0 < efficiency <= 1 and cell_volt > 0 and 0 <= lit_h <= DAY_H and efficiency_error >= 0):
        raise MapError(
            expected="an efficiency above 0 and up to 1, a voltage above 0, and 0 to 24 hours",
            found=f"{efficiency:g}, {cell_volt:g} V, {lit_h:g} h",
            where="a node's day",
        )
    from scipy.stats import norm

    power = efficiency * cell_volt * np.maximum(current_ampere, 0.0)
    with np.errstate(divide="ignore"):
        hours = node.energy_joule / power / 3600.0
        spread = np.sqrt(relative_error**2 + (efficiency_error / efficiency) ** 2 + node.relative_error**2)
        margin = np.log(max(lit_h, 1e-9) / hours) / np.maximum(spread, 1e-9)
    factor = np.exp(COVERED * spread)
    return LightHours(
        hours=np.asarray(hours, dtype=np.float64),
        low=np.asarray(hours / factor, dtype=np.float64),
        high=np.asarray(hours * factor, dtype=np.float64),
        suffices=np.asarray(norm.cdf(margin), dtype=np.float64),
    )
