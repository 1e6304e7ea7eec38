"""How often Python looks for objects that refer to each other in circles and are used no more."""

import atexit
import gc

NEW_OBJECTS = 500_000  # between two looks at the youngest: a run keeps 1.8 million; Python's 700 suit small programs


def collect_rarely() -> None:
    """Look for unused circles of objects more rarely, and not at the end, in a process that is ours alone.

    Loading the libraries and drawing figures makes some million objects that stay. To look through them again and
    again, and to take them apart one by one before the process ends, took a tenth of a run's time. Arrays, which are
    what fills the memory, are freed at once as before; the rest the system takes back with the process.
    """
    _, *older = gc.get_threshold()
    gc.set_threshold(NEW_OBJECTS, *older)
    atexit.register(gc.freeze)
