"""Material classes of the views, counted while the light is taken out of the colours: neither needs the other."""

from contextlib import AbstractContextManager
from pathlib import Path

from lidarspectra.beside import beside
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.estimate import CountVotes
from lidarspectra.material.segmentation.fusion import FaceClasses, view_votes
from lidarspectra.material.segmentation.segmentation import Classifier
from lidarspectra.material.views.views import ViewSet
from lidarspectra.progress import Progress
from lidarspectra.threads import cores_for


def votes_beside(model: Path, scan: Scan, views: ViewSet, *, workers: int | None) -> AbstractContextManager[CountVotes]:
    """Begin to count the views' votes in a `with` block that does other work meanwhile (see `beside`).

    Parameters
    ----------
    model : Path
        Network that tells material classes.
    scan : Scan
    views : ViewSet
        Of it.
    workers : int, optional
        Processor cores that may be used, one of them by the `with` block; all if left out. With one, nothing is begun.

    Returns
    -------
    votes : context manager
        Of a callable that waits for the votes, tells meanwhile how far they are, and gives them.

    Raises
    ------
    ArgumentError
        If fewer than one worker is asked for.
    """
    threads = max(1, cores_for(workers) - 1)

    def count(progress: Progress) -> FaceClasses:
        return view_votes(Classifier(model, threads=threads), scan, views, progress)

    return beside(count, words="material classes", workers=workers, in_thread=True)
