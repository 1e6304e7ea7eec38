"""Seconds that seed the engine are never used twice, whatever clock a machine has."""

import time

from lidarspectra.radiance.engine.engine import EngineJob, find_engine
from lidarspectra.radiance.engine.seed_clock import LAG_S, START_S, await_unused, joined, seconds_between


class Clock:
    """A clock that runs only while somebody sleeps."""

    def __init__(self, now: float) -> None:
        self.now, self.begun = now, now

    def sleep(self, seconds: float) -> None:
        assert seconds >= 0
        self.now += seconds

    @property
    def slept(self) -> float:
        return self.now - self.begun


def test_intervals_that_touch_are_one() -> None:
    assert joined([(8, 9), (1, 3), (4, 4), (2, 2), (6, 6)]) == ((1, 4), (6, 6), (8, 9))
    assert joined([]) == ()


def test_a_program_may_have_asked_a_clock_that_lags() -> None:
    assert seconds_between(100.01, 100.02) == (99, 100)
    assert seconds_between(100.5, 102.1) == (100, 102)
    assert seconds_between(100.5, 40.0) == (100, 100)  # set back meanwhile


def test_the_same_machine_waits_for_the_next_second() -> None:
    clock = Clock(100.3)
    await_unused([(98, 100)], now=lambda: clock.now, sleep=clock.sleep)
    assert 101.0 + LAG_S <= clock.now <= 101.1


def test_a_machine_behind_waits_until_its_clock_has_passed_what_was_used() -> None:
    for behind in (97.9, 100.0 - START_S / 2, 101.7):
        clock = Clock(behind)
        await_unused([(100, 102)], now=lambda clock=clock: clock.now, sleep=clock.sleep)  # type: ignore[misc]
        assert clock.now >= 103.0 + LAG_S


def test_a_machine_far_off_does_not_wait() -> None:
    for now in (90.0, 500.0):
        clock = Clock(now)
        await_unused([(100, 102), (110, 120)], now=lambda clock=clock: clock.now, sleep=clock.sleep)  # type: ignore[misc]
        assert clock.slept == 0.0


def test_it_starts_in_no_interval_that_follows() -> None:
    clock = Clock(100.5)
    await_unused([(100, 102), (105, 107)], now=lambda: clock.now, sleep=clock.sleep)
    assert clock.now >= 108.0 + LAG_S  # at 103 a slow start would have ended up in 105


def test_the_engine_waits_before_it_starts_a_program_and_says_when_it_ran() -> None:
    engine, now = find_engine(), int(time.time())
    job = EngineJob(program="rtrace", arguments=("-version",), folder=engine.library, unlike=((now - 1, now),))
    (run,) = engine.run_jobs([job], workers=1)
    assert run.clock[0] > now
