"""The slopes of de-lighting's objective in closed form are those that differences give."""

from dataclasses import replace

import numpy as np
import pytest

from lidarspectra.material.light_evidence import LightEvidence
from lidarspectra.material.light_objective import LightObjective
from lidarspectra.material.robust_centers import RobustCenters

from .lit_walls import evidence

SMALL = 1e-6  # of a central difference: its error is of the square of it, and rounding 1e-16 / 1e-6


def rich_evidence() -> LightEvidence:
    """The lit walls under three lamps of a beam, with a window and a bright source of no known kind."""
    data, random = evidence(2), np.random.default_rng(5)
    count = len(data.shown)
    return replace(
        data,
        direct=data.direct * random.uniform(0.2, 1.0, (3, count, 1)),
        emission=random.uniform(0.3, 1.0, (3, count)),
        other=random.uniform(0.0, 0.3, (2, 3, count)),
        other_upright=np.array([True, False]),
        ceiling=data.group == 0,
    )


@pytest.mark.parametrize("redescending", [False, True])
def test_slopes_in_closed_form_are_those_of_differences(redescending: bool) -> None:
    model = LightObjective(rich_evidence(), flux_deviation=np.full(3, 0.15), redescending=redescending)
    place = np.random.default_rng(2).uniform(-0.3, 0.3, model.count)
    place[1] = 0.4  # the shoulder, which is not below 0
    found = model.jacobian(place)
    for column in range(2, model.count):
        step = SMALL * np.eye(model.count)[column]
        wanted = (model.residuals(place + step) - model.residuals(place - step)) / (2 * SMALL)
        # Priors' slopes are differences over a step of 1e-3, whose error is half of it times the curvature.
        assert np.abs(found[:, column] - wanted).max() < 0.01 * np.abs(wanted).max(), f"parameter {column}"
        data = slice(0, 3 * model.rows.size)
        assert np.abs(found[data, column] - wanted[data]).max() < 1e-5 * np.abs(wanted).max(), f"parameter {column}"


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
