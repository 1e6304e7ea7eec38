"""Small tables are read as people and spreadsheets write them."""

from pathlib import Path

import numpy as np
import pytest

from lidarspectra.errors import DatabaseError, MapError
from lidarspectra.io.csv_cells import csv_rows, numbered_rows
from lidarspectra.mapping.photometry.schedule import read_schedule
from lidarspectra.mapping.photometry.week import read_week
from lidarspectra.radiance.sampling.receptors import read_receptor
from lidarspectra.room.sensor_points import read_points
from lidarspectra.spectra.sensor_files import find_bands


def test_the_first_line_says_what_is_between_cells_and_so_what_a_comma_means() -> None:
    assert list(csv_rows(["a,b", '1.5,"x, y"', ""])) == [["a", "b"], ["1.5", "x, y"], []]
    assert list(csv_rows(["a;b", "1,5; -0,25 ;left, above"])) == [["a", "b"], ["1.5", " -0.25 ", "left, above"]]
    assert list(csv_rows(["a\tb", "1,5\t1.234,5"])) == [["a", "b"], ["1.5", "1.234,5"]]
    assert list(csv_rows(["# a, b, c", "", "a;b", "#1;2"])) == [[], [], ["a", "b"], ["#1", "2"]]


def test_a_cell_in_quotes_may_have_line_ends_and_its_row_the_number_of_its_last_line() -> None:
    text = '# table.csv\r\n\r\nname;value\r\n"two\nlines";1,5\r\n;\r\n last ;"2;5"\r\n'
    assert list(numbered_rows(text)) == [(3, ["name", "value"]), (5, ["two\nlines", "1.5"]), (7, ["last", "2;5"])]
    assert list(numbered_rows("# nothing\n\n")) == []


def test_a_sensor_and_its_receptor_may_come_from_a_german_spreadsheet(tmp_path) -> None:
    (tmp_path / "device.csv").write_text("center_nm;fwhm_nm\n460;20\n560,5;20\n", encoding="utf-8-sig")
    np.testing.assert_allclose(find_bands("device.csv", tmp_path).centers_nm, [460.0, 560.5])
    (tmp_path / "receptor.csv").write_text("angle_deg;response\n0;1\n45;0,7\n90;0\n", encoding="utf-8")
    np.testing.assert_allclose(read_receptor(tmp_path / "receptor.csv").response, [1.0, 0.7, 0.0])
    (tmp_path / "device.csv").write_text("center_nm,fwhm_nm\n460,20\n560,5,20\n", encoding="utf-8")
    with pytest.raises(DatabaseError, match="expected 2 cells, found 3"):
        find_bands("device.csv", tmp_path)


@pytest.mark.parametrize("mark", [",", ";"])
def test_points_and_hours_are_read_as_the_pages_print_them_and_a_spreadsheet_saves_them(tmp_path, mark: str) -> None:
    def saved(text: str) -> Path:
        lines = [line.replace(",", mark) for line in text.splitlines()]
        lines = lines if mark == "," else [line.replace(".", ",") for line in lines]
        (tmp_path / "table.csv").write_text("\n".join(["# table.csv", *lines]) + "\n", encoding="utf-8")
        return tmp_path / "table.csv"

    positions, normals = read_points(saved("x,y,z,nx,ny,nz\n0.6,1.0,1.2,1,0,0"))
    np.testing.assert_allclose([positions, normals], [[[0.6, 1.0, 1.2]], [[1.0, 0.0, 0.0]]])
    (shift,) = read_schedule(saved("lamp,from,to,dim\npanel 1,8:30,17.5,0.4"))
    assert (shift.start_h, shift.end_h, shift.dim) == (8.5, 17.5, 0.4)
    (days,) = read_week(saved("days,lamp,from,to,dim\nmon-wed,panel 1,8:30,17.5,0.4"))
    assert (days.days, days.shift) == ((0, 1, 2), shift)
    with pytest.raises(MapError, match="line 3"):
        read_week(saved("days,lamp,from,to\nnever,panel 1,8,9"))
