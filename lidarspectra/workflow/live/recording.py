"""Fixed sensors as one recording under one clock, without a run: a CSV a day, and how each node and its clock did."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from lidarspectra.hardware.incoming.arrival_log import ArrivalLog, newest_time
from lidarspectra.hardware.incoming.arrivals import Arrival, Notice, Stop
from lidarspectra.hardware.incoming.gathering import gather
from lidarspectra.hardware.incoming.node_clocks import NodeClock, NodeStatus
from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS
from lidarspectra.mapping.figures.tables import Table, save_table
from lidarspectra.workflow.live.sensors_file import read_sensors
from lidarspectra.workflow.live.sources import sources_of
from lidarspectra.workflow.run_folder.workspace import made_folder

DAY_S = 86400.0  # [s]


def record_nodes(
    sources: Sequence[str], folder: Path, *, stop: Stop, on_notice: Callable[[Notice], None]
) -> tuple[Table, tuple[str, ...]]:
    """Record until it is time to stop; a folder that was recorded into is continued.

    Parameters
    ----------
    sources : sequence of str
        A file of sensors, as `live` takes it (`sensors_file`), whose sensors need no place; or NAME=PORT or
        NAME=LOG.csv for each.
    folder : Path
        Gets DATE.csv with every reading and its time of arrival by this machine's clock, a log of counts beside it for
        each serial port, and nodes.csv at the end.
    stop, on_notice : callable

    Returns
    -------
    table : Table
        Of the nodes.
    notes : tuple of str
        Clocks that drift apart, sensors that gave nothing.

    Raises
    ------
    LidarSpectraError
        If a source cannot be understood, or readings cannot be written.
    """
    sensors, base = read_sensors(list(sources), need_places=False)
    made_folder(folder)
    made = sources_of(sensors, CHANNEL_LABELS, base=base, logs=folder, run=folder)
    before_s = newest_time(folder)
    clocks = {sensor.name: NodeClock(sensor.name) for sensor in sensors.sensors}

    def count(arrival: Arrival) -> None:
        nonlocal before_s
        if before_s is not None:
            gap = f"The recording goes on {arrival.unix_s - before_s:.1f} s after its last reading."
            on_notice(Notice(source=folder.name, text=gap))
            before_s = None
        if arrival.sensor in clocks:  # not a switch
            clocks[arrival.sensor].take(arrival)

    labels = [label for sensor in sensors.sensors for label in sensor.topics]
    gather(made, ArrivalLog(folder, labels=labels), stop=stop, on_arrival=count, on_notice=on_notice)
    nodes = [clock.status for clock in clocks.values()]
    table = nodes_table(nodes)
    save_table(table, folder)
    return table, node_notes(nodes)


def nodes_table(nodes: Sequence[NodeStatus]) -> Table:
    """A row for each node."""
    frame = pd.DataFrame(
        {
            "sensor": [node.sensor for node in nodes],
            "readings": [node.readings for node in nodes],
            "gaps": [node.gaps for node in nodes],
            "longest gap [s]": [node.longest_gap_s for node in nodes],
            "restarts": [node.restarts for node in nodes],
            "clock slow by [s/day]": [1e-6 * DAY_S * node.drift_ppm for node in nodes],
            "± [s/day]": [1e-6 * DAY_S * node.drift_se_ppm for node in nodes],
        }
    )
    formats = {"longest gap [s]": ".1f", "clock slow by [s/day]": ".2f", "± [s/day]": ".2f"}
    caption = (
        "Nodes under this machine's clock, since the recording was last begun. Clocks are compared from ten minutes "
        "on, where a node tells its own."
    )
    return Table(name="nodes", caption=caption, frame=frame, formats=formats)


def node_notes(nodes: Sequence[NodeStatus]) -> tuple[str, ...]:
    """What the user should know of the nodes, as full sentences."""
    notes = []
    silent = [node.sensor for node in nodes if not node.readings]
    if silent:
        notes.append(f"No reading came from {', '.join(silent)}: check power, cable or topic; the others are recorded.")
    known = [node for node in nodes if np.isfinite(node.drift_ppm)]
    if len(known) > 1:
        slow = max(known, key=lambda node: node.drift_ppm)
        fast = min(known, key=lambda node: node.drift_ppm)
        apart_s = 1e-6 * DAY_S * (slow.drift_ppm - fast.drift_ppm)
        notes.append(
            f"The nodes' own clocks drift apart by up to {apart_s:.1f} s a day ('{slow.sensor}' is the slowest, "
            f"'{fast.sensor}' the fastest). The recording is not affected: its times are this machine's."
        )
    return tuple(notes)
