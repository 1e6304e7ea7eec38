"""What is bright in a scan without being a lamp."""

from dataclasses import replace
from unittest.mock import MagicMock, patch

import numpy as np
import pytest

from lidarspectra.geometry.scan import bare_scan
from lidarspectra.geometry.small_faces import small_faces
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.make_lamp import make_lamp
from lidarspectra.lamps.shapes import Strip
from lidarspectra.material.delighting.albedo import MAX_STEPS, fit_light
from lidarspectra.room.room import find_room
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.workflow.materials import delighting, light_rounds
from lidarspectra.workflow.materials.delighting import Delighting
from lidarspectra.workflow.materials.delighting_notes import (
    fit_in_words,
    stated_light,
    unsettled_note,
    whiter_than_paint_note,
)
from lidarspectra.workflow.materials.delighting_samples import near_lamps
from lidarspectra.workflow.materials.light_rounds import STRAY_LIGHT, _neutral, _unsure, _whites, fit_in_rounds

from .conftest import box_scan
from .lit_walls import evidence

STRIP = Lamp(
    name="strip",
    shape=Strip(9.0, 0.3),
    center=np.array([6.0, 1.6, 2.66]),
    normal=np.array([0.0, 0.0, -1.0]),
    flux=Spectrum(wavelengths_nm=[400, 700], values=[1.0, 1.0]),
)


def test_a_white_desk_under_a_long_lamp_is_no_lamp() -> None:
    # Within half of the lamp's length, as its own ends are: they are told by where the lamp shines.
    desk, end, plate = [6.5, 1.8, 0.74], [10.4, 1.6, 2.67], [6.0, 1.7, 2.7]
    assert near_lamps(np.array([desk, end, plate]), [STRIP]).tolist() == [False, True, True]


def test_a_face_has_the_mean_of_its_parts_that_show_a_surface_if_they_are_enough() -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [9, 0, 0], [9, 1, 0], [8, 0, 0]], dtype=float)
    square = bare_scan(corners, np.array([[0, 1, 2], [3, 4, 5]]))
    small = small_faces(square, 0.3)
    count = len(small.parent)
    color = np.full((count, 3), 0.4)
    most = small.scan.centers[:, 0] > 8.2  # of the second face, all but a corner
    color[most] = 1.0
    color[np.flatnonzero(small.parent == 0)[0]] = 1.0
    of_place = np.where(small.parent == 0, 0.0, 0.3)
    deviation = np.where(most[:, None], 9.0, np.full((count, 3), 0.05))
    parts = Delighting(
        face_color=color, face_deviation=deviation, fit=None, words="", face_place_deviation=of_place
    )  # fmt: skip
    found = parts.of_whole_faces(small)
    assert found.face_color is not None
    assert found.face_deviation is not None
    np.testing.assert_allclose(found.face_color, [[0.4] * 3, [1.0] * 3])
    np.testing.assert_allclose(found.face_deviation[0], 0.05)
    assert found.face_place_deviation is not None
    np.testing.assert_allclose(found.face_place_deviation, [0.0, 0.3])


def test_a_note_tells_of_white_surfaces_that_came_out_brighter_than_paint_and_not_of_noise_about_white() -> None:
    floor = np.full((60, 3), 0.2)
    bright = np.vstack([floor, np.full((30, 3), 0.95), np.full((10, 3), 0.85)])
    areas = np.full(100, 2.0)
    (note,) = whiter_than_paint_note(bright, areas)
    assert note.startswith("60 m² came out brighter")
    noisy = np.vstack([floor, np.linspace(0.76, 0.94, 40)[:, None] * np.ones(3)])
    assert whiter_than_paint_note(noisy, areas) == ()
    assert whiter_than_paint_note(floor, areas[:60]) == ()


def test_whites_are_light_surfaces_other_than_the_ceiling() -> None:
    reflectance = np.repeat([[0.9], [0.9], [0.5], [0.7]], 3, axis=1)
    ceiling = np.array([False, True, False, False])
    assert _whites(reflectance, ceiling).tolist() == [True, False, False, True]


