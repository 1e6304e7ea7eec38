"""Wide tables of counts, and the files of positions."""

import gzip
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from lidarspectra.cli.sensor import app
from lidarspectra.errors import MapError
from lidarspectra.mapping.localization.fingerprint_files import (
    header_of,
    parse_frame,
    read_empty_room,
    read_fingerprints,
)
from lidarspectra.mapping.localization.fingerprint_table import save_fingerprints

Maker = Callable[..., xr.Dataset]
HEADER = "s1_w1,s1_w9,s2_w1,s2_w9,loc"


def written(folder: Path, *rows: str, header: str = HEADER, name: str = "night.csv") -> Path:
    path = folder / name
    path.write_text("\n".join([header, *rows, ""]), encoding="utf-8")
    return path


def test_channels_are_found_by_name_and_not_by_place(tmp_path: Path) -> None:
    by_number = read_fingerprints(written(tmp_path, "8,153,9,216,0"))
    shuffled = written(tmp_path, "216,0,153,8,9", header="s2_610,label,s1_610,s1_410,s2_410", name="b.csv")
    by_wavelength = read_fingerprints(shuffled).sel(sensor=["s1", "s2"])
    assert by_number["band"].to_numpy().tolist() == [410.0, 610.0]  # w9 is the ninth channel by wavelength
    assert by_number["counts"].to_numpy().tolist() == [[[8.0, 153.0], [9.0, 216.0]]]
    assert (by_wavelength["counts"] == by_number["counts"]).all()
    assert by_number["label"].item() == by_wavelength["label"].item() == "0"


def test_semicolons_and_tabs_stand_between_channels_too(tmp_path: Path) -> None:
    commas = read_fingerprints(written(tmp_path, "8,153,,216,a"))
    for mark in ";\t":
        other = written(tmp_path, "8,153,,216,a".replace(",", mark), header=HEADER.replace(",", mark), name="b.csv")
        assert read_fingerprints(other)["counts"].equals(commas["counts"])


@pytest.mark.parametrize("name", ["NA", "None", "nan", "null", "N/A", "007", "1e3", "3"])
def test_a_place_is_called_as_it_is_written(name: str, tmp_path: Path) -> None:
    night = written(tmp_path, f"8,153,9,216,{name}", "8,153,9,216,b", "8,153,,216,", "8,nan,9,NA,b")
    (tmp_path / "places.csv").write_text(f"name,x,y\n{name},1,2\nb,3,4\n", encoding="utf-8")
    table = read_fingerprints(night, tmp_path / "places.csv")
    assert table["label"].to_numpy().tolist() == [name, "b", "", "b"]
    assert table["position_m"].to_numpy()[0].tolist() == [1.0, 2.0, 0.0]
    assert int(table["counts"].isnull().sum()) == 3  # in a channel the same words are missing readings


def test_a_number_sign_begins_a_comment_only_where_a_line_does(tmp_path: Path) -> None:
    table = read_fingerprints(written(tmp_path, "# by the window", "8,153,9,216,desk #2", "  # done"))
    assert table["label"].item() == "desk #2"
    first = written(tmp_path, "desk #2,8,153,9,216", header="loc,s1_w1,s1_w9,s2_w1,s2_w9", name="first.csv")
    assert read_fingerprints(first)["counts"].equals(table["counts"])


def test_all_that_localization_reads_is_shown_and_drawn(make_table: Maker, tmp_path: Path) -> None:
    save_fingerprints(make_table(), tmp_path / "prints.nc")
    few = written(tmp_path, *(f"{8 + i},153,9,216,p{i}" for i in range(4)))  # two channels a sensor
    for path, words in ((tmp_path / "prints.nc", "s1"), (few, "4 at 4 places")):
        picture = tmp_path / f"{path.stem}.png"
        result = CliRunner().invoke(app, ["show", str(path), "--plot", str(picture)])
        assert result.exit_code == 0, result.exception
        assert words in result.output
        assert picture.stat().st_size > 5000


def test_saturated_and_absent_counts_are_missing(tmp_path: Path) -> None:
    counts = read_fingerprints(written(tmp_path, "8,65535,,216,a"))["counts"].to_numpy()[0]
    assert np.isnan(counts).tolist() == [[False, True], [True, False]]


def test_rows_of_the_empty_room_become_the_reference(tmp_path: Path) -> None:
    rows = ("10,100,20,200,empty", "12,104,20,,empty", "9,90,21,210,a")
    table = read_fingerprints(written(tmp_path, *rows))
    assert table.sizes["fingerprint"] == 1
    assert table["empty"].to_numpy().tolist() == [[11.0, 102.0], [20.0, 200.0]]


def test_empty_with_a_capital_is_the_empty_room_too(tmp_path: Path) -> None:
    table = read_fingerprints(written(tmp_path, "10,100,10,100,Empty", "8,153,9,216,Desk"))
    assert table["label"].to_numpy().tolist() == ["Desk"]
    assert table["empty"].to_numpy().tolist() == [[10.0, 100.0], [10.0, 100.0]]


def test_an_empty_room_is_read_from_its_rows_or_from_a_table_of_nothing_else(tmp_path: Path) -> None:
    rows = ("10,100,20,200,empty", "12,104,20,,empty")
    without = written(tmp_path, *(row.removesuffix(",empty") for row in rows), header="s1_w1,s1_w9,s2_w1,s2_w9")
    for path in (
        without,
        written(tmp_path, *rows, "9,90,21,210,a", name="night.csv"),
        written(tmp_path, *rows, name="only.csv"),
    ):
        assert read_empty_room(path)["empty"].to_numpy().tolist() == [[11.0, 102.0], [20.0, 200.0]]
    with pytest.raises(MapError, match="the labels a, b"):
        read_empty_room(written(tmp_path, "9,90,21,210,a", "9,90,21,210,b"))


