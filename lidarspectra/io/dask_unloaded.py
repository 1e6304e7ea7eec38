"""xarray without Dask in a process that is ours alone."""

import sys
from collections.abc import Sequence

CLUSTER_OPTION = "--cluster"  # of the commands that hand their rays to Dask


def leave_dask_unloaded(arguments: Sequence[str]) -> None:
    """Keep xarray from loading Dask, where it is installed and no cluster is asked for.

    xarray loads it with the first dataset, to tell whether an array is Dask's. None of ours is, and loading it takes as
    long as a third of an answer of `relight`.

    Parameters
    ----------
    arguments : sequence of str
        Of the command line.
    """
    if not any(word.split("=")[0] == CLUSTER_OPTION for word in arguments):
        sys.modules.setdefault("dask", None)  # type: ignore[arg-type]  # None: importing it fails as if it were not there