def test_what_strays_in_counts_most_in_the_cone_of_least_light() -> None:
    edges = np.zeros((1, 3))
    assert _unsure(edges, np.array([[1.0, 0.5, 0.1]]))[0] == pytest.approx(STRAY_LIGHT / np.array([1.0, 0.5, 0.1]))


def test_a_note_tells_of_a_fit_that_has_not_settled() -> None:
    fit = fit_light(evidence(1), flux_deviation=np.array([0.15]))
    assert 0 < fit.steps < MAX_STEPS
    assert unsettled_note(fit) == ()
    (note,) = unsettled_note(replace(fit, steps=MAX_STEPS))
    assert "did not converge" in note


def test_a_ceiling_counts_for_white_the_less_the_more_it_is_coloured_and_never_jumps() -> None:
    """Where it did, a texture off by one level moved a room's reflectances by 5 %."""
    yellowness = np.linspace(0.0, 0.3, 301)
    ceiling = np.ones(4, dtype=np.bool_)
    weights = [_neutral(ceiling, np.tile([0.8, 0.78, 0.8 * (1.0 - off)], (4, 1))) for off in yellowness]
    assert weights[0] == 1.0
    assert weights[-1] == 0.0
    assert np.abs(np.diff(weights)).max() < 0.02
    assert _neutral(np.zeros(4, dtype=np.bool_), np.full((4, 3), 0.8)) == 0.0


@pytest.mark.parametrize(("last", "kept"), [(0.0405, 0.0405), (0.045, 0.04)])
def test_groups_that_leave_more_scatter_than_those_before_mix_paints_and_are_not_kept(last: float, kept: float) -> None:
    data, silent = evidence(2), MagicMock()
    fit = fit_light(data, flux_deviation=np.array([0.15]))
    fits = [replace(fit, scatter=scatter) for scatter in (0.03, 0.04, last)]  # the first, of tinted hues, never is
    grouping = MagicMock()
    grouping.of.return_value.regrouped.side_effect = lambda evidence, fit: replace(evidence, ceiling_weight=fit.scatter)
    with (
        patch.object(light_rounds, "fit_light", side_effect=fits),
        patch.object(light_rounds, "_Grouping", grouping),
    ):
        found, of = fit_in_rounds(
            MagicMock(), (), data, np.ones((1, 1)), np.array([0.15]), (), lambda evidence, fit: evidence, silent
        )
    assert found.scatter == kept
    assert of.ceiling_weight == (0.04 if kept == last else 0.03), "the evidence that it was fitted to"


def test_what_is_stated_of_the_light_is_wider_where_the_fit_is_less_sure() -> None:
    fit = fit_light(evidence(2), flux_deviation=np.array([0.15]))
    unsure = replace(fit, log_deviation=3.0 * fit.log_deviation)
    assert stated_light(unsure) == pytest.approx(3.0 * stated_light(fit))
    assert f"uncertain by {100 * np.median(stated_light(unsure)):.0f} %" in fit_in_words(unsure, stated_light(unsure))


@pytest.mark.parametrize(("spectrum", "told"), [("LPS", False), ("HPS", True)])
def test_light_of_one_colour_alone_tells_no_reflectances(
    spectrum: str, told: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A low-pressure sodium lamp has a response below 0 in one cone, of which no exposure can be told."""
    scan, _ = box_scan(cells=4)
    lamp = make_lamp("panel", (2.0, 1.5, 2.3), name="lamp", size=0.5, spectrum=spectrum, luminous_flux_lm=2000)

    def gather(*_: object, **__: object) -> None:
        raise InterruptedError

    monkeypatch.setattr(delighting, "gather_evidence", gather)
    if told:
        with pytest.raises(InterruptedError):
            delighting.take_light_out(scan, find_room(scan), [lamp])
    else:
        found = delighting.take_light_out(scan, find_room(scan), [lamp])
        assert found.face_color is None
        assert "nearly one colour" in found.warnings[0]
