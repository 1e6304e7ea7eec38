"""Arrays in a temporary file come back as they were; a full disk is one clear error, and nothing stays behind."""

import errno
import tempfile
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from lidarspectra.errors import ScanError
from lidarspectra.io.scratch import ScratchFile


def test_arrays_come_back_in_any_order_and_the_file_is_gone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    arrays = [
        np.arange(12, dtype=np.float32).reshape(3, 4).T,  # not contiguous
        np.array([[True, False]]),
        np.zeros((0, 3)),
        np.linspace(0, 1, 5),
    ]
    with ScratchFile() as scratch:
        kept = [scratch.keep(array) for array in arrays]
        for number in (3, 0, 2, 1):
            read = scratch.read(kept[number])
            assert read.dtype == arrays[number].dtype
            np.testing.assert_array_equal(read, arrays[number])
    assert not list(tmp_path.iterdir())


def test_a_full_disk_is_one_clear_error() -> None:
    with ScratchFile(error=ScanError) as scratch:
        with patch.object(scratch, "_file") as full:
            full.write.side_effect = OSError(errno.ENOSPC, "No space left on device")
            with pytest.raises(ScanError, match="No space left") as caught:
                scratch.keep(np.zeros(3))
        assert tempfile.gettempdir() in str(caught.value)
