"""The paper's databases are imported row by row, by ID, with their own ranges; malformed files are refused by place."""

import json
from pathlib import Path

import numpy as np
import pytest

from lidarspectra.errors import DatabaseError
from lidarspectra.spectra.databases import (
    import_lspdd,
    import_spectraldb,
    lamp_spectrum,
    list_databases,
    load_reflectances,
    show_spectrum,
    user_folder,
)

HEADER = "ID,Name,ObjectType,RadianceType,Specularity,Roughness,SCIMeasures,SCEMeasures\n"


@pytest.fixture(autouse=True)
def data(tmp_path, monkeypatch):
    folder = tmp_path / "user data"
    monkeypatch.setenv("LIDARSPECTRA_DATA", str(folder))
    return folder


def table(tmp_path: Path, *lines: str) -> Path:
    path = tmp_path / "spectraldb.csv"
    path.write_text(HEADER + "".join(line + "\n" for line in lines), encoding="utf-8")
    return path


def test_rows_are_keyed_by_id_in_fractions_with_their_own_ranges(tmp_path):
    path = table(
        tmp_path,
        '00001,Wall,Wall,Plastic,0.01,0.2,"{360: 8.5, 370: 10.0}","{360: 8.0, 370: 9.0}"',
        '00002,Wall,Door,Metal,0,0,"","{400: 50, 700: 60, 705: 70}"',
    )
    summary = import_spectraldb(path)
    assert summary.count == 2
    library = load_reflectances(["spectraldb"])
    first, second = library.find("00001"), library.find("spectraldb:00002")
    assert first.spectrum.values.tolist() == [0.085, 0.1]
    assert first.specularity == 0.01
    assert first.range_nm == (360, 370)
    assert second.range_nm == (400, 705)
    assert second.kind == "metal"
    assert "SCE" in second.note
    assert show_spectrum("00002").name == "Wall"


def test_a_row_above_what_a_surface_can_reflect_is_cut_kept_out_of_matching_and_said(tmp_path):
    summary = import_spectraldb(
        table(
            tmp_path,
            '7,Brightened door,Door,Plastic,0,0,"{400: 114.9, 410: 60}",',
            '8,W,D,Plastic,0,0,"{400: 5, 410: 6}",',
        )
    )
    surface = load_reflectances(["spectraldb"]).find("7")
    assert surface.spectrum.values.tolist() == [0.99, 0.6]
    assert not surface.matchable
    assert "114.9" in surface.note
    assert "7" in summary.notes[1]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('1,a,b,Plastic,0,0,"{400: 5, 410: x}",', "row 2, column SCIMeasures"),
        ('1,a,b,Plastic,0,0,"[400, 5]",', "row 2, column SCIMeasures"),
        ('1,a,b,Plastic,0,0,"{400: 5}",', "row 2, column SCIMeasures"),
        ('1,a,b,Plastic,0,0,"{400: -5, 410: 5}",', "row 2, column SCIMeasures"),
        ('1,a,b,Plastic,0,0,"{400: 5, 410: 5}"', "row 2"),
        ('1,a,b,Plastic,2,0,"{400: 5, 410: 5}",', "row 2, column Specularity"),
        (',a,b,Plastic,0,0,"{400: 5, 410: 5}",', "row 2, column ID"),
        ("1,a,b,Plastic,0,0,,", "row 2, column SCEMeasures"),
    ],
)
def test_a_malformed_row_is_refused_by_row_and_column_and_nothing_is_written(tmp_path, line, words):
    with pytest.raises(DatabaseError, match=words):
        import_spectraldb(table(tmp_path, line))
    assert not (user_folder() / "reflectance").exists()


def test_another_table_is_refused(tmp_path):
    path = tmp_path / "other.csv"
    path.write_text("a,b\n1,2\n", encoding="utf-8")
    with pytest.raises(DatabaseError, match="SCIMeasures"):
        import_spectraldb(path)


def lamp_file(folder: Path, number: int, lines: str = " 400.00,0.0\r\n 400.50,1.5\r\n") -> Path:
    path = folder / f"{number}.json"
    record = {"id": number, "brand": "Ours", "lamptype": "BR30", "category": "LED", "cct": 2700}
    path.write_text(
        json.dumps(record | {"spectraldata": "wavelength,relativeIntensity\n" + lines}), encoding="utf-8", newline=""
    )
    return path


def test_lamps_are_imported_by_id_and_added_to_those_before(tmp_path):
    import_lspdd([lamp_file(tmp_path, 2469)])
    assert import_lspdd([lamp_file(tmp_path, 2470)]).count == 2
    lamp = lamp_spectrum("lspdd:2469")
    assert lamp.spectrum.values.tolist() == [0.0, 1.5]
    assert lamp.category == "led"
    assert not lamp.absolute
    assert lamp_spectrum("LSPDD:2470").spectrum.range_nm == (400, 400.5)


@pytest.mark.parametrize("lines", ["400,1\n", "400,1\n399,2\n", "400,1\n401,x\n", "400,-1\n401,2\n", "400,0\n401,0\n"])
def test_a_malformed_lamp_is_refused_by_file(tmp_path, lines):
    with pytest.raises(DatabaseError, match=r"2469\.json"):
        import_lspdd([lamp_file(tmp_path, 2469, lines)])


