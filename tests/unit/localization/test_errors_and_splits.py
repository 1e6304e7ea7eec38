"""Percentiles, ranks and honest splits, by hand."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import to_hex

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.figures.figure_style import save_figure
from lidarspectra.mapping.figures.floor_plan import FloorPlan
from lidarspectra.mapping.localization.location_errors import (
    TOP_1_ERROR,
    LocationErrors,
    clustered_mean,
    error_table,
    location_errors,
    place_table,
)
from lidarspectra.mapping.localization.location_figures import (
    error_curves_figure,
    error_map_figure,
    gain_curve_figure,
    two_times_figure,
)
from lidarspectra.mapping.localization.places import Located, Places, geometric_median
from lidarspectra.mapping.localization.time_splits import time_splits, visits_of


def errors(distances: list[float], *, known: bool = True) -> LocationErrors:
    true = np.zeros((len(distances), 2))
    put = np.array([[distance, 0.0] for distance in distances])
    return LocationErrors(
        labels=tuple("ab"[number % 2] for number in range(len(distances))),
        true_m=true if known else np.full_like(true, np.nan),
        located_m=put,
        rank=np.arange(len(distances)),
    )


def test_percentiles_and_shares_are_those_of_the_distances() -> None:
    found = errors([0.0, 1.0, 2.0, 3.0, 4.0])
    row = error_table({"x": found}, name="t", caption="c").frame.iloc[0]
    assert [row["median [m]"], row["75th percentile [m]"], row["90th percentile [m]"]] == [2.0, 3.0, pytest.approx(3.6)]
    assert [row["top 1 [%]"], row["top 3 [%]"], row["top 5 [%]"]] == [20.0, 60.0, 100.0]


def test_without_coordinates_nothing_is_said_in_metres() -> None:
    found = errors([0.0, 1.0], known=False)
    assert np.isnan(found.percentile_m(50))
    assert list(error_table({"x": found}, name="t", caption="c").frame) == [
        "method", "readings", "top 1 [%]", TOP_1_ERROR, "top 3 [%]", "top 5 [%]",
    ]  # fmt: skip
    with pytest.raises(MapError, match="--positions"):
        error_map_figure(found)
    with pytest.raises(MapError, match="--positions"):
        error_curves_figure({"a room": {"x": found}})


def ranked(labels: str, rank: list[int]) -> LocationErrors:
    unknown = np.full((len(rank), 2), np.nan)
    return LocationErrors(labels=tuple(labels), true_m=unknown, located_m=unknown, rank=np.array(rank))


def test_the_standard_error_of_top_1_is_over_places_by_hand() -> None:
    # Of 4 readings at a 3 are right, of 1 at b none, of 3 at c all: m = 6/8; y - m n = 0, -.75, .75
    found = ranked("aaabcacc", [0, 0, 1, 2, 0, 0, 0, 0])
    assert found.top(1) == 0.75
    assert found.top_1_error == pytest.approx(np.sqrt(3.0 / 2.0 * 2.0 * 0.75**2) / 8.0)
    row = error_table({"x": found}, name="t", caption="c").frame.iloc[0]
    assert row[TOP_1_ERROR] == pytest.approx(100.0 * found.top_1_error)


def test_copies_of_readings_tell_no_more_and_without_them_it_is_that_of_a_mean() -> None:
    random = np.random.default_rng(0)
    right = random.integers(0, 2, 12).astype(np.float64)
    mean, error = clustered_mean(right, np.arange(12))
    assert error == pytest.approx(right.std(ddof=1) / np.sqrt(12))
    assert clustered_mean(np.repeat(right, 50), np.repeat(np.arange(12), 50)) == pytest.approx((mean, error))


def test_the_standard_error_is_how_much_other_places_and_people_would_scatter() -> None:
    random, shares, stated = np.random.default_rng(1), [], []
    for _ in range(2000):
        frames = random.integers(20, 101, 24)  # of a visit, all right or all wrong
        right = np.repeat((random.random(24) < 0.7).astype(np.float64), frames)
        mean, error = clustered_mean(right, np.repeat(np.arange(24), frames))
        shares.append(mean)
        stated.append(error**2)
    assert np.sqrt(np.mean(stated)) == pytest.approx(np.std(shares), rel=0.08)  # 2000 draws tell it to 2 %


def test_of_one_place_or_one_unknown_there_is_no_standard_error_and_all_right_has_none_to_tell() -> None:
    assert np.isnan(ranked("aaa", [0, 1, 0]).top_1_error)
    assert np.isnan(ranked("aab", [0, 1, -1]).top_1_error)
    assert ranked("aabb", [0, 0, 0, 0]).top_1_error == 0.0
    assert np.isnan(clustered_mean(np.array([]), np.array([]))).all()
    assert TOP_1_ERROR not in error_table({"x": ranked("aa", [0, 1])}, name="t", caption="c").frame


def test_two_locators_are_compared_reading_by_reading() -> None:
    first, second = ranked("aabbcc", [0, 0, 0, 1, 0, 0]), ranked("aabbcc", [0, 0, 1, 0, 1, 1])
    # Differences by place: 0, 0, 2, of 6 readings: m = 1/3, y - m n = -2/3, -2/3, 4/3
    gain, error = first.top_1_gain(second)
    assert gain == pytest.approx(1.0 / 3.0)
    assert error == pytest.approx(np.sqrt(3.0 / 2.0 * 24.0 / 9.0) / 6.0)
    assert second.top_1_gain(first) == pytest.approx((-gain, error))
    assert first.top_1_gain(first) == (0.0, 0.0)
    assert np.isnan(first.top_1_gain(ranked("aabbcc", [0, 0, 0, 0, 0, -1]))).all()
    with pytest.raises(MapError, match="same readings"):
        first.top_1_gain(ranked("aabbca", [0, 0, 0, 0, 0, 0]))


def test_errors_by_place_are_told_apart() -> None:
    frame = place_table(errors([0.0, 1.0, 2.0, 3.0])).frame.set_index("place")
    assert frame.loc["a", "median [m]"] == 1.0
    assert frame.loc["b", "median [m]"] == 2.0


def test_shares_by_place_are_of_its_readings_and_left_out_where_the_locator_does_not_know_it() -> None:
    nowhere = np.full((5, 2), np.nan)
    found = LocationErrors(
        labels=tuple("aaaab"), true_m=nowhere, located_m=nowhere, rank=np.array([0, 1, 0, 0, -1])
    )  # fmt: skip
    frame = place_table(found).frame.set_index("place")
    assert frame.loc["a", "top 1 [%]"] == 75.0
    assert np.isnan(frame.loc["b", "top 1 [%]"])
    assert "median [m]" not in frame


def test_a_distance_is_from_the_true_place_to_where_a_reading_was_put() -> None:
    true, put = np.array([[3.0, 5.0], [-1.0, 2.0]]), np.array([[6.0, 1.0], [-1.0, 2.5]])
    found = LocationErrors(labels=tuple("ab"), true_m=true, located_m=put, rank=np.zeros(2, np.int64))
    assert found.error_m.tolist() == [5.0, 0.5]


def test_the_position_is_the_geometric_median_of_the_places_and_a_tie_is_lost() -> None:
    places = Places(labels=tuple("abc"), positions_m=np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 2.0, 0.0]]))
    located = Located(scores=np.array([[0.5, 0.25, 0.25]]), places=places, people=np.array([[0.0, 1.0, 0.0]]))
    # The others pull at a with .25 along x and along y, .35 together, which is less than its own .5
    assert located.positions_m.tolist() == [[0.0, 0.0, 0.0]]
    assert located.spread_m == pytest.approx([np.sqrt(0.25 * 16.0 + 0.25 * 4.0)])
    assert [int(located.rank(np.array([place]))[0]) for place in range(3)] == [0, 2, 2]


def test_the_geometric_median_has_the_least_weighted_sum_of_distances() -> None:
    generator = np.random.default_rng(0)
    points = np.column_stack([generator.uniform(0.0, 5.0, (12, 2)), np.zeros(12)])
    weights = generator.dirichlet(np.ones(12), 20)
    found = geometric_median(points, weights)

    def cost(where: FloatArray) -> FloatArray:
        return np.asarray((weights * np.linalg.norm(points[None] - where[:, None], axis=2)).sum(axis=1))

    for step in 0.01 * np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]]):
        assert (cost(found + step) >= cost(found) - 1e-9).all()
    assert (cost(found) < cost(weights @ points)).all()


def test_the_geometric_median_of_an_equilateral_triangle_is_its_middle() -> None:
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
    found = geometric_median(points, np.array([[1.0, 1.0, 1.0], [0.2, 0.2, 0.6], [0.0, 1.0, 0.0]]))
    assert found == pytest.approx(np.array([[0.5, np.sqrt(0.75) / 3.0], points[2], points[1]]), abs=1e-6)
    # Two places with one position weigh together
    twice = geometric_median(np.array([[0.0, 0.0], [0.0, 0.0], [3.0, 0.0]]), np.array([[0.3, 0.3, 0.4]]))
    assert twice.tolist() == [[0.0, 0.0]]


def test_a_visit_ends_where_the_label_changes() -> None:
    assert visits_of(list("aabba")).tolist() == [0, 0, 1, 1, 2]
    times = np.array([0.0, 1.0, 100.0, 101.0, 102.0])  # the empty room was read in between
    assert visits_of(list("aaaab"), times).tolist() == [0, 0, 1, 1, 2]
    assert visits_of(list("aaaab"), 60.0 * np.arange(5)).tolist() == [0, 0, 0, 0, 1]  # one a minute is one visit


def test_single_visits_are_cut_with_a_gap_and_never_shuffled() -> None:
    labels = ["a"] * 20 + ["b"] * 20
    splits = time_splits(labels)
    assert [split.kind for split in splits] == ["stretches", "stretches"]
    tested = np.sum([split.test for split in splits], axis=0)
    assert (tested == 1).all()
    first = splits[0]
    assert np.flatnonzero(first.test).tolist() == [*range(10), *range(20, 30)]
    # A tenth of a visit of 20 readings: two are left out between what is tested on and what is learned from
    assert np.flatnonzero(first.train).tolist() == [*range(12, 20), *range(32, 40)]


def test_places_that_were_visited_again_are_split_by_visit() -> None:
    splits = time_splits(list("aabbbaabaa"))
    assert [split.kind for split in splits] == ["visits", "visits"]
    assert np.flatnonzero(splits[1].test).tolist() == [5, 6, 7]
    assert (splits[1].train == ~splits[1].test).all()  # the third visit to a is learned from


def test_a_visit_of_one_reading_cannot_be_split() -> None:
    with pytest.raises(MapError, match="at 'b'"):
        time_splits(list("aaaaaab"))


def test_curves_hold_every_reading(tmp_path: Path) -> None:
    figure = error_curves_figure({"office": {"old": errors([0.1, 0.2, 0.4, 0.4]), "new": errors([0.1])}})
    x, y = figure.axes[0].lines[0].get_data()
    assert np.asarray(x).tolist() == [0.0, 0.1, 0.2, 0.4, 0.4]
    assert np.asarray(y).tolist() == [0.0, 25.0, 50.0, 75.0, 100.0]
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == ["old: 0.30 m", "new: 0.10 m"]
    assert all(path.stat().st_size > 1000 for path in save_figure(figure, tmp_path, "curves"))
    with pytest.raises(MapError):
        error_curves_figure({})


def test_the_map_leads_from_each_place_to_where_it_is_put() -> None:
    found = errors([1.0, 2.0, 3.0, 4.0])
    plan = FloorPlan(outline=np.array([[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]]))
    for ground in (None, plan):
        axes = error_map_figure(found, ground).axes[0]
        ends = [line.get_xdata()[-1] for line in axes.lines if len(line.get_xdata()) == 2][:2]
        assert ends[0] == 2.0


def test_two_times_and_gains_are_drawn() -> None:
    axes = two_times_figure(np.ones((3, 2)), 0.9 * np.ones((3, 2)), ["s1", "s2"], 560.0).axes[0]
    assert [line.get_ydata()[0] for line in axes.lines[:2]] == [1.0, 0.9]
    assert to_hex(axes.lines[0].get_color()) != to_hex(axes.lines[1].get_color())
    axes = gain_curve_figure([0, 1, 2], {"greedy": [3.0, 2.0, 1.5]}, "error [m]").axes[0]
    assert np.asarray(axes.lines[0].get_ydata()).tolist() == [3.0, 2.0, 1.5]


def test_the_right_spot_on_the_wrong_storey_is_no_hit() -> None:
    """Two places one above the other: neither is the other, and half and half is not known to a spot."""
    places = Places(labels=("kitchen", "attic"), positions_m=np.array([[1.0, 2.0, 0.0], [1.0, 2.0, 2.8]]))
    scores = np.array([[0.1, 0.9], [0.5, 0.5]])
    located = Located(scores=scores, places=places, people=np.tile([0.0, 1.0, 0.0], (2, 1)))
    table = xr.Dataset(
        coords={
            "label": ("fingerprint", ["kitchen", "kitchen"]),
            "position_m": (("fingerprint", "axis"), np.tile([1.0, 2.0, 0.0], (2, 1))),
        }
    )
    found = location_errors(located, table)
    assert found.error_m[0] == pytest.approx(2.8)
    assert located.spread_m[1] > 1.0
    assert error_map_figure(found).axes
