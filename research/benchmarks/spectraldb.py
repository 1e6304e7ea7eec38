"""spectraldb for a benchmark: measured surfaces that users import themselves (see docs/howto-material.md)."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

from lidarspectra.spectra.databases import DATA_VARIABLE, import_spectraldb


@contextmanager
def imported(file: Path) -> Iterator[str]:
    """Import spectraldb's CSV into a folder of its own while a block lasts; gives the database's name.

    What a user imported is out of reach meanwhile.
    """
    with tempfile.TemporaryDirectory() as folder, patch.dict(os.environ, {DATA_VARIABLE: folder}):
        import_spectraldb(file)
        yield "spectraldb"
