"""The recorder against devices that misbehave: thousands of seeded faults, on a clock that runs as fast as it can.

What is held: every reading that came over the wire whole is in the log, once; none is there that did not come; every
time without a reading stands in the log as a gap, with a reason; and the recorder ends when it is told to.
"""

import itertools
from collections import Counter
from pathlib import Path

import pytest

from lidarspectra.errors import DeviceError
from lidarspectra.hardware.sensor.gaps import ALARM_PERIODS, SLACK_S
from lidarspectra.hardware.sensor.identify import Wishes
from lidarspectra.hardware.sensor.reading_log import COUNT_COLUMNS, MODULE_COLUMNS, LogWriter, read_rows
from lidarspectra.hardware.sensor.recorder import RecordOptions, RecordSummary, record
from lidarspectra.hardware.virtual.emulator import AtModule, Device, SketchBoard, SparkfunBoard
from lidarspectra.hardware.virtual.faults import FAULTS, Fault, FaultPlan, FaultyWire, VirtualClock, VirtualPort

DURATION_S = 200.0
END_S = 170.0  # what is still on its way at the end is left out: no pause lasts longer than the rest
SEEDS = range(12)  # of 13 random changes of recorder and drivers they found 7, and 24 more seeds none of the rest


def run(
    device: Device, plan: FaultPlan | None, path: Path, *, duration_s: float = DURATION_S, give_up_s: float = 600.0
) -> tuple[RecordSummary, FaultyWire, list[dict[str, str]]]:
    clock = VirtualClock()
    wire = FaultyWire(device, plan)
    options = RecordOptions(wishes=Wishes(period_s=1.0), duration_s=duration_s, give_up_s=give_up_s)
    with LogWriter(path, sync=lambda descriptor: None) as log:
        summary = record(VirtualPort(wire, clock), log, options=options, clock=clock)
    assert clock.elapsed_s < duration_s + 15.0  # it ends: the longest that any single step may take is far less
    rows, _, broken = read_rows(path)
    assert broken == 0
    return summary, wire, rows


def of_kind(rows: list[dict[str, str]], kind: str) -> list[dict[str, str]]:
    return [row for row in rows if row["kind"] == kind]


def assert_gaps_are_told(rows: list[dict[str, str]], *, period_s: float, wait_s: float = 0.0) -> None:
    """Between any two readings that are far apart stands a gap that spans them, with a reason."""
    spans = [(float(row["since_unix_s"]), float(row["unix_s"]), row["reason"]) for row in of_kind(rows, "gap")]
    assert all(reason for *_, reason in spans)
    times = sorted(float(row["unix_s"]) for row in of_kind(rows, "reading"))
    for before, after in itertools.pairwise(times):
        if after - before > ALARM_PERIODS * period_s + SLACK_S + wait_s:
            assert any(since <= before + 0.01 and until >= after - 0.01 for since, until, _ in spans), (before, after)


@pytest.mark.parametrize("seed", SEEDS)
def test_our_sketch_loses_no_whole_reading_and_invents_none(seed: int, tmp_path: Path) -> None:
    _, wire, rows = run(SketchBoard(seed=seed), FaultPlan(rate=0.25, seed=seed), tmp_path / "log.csv")
    assert sum(wire.met.values()) > 20
    recorded = [(int(row["boot"]), int(row["sequence"])) for row in of_kind(rows, "reading")]
    whole = {sent.name[1:3]: sent for sent in wire.sent if sent.whole}
    assert len(recorded) == len(set(recorded))
    assert set(recorded) <= set(whole)
    assert {name for name, sent in whole.items() if sent.at_s < END_S} <= set(recorded)
    for row in of_kind(rows, "reading"):
        counts = tuple(int(row[name] or 65535) for name in COUNT_COLUMNS)
        assert counts == whole[int(row["boot"]), int(row["sequence"])].name[3]
    assert_gaps_are_told(rows, period_s=1.0)


def test_a_board_that_reads_no_faster_has_no_gap_at_every_reading(tmp_path: Path) -> None:
    clock = VirtualClock()
    options = RecordOptions(wishes=Wishes(period_s=0.2), duration_s=60.0)
    wire = FaultyWire(SketchBoard(shortest_ms=500), None)
    with LogWriter(tmp_path / "log.csv", sync=lambda descriptor: None) as log:
        summary = record(VirtualPort(wire, clock), log, options=options, clock=clock)
    assert summary.readings > 50
    assert summary.gaps <= 1  # until it is known how often it reads
    assert summary.troubles == {"device error": 1}  # it refused the period


