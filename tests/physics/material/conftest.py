"""What rooms that are photographed and de-lit share."""

import pytest

from lidarspectra.workflow.materials import picture_evidence

HALF_OF_THE_SAMPLES = 3_000


@pytest.fixture
def half_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """Light is taken out by 3,000 places of a room, not 6,000: with all of them test_by_day.py holds what it leaves."""
    monkeypatch.setattr(picture_evidence, "SAMPLES", HALF_OF_THE_SAMPLES)
