"""The laws of the paper's microbenchmarks hold in the trace: each against an answer by another route."""

import numpy as np
import pytest

from lidarspectra.spectra.databases import scenes_folder
from lidarspectra.spectra.spectrum_files import read_table
from research.experiments.experiment_figures import (
    cloths_figure,
    inverse_square_figure,
    superposition_figure,
    superposition_setup_figure,
)
from research.experiments.microbenchmark_tables import microbenchmark_table
from research.experiments.microbenchmarks import cloths, inverse_square, line_fit, superposition


def test_a_line_through_points_on_a_line_fits_wholly() -> None:
    x = np.linspace(1.0, 2.0, 9)
    assert line_fit(x, np.outer(3.0 * x + 1.0, [1.0, 2.0])) == pytest.approx([1.0, 1.0])


@pytest.mark.slow
def test_light_falls_with_the_square_adds_up_and_is_reflected_as_computed() -> None:
    squares = inverse_square("standard")
    assert squares.r_squared.min() > 0.98  # the values spread by 16 %, of which 1 % of noise takes 0.004
    assert np.abs(squares.irradiance / squares.expected - 1.0).max() < 0.06  # six standard errors of 1 %
    sums = superposition("standard")
    # Three traces of 1 %: six times their joint error.
    assert np.abs((sums.first + sums.second) / sums.together - 1.0).max() < 0.1
    rows = {row.id: row.spectrum for row in read_table(scenes_folder() / "reflectances.csv")}
    fabrics = cloths({"red": rows["fabric-red"]}, "standard")
    assert np.abs(fabrics.irradiance / fabrics.expected - 1.0).max() < 0.06
    assert len(microbenchmark_table(squares, sums, fabrics).frame) == 3
    figures = (inverse_square_figure(squares), superposition_setup_figure(sums), superposition_figure(sums))
    for figure in (*figures, cloths_figure(fabrics)):
        for axes in figure.axes:
            assert "[" in axes.get_xlabel()
            assert "[" in axes.get_ylabel()
