"""Votes that are counted beside other work are those that are counted at once."""

import time
from pathlib import Path

import numpy as np
import pytest

from lidarspectra.errors import ArgumentError, MaterialError
from lidarspectra.material.segmentation.segmentation import SHIPPED_MODEL
from lidarspectra.material.views import viewpoints
from lidarspectra.material.views.viewpoints import ViewSettings, render_views
from lidarspectra.progress import silent
from lidarspectra.spectra.databases import scenes_folder
from lidarspectra.workflow.materials.votes_ahead import votes_beside
from lidarspectra.workflow.run_folder.inputs import read_inputs

from .material.conftest import box_scan

SMALL = ViewSettings(width=144, height=144, samples=2, sample_spacing_m=0.3)


@pytest.fixture(scope="module")
def seen():
    scan, _ = box_scan(noise=0.05)
    return scan, render_views(scan, settings=SMALL, workers=1)


def test_votes_beside_other_work_are_the_same_as_on_one_core(seen):
    scan, views = seen
    with votes_beside(SHIPPED_MODEL, scan, views, workers=1) as votes:
        alone = votes(silent)
    with votes_beside(SHIPPED_MODEL, scan, views, workers=2) as votes:
        beside = votes(silent)
    assert np.array_equal(alone.belief, beside.belief)
    assert alone.classes == beside.classes


def test_a_fault_of_the_model_is_told_to_who_asks_for_the_votes(seen, tmp_path: Path):
    scan, views = seen
    (tmp_path / "bad.onnx").write_bytes(b"no model")
    (tmp_path / "bad.toml").write_bytes(SHIPPED_MODEL.with_suffix(".toml").read_bytes())
    with votes_beside(tmp_path / "bad.onnx", scan, views, workers=2) as votes, pytest.raises(MaterialError):
        votes(silent)


def test_where_the_search_fails_no_view_is_rendered_any_more(seen, monkeypatch: pytest.MonkeyPatch):
    scan, _ = seen
    rendered = []

    def slow(*arguments, name, **keywords):
        time.sleep(0.1)
        rendered.append(name)

    def fail(fraction: float, words: str) -> None:
        if fraction > 0.0:
            raise ZeroDivisionError

    monkeypatch.setattr(viewpoints, "capture_image", slow)
    with pytest.raises(ZeroDivisionError):
        render_views(scan, settings=SMALL, workers=2, progress=fail)
    known = len(rendered)
    assert known < 6  # that v0 has
    time.sleep(0.3)
    assert len(rendered) == known


@pytest.mark.parametrize("workers", [0, -1])
def test_fewer_than_one_worker_is_refused(seen, workers: int):
    scan, views = seen
    with pytest.raises(ArgumentError, match="1 or more"):
        render_views(scan, settings=SMALL, workers=workers)
    with pytest.raises(ArgumentError, match="1 or more"), votes_beside(SHIPPED_MODEL, scan, views, workers=workers):
        pass
    with pytest.raises(ArgumentError, match="1 or more"):
        read_inputs(scenes_folder() / "box" / "room.toml", workers=workers)


def test_views_rendered_beside_the_search_are_those_of_one_core(seen):
    scan, views = seen
    beside = render_views(scan, settings=SMALL, workers=3)
    assert [view.name for view in beside.views] == [view.name for view in views.views]
    for one, other in zip(views.views, beside.views, strict=True):
        assert np.array_equal(one.image, other.image)
        assert np.array_equal(one.face, other.face)
