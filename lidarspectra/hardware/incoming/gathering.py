"""Sources in threads, every reading to the disk under one clock: what live runs and recordings share."""

import threading
from collections.abc import Callable, Sequence

from lidarspectra.errors import LidarSpectraError
from lidarspectra.hardware.incoming.arrival_log import ArrivalLog
from lidarspectra.hardware.incoming.arrivals import Arrival, Inbox, Notice, Source, Stop

WAIT_S = 0.2  # [s] longest wait for a reading in one go

Tell = Callable[[Notice], None]


def gather(
    sources: Sequence[Source],
    log: ArrivalLog,
    *,
    stop: Stop,
    on_arrival: Callable[[Arrival], None],
    on_notice: Tell,
    on_turn: Callable[[bool], None] = lambda has_reading: None,
) -> None:
    """Take readings from sources until it is time to stop.

    Parameters
    ----------
    sources : sequence of Source
        A thread each.
    log : ArrivalLog
        Every reading goes there before it is used; it is closed at the end.
    stop : callable
        Looked at five times a second.
    on_arrival, on_notice : callable
        Called in this thread.
    on_turn : callable
        After each look, with whether there was a reading.

    Raises
    ------
    ReadingError
        If readings cannot be written to disk.
    """
    inbox, ended = Inbox(), threading.Event()

    def run(source: Source) -> None:
        try:
            source.run(inbox.put, ended.is_set)
        except Exception as fault:  # noqa: BLE001 - whatever ends one source ends no recording of the others
            words = str(fault) if isinstance(fault, LidarSpectraError) else f"{type(fault).__name__}: {fault}"
            todo = "It gives no readings any more: mend that, and begin anew."
            inbox.put(Notice(source=source.name, text=f"{words.rstrip('.')}. {todo}"))

    threads = [threading.Thread(target=run, args=(source,), daemon=True) for source in sources]
    for thread in threads:
        thread.start()
    try:
        while not stop():
            on_turn(_take(inbox, WAIT_S, log, on_arrival, on_notice))
    finally:
        ended.set()
        for thread in threads:
            thread.join(timeout=10.0)
        _take(inbox, 0.0, log, on_arrival, on_notice)
        log.close()


def _take(
    inbox: Inbox, limit_s: float, log: ArrivalLog, on_arrival: Callable[[Arrival], None], on_notice: Tell
) -> bool:
    """Log and use all items; whether a reading was among them."""
    items = inbox.take(limit_s)
    arrivals = [item for item in items if isinstance(item, Arrival)]
    if arrivals:
        log.write(arrivals)
    for item in items:
        if isinstance(item, Notice):
            on_notice(item)
        else:
            on_arrival(item)
    return bool(arrivals)
