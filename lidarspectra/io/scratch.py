"""Arrays in a temporary file, so that memory does not grow with their number."""

import tempfile
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from lidarspectra.errors import LidarSpectraError, WorkspaceError
from lidarspectra.io.files import writing


@dataclass(frozen=True, kw_only=True)
class ScratchArray:
    """Where an array lies in a scratch file.

    Parameters
    ----------
    start : int
        Its first byte.
    shape : tuple of int
    dtype : numpy.dtype
    """

    start: int
    shape: tuple[int, ...]
    dtype: "np.dtype[np.generic]"


class ScratchFile:
    """A temporary file of arrays, which is gone when it is closed.

    Parameters
    ----------
    error : type
        Of the error that is raised where the file cannot be written.
    """

    def __init__(self, *, error: type[LidarSpectraError] = WorkspaceError) -> None:
        self._error, self._size = error, 0
        with self._writing():
            self._file = tempfile.TemporaryFile(prefix="lidarspectra-")  # noqa: SIM115 - open until `close`

    def keep(self, array: NDArray[np.generic]) -> ScratchArray:
        """Append an array; an error of the given type where the disk is full."""
        kept = ScratchArray(start=self._size, shape=array.shape, dtype=array.dtype)
        with self._writing():
            self._file.seek(kept.start)
            self._file.write(np.ascontiguousarray(array).data)
            self._file.flush()
        self._size += array.nbytes
        return kept

    def read(self, kept: ScratchArray) -> NDArray[np.generic]:
        """An array that was kept here."""
        array = np.empty(kept.shape, dtype=kept.dtype)
        with self._writing():
            self._file.seek(kept.start)
            self._file.readinto(array.data)
        return array

    def close(self) -> None:
        """Remove the file."""
        self._file.close()

    def _writing(self) -> AbstractContextManager[None]:
        return writing(
            Path(tempfile.gettempdir()), error=self._error, expected="a temporary file that can be written",
            todo="Free disk space there, or name a folder with more of it in the variable TMPDIR.",
        )  # fmt: skip

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
