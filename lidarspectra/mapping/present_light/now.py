"""The light of now in a room: readings in, states of the lamps, map, means, trend and alarm out.

Plain arrays and no clock of its own: a live run, a recording and a simulation are the same to it.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, float_array
from lidarspectra.errors import MapError
from lidarspectra.mapping.present_light.doubts import Alarm, Suspect
from lidarspectra.mapping.present_light.model import LampKnowledge, SensorModel, StatePrior
from lidarspectra.mapping.present_light.states import States, light_now, solve_states
from lidarspectra.mapping.present_light.trend import Trend
from lidarspectra.mapping.present_light.watch import PATIENCE, Watch

MAX_AGE_S = 60.0  # [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class LitRoom:
    """A room, its lamps and its fixed sensors, as plain arrays.

    Parameters
    ----------
    lamps, sensors, quantities : tuple of str
        Names; the quantities are those that the map has.
    numbers : tuple of (str, str)
        Sensor and key of every number that is read: 'lux', or a channel's label.
    model : SensorModel
        Of those numbers.
    knowledge : LampKnowledge
    map_light : (quantity, point, lamp) float
        Of every lamp, at the run's points. [unit of the quantity]
    sensor_light : (quantity, sensor, lamp) float
        The same at the sensors.
    counted : (point,) bool
        Points that count in means: those that are not buried.
    """

    lamps: tuple[str, ...]
    sensors: tuple[str, ...]
    quantities: tuple[str, ...]
    numbers: tuple[tuple[str, str], ...]
    model: SensorModel
    knowledge: LampKnowledge
    map_light: FloatArray
    sensor_light: FloatArray
    counted: BoolArray

    def __post_init__(self) -> None:
        lamps, quantities = len(self.lamps), len(self.quantities)
        for name, shape in (("map_light", (quantities, None, lamps)), ("sensor_light", (quantities, None, lamps))):
            object.__setattr__(self, name, float_array(getattr(self, name), name=f"LitRoom.{name}", shape=shape))
        if len(self.numbers) != self.model.numbers:
            raise MapError(
                expected=f"{self.model.numbers} numbers, as its model has",
                found=f"{len(self.numbers)}",
                where="LitRoom.numbers",
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class PresentAnswer:
    """The light of a moment.

    Parameters
    ----------
    time_s : float
        [s since 1970]
    states : States
        Of the lamps; while there is an alarm with a single suspect, without that sensor or that switch.
    said : (lamp,) float
        What switches say; NaN where there is none. [0-1]
    map_value, map_sd : (quantity, point) float
        And its deviation. [unit of the quantity]
    sensor_value, sensor_sd : (quantity, sensor) float
        What the states give at the sensors.
    mean, mean_sd : (quantity,) float
        Over the points that count; the deviation is that of the states alone.
    read : (number,) float
        Readings that it rests on; NaN where there was none, or only an old one. [unit of the number]
    alarm : Alarm or None
    """

    time_s: float
    states: States
    said: FloatArray
    map_value: FloatArray
    map_sd: FloatArray
    sensor_value: FloatArray
    sensor_sd: FloatArray
    mean: FloatArray
    mean_sd: FloatArray
    read: FloatArray
    alarm: Alarm | None


class PresentLight:
    """The light of now, inferred from the latest reading of every fixed sensor.

    Parameters
    ----------
    room : LitRoom
    max_age_s : float
        Readings that are older than this count no more; switches hold until they say something else. [s]
    patience : int
        Answers in a row that do not fit before there is an alarm.

    Attributes
    ----------
    trend : Trend
        Means of the map and states of the lamps over each minute of the last day.
    last_s : float or None
        When the latest reading came. [s since 1970]
    """

    def __init__(self, room: LitRoom, *, max_age_s: float = MAX_AGE_S, patience: int = PATIENCE) -> None:
        self.room = room
        self.trend = Trend((*room.quantities, *(f"lamp {name}" for name in room.lamps)))
        self._max_age_s = max_age_s
        self._place = {name: index for index, name in enumerate(room.numbers)}
        self._lamp = {name: index for index, name in enumerate(room.lamps)}
        self._value = np.full(len(room.numbers), np.nan)
        self._since_s = np.full(len(room.numbers), -np.inf)
        self._said = np.full(len(room.lamps), np.nan)
        self._prior: tuple[bytes, StatePrior] | None = None
        self.last_s: float | None = None
        self._watch = Watch(room.model, room.knowledge, sensors=room.sensors, lamps=room.lamps, patience=patience)

    def take(self, sensor: str, values: Mapping[str, float], time_s: float) -> bool:
        """Take a reading.

        Parameters
        ----------
        sensor : str
            Name of a sensor, or of a lamp for what its switch says.
        values : mapping of str to float
            'lux' [lx], channels by label [W/m²/nm], or 'state' of a switch [0-1].
        time_s : float
            [s since 1970]

        Returns
        -------
        counts : bool
            Whether any of it is of this room.
        """
        counts = False
        for key, value in values.items():
            if key == "state" and sensor in self._lamp and np.isfinite(value):
                self._said[self._lamp[sensor]] = min(max(value, 0.0), 1.0)
                counts = True
            place = self._place.get((sensor, key))
            if place is not None and np.isfinite(value):
                self._value[place], self._since_s[place] = value, time_s
                self.last_s = time_s
                counts = True
        return counts

    def answer(self, time_s: float) -> PresentAnswer:
        """The light at a moment [s since 1970], from the latest reading of every sensor."""
        room = self.room
        age_s = np.abs(time_s - self._since_s)  # what is of later was read before the clock was set back
        read = np.where(age_s <= self._max_age_s, self._value, np.nan)
        said = self._said.copy()
        states = solve_states(room.model, read, self._prior_of(said))
        alarm = self._watch.take(states, read, said, time_s) if np.isfinite(read).any() else self._watch.alarm
        if alarm is not None and len(alarm.suspects) == 1:
            states = self._without(alarm.suspects[0], read, said)
        on_map = [light_now(light, states, local_sd=room.model.local_sd) for light in room.map_light]
        at_sensors = [light_now(light, states, local_sd=room.model.local_sd) for light in room.sensor_light]
        average = [light_now(each[room.counted].mean(axis=0)[None], states, local_sd=0.0) for each in room.map_light]
        mean = np.array([value[0] for value, _ in average])
        self.trend.add(time_s, np.concatenate([mean, states.state]))
        return PresentAnswer(
            time_s=time_s,
            states=states,
            said=said,
            map_value=np.array([value for value, _ in on_map]),
            map_sd=np.array([sd for _, sd in on_map]),
            sensor_value=np.array([value for value, _ in at_sensors]),
            sensor_sd=np.array([sd for _, sd in at_sensors]),
            mean=mean,
            mean_sd=np.array([sd[0] for _, sd in average]),
            read=read,
            alarm=alarm,
        )

    def _without(self, suspect: Suspect, read: FloatArray, said: FloatArray) -> States:
        """States that rest neither on the one sensor nor on the one switch that is in doubt."""
        room = self.room
        if suspect.kind == "sensor":
            return solve_states(room.model, read, self._prior_of(said), chosen=room.model.sensor != suspect.index)
        believed = said.copy()
        believed[suspect.index] = np.nan
        return solve_states(room.model, read, room.knowledge.prior(believed))

    def _prior_of(self, said: FloatArray) -> StatePrior:
        key = said.tobytes()
        if self._prior is None or self._prior[0] != key:
            self._prior = (key, self.room.knowledge.prior(said))
        return self._prior[1]