def test_a_sensor_that_was_dead_in_the_empty_room_is_left_out_and_the_night_is_read(
    tmp_path: Path,
) -> None:
    night = written(tmp_path, "10,100,,65535,empty", "12,102,,65535,empty", "9,90,,210,a")
    for table in (read_fingerprints(night), read_empty_room(night)):
        assert table["empty"].to_numpy().tolist() == [[11.0, 101.0], [0.0, 0.0]]  # 0 is no reference
    with pytest.raises(MapError, match="one count or more in the rows 'empty'"):
        read_fingerprints(written(tmp_path, ",,,65535,empty", "9,90,,210,a"))


@pytest.mark.parametrize("name", ["time", "time_s", "Timestamp"])
def test_times_of_a_wide_table_are_read_in_any_form_or_refused(name: str, tmp_path: Path) -> None:
    header = f"{name},{HEADER}"
    for first, second in (("100", "102.5"), ("2023-04-20 14:36:08", "2023-04-20T14:36:10.5Z")):
        rows = (f"{first},8,153,9,216,a", f"{second},8,153,9,216,a")
        times = read_fingerprints(written(tmp_path, *rows, header=header))["time_s"].to_numpy()
        assert np.diff(times) == pytest.approx([2.5])
    with pytest.raises(MapError, match=r"row 3, column .*: expected a time in every row, found 'soon'"):
        read_fingerprints(written(tmp_path, "100,8,153,9,216,a", "soon,8,153,9,216,a", header=header))


def test_a_packed_table_and_labels_with_gaps_are_read(tmp_path: Path) -> None:
    plain = written(tmp_path, "8,153,9,216,3", "8,153,9,216,")
    packed = tmp_path / "night.csv.gz"
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    # pandas makes 3.0 of 3 where a label is missing; it is the place '3' all the same
    assert read_fingerprints(packed)["label"].to_numpy().tolist() == ["3", ""]


def test_a_damaged_packed_table_is_one_clear_error(tmp_path: Path) -> None:
    packed = bytearray(gzip.compress(HEADER.encode() + b"\n" + b"8,153,9,216,a\n" * 500))
    packed[12:20] = b"\xff" * 8
    path = tmp_path / "night.csv.gz"
    path.write_bytes(bytes(packed))
    with pytest.raises(MapError, match="readable CSV"):
        read_fingerprints(path)


def test_positions_come_from_a_file_of_names(tmp_path: Path) -> None:
    night = written(tmp_path, "8,153,9,216,a", "8,150,9,210,b")
    places = written(tmp_path, "b,3,4", "a,1,2", header="name,x,y", name="places.csv")
    assert read_fingerprints(night, places)["position_m"].to_numpy().tolist() == [[1.0, 2.0, 0.0], [3.0, 4.0, 0.0]]


@pytest.mark.parametrize(
    ("header", "row", "found"),
    [
        ("a,b,c", "1,2,3", "a, b, c"),
        ("s1_w19,loc", "1,a", "s1_w19"),
        ("s1_411,loc", "1,a", "s1_411"),
        ("s1_w1,s1_410,loc", "1,2,a", "again"),
        ("s1_410,s1_410,loc", "1,2,a", "'s1_410' again"),
        ("s1_w1,s1_w2,s2_w1,loc", "1,2,3,a", "no 435 nm of 's2'"),
        (HEADER, "1,2,3,dark,a", "'dark'"),
        (HEADER, "1,2,3,4,empty", "only of the empty room"),
    ],
)
def test_what_is_not_understood_is_refused(tmp_path: Path, header: str, row: str, found: str) -> None:
    with pytest.raises(MapError, match=found):
        read_fingerprints(written(tmp_path, row, header=header))


@pytest.mark.parametrize(
    ("rows", "found"), [(("a,1,2", "a,3,4"), "'a'"), (("a,1,far",), "nan"), (("b,1,2",), "none for a")]
)
def test_positions_that_are_no_positions_are_refused(tmp_path: Path, rows: tuple[str, ...], found: str) -> None:
    night = written(tmp_path, "8,153,9,216,a")
    with pytest.raises(MapError, match=found):
        read_fingerprints(night, written(tmp_path, *rows, header="name,x,y", name="places.csv"))


def test_a_line_over_a_wire_is_a_frame_or_nothing() -> None:
    columns = header_of(HEADER, where="wire")
    assert parse_frame("8,153,9,65535,", columns) == pytest.approx(np.array([[8, 153], [9, np.nan]]), nan_ok=True)
    for damaged in ("8,153,9", "8,1?3,9,216,", "", HEADER + ",x"):
        assert parse_frame(damaged, columns) is None


def test_the_authors_night_is_read(shared: Path) -> None:
    table = read_fingerprints(shared / "localization" / "night2.csv.gz")
    assert dict(table.sizes) == {"fingerprint": 3008, "sensor": 27, "band": 18, "axis": 3}
    assert len(set(table["label"].to_numpy().tolist())) == 43
    # The 610 nm channel of real sensors reads several times its neighbours: the order is right.
    ratio = table["counts"].sel(band=610) / table["counts"].sel(band=[585, 645]).mean("band")
    assert float(ratio.median()) > 2.0
