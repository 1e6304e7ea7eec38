"""Whether locators have a feature for each sensor or for each channel: what finds people better who were not learned.

Clothes tint what a body leaves of the light, and so do walls and furniture. Fingerprints of several people at the same
places tell how much each does: one person after the other is left out, found by a discriminant that learned the others
(`discriminant`), and the channels get features where more are found so.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.hardware.sensor.as7265x import SensorSettings
from lidarspectra.mapping.localization.discriminant import fit_discriminant, sensor_blur
from lidarspectra.mapping.localization.features import FeatureSpace, Per, reference_of
from lidarspectra.mapping.localization.fingerprint_table import quantity_of
from lidarspectra.mapping.localization.places import Places

SURE = 1.0  # standard errors by which more people have to be found; channels cost time and memory


def chosen_features(
    space: FeatureSpace,
    tables: Sequence[xr.Dataset],
    places: Places,
    device: SensorSettings | None,
    *,
    drift: float,
) -> FeatureSpace:
    """The space with a feature for each sensor, or for each channel if people who were left out are found better so.

    Parameters
    ----------
    space : FeatureSpace
        If its settings say of what features are, it is returned as it is.
    tables : sequence of xarray.Dataset
        Fingerprints, of the space's sensors and bands. Persons are told apart by `draw`, if the table has it; those of
        two tables are two. One person alone gives features of sensors.
    places : Places
        Of all tables.
    device : SensorSettings, optional
        As in `discriminant.sensor_blur`.
    drift : float
        d, of a die since its reference. [1]

    Returns
    -------
    space : FeatureSpace
        With `settings.per`.
    """
    if space.settings.per is not None:
        return space
    place = np.concatenate([places.index(table["label"].to_numpy()) for table in tables])
    person = _persons(tables)
    spaces: dict[Per, FeatureSpace] = {
        per: replace(space, settings=replace(space.settings, per=per)) for per in ("sensor", "channel")
    }
    shares = [_found(each, tables, place, person, device, drift=drift) for each in spaces.values()]
    gain = shares[1] - shares[0]
    if len(gain) < 2 or not gain.mean() > SURE * gain.std(ddof=1) / np.sqrt(len(gain)):
        return spaces["sensor"]
    return spaces["channel"]


def _persons(tables: Sequence[xr.Dataset]) -> IntArray:
    """(fingerprint,) number of the person, over all tables."""
    keys: list[tuple[int, int]] = []
    for number, table in enumerate(tables):
        drawn = (
            table["draw"].to_numpy().astype(np.int64)
            if "draw" in table.coords
            else np.zeros(table.sizes["fingerprint"])
        )
        keys += [(number, int(each)) for each in drawn]
    return np.asarray(np.unique(np.array(keys), axis=0, return_inverse=True)[1].reshape(-1), dtype=np.int64)


def _found(
    space: FeatureSpace,
    tables: Sequence[xr.Dataset],
    place: IntArray,
    person: IntArray,
    device: SensorSettings | None,
    *,
    drift: float,
) -> FloatArray:
    """(visit,) share of a person's fingerprints at a place that a discriminant of the others finds there [0-1]."""
    features = np.vstack(
        [space.features(table[quantity_of(table)].to_numpy(), reference_of(table)) for table in tables]
    )
    blur = sensor_blur(space, tables[0], device, drift=drift)
    shares: list[float] = []
    for left_out in np.unique(person):
        learned: BoolArray = person != left_out
        known, own = np.unique(place[learned], return_inverse=True)
        if known.size < 2:
            continue
        fitted = fit_discriminant(features[learned], own, known.size, blur, mismatch=space.settings.mismatch)
        tested = np.flatnonzero(~learned & np.isin(place, known))
        right = known[fitted.scores(features[tested]).argmax(axis=1)] == place[tested]
        shares += [float(right[place[tested] == each].mean()) for each in np.unique(place[tested])]
    return np.array(shares)
