"""Grey and white cards of a run, as the run file has them."""

from collections.abc import Sequence

import numpy as np

from lidarspectra.config import CardSection
from lidarspectra.material.delighting.cards import Card


def cards_of_run(sections: Sequence[CardSection]) -> tuple[Card, ...]:
    """The cards of `[[materials.cards]]`."""
    return tuple(
        Card(center=np.array(each.center), size_m=each.size, reflectance=each.reflectance) for each in sections
    )
