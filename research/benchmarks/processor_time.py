"""Processor time, which a busy machine and another number of cores change little."""

import os
import sys
import time

from lidarspectra.threads import available_cores


def processor_seconds() -> float:
    """Time that this process and its ended children have computed for [s]; the clock's where children do not count."""
    if sys.platform == "win32":
        return time.perf_counter() * available_cores()
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def engine_seconds() -> float:
    """The part of it that ended children, the engine's programs, have computed for [s]; 0 where they do not count."""
    spent = os.times()
    return spent.children_user + spent.children_system
