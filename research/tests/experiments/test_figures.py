"""Figures of the experiments have units on their axes and survive maps of few points."""

from pathlib import Path

import numpy as np

from lidarspectra.mapping.figures.figure_style import save_figure
from lidarspectra.mapping.figures.map_comparison_figure import map_comparison_figure
from research.experiments.accuracy import map_deviation
from research.experiments.experiment_figures import accuracy_figure, tornado_figure
from research.experiments.sensitivity import Change, Influence
from research.experiments.true_floor_plan import true_floor_plan
from research.virtual_rooms.room_plan import read_plan

CENTERS = np.linspace(410.0, 760.0, 14)


def deviations():
    truth = np.outer(np.linspace(1.0, 2.0, 9), np.ones(3))
    off = 0.01 * np.random.default_rng(1).random(truth.shape)
    return [
        map_deviation(
            factor * truth + off, truth, np.ones(9, bool), scene="office", materials=materials, accuracy=accuracy
        )
        for materials, factor in (("estimated", 1.05), ("white plastic", 1.5))
        for accuracy in ("low", "ultra")
    ]


def test_lines_over_reflections_have_units_and_a_legend() -> None:
    figure = accuracy_figure(deviations())
    assert len(figure.axes) == 3
    assert all("[" in axes.get_ylabel() and "[" in axes.get_xlabel() for axes in figure.axes)
    assert {text.get_text() for text in figure.legends[0].get_texts()} == {"office, estimated", "office, white plastic"}


def test_the_tornado_has_its_longest_bar_on_top() -> None:
    error, worse, *_ = deviations()[0], deviations()[2]
    small, large = (
        Influence(words=words, changes=(Change(words="x", error=each),)) for words, each in (("a", error), ("b", worse))
    )
    (axes,) = tornado_figure([large, small], 1.0, "office").axes
    assert [label.get_text() for label in axes.get_yticklabels()] == ["a", "b"]
    assert "[%]" in axes.get_xlabel()


def test_maps_are_drawn_of_many_points_of_few_and_of_points_on_a_line(project: Path, tmp_path: Path) -> None:
    plan = true_floor_plan(read_plan(project / "scenes" / "office" / "plan.toml").file)
    generator = np.random.default_rng(1)
    for number, places in enumerate(
        (generator.random((20, 3)) * [3.0, 3.0, 0.0], np.linspace(0.5, 2.5, 4)[:, None] * [1.0, 1.0, 0.0])
    ):
        light = generator.random((len(places), 14)) * 1e-3
        figure = map_comparison_figure({"truth": light, "made": 0.9 * light}, places, CENTERS, plan)
        paths = save_figure(figure, tmp_path, f"maps-{number}")
        assert sorted(path.suffix for path in paths) == [".png", ".svg"]
