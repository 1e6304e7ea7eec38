"""A finished run kept live: how right its map of now is, how soon, and what a day of it costs.

    python -m research.benchmarks.live RUN --points 20 90 150 [--draws 300] [--hours 24]

Lux sensors stand at points of the run. Printed are: over draws of the lamps' states, fluxes and the model's errors, the
map's error and how many points lie within one and two of its deviations, without switches and with them; over faults,
how often they are noticed and named; a simulated day at one reading a second of each sensor: processor time, memory and
false alarms; and the time from a line in a log to the page, with the real server.
"""

import argparse
import json
import resource
import tempfile
import threading
import time
import tracemalloc
import urllib.request
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.hardware.incoming.arrivals import Notice
from lidarspectra.mapping.calibration.model import LOCAL_SD, READING_SD
from lidarspectra.mapping.present_light.doubts import STRANGE, suspects
from lidarspectra.mapping.present_light.now import LitRoom, PresentLight
from lidarspectra.mapping.present_light.states import light_now, solve_states
from lidarspectra.workflow.live.live_run import LiveOptions, LiveRun, present_light

FLUX_SD = 0.1  # [1] of the lamps' true fluxes about those of the run
LEVELS = (0.0, 0.0, 0.3, 0.7, 1.0, 1.0)  # states that lamps are drawn from
MIN_LIT = 0.05  # [1] of the mean light of all lamps on: darker draws say nothing of a map's relative error


class Draws:
    """Rooms that differ from the run as its model says: fluxes, and the light at each place by itself."""

    def __init__(self, room: LitRoom, seed: int) -> None:
        self.room = room
        self.lux = np.array([key == "lux" for _, key in room.numbers])
        self.random = np.random.default_rng(seed)

    def states(self) -> FloatArray:
        """(lamp,) what switches say [1]."""
        return self.random.choice(LEVELS, size=len(self.room.lamps))

    def read(self, light: FloatArray, place: FloatArray) -> FloatArray:
        """(number,) readings of the lux sensors."""
        noise = 1.0 + READING_SD * self.random.standard_normal(place.size)
        values = np.full(self.lux.size, np.nan)
        values[self.lux] = (self.room.model.light[self.lux] @ light) * place * noise
        return values

    def local(self, count: int) -> FloatArray:
        """(count,) factors of the model's own error at places [1]."""
        return np.asarray(1.0 + LOCAL_SD * self.random.standard_normal(count))


def print_maps(room: LitRoom, draws: int, *, switched: bool) -> None:
    """Error of the map of now over draws, and what is stated of it."""
    drawn = Draws(room, 3)
    errors: list[float] = []
    within: list[list[float]] = []
    full = float((room.map_light[0][room.counted].sum(axis=1)).mean())
    while len(errors) < draws:
        level = drawn.states()
        light = level * (1.0 + FLUX_SD * drawn.random.standard_normal(level.size))
        truth = (room.map_light[0] @ light) * drawn.local(room.map_light.shape[1])
        if truth.mean() < MIN_LIT * full:
            continue
        readings = drawn.read(light, drawn.local(int(drawn.lux.sum())))
        said = level if switched else np.full(level.size, np.nan)
        states = solve_states(room.model, readings, room.knowledge.prior(said))
        value, deviation = light_now(room.map_light[0], states, local_sd=room.model.local_sd)
        off = (value - truth)[room.counted]
        errors.append(float(np.sqrt((off**2).mean()) / truth[room.counted].mean()))
        within.append([float(np.mean(np.abs(off) <= times * deviation[room.counted])) for times in (1, 2)])
    one, two = np.mean(within, axis=0)
    rms = np.sqrt(np.mean(np.square(errors)))
    words = "with switches" if switched else "without switches"
    print(f"map of now, {words}, {draws} draws: NRMSE {rms:.1%}, within 1 sd {one:.0%}, within 2 sd {two:.0%}")


