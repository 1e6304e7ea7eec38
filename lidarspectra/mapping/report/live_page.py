"""The live page: the room in 3D with the map of now. Its numbers come from the server while it is open."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.mapping.figures.printable import printable
from lidarspectra.mapping.photometry.quantities import light_quantity
from lidarspectra.mapping.present_light.now import LitRoom, PresentAnswer
from lidarspectra.mapping.present_light.trend import Trend
from lidarspectra.mapping.report.report_page import document, resource
from lidarspectra.mapping.report.room_view import packed

SCRIPTS = ("three.js", "room-picture.js", "live.js")


@dataclass(frozen=True, kw_only=True, eq=False)
class LiveView:
    """What the page is of.

    Parameters
    ----------
    title : str
        Of the room.
    room : LitRoom
        Its quantities are names of `light_quantity`.
    places : (sensor, 3) float
        Where the sensors stand. [m]
    shown : (shown,) int
        Points that the 3D view has; see `room_view.shown_points`.
    is_recording : bool
        Whether readings are of the past.
    """

    title: str
    room: LitRoom
    places: FloatArray
    shown: IntArray
    is_recording: bool = False

    def page(self, room_data: str) -> str:
        """The page's HTML, with the room's own data of `room_view_data`."""
        quantities = [light_quantity(name) for name in self.room.quantities]
        about = {
            "title": printable(self.title),
            "recording": self.is_recording,
            "quantities": [{"words": each.words, "unit": each.unit} for each in quantities],
            "lamps": [printable(name) for name in self.room.lamps],
            "sensors": [
                {"name": printable(name), "place": place}
                for name, place in zip(self.room.sensors, self.places.tolist(), strict=True)
            ],
        }
        return document(
            title=self.title,
            style=resource("style.css") + resource("live.css"),
            body=resource("live.html"),
            scripts=[resource(name) for name in SCRIPTS],
            data={"room-data": room_data, "live-data": _json(about).replace("<", "\\u003c")},
            connect=True,
        )

    def message(self, answer: PresentAnswer, last_s: float | None) -> str:
        """An answer as JSON on one line.

        Parameters
        ----------
        answer : PresentAnswer
        last_s : float or None
            When the last reading came; None before the first. [s since 1970]
        """
        room, states, alarm = self.room, answer.states, answer.alarm
        lamps = [
            {"state": state, "sd": sd, "said": said, "full": full, "daylight": daylight}
            for state, sd, said, full, daylight in zip(
                states.state.tolist(),
                states.sd.tolist(),
                answer.said.tolist(),
                room.knowledge.full.tolist(),
                room.knowledge.is_daylight.tolist(),
                strict=True,
            )
        ]
        fields = {
            "time": answer.time_s,
            "last": last_s,
            "chi_square": states.chi_square,
            "count": states.count,
            "lamps": lamps,
            "map": {
                "value": packed(answer.map_value[:, self.shown], "<f4"),
                "sd": packed(answer.map_sd[:, self.shown], "<f4"),
            },
            "mean": answer.mean.tolist(),
            "mean_sd": answer.mean_sd.tolist(),
            "sensors": [self._sensor(answer, index) for index in range(len(room.sensors))],
            "alarm": None
            if alarm is None
            else {
                "since": alarm.since_s,
                "sentences": list(alarm.sentences),
                "sensors": _named(alarm.suspects, "sensor", room.sensors),
                "lamps": _named(alarm.suspects, "lamp", room.lamps),
            },
        }
        return _json(fields)

    def _sensor(self, answer: PresentAnswer, index: int) -> dict[str, Any]:
        own = (self.room.model.sensor == index) & np.isfinite(answer.read)
        expected = answer.states.expected
        lux = [
            float(value)
            for (_, key), value, is_own in zip(self.room.numbers, answer.read, own, strict=True)
            if key == "lux" and is_own
        ]
        total = float(expected[own].sum())
        return {
            "lux": lux[0] if lux else None,
            "ratio": float(answer.read[own].sum()) / total if total > 0 else None,
            "value": answer.sensor_value[:, index].tolist(),
            "sd": answer.sensor_sd[:, index].tolist(),
        }


def trend_json(trend: Trend, columns: int) -> str:
    """The first columns of a trend as JSON, NaN as null."""
    times, means = trend.series()
    return _json({"step": trend.step_s, "times": times.tolist(), "values": means[:, :columns].tolist()})


def _named(suspects: Sequence[Any], kind: str, names: Sequence[str]) -> list[str]:
    return [printable(names[each.index]) for each in suspects if each.kind == kind]


def _json(value: Any) -> str:
    return json.dumps(_plain(value), separators=(",", ":"), allow_nan=False)


def _plain(value: Any) -> Any:
    """The same with None for numbers that JSON does not have."""
    if isinstance(value, dict):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_plain(each) for each in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