@pytest.mark.parametrize("kind", [AtModule, SketchBoard])
@pytest.mark.parametrize("period_s", [60.0, 900.0])
def test_a_reading_a_minute_or_a_quarter_of_an_hour_is_no_silence(
    kind: type[AtModule], period_s: float, tmp_path: Path
) -> None:
    clock = VirtualClock()
    options = RecordOptions(wishes=Wishes(period_s=period_s), duration_s=10.5 * period_s)
    with LogWriter(tmp_path / "log.csv", sync=lambda descriptor: None) as log:
        summary = record(VirtualPort(FaultyWire(kind(), None), clock), log, options=options, clock=clock)
    assert 10 <= summary.readings <= 12  # our sketch reads one before it is told the period
    assert not summary.troubles
    assert not summary.gave_up


@pytest.mark.parametrize("seed", range(8))
def test_our_sketch_counts_what_is_lost(seed: int, tmp_path: Path) -> None:
    kinds: tuple[Fault, ...] = ("cut", "corrupt", "garbage", "repeat", "flood")
    summary, wire, rows = run(SketchBoard(seed=seed), FaultPlan(kinds=kinds, rate=0.3, seed=seed), tmp_path / "log.csv")
    recorded = [int(row["sequence"]) for row in of_kind(rows, "reading")]
    first, last = min(recorded), max(recorded)
    missing = [sent for sent in wire.sent if not sent.whole and first < sent.name[2] < last]  # type: ignore[operator]
    assert summary.lost == len(missing)
    assert sum(int(row["lost"]) for row in of_kind(rows, "gap")) == len(missing)


@pytest.mark.parametrize("seed", SEEDS)
def test_the_modules_firmware_loses_no_whole_reading(seed: int, tmp_path: Path) -> None:
    _, wire, rows = run(AtModule(seed=seed), FaultPlan(rate=0.08, seed=seed), tmp_path / "log.csv")
    assert sum(wire.met.values()) > 20
    recorded = [
        tuple(int(row[name]) if row[name] else None for name in COUNT_COLUMNS) for row in of_kind(rows, "reading")
    ]
    open_ones = Counter(recorded)
    for sent in wire.sent:
        counts = sent.name[2]
        if not sent.clean or sent.at_s > END_S:
            continue
        match = next((known for known in open_ones if open_ones[known] and agrees(counts, known)), None)
        assert match is not None, sent
        open_ones[match] -= 1
    assert_gaps_are_told(rows, period_s=1.0, wait_s=0.5)  # it is asked after half a second of settling


def agrees(counts: object, known: tuple[int | None, ...]) -> bool:
    """Whether a recorded row is that reading; up to three masked channels match anything."""
    assert isinstance(counts, tuple)
    return known.count(None) <= 3 and all(b is None or a == b for a, b in zip(counts, known, strict=True))


@pytest.mark.parametrize("seed", range(12))
def test_the_modules_gain_is_never_wrong(seed: int, tmp_path: Path) -> None:
    """A reading says gain 16 only if the module measured it so, however often it restarts."""
    plan = FaultPlan(kinds=("reset", "pause", "disconnect", "cut"), rate=0.06, seed=seed)
    _, wire, rows = run(AtModule(seed=seed), plan, tmp_path / "log.csv")
    settings: dict[tuple[int, ...], set[tuple[int, int]]] = {}
    for sent in wire.sent:
        settings.setdefault(sent.name[2], set()).add(sent.name[3:5])
    for row in of_kind(rows, "reading"):
        counts = tuple(int(row[name]) if row[name] else 65535 for name in COUNT_COLUMNS)
        if row["gain"] and counts in settings and len(settings[counts]) == 1:
            ((gain_code, steps),) = settings[counts]
            assert (float(row["gain"]), float(row["integration_ms"])) == (16.0, 165.2), row
            assert (gain_code, steps) == (2, 59)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_sparkfun_sketch_loses_no_whole_reading(seed: int, tmp_path: Path) -> None:
    _, wire, rows = run(SparkfunBoard(seed=seed), FaultPlan(rate=0.2, seed=seed), tmp_path / "log.csv")
    assert sum(wire.met.values()) > 20
    recorded = [tuple(row[name] for name in MODULE_COLUMNS) for row in of_kind(rows, "reading")]
    open_ones = Counter(recorded)
    for sent in wire.sent:
        if not sent.clean or sent.at_s > END_S:
            continue
        values = sent.name[2]
        assert isinstance(values, tuple)
        told = tuple(f"{value:.2f}" for value in values)
        match = next((known for known in open_ones if open_ones[known] and same_row(told, known)), None)
        assert match is not None, sent
        open_ones[match] -= 1
    assert_gaps_are_told(rows, period_s=0.6)


