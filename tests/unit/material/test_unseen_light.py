"""Where much of the light comes from what no picture shows, reflectances are less sure."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array

from lidarspectra.material.delighting.albedo import LightFit, fit_light
from lidarspectra.material.delighting.light_evidence import LightEvidence
from lidarspectra.material.delighting.sharpened_cones import cones_of_srgb
from lidarspectra.material.delighting.unseen_light import (
    UNSEEN_DEVIATION,
    share_of_unseen,
    unseen_light_deviation,
)

from .lit_walls import evidence

BOTH = np.arange(2)


@pytest.fixture(scope="module")
def seeing() -> tuple[LightEvidence, LightFit]:
    """Every point sees two equal faces, each with a tenth of what it sees, and the light that these send."""
    alone = evidence(2)
    points, faces = alone.exchange.shape[0], alone.exchange.shape[1] - 1
    form_factors = np.zeros((points, faces + 1))
    form_factors[:, BOTH] = 0.1
    shown = np.full((faces, 3), 0.2)
    seen = replace(alone, exchange=csr_array(form_factors), face_shown=shown)
    return seen, fit_light(seen, flux_deviation=np.array([0.15]))


def test_the_deviation_is_that_of_what_unseen_faces_send_by_their_share_of_the_light(
    seeing: tuple[LightEvidence, LightFit],
) -> None:
    data, fit = seeing
    found = unseen_light_deviation(data, fit, BOTH[:1])
    # The light of one face, changed by one deviation, over all light.
    one_more = replace(
        data, face_excess=np.where(np.arange(len(data.face_shown))[:, None] == 0, 1.0 + UNSEEN_DEVIATION, 1.0)
    )
    change = share_of_unseen(one_more, fit, BOTH) - share_of_unseen(data, fit, BOTH)
    assert found == pytest.approx(change)
    assert (found > 0).all()
    assert unseen_light_deviation(data, fit, BOTH) == pytest.approx(2.0 * found)


def test_the_share_is_what_unseen_faces_send_by_form_factor_over_all_light(
    seeing: tuple[LightEvidence, LightFit],
) -> None:
    data, fit = seeing
    for irradiance in (fit.irradiance, 3.0 * fit.irradiance):
        share = share_of_unseen(data, replace(fit, irradiance=irradiance), BOTH[:1])
        sent = cones_of_srgb(data.face_light(fit.tone, BOTH[:1]))
        assert share * irradiance == pytest.approx(np.broadcast_to(0.1 * sent, share.shape))


def test_nothing_is_added_where_all_is_seen_or_what_is_unseen_is_a_known_lamp(
    seeing: tuple[LightEvidence, LightFit],
) -> None:
    data, fit = seeing
    assert not unseen_light_deviation(data, fit, np.zeros(0, dtype=np.int64)).any()
    lamps = replace(data, face_lamp=np.arange(len(data.face_shown)) < 2)
    assert not unseen_light_deviation(lamps, fit, BOTH).any()
