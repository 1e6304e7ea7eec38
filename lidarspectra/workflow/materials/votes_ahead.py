"""Material classes of the views, counted while the light is taken out of the colours: neither needs the other."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import wait as wait_for
from contextlib import contextmanager
from pathlib import Path
from threading import Event

from lidarspectra.geometry.scan import Scan
from lidarspectra.material.estimate import CountVotes
from lidarspectra.material.segmentation.fusion import FaceClasses, view_votes
from lidarspectra.material.segmentation.segmentation import Classifier
from lidarspectra.material.views.views import ViewSet
from lidarspectra.progress import Progress
from lidarspectra.threads import cores_for

TOLD_S = 0.2  # [s] between two looks at how far it is


class _Abandoned(Exception):  # noqa: N818 - no error: nobody waits for the votes any more
    """Ends the counting."""


@contextmanager
def votes_beside(model: Path, scan: Scan, views: ViewSet, *, workers: int | None) -> Iterator[CountVotes]:
    """Begin to count the views' votes in a thread of its own, in a `with` block that does other work meanwhile.

    Parameters
    ----------
    model : Path
        Network that tells material classes.
    scan : Scan
    views : ViewSet
        Of it.
    workers : int, optional
        Processor cores that may be used, one of them by the `with` block; all if left out. With one, nothing is begun.

    Yields
    ------
    votes : callable
        Waits for the votes, tells meanwhile how far they are, and gives them; raises what their counting raised.

    Raises
    ------
    ArgumentError
        If fewer than one worker is asked for.
    """
    cores = cores_for(workers)
    if cores < 2:
        yield lambda progress: view_votes(Classifier(model, threads=1), scan, views, progress)
        return
    abandoned, told = Event(), [(0.0, "material classes")]

    def tell(fraction: float, words: str) -> None:
        if abandoned.is_set():
            raise _Abandoned
        told[0] = (fraction, words)

    def count() -> FaceClasses:
        return view_votes(Classifier(model, threads=cores - 1), scan, views, tell)

    with ThreadPoolExecutor(max_workers=1, thread_name_prefix="votes") as pool:
        begun = pool.submit(count)

        def votes(progress: Progress) -> FaceClasses:
            while wait_for([begun], timeout=TOLD_S).not_done:
                progress(*told[0])
            return begun.result()

        try:
            yield votes
        finally:
            abandoned.set()
