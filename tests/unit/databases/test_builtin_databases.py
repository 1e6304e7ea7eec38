"""The built-in databases are what their manifest says, and hold what the paper and the engine need."""

import runpy
import subprocess
import sys

import numpy as np
import pytest

from lidarspectra.errors import DatabaseError
from lidarspectra.io.files import hash_file
from lidarspectra.material.material_map import MAX_REFLECTANCE
from lidarspectra.spectra.database_files import table
from lidarspectra.spectra.databases import (
    data_folder,
    lamp_spectrum,
    list_databases,
    list_lamps,
    load_reflectances,
    scenes_folder,
    show_spectrum,
)
from lidarspectra.spectra.spectrum import AS7265X_CENTERS_NM
from lidarspectra.spectra.spectrum_files import read_table


@pytest.fixture(autouse=True)
def _no_imports(tmp_path, monkeypatch):
    monkeypatch.setenv("LIDARSPECTRA_DATA", str(tmp_path))


def test_every_file_is_in_the_manifest_with_its_hash_count_source_and_licence():
    files = list_databases()
    on_disk = set(data_folder().rglob("*.csv"))
    assert {file.path for file in files} == on_disk
    for file in files:
        assert file.sha256 == hash_file(file.path), file.path
        assert file.source
        assert file.licence
        assert file.provenance
        lines = file.path.read_text(encoding="utf-8").splitlines()
        assert file.count == len(lines) - 1


@pytest.mark.slow  # colour-science's tables are read and every file written: some seconds
def test_building_them_again_gives_the_same_spectra(tmp_path, project):
    folder = tmp_path / "built"
    folder.mkdir()
    main = runpy.run_path(str(project / "databases" / "build.py"))["main"]
    main.__globals__["HERE"] = folder
    main()
    for file in list_databases():
        if file.kind == "sensors":
            continue
        for again, row in zip(read_table(folder / file.path.relative_to(data_folder())), table(file.path), strict=True):
            assert (again.id, again.name, again.category) == (row.id, row.name, row.category)
            assert again.properties == row.properties
            # six digits are written; another machine's exponential may round the last one differently
            assert np.allclose(again.spectrum.values, row.spectrum.values, rtol=1e-5, atol=1e-12)


def test_lamps_of_every_kind_have_light_and_a_provenance():
    lamps = list_lamps()
    assert {"LED-B3", "FL11", "FL2", "A", "D65", "HP1"} <= {lamp.name for lamp in lamps}
    assert {lamp.category for lamp in lamps} >= {"led", "fluorescent", "incandescent", "discharge", "daylight"}
    for lamp in lamps:
        assert lamp.spectrum.values.min() >= 0, lamp.name
        assert lamp.spectrum.values.max() > 0, lamp.name
        assert lamp.provenance in ("measured", "modelled"), lamp.name
        assert not lamp.absolute, lamp.name
        # the paper's 14 channels end at 760 nm
        assert lamp.spectrum.range_nm[0] <= 380, lamp.name
        assert lamp.spectrum.range_nm[1] >= 780, lamp.name


def test_illuminant_a_is_planck_at_its_temperature():
    spectrum = lamp_spectrum("A").spectrum
    # CIE 15:2018: 100 at 560 nm; Planck at 2855.5 K (c2 = 14388 µm K), so 1e-3 for the constants' rounding
    grid = np.array([400.0, 560.0, 700.0, 940.0])
    planck = grid**-5 / np.expm1(1.4387769e7 / (2855.5 * grid))
    assert np.allclose(spectrum.at(grid, outside="zero"), 100 * planck / planck[1], rtol=1e-3)


def test_lamp_names_do_not_mind_capitals_and_a_wrong_one_names_near_ones():
    assert lamp_spectrum("led-b3").name == "LED-B3"
    with pytest.raises(DatabaseError, match="Did you mean LED-B3"):
        lamp_spectrum("LEDB3")


def test_a_file_is_found_beside_the_run_file(tmp_path):
    (tmp_path / "my lamp.csv").write_text("nm,W/nm\n400,1\n700,2\n", encoding="utf-8")
    lamp = lamp_spectrum("my lamp.csv", tmp_path)
    assert lamp.absolute
    assert lamp.unit == "W/nm"
    assert lamp.provenance == "assigned"


def test_the_library_has_the_papers_five_default_materials_and_never_matches_them():
    library = load_reflectances()
    for name in ("white-plastic", "white-wall", "wooden-cabinet", "fully-reflective", "non-reflective"):
        surface = library.find(name)
        assert surface.provenance == "modelled"
        assert not surface.matchable
    assert library.find("fully-reflective").spectrum.values.max() == MAX_REFLECTANCE
    assert library.find("non-reflective").spectrum.values.max() == 0


def test_every_surface_is_a_fraction_and_says_what_was_measured():
    library = load_reflectances()
    assert library.matchable.sum() > 300
    for surface in library.rows:
        assert 0 <= surface.spectrum.values.min() <= surface.spectrum.values.max() <= MAX_REFLECTANCE
        assert surface.provenance in ("measured", "modelled")
        assert surface.range_nm[0] <= 400
        assert surface.range_nm[1] >= 700


def test_the_orange_patch_is_orange():
    library = load_reflectances()
    red, green, blue = library.linear_srgb[library.rows.index(library.find("builtin:cc-orange"))]
    assert red > 2 * green > 4 * blue


def test_an_unknown_database_or_surface_is_our_error():
    with pytest.raises(DatabaseError, match="nowhere"):
        load_reflectances(["nowhere"])
    with pytest.raises(DatabaseError, match="white-wall"):
        load_reflectances().find("white-wal")


def test_show_finds_lamps_and_surfaces():
    assert show_spectrum("FL11").name == "FL11"
    assert show_spectrum("white-wall").name == "White wall paint"
    with pytest.raises(DatabaseError):
        show_spectrum("no such thing")


def test_a_table_of_the_users_is_a_database(tmp_path):
    (tmp_path / "mine.csv").write_text("id,name,category,400,700\nx,My wall,painted,0.5,0.6\n", encoding="utf-8")
    library = load_reflectances(["mine.csv"], tmp_path)
    assert library.find("mine:x").range_nm == (400, 700)


def test_percent_in_a_users_table_is_refused(tmp_path):
    (tmp_path / "mine.csv").write_text("id,name,category,400,700\nx,My wall,painted,50,60\n", encoding="utf-8")
    with pytest.raises(DatabaseError, match="percent"):
        load_reflectances(["mine.csv"], tmp_path)


def test_the_sensors_channels_are_the_codes_own(project):
    table = np.genfromtxt(data_folder() / "sensors" / "as7265x.csv", delimiter=",", dtype=str, skip_header=1)
    assert table[:, 1].astype(float).tolist() == list(AS7265X_CENTERS_NM)
    assert "".join(table[:, 0]) == "ABCDEFGHRISJTUVWKL"


def test_folders_are_those_of_the_checkout(project):
    assert data_folder() == project / "databases"
    assert scenes_folder() == project / "scenes"


def test_reading_databases_does_not_load_heavy_libraries():
    heavy = "colour", "sklearn", "pandas", "matplotlib", "trimesh", "cv2"
    code = "import sys, lidarspectra.spectra.databases as d; d.load_reflectances().lab; d.list_lamps(); "
    code += "print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not set(heavy) & set(loaded)
