"""Arrays in npz files: written quickly, and read back or said in our words to be damaged."""

import zipfile
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarspectra.errors import WorkspaceError

FASTEST = 1  # zlib's level; numpy's own, 6, takes five times as long for files that are a fifth smaller


def write_arrays(path: Path, **arrays: NDArray[np.generic]) -> None:
    """Write arrays by name as numpy's `savez_compressed` does, with less effort.

    Parameters
    ----------
    path : Path
        Ends in .npz.
    **arrays
    """
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=FASTEST) as archive:
        for name, values in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, values, allow_pickle=False)


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
    WorkspaceError
        If the file is missing, cut off or no npz.
    """
    try:
        # Opened here, because numpy leaves a file open that turns out to be damaged.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    except (OSError, ValueError, EOFError, KeyError, AttributeError, zipfile.BadZipFile, zlib.error) as cause:
        raise WorkspaceError(
            expected="arrays that an earlier stage wrote", found=f"{type(cause).__name__}: {cause}", where=str(path)
        ) from cause
