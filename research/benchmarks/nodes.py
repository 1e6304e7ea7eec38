"""A day of many sensor nodes at 1 Hz through the recording, on a clock that runs fast: size, time, and a cut.

    python -m research.benchmarks.nodes [--nodes 27] [--hours 24]

Each node reads 18 channels once a second by a clock of its own, up to 100 ppm off, and its readings take 5 to 200 ms to
arrive. They go through `ArrivalLog` and `NodeClock`, as from `lidarspectra sensor nodes`, a second at a time. In the
middle of the day the process is cut: the last row is half written, and the recording is begun again on the same folder.
Told are the size, the processor time, how long the restart takes, which rows are lost, and how well drifts are found.
"""

import argparse
import csv
import resource
import tempfile
import time
from pathlib import Path

import numpy as np

from lidarspectra.hardware.incoming.arrival_log import ArrivalLog
from lidarspectra.hardware.incoming.arrivals import Arrival
from lidarspectra.hardware.incoming.growing_log import GrowingLog
from lidarspectra.hardware.incoming.node_clocks import NodeClock
from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS
from lidarspectra.hardware.sensor.log_layouts import read_sensor_log

START_S = 1_780_272_000.0  # [s] a day's beginning, UTC
MAX_DRIFT = 100e-6  # [1] of a node's clock
DELAY_S = (0.005, 0.2)  # [s] on the way
HALF_ROW = 40  # bytes of a row that the cut leaves
SEED = 21


class Day:
    """Nodes that read once a second, each by its own clock."""

    def __init__(self, nodes: int) -> None:
        self._generator = np.random.default_rng(SEED)
        self.names = [f"node {number + 1}" for number in range(nodes)]
        self.rates = self._generator.uniform(-MAX_DRIFT, MAX_DRIFT, nodes)
        self._begun_s = self._generator.uniform(0.0, 1e5, nodes)
        self._light = self._generator.uniform(1e-4, 1e-2, (nodes, len(CHANNEL_LABELS)))

    def second(self, second: int) -> list[Arrival]:
        """All nodes' readings of a second."""
        waits = self._generator.uniform(*DELAY_S, len(self.names))
        noise = 1.0 + 0.004 * self._generator.standard_normal(self._light.shape)
        device = (1.0 - self.rates) * second + self._begun_s
        return [
            Arrival(
                sensor=name,
                values=dict(zip(CHANNEL_LABELS, row, strict=True)),
                unix_s=START_S + second + waits[number],
                device_s=float(device[number]),
            )
            for number, (name, row) in enumerate(zip(self.names, (self._light * noise).tolist(), strict=True))
        ]


def cut(path: Path) -> None:
    """What a power cut leaves: the last row half written."""
    with path.open("r+b") as file:
        size = file.seek(0, 2)
        file.seek(max(0, size - 4096))
        end = file.read().rstrip(b"\n").rfind(b"\n") + 1 + max(0, size - 4096)
        file.truncate(end + HALF_ROW)


def main() -> None:
    """Run it."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--nodes", type=int, default=27)
    parser.add_argument("--hours", type=float, default=24.0)
    arguments = parser.parse_args()
    day, seconds = Day(arguments.nodes), int(3600 * arguments.hours)
    clocks = {name: NodeClock(name) for name in day.names}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log, writing_s, restart_s = ArrivalLog(folder), 0.0, 0.0
        for second in range(seconds):
            arrivals = day.second(second)
            if second == seconds // 2:
                log.close()
                cut(next(folder.glob("*.csv")))
                began = time.perf_counter()
                log = ArrivalLog(folder)
                log.write(arrivals)
                restart_s = time.perf_counter() - began
                continue
            began = time.process_time()
            log.write(arrivals)
            for arrival in arrivals:
                clocks[arrival.sensor].take(arrival)
            writing_s += time.process_time() - began
        log.close()
        files = sorted(folder.glob("*.csv"))
        size, count = sum(path.stat().st_size for path in files), arguments.nodes * seconds
        began = time.process_time()
        read = sum(1 for path in files for _ in GrowingLog(path, sensor="").past())
        reading_s = time.process_time() - began
        began = time.process_time()
        held = sum(read_sensor_log(path).readings.sizes["reading"] for path in files)
        shown_s = time.process_time() - began
        first = next(csv.DictReader(files[0].open(encoding="utf-8")))
    began = time.process_time()
    found = [clock.status for clock in clocks.values()]
    told_s = time.process_time() - began
    errors = np.array([1e6 * rate - node.drift_ppm for rate, node in zip(day.rates, found, strict=True)])
    print(f"{arguments.nodes} nodes, {arguments.hours:g} h at 1 Hz: {count} readings, {len(first)} columns each")
    print(f"size: {size / 1e6:.0f} MB in {len(files)} files, {size / count:.0f} bytes a reading")
    print(f"writing and clocks: {writing_s:.0f} s of processor time, {1e6 * writing_s / count:.0f} µs a reading, "
          f"{100 * writing_s / seconds:.2f} % of a core")  # fmt: skip
    print(f"read back: {reading_s:.0f} s; {read} readings whole, {count - read} lost with the cut")
    print(f"as a log, for 'sensor show' and 'cells': {shown_s:.0f} s of processor time; {held} readings; "
          f"{resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MiB of memory at most")  # fmt: skip
    print(f"restart after the cut, to the first reading on disk: {1e3 * restart_s:.1f} ms")
    print(f"drift: root mean square error {np.sqrt(np.mean(errors**2)):.2f} ppm of up to {1e6 * MAX_DRIFT:.0f}, "
          f"largest {np.abs(errors).max():.2f}; told in {told_s:.1f} s")  # fmt: skip


if __name__ == "__main__":
    main()