def same_row(told: tuple[str, ...], known: tuple[str, ...]) -> bool:
    """Whether a recorded row is that one; its first number may be masked, for something may have stood before it."""
    pairs = list(zip(told, known, strict=True))
    return all(float(a) == float(b) for a, b in pairs[1:] if b) and (not known[0] or float(told[0]) == float(known[0]))


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("kind", [AtModule, SketchBoard, SparkfunBoard])
def test_each_fault_alone_is_survived(kind: type[AtModule], fault: Fault, tmp_path: Path) -> None:
    plan = FaultPlan(kinds=(fault,), rate=0.1, seed=3)
    summary, wire, rows = run(kind(), plan, tmp_path / "log.csv")
    assert wire.met[fault] > 5
    assert summary.readings > 20
    assert of_kind(rows, "gap") or fault in ("repeat", "garbage", "flood", "pause", "corrupt", "cut")


def test_a_wire_that_is_all_faults_is_survived(tmp_path: Path) -> None:
    for kind in (AtModule, SketchBoard, SparkfunBoard):
        plan = FaultPlan(rate=1.0, seed=1, spare=4)
        summary, wire, _ = run(kind(), plan, tmp_path / f"{kind.__name__}.csv")
        assert sum(wire.met.values()) > 30
        assert summary.gaps > 0


def test_a_device_that_never_comes_back_is_given_up_and_the_gap_is_told(tmp_path: Path) -> None:
    plan = FaultPlan(kinds=("disconnect",), rate=1.0, spare=20, disconnect_s=1e6)
    summary, _, rows = run(SketchBoard(), plan, tmp_path / "log.csv", duration_s=1000.0, give_up_s=60.0)
    assert summary.gave_up
    assert of_kind(rows, "gap")[-1]["reason"] == "disconnected"


def test_a_gap_is_on_the_disk_while_it_lasts(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    plan = FaultPlan(kinds=("disconnect",), rate=1.0, spare=20, disconnect_s=1e6)
    _, _, rows = run(SketchBoard(), plan, path, duration_s=200.0)
    begins = of_kind(rows, "gap begins")
    assert begins
    assert begins[0]["reason"] == "disconnected"


def test_a_faultless_recording_has_no_gap_and_no_trouble(tmp_path: Path) -> None:
    for kind in (AtModule, SketchBoard, SparkfunBoard):
        summary, wire, rows = run(kind(), None, tmp_path / f"{kind.__name__}.csv")
        assert of_kind(rows, "gap") == []
        assert summary.troubles == {}
        assert summary.readings >= len(wire.sent) - 1


@pytest.mark.parametrize("period_s", [0.05, 1.0], ids=["several at once", "one by one"])
@pytest.mark.parametrize("spectrum", [True, False], ids=["with spectra", "cells alone"])
def test_as_many_readings_are_recorded_as_were_asked_for(period_s: float, spectrum: bool, tmp_path: Path) -> None:
    clock = VirtualClock()
    wire = FaultyWire(SketchBoard(cells=lambda now_s: (110, 99, 8), spectrum=spectrum))
    options = RecordOptions(wishes=Wishes(period_s=period_s), duration_s=60.0, readings=3)
    with LogWriter(tmp_path / "log.csv", sync=lambda descriptor: None) as log:
        summary = record(VirtualPort(wire, clock), log, options=options, clock=clock)
    assert (summary.readings if spectrum else summary.cell_readings) == 3
    assert len(of_kind(read_rows(tmp_path / "log.csv")[0], "reading" if spectrum else "cells")) == 3
    assert clock.elapsed_s < 30.0


def test_a_flood_does_not_swell_the_log(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    plan = FaultPlan(kinds=("flood",), rate=0.5, seed=2, flood_bytes=200_000)
    run(SketchBoard(), plan, path)
    quiet = tmp_path / "quiet.csv"
    run(SketchBoard(), None, quiet)
    assert path.stat().st_size < 2 * quiet.stat().st_size  # ten megabytes of noise came over the wire


def test_the_log_is_made_safe_every_second(tmp_path: Path) -> None:
    synced: list[float] = []
    clock = VirtualClock()
    wire = FaultyWire(SketchBoard())
    with LogWriter(tmp_path / "log.csv", sync=lambda descriptor: synced.append(clock.elapsed_s)) as log:
        record(VirtualPort(wire, clock), log, options=RecordOptions(duration_s=60.0), clock=clock)
    spacings = [after - before for before, after in itertools.pairwise(synced)]
    assert max(spacings) < 1.2  # a second, and the loop's longest wait


@pytest.mark.parametrize("device", [SparkfunBoard(header=False), SparkfunBoard(header=False, whole_numbers=True)])
def test_rows_without_a_header_are_refused_with_advice(device: SparkfunBoard, tmp_path: Path) -> None:
    with pytest.raises(DeviceError, match="--header"):
        run(device, None, tmp_path / "log.csv")


def test_a_silent_port_is_refused(tmp_path: Path) -> None:
    plan = FaultPlan(kinds=("pause",), rate=1.0, spare=0, pause_s=1e9)
    with pytest.raises(DeviceError, match="silence"):
        run(SketchBoard(), plan, tmp_path / "log.csv")
