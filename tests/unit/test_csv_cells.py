"""Small tables are read as people and spreadsheets write them."""

import numpy as np
import pytest

from lidarspectra.errors import DatabaseError
from lidarspectra.io.csv_cells import csv_rows
from lidarspectra.radiance.sampling.receptors import read_receptor
from lidarspectra.spectra.sensor_files import find_bands


def test_the_first_line_says_what_is_between_cells_and_so_what_a_comma_means() -> None:
    assert list(csv_rows(["a,b", '1.5,"x, y"', ""])) == [["a", "b"], ["1.5", "x, y"], []]
    assert list(csv_rows(["a;b", "1,5; -0,25 ;left, above"])) == [["a", "b"], ["1.5", " -0.25 ", "left, above"]]
    assert list(csv_rows(["a\tb", "1,5\t1.234,5"])) == [["a", "b"], ["1.5", "1.234,5"]]


def test_a_sensor_and_its_receptor_may_come_from_a_german_spreadsheet(tmp_path) -> None:
    (tmp_path / "device.csv").write_text("center_nm;fwhm_nm\n460;20\n560,5;20\n", encoding="utf-8-sig")
    np.testing.assert_allclose(find_bands("device.csv", tmp_path).centers_nm, [460.0, 560.5])
    (tmp_path / "receptor.csv").write_text("angle_deg;response\n0;1\n45;0,7\n90;0\n", encoding="utf-8")
    np.testing.assert_allclose(read_receptor(tmp_path / "receptor.csv").response, [1.0, 0.7, 0.0])
    (tmp_path / "device.csv").write_text("center_nm,fwhm_nm\n460,20\n560,5,20\n", encoding="utf-8")
    with pytest.raises(DatabaseError, match="expected 2 cells, found 3"):
        find_bands("device.csv", tmp_path)
