"""An alarm after several answers that do not fit, and its end after as many that do."""

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.present_light.doubts import STRANGE, Alarm, alarm_sentences, suspects
from lidarspectra.mapping.present_light.model import LampKnowledge, SensorModel
from lidarspectra.mapping.present_light.states import States

PATIENCE = 5  # answers: what passes by a sensor for a moment is no alarm


class Watch:
    """Keeps count of answers that do not fit.

    Parameters
    ----------
    model : SensorModel
    knowledge : LampKnowledge
    sensors, lamps : tuple of str
        Names, for the sentences.
    patience : int
        Answers in a row that do not fit before there is an alarm, and that fit before it ends.
    """

    def __init__(
        self,
        model: SensorModel,
        knowledge: LampKnowledge,
        *,
        sensors: tuple[str, ...],
        lamps: tuple[str, ...],
        patience: int = PATIENCE,
    ) -> None:
        self._model = model
        self._knowledge = knowledge
        self._sensors, self._lamps = sensors, lamps
        self._patience = patience
        self._run = 0  # answers in a row of the kind below
        self._fits = True
        self._since_s = 0.0
        self.alarm: Alarm | None = None

    def take(self, states: States, readings: FloatArray, said: FloatArray, time_s: float) -> Alarm | None:
        """The alarm after one more answer, or None while all is well.

        Parameters
        ----------
        states : States
        readings : (number,) float
            That they were estimated from. [unit of the number]
        said : (lamp,) float
            What the switches say.
        time_s : float
            [s since 1970]
        """
        fits = states.probability >= STRANGE
        if fits != self._fits:
            self._fits, self._run = fits, 0
            if not fits and self.alarm is None:
                self._since_s = time_s
        self._run += 1
        if fits:
            if self._run >= self._patience:
                self.alarm = None
        elif self._run % self._patience == 0:  # anew from time to time: causes come and go
            found = suspects(self._model, readings, self._knowledge, said)
            words = alarm_sentences(states, found, self._model, self._sensors, self._lamps)
            self.alarm = Alarm(since_s=self._since_s, sentences=words, suspects=tuple(found))
        return self.alarm
