"""Fixtures that every test room uses."""

import os
from pathlib import Path

import pytest

PROJECT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def project() -> Path:
    """Root of the checkout."""
    return PROJECT


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder with real data that cannot be part of the repository; the test is skipped where it is absent."""
    folder = Path(os.environ.get("LIDARSPECTRA_SHARED", PROJECT.parent / "shared"))
    if not (folder / "data").is_dir():
        pytest.skip(f"real data is not at {folder} (or $LIDARSPECTRA_SHARED)")
    return folder / "data"
