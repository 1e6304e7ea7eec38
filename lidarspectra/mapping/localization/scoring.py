"""Locators on measured nights: within a night by splits in time, and from one night to another."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.localization.location_errors import LocationErrors, location_errors
from lidarspectra.mapping.localization.location_model import (
    METHODS,
    Against,
    LocationModel,
    TrainingSettings,
    train_locator,
)
from lidarspectra.mapping.localization.locators import Method
from lidarspectra.mapping.localization.places import Located
from lidarspectra.mapping.localization.running_reference import MedianWindow
from lidarspectra.mapping.localization.time_splits import SplitKind, time_splits
from lidarspectra.progress import Progress, part_of, silent


@dataclass(frozen=True, kw_only=True, eq=False)
class NightScore:
    """Errors on a night's readings.

    Parameters
    ----------
    words : str
        Training and test data.
    errors : mapping of Method to LocationErrors
    kind : 'visits', 'stretches' or None
        How the night was split; None where the model was trained on another night.
    """

    words: str
    errors: Mapping[Method, LocationErrors]
    kind: SplitKind | None = None


def errors_of(
    model: LocationModel, table: xr.Dataset, *, against: Against = "own", times_s: FloatArray | None = None
) -> dict[Method, LocationErrors]:
    """Errors of every method on a table of labelled readings; readings without any feature are left out.

    These are readings in which no sensor has a value, and the first of a stream, before there is a running median: live
    localization gives no position for either.

    Parameters
    ----------
    model : LocationModel
    table : xarray.Dataset
    against
        As of `LocationModel.features`.
    times_s : (reading,) float, optional
        Each reading is located with what those before it told; without times, by itself. [s]

    Raises
    ------
    MapError
        If nothing is left, or as `LocationModel.features` and `location_errors`.
    """
    features = model.features(table, against=against)
    known = np.flatnonzero(np.isfinite(features).any(axis=1))
    if not known.size:
        raise MapError(
            expected="readings with at least one feature",
            found=f"none of {len(features)}",
            where=_name(table),
            todo=f"A running median needs {MedianWindow().first} readings." if against == "running" else "",
        )
    readings, given = table.isel(fingerprint=known), features[known]
    people = model.people(given)  # the same for all methods
    found: dict[Method, LocationErrors] = {}
    for method in METHODS:
        located = Located(scores=model.locators[method].scores(given), places=model.places, people=people)
        if times_s is not None:
            located = model.remembered(located, given, times_s[known])
        found[method] = location_errors(located, readings)
    return found


def times_in_order(table: xr.Dataset, *, is_recording: bool) -> FloatArray | None:
    """(reading,) times of a table's readings [s]; a second apart in a recording without any, else None."""
    if "time_s" in table.coords:
        return np.asarray(table["time_s"].to_numpy(), dtype=np.float64)
    return np.arange(table.sizes["fingerprint"], dtype=np.float64) if is_recording else None


def score_within(
    table: xr.Dataset,
    settings: TrainingSettings | None = None,
    *,
    each_alone: bool = False,
    progress: Progress = silent,
) -> NightScore:
    """Cross-validation within a night: train on one part and test on the other, part after part.

    Parameters
    ----------
    table : xarray.Dataset
        A night's readings in order of time. Without an empty room, each part's reference is its own median.
    settings : TrainingSettings, optional
    each_alone : bool
        Whether each reading is located by itself, without what those before it told.
    progress : Progress, optional

    Returns
    -------
    score : NightScore
        Over all readings, each tested once.

    Raises
    ------
    MapError
        As `time_splits` and `train_locator`.
    """
    told_s = table["time_s"].to_numpy() if "time_s" in table.coords else None
    splits = time_splits(table["label"].to_numpy().astype(str).tolist(), told_s)
    times_s = None if each_alone else times_in_order(table, is_recording=True)
    parts: list[dict[Method, LocationErrors]] = []
    for number, split in enumerate(splits):
        share = part_of(progress, number / len(splits), (number + 1) / len(splits))
        model = train_locator(table.isel(fingerprint=np.flatnonzero(split.train)), settings, progress=share)
        test = table.isel(fingerprint=np.flatnonzero(split.test))
        parts.append(errors_of(model, test, times_s=None if times_s is None else times_s[split.test]))
    return NightScore(
        words=f"{_name(table)}, within the night",
        errors={method: LocationErrors.joined([part[method] for part in parts]) for method in METHODS},
        kind=splits[0].kind,
    )


def score_across(
    learned: xr.Dataset,
    tested: xr.Dataset,
    settings: TrainingSettings | None = None,
    *,
    each_alone: bool = False,
    progress: Progress = silent,
) -> tuple[NightScore, NightScore]:
    """Train on one night and test on another: against the second night's own reference, and against the first's.

    Parameters
    ----------
    learned, tested : xarray.Dataset
        Two nights.
    settings, each_alone
        As of `score_within`.
    progress : Progress, optional

    Returns
    -------
    own, trained : NightScore
        The second shows the value of raw readings, without a new reference.
    """
    model = train_locator(learned, settings, progress=progress)
    words = f"{_name(learned)} to {_name(tested)}"
    times_s = None if each_alone else times_in_order(tested, is_recording=True)
    own, trained = (
        errors_of(model, tested, against="own", times_s=times_s),
        errors_of(model, tested, against="trained", times_s=times_s),
    )
    return (
        NightScore(words=f"{words}, own reference", errors=own),
        NightScore(words=f"{words}, first night's reference", errors=trained),
    )


def _name(table: xr.Dataset) -> str:
    return str(table.attrs.get("source", "readings"))
