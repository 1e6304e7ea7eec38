"""How often it is right that nobody is there, one person or two, and how often as often as it says."""

from itertools import pairwise

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.localization.location_model import Against, LocationModel
from lidarspectra.mapping.localization.presence import NOBODY, TWO_PEOPLE

COUNTS = (NOBODY, "one person", TWO_PEOPLE)
CONFIDENCES = (0.0, 0.6, 0.8, 0.95, 1.0)  # [1] edges of what is said


def people_of(
    model: LocationModel, table: xr.Dataset, *, against: Against = "own", times_s: FloatArray | None = None
) -> tuple[IntArray, FloatArray]:
    """How many people there were, and how probable the model takes each number to be.

    Parameters
    ----------
    model : LocationModel
    table : xarray.Dataset
        Labelled readings: 'nobody', 'two people', or the place of one person.
    against
        As in `LocationModel.features`.
    times_s : (reading,) float, optional
        Each reading is judged with what those before it told; without times, by itself. [s]

    Returns
    -------
    people : (reading,) int
    probabilities : (reading, 3) float
        Of readings with at least one feature.
    """
    features = model.features(table, against=against)
    known = np.isfinite(features).any(axis=1)
    labels = table["label"].to_numpy().astype(str)[known]
    people = np.where(labels == NOBODY, 0, np.where(labels == TWO_PEOPLE, 2, 1)).astype(np.int64)
    if times_s is not None:
        return people, model.locate_in_order(features[known], times_s[known]).people
    return people, model.people(features[known])


def people_table(people: IntArray, probabilities: FloatArray) -> Table:
    """Per number of people: readings, and how often each answer was given [%].

    Parameters
    ----------
    people : (reading,) int
    probabilities : (reading, 3) float
    """
    said = probabilities.argmax(axis=1)
    rows = []
    for number, words in enumerate(COUNTS):
        own = said[people == number]
        if own.size:
            rows.append((words, own.size, *(100.0 * float((own == other).mean()) for other in range(len(COUNTS)))))
    headings = ["there", "readings", *(f"said {words} [%]" for words in COUNTS)]
    formats = {heading: ".1f" for heading in headings if "[%]" in heading}
    frame = pd.DataFrame(rows, columns=headings)
    return Table(name="people", caption="How many people are there.", frame=frame, formats=formats)


def reliability_table(right: FloatArray, probability: FloatArray, *, name: str, caption: str) -> Table:
    """How often answers are right, by the probability that they say.

    Parameters
    ----------
    right : (answer,) float
        1 for a right answer, 0 for a wrong one.
    probability : (answer,) float
        That it said. [0-1]
    name, caption : str
    """
    rows = []
    for low, high in pairwise(CONFIDENCES):
        chosen = (probability >= low) & ((probability < high) | (high == 1.0))
        if chosen.any():
            said, was = 100.0 * float(probability[chosen].mean()), 100.0 * float(right[chosen].mean())
            rows.append((f"{100 * low:.0f} to {100 * high:.0f}", int(chosen.sum()), said, was))
    headings = ["says [%]", "answers", "said, mean [%]", "right [%]"]
    formats = dict.fromkeys(headings[2:], ".1f")
    return Table(name=name, caption=caption, frame=pd.DataFrame(rows, columns=headings), formats=formats)
