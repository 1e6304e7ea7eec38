"""Read arrays back from an npz file, or say in our words that it is damaged."""

import zipfile
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarspectra.errors import MaterialError


def read_arrays(path: Path) -> dict[str, NDArray[np.generic]]:
    """Every array of an npz file, nothing pickled.

    Parameters
    ----------
    path : Path

    Returns
    -------
    arrays : dict of str to array

    Raises
    ------
    MaterialError
        If the file is missing, cut off or no npz.
    """
    try:
        # Opened here, because numpy leaves a file open that turns out to be damaged.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    except (OSError, ValueError, EOFError, KeyError, AttributeError, zipfile.BadZipFile, zlib.error) as cause:
        raise MaterialError(
            expected="arrays that an earlier stage wrote", found=f"{type(cause).__name__}: {cause}", where=str(path)
        ) from cause
