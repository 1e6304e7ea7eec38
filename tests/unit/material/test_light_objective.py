"""The slopes of de-lighting's objective in closed form are those that differences give."""

from dataclasses import replace

import numpy as np
import pytest

from lidarspectra.material.light_evidence import LightEvidence
from lidarspectra.material.light_objective import OF_TONE, LightObjective
from lidarspectra.material.robust_centers import RobustCenters
from lidarspectra.material.surface_light import MIN_LIGHT

from .lit_walls import evidence

SMALL = 1e-6  # of a central difference: its error is of the square of it, and rounding 1e-16 / 1e-6


def rich_evidence() -> LightEvidence:
    """The lit walls under three lamps of a beam, with a window, a bright source of no known kind, and two cards."""
    data, random = evidence(2), np.random.default_rng(5)
    count = len(data.shown)
    lit = np.arange(count) >= 3  # nothing arrives at the first
    return replace(
        data,
        direct=data.direct * random.uniform(0.2, 1.0, (3, count, 1)) * lit[:, None],
        emission=random.uniform(0.3, 1.0, (3, count)),
        other=random.uniform(0.0, 0.3, (2, 3, count)) * lit,
        other_upright=np.array([True, False]),
        other_shown=np.array([[0.3, 0.4, 0.5], [np.nan] * 3]),
        card=np.where(lit & (np.arange(count) % 4 < 2), np.arange(count) % 2, -1),
        card_log=np.log([[0.5, 0.5, 0.5], [0.2, 0.2, 0.2]]),
        ceiling=data.group == 0,
    )


@pytest.mark.parametrize("redescending", [False, True])
def test_slopes_in_closed_form_are_those_of_differences(redescending: bool) -> None:
    model = LightObjective(rich_evidence(), flux_deviation=np.full(3, 0.15), redescending=redescending)
    place = np.random.default_rng(2).uniform(-0.3, 0.3, model.count)
    place[1] = 0.4  # the shoulder, which is not below 0
    found = model.jacobian(place)
    for column in range(model.count):
        step = SMALL * np.eye(model.count)[column]
        wanted = (model.residuals(place + step) - model.residuals(place - step)) / (2 * SMALL)
        # The priors' slopes and the tone curve's are differences over 1e-3: off by half of it times the curvature.
        assert np.abs(found[:, column] - wanted).max() < 0.01 * np.abs(wanted).max(), f"parameter {column}"
        if column >= OF_TONE:
            data = slice(0, 3 * model.rows.size)
            assert np.abs(found[data, column] - wanted[data]).max() < 1e-5 * np.abs(wanted).max(), f"parameter {column}"


def test_where_hardly_any_light_arrives_the_least_light_is_taken_which_no_lamp_moves() -> None:
    dim = replace(rich_evidence(), other=None, other_upright=None, other_shown=None)
    dim.direct[:, 3:6] *= 1e-9
    model = LightObjective(dim, flux_deviation=np.full(3, 0.15))
    place = np.zeros(model.count)
    light = model.light(place)[1]
    slopes = model.straight_slopes(model.some_light, place, light)
    assert (light[:6] == MIN_LIGHT).all()
    assert np.all(slopes[:6] == 0.0)
    assert np.all(slopes[6:, :, 3] != 0.0)


@pytest.mark.parametrize("redescending", [False, True])
def test_robust_centres_move_with_their_values_as_told(redescending: bool) -> None:
    random = np.random.default_rng(3)
    group, values = np.repeat([0, 1, 2], 40), random.normal(size=(120, 3))
    values[::10] += 4.0  # outliers
    centers = RobustCenters(group, random.uniform(0.3, 1.0, (120, 3)), scale=0.5, redescending=redescending)
    slopes = random.normal(size=(120, 3, 2))
    found = centers.slopes(values, slopes)
    for column in range(2):
        moved = SMALL * slopes[:, :, column]
        wanted = (centers.of(values + moved) - centers.of(values - moved)) / (2 * SMALL)
        assert np.abs(found[:, :, column] - wanted).max() < 1e-6
