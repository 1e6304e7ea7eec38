"""Live localization: whether somebody is there, and where, frame by frame."""

from dataclasses import dataclass, field

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.localization.features import require_same_sensors
from lidarspectra.mapping.localization.fingerprint_table import quantity_of
from lidarspectra.mapping.localization.frames import Frame
from lidarspectra.mapping.localization.location_model import LocationModel
from lidarspectra.mapping.localization.locators import Method
from lidarspectra.mapping.localization.places import Located
from lidarspectra.mapping.localization.presence import NOBODY, TWO_PEOPLE
from lidarspectra.mapping.localization.running_reference import MedianWindow, RunningMedian


@dataclass(frozen=True, kw_only=True)
class Fix:
    """The position of the person by a frame and, unless each is judged alone, those before it.

    Parameters
    ----------
    time_s : float
        [s]
    label : str
        The most probable place; 'nobody' or 'two people' where that is more probable than one person.
    probability : float
        Its probability; that of a place includes that one person is there. [0-1]
    position_m : (float, float)
        Geometric median of the places with their probabilities as weights, in plan (see `places`); NaN where
        coordinates are not known, and where the answer is no place. [m]
    spread_m : float
        Root mean square distance of the places from it, with the same weights. [m]
    sensors : int
        Number of sensors with a reading.
    people : (float, float, float)
        Probability of nobody, one person and two. [0-1]
    """

    time_s: float
    label: str
    probability: float
    position_m: tuple[float, float]
    spread_m: float
    sensors: int
    people: tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class LiveSettings:
    """How frames are located.

    Parameters
    ----------
    method : Method
    window : MedianWindow
        Of the running median, which is the reference where no empty room is given.
    each_alone : bool
        Whether each frame is judged by itself, without what those before it told (`memory`).
    always_one : bool
        Whether one person is known to be there, so that every answer is a place.
    """

    method: Method = "together"
    window: MedianWindow = field(default_factory=MedianWindow)
    each_alone: bool = False
    always_one: bool = False


class LiveLocator:
    """Locates frames as they come, with a reference that follows the light and a memory of what was told.

    Parameters
    ----------
    model : LocationModel
    settings : LiveSettings, optional
    reference : (sensor, band) float, optional
        The empty room, in the unit of the frames and the model's order; without it the running median is taken.
    """

    def __init__(
        self, model: LocationModel, settings: LiveSettings | None = None, reference: FloatArray | None = None
    ) -> None:
        self._model = model
        self._settings = settings or LiveSettings()
        self._given = reference
        self._median = RunningMedian(self._settings.window)
        self._memory = model.memory()

    def locate(self, frame: Frame) -> Fix | None:
        """Locate the person; None while there is no reference yet, and where no sensor has a reading.

        Raises
        ------
        MapError
            If the frame lacks sensors or bands of the model.
        """
        table = require_same_sensors(frame.table, self._model.space, where="live readings")
        readings = table[quantity_of(table)].to_numpy()
        heard = int(np.isfinite(readings[0]).any(axis=1).sum())
        reference = self._given if self._given is not None else self._median.take(readings[0])
        if reference is None or not heard:
            return None
        trend = self._median.trend if self._given is None else None
        features = self._model.features_against(readings, reference, quantity_of(table), trend=trend)
        located = self._model.locate_features(features, self._settings.method)
        if not self._settings.each_alone:
            scores, people = self._memory.take(frame.time_s, features[0], located.scores[0], located.people[0])
            located = Located(scores=scores[None], places=located.places, people=people[None])
        nobody, one, two = (float(value) for value in located.people[0])
        if self._settings.always_one:
            nobody, one, two = 0.0, 1.0, 0.0
        best = int(located.best[0])
        x, y, _ = (float(value) for value in located.positions_m[0])
        label, probability = self._model.places.labels[best], one * float(located.scores[0, best])
        spread_m = float(located.spread_m[0])
        if max(nobody, two) > one:
            label, probability = (NOBODY, nobody) if nobody > two else (TWO_PEOPLE, two)
            x = y = spread_m = float("nan")
        return Fix(
            time_s=frame.time_s,
            label=label,
            probability=probability,
            position_m=(x, y),
            spread_m=spread_m,
            sensors=heard,
            people=(nobody, one, two),
        )
