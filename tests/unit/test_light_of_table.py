"""Measured points are taken as they stand in a table, gaps are said, and what is no table is refused."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lidarspectra.errors import MapError
from lidarspectra.spectra.spectrum import sensor_bands
from lidarspectra.workflow.applications.cells_of_run import predict_from_table
from lidarspectra.workflow.run_folder.light_of_run import light_of_table

BANDS = sensor_bands("as7265x-14")
CHANNELS = [f"E_{label}" for label in BANDS.labels]


def write(folder: Path, **changes: object) -> Path:
    """Three readings of flat light, with changes by column."""
    table = pd.DataFrame({"x": [0.0, 1.0, 2.0], "y": 0.5, "z": 1.0} | dict.fromkeys(CHANNELS, 0.01))
    table.assign(**changes).to_csv(folder / "measured.csv", index=False)
    return folder / "measured.csv"


def test_points_without_direction_or_error_look_up_and_are_exact(tmp_path: Path) -> None:
    measured = light_of_table(write(tmp_path), BANDS)
    np.testing.assert_array_equal(measured.light.irradiance, np.full((3, 14), 0.01))
    assert not measured.light.irradiance_se.any()
    assert measured.places["nz"].to_numpy().tolist() == [1.0] * 3
    assert not measured.places["buried"].any()
    assert measured.notes == ()


@pytest.mark.parametrize("column", ["x", "z", "nz", CHANNELS[3], "SE_435"])
def test_a_reading_with_a_gap_is_left_out_and_said(tmp_path: Path, column: str) -> None:
    errors = dict.fromkeys([name.replace("E_", "SE_") for name in CHANNELS], 0.001)
    directions = {"nx": 0.0, "ny": 0.0, "nz": 1.0}
    measured = light_of_table(write(tmp_path, **errors | directions | {column: [1.0, np.nan, 1.0]}), BANDS)
    assert measured.places.sizes["point"] == 2
    assert "1 of 3 readings" in measured.notes[0]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"SE_410": 0.1}, "SE_435"),
        ({"E_410": ["a", "b", "c"]}, "E_410"),
        ({"x": np.nan}, "a place and a value"),
    ],
)
def test_what_tells_no_light_is_refused(tmp_path: Path, changes: dict[str, object], words: str) -> None:
    with pytest.raises(MapError, match=words):
        light_of_table(write(tmp_path, **changes), BANDS)


def test_a_cell_that_sees_more_than_the_channels_is_told_with_a_word_of_it(tmp_path: Path) -> None:
    def notes(cell: str, scale: float = 1.0) -> str:
        _, found = predict_from_table(
            write(tmp_path), cell, "as7265x-14", lamp_kind=None, area_cm2=1.0, scale=scale, base=tmp_path,
            out=tmp_path / "told.csv",
        )  # fmt: skip
        return "\n".join(found)

    assert "lies outside these channels" in notes("silicon")
    assert "known only up to a factor" in notes("organic-green")
    assert notes("organic-green", scale=0.3) == ""
    with pytest.raises(MapError, match="above 0"):
        notes("silicon", scale=float("nan"))