def print_faults(room: LitRoom, draws: int) -> None:
    """How often faults are noticed within five answers, and named."""
    drawn = Draws(room, 4)
    said = np.ones(len(room.lamps))
    sensors, lamps = len(room.sensors), len(room.lamps)
    counts: dict[str, list[tuple[bool, bool, bool]]] = {}
    for _ in range(draws):
        for fault in ("none", "sensor covered", "sensor reads half", "sensor reads double", "lamp dead"):
            light = 1.0 + FLUX_SD * drawn.random.standard_normal(lamps)
            which = int(drawn.random.integers(lamps if fault == "lamp dead" else sensors))
            if fault == "lamp dead":
                light[which] = 0.0
            readings = drawn.read(light, drawn.local(int(drawn.lux.sum())))
            factor = {"sensor covered": 0.05, "sensor reads half": 0.5, "sensor reads double": 2.0}.get(fault, 1.0)
            readings[room.model.sensor == which] *= factor
            seen = solve_states(room.model, readings, room.knowledge.prior(said)).probability < STRANGE
            found = suspects(room.model, readings, room.knowledge, said) if seen else []
            kind = "lamp" if fault == "lamp dead" else "sensor"
            named = any((each.kind, each.index) == (kind, which) for each in found)
            counts.setdefault(fault, []).append((seen, named, named and len(found) == 1))
    for fault, each in counts.items():
        shares = np.mean(np.array(each, dtype=np.float64), axis=0)
        print(f"{fault}: noticed {shares[0]:.1%}, named {shares[1]:.1%}, alone {shares[2]:.1%} of {draws}")


def print_day(room: LitRoom, hours: float) -> None:
    """A day at one reading a second of each sensor."""
    drawn, present = Draws(room, 5), PresentLight(room)
    names = [name for (name, _), is_lux in zip(room.numbers, drawn.lux, strict=True) if is_lux]
    place = drawn.local(len(names))
    alarms, level = 0, drawn.states()
    tracemalloc.start()
    began, first_hour, was_alarm = time.process_time(), 0, False
    for second in range(int(3600 * hours)):
        if second % 1800 == 0:
            level = drawn.states()
        for name, value in zip(names, drawn.read(level, place)[drawn.lux], strict=True):
            present.take(name, {"lux": float(value)}, float(second))
        is_alarm = present.answer(float(second)).alarm is not None
        alarms, was_alarm = alarms + (is_alarm and not was_alarm), is_alarm
        if second == 3599:
            first_hour = tracemalloc.get_traced_memory()[0]
    spent = time.process_time() - began
    last = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    print(
        f"{hours:g} hours at 1 Hz of {len(names)} sensors: {spent:.0f} s of processor time with memory traced, "
        f"{1000 * spent / (3600 * hours):.1f} ms an answer; memory in use {last / 1e3:.1f} kB at the end, "
        f"{first_hour / 1e3:.1f} kB after the first hour; {alarms} false alarms; peak of the process "
        f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB"
    )


def print_delay(run: Path, points: Sequence[int], count: int) -> None:
    """From a line in a log to the page's stream of events."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log.csv"
        log.write_text("lux\n", encoding="utf-8")
        alive = LiveRun(run, [f"desk@{points[0]}={log}"], LiveOptions())
        ended = threading.Event()
        notices: list[Notice] = []
        thread = threading.Thread(target=lambda: alive.run(stop=ended.is_set, on_notice=notices.append))
        thread.start()
        delays = []
        with urllib.request.urlopen(alive.server.address + "events", timeout=30) as stream:
            for number in range(count):
                time.sleep(1.0)
                written = time.monotonic()
                with log.open("a", encoding="utf-8") as file:
                    file.write(f"{100 + number}\n")
                while True:
                    line = stream.readline().decode()
                    if line.startswith("data: ") and json.loads(line[6:])["sensors"][0]["lux"] == 100 + number:
                        break
                delays.append(time.monotonic() - written)
        ended.set()
        thread.join()
    print(
        f"from a line in a log to the page, {count} readings: median {1000 * np.median(delays):.0f} ms, "
        f"longest {1000 * max(delays):.0f} ms"
    )


def main() -> None:
    """Print all of it for one run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path)
    parser.add_argument("--points", type=int, nargs="+", default=[20, 90, 150])
    parser.add_argument("--draws", type=int, default=300)
    parser.add_argument("--hours", type=float, default=24.0)
    parser.add_argument("--readings", type=int, default=30)
    given = parser.parse_args()
    room = present_light(given.run, [f"s{point}@{point}=none.csv" for point in given.points]).room
    for switched in (False, True):
        print_maps(room, given.draws, switched=switched)
    print_faults(room, given.draws)
    print_delay(given.run, given.points, given.readings)
    print_day(room, given.hours)


if __name__ == "__main__":
    main()