@pytest.mark.parametrize("text", ["", "{", "[]", '{"id": 1}', '{"id": 1, "spectraldata": null}'])
def test_what_is_no_lamp_file_is_refused(tmp_path, text):
    path = tmp_path / "x.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DatabaseError, match=r"x\.json"):
        import_lspdd([path])


def test_the_manifest_keeps_every_import_with_the_hash_of_its_source(tmp_path):
    import_lspdd([lamp_file(tmp_path, 1)])
    import_spectraldb(table(tmp_path, '1,a,b,Plastic,0,0,"{400: 5, 410: 5}",'))
    import_spectraldb(table(tmp_path, '1,a "quoted" \\ name,b,Plastic,0,0,"{400: 6, 410: 5}",'))
    imported = {file.database: file for file in list_databases() if file.database != "builtin"}
    assert set(imported) == {"lspdd", "spectraldb"}
    assert len(imported["spectraldb"].source_sha256) == 64
    assert load_reflectances(["spectraldb"]).find("1").spectrum.values[0] == 0.06


def test_a_data_folder_that_cannot_be_written_is_our_error(tmp_path, monkeypatch):
    blocked = tmp_path / "file"
    blocked.write_text("", encoding="utf-8")
    monkeypatch.setenv("LIDARSPECTRA_DATA", str(blocked / "data"))
    with pytest.raises(DatabaseError, match="LIDARSPECTRA_DATA"):
        import_spectraldb(table(tmp_path, '1,a,b,Plastic,0,0,"{400: 5, 410: 5}",'))


def test_a_damaged_manifest_is_our_error(data):
    data.mkdir()
    (data / "MANIFEST.toml").write_text('[[file]]\npath = "x"\n', encoding="utf-8")
    with pytest.raises(DatabaseError, match="MANIFEST"):
        list_databases()


def test_the_real_spectraldb_has_its_five_grids_repeated_names_and_four_rows_too_bright(shared):
    import_spectraldb(shared / "reflectance" / "spectraldb.csv")
    rows = load_reflectances(["spectraldb"]).rows
    assert len(rows) == 1288
    assert len({row.name for row in rows}) < len(rows)
    assert len({row.range_nm for row in rows}) == 5
    assert sum(not row.matchable for row in rows) == 4
    assert sum(row.range_nm[1] >= 760 for row in rows) == 28
    assert sum(row.range_nm[1] <= 700 for row in rows) == 371
    assert np.all([row.spectrum.values.max() <= 0.99 for row in rows])


def test_the_real_lspdd_lamps_are_read(shared):
    files = sorted((shared / "lamps" / "lspdd").glob("*.json"))
    assert import_lspdd(files).count == len(files) == 8
    assert "BR30" in show_spectrum("lspdd:2469").spectrum.name


def test_fractions_are_no_percent(tmp_path: Path) -> None:
    with pytest.raises(DatabaseError, match=r"percent.*none above 0\.8.*Multiply fractions by 100"):
        import_spectraldb(table(tmp_path, '1,Wall,Wall,Plastic,0,0,"{400: 0.7, 700: 0.8}",'))


def own_table(tmp_path: Path, text: str) -> list[str]:
    (tmp_path / "own.csv").write_text(text, encoding="utf-8")
    return [str(tmp_path / "own.csv")]


@pytest.mark.parametrize("wavelengths", ["0.4,0.5,0.7", "4000,5000,7000"])
def test_a_table_of_wavelengths_in_another_unit_is_refused(tmp_path: Path, wavelengths: str) -> None:
    """Its surfaces would have the value of an end at all visible wavelengths."""
    names = own_table(tmp_path, f"id,name,category,{wavelengths}\nx,Wall,painted,0.4,0.5,0.6\n")
    with pytest.raises(DatabaseError, match=r"visible light.*micrometres by 1000"):
        load_reflectances(names)


def test_a_surface_measured_in_the_infrared_alone_is_matched_to_no_colour(tmp_path: Path) -> None:
    names = own_table(tmp_path, "id,name,category,400,700,900,1000\na,A,painted,.4,.5,,\nb,B,painted,,,.4,.5\n")
    assert [row.matchable for row in load_reflectances(names).rows] == [True, False]


def test_kinds_are_read_whatever_their_capitals_and_others_refused(tmp_path: Path) -> None:
    heading = "id,name,category,kind,matching,specularity,400,700\n"
    (metal,) = load_reflectances(own_table(tmp_path, heading + "a,A,metal,Metal,No,0.9,.6,.6\n")).rows
    assert metal.kind == "metal"
    assert not metal.matchable
    with pytest.raises(DatabaseError, match=r"id a, column kind.*plastic or metal.*'glas'"):
        load_reflectances(own_table(tmp_path, heading + "a,A,glass,glas,yes,0,.06,.06\n"))
    with pytest.raises(DatabaseError, match=r"column specularity.*0 to 1"):
        load_reflectances(own_table(tmp_path, heading + "a,A,painted,plastic,yes,5,.06,.06\n"))


@pytest.mark.parametrize(
    ("values", "todo"), [("40,50", "Divide percent"), ("-0.01,0.5", "noise below 0"), ("0.9,1.1", "Cut it at 0.99")]
)
def test_reflectances_that_cannot_be_are_refused_with_what_helps(tmp_path: Path, values: str, todo: str) -> None:
    with pytest.raises(DatabaseError, match=todo):
        load_reflectances(own_table(tmp_path, f"id,name,category,400,700\nx,Wall,painted,{values}\n"))
