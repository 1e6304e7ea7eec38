"""Users' spectrum files are understood as people write them, or refused with the line named."""

from pathlib import Path

import colour
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarspectra.errors import DatabaseError
from lidarspectra.spectra.databases import lamp_spectrum
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.spectra.spectrum_files import TableRow, read_spectrum_file, read_table, write_table


def written(folder: Path, text: str | bytes, name: str = "lamp.csv") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8"))
    return path


@pytest.mark.parametrize(
    "text",
    [
        "wavelength_nm,value\n400,1\n410,2.5\n",
        "400,1\n410,2.5\n",
        "# my lamp\nwavelength_nm;value\r\n400;1,0\r\n410;2,5\r\n",
        "400\t1\n410\t2.5\n",
        "  400   1.0\n  410   2.5\n\n",
        "400 1,0\n410 2,5\n",
        "\ufeffWavelength (nm), Relative power\n400, 1\n410, 2.5e0\n",
        "value,wavelength\n1,400\n2.5,410\n",
        '"wavelength","power"\n"400","1"\n"410","2.5"\n',
        "nr,wavelength_nm,value\n1,400,1\n2,410,2.5\n",
        "nr;nm;value;deviation\n1;400;1,0;0,1\n2;410;2,5;0,1\n",
        "wavelength,value\n400,1,\n410,2.5,\n",
    ],
)
def test_two_columns_are_read_whatever_the_delimiter_and_header(tmp_path, text):
    found = read_spectrum_file(written(tmp_path, text))
    assert found.spectrum.wavelengths_nm.tolist() == [400, 410]
    assert found.spectrum.values.tolist() == [1, 2.5]
    assert not found.absolute


@pytest.mark.parametrize(
    ("heading", "scale"),
    [("flux [W/nm]", 1.0), ("W nm-1", 1.0), ("mW/nm", 1e-3), ("spectral flux (µW/nm)", 1e-6), ("W·nm⁻¹", 1.0)],
)
def test_a_heading_in_watts_per_nanometre_makes_it_absolute(tmp_path, heading, scale):
    found = read_spectrum_file(written(tmp_path, f"nm,{heading}\n400,1\n410,2\n"))
    assert found.absolute
    assert found.unit == "W/nm"
    assert np.allclose(found.spectrum.values, [scale, 2 * scale])


@pytest.mark.parametrize(
    "heading",
    ["irradiance W/m²/nm", "W/m2/nm", "W/sr/nm", "value", "lm/nm", "new value", "W/nm/m²", "W nm^-1 m^-2", "mW/nm/sr",
     "spectral irradiance (W/nm)"],
)  # fmt: skip
def test_other_units_are_not_taken_for_flux(tmp_path, heading):
    assert not read_spectrum_file(written(tmp_path, f"wavelength,{heading}\n400,1\n410,2\n")).absolute


@pytest.mark.parametrize("heading", ["µmol/s/nm", "photon flux", "photons / s nm", "PPFD per nm"])
def test_values_that_count_photons_are_made_power(tmp_path, heading):
    found = read_spectrum_file(written(tmp_path, f"wavelength,{heading}\n400,2\n800,2\n"))
    first, last = found.spectrum.values
    assert first / last == pytest.approx(2.0)
    assert "photons" in found.notes[0]


@pytest.mark.parametrize("heading", ["incident photon to current efficiency", "spectrum", "flux [W/nm]"])
def test_other_values_are_as_they_are(tmp_path, heading):
    found = read_spectrum_file(written(tmp_path, f"wavelength,{heading}\n400,2\n800,2\n"))
    assert found.spectrum.values.tolist() == [2, 2]


def test_a_heading_in_one_cell_does_not_make_wavelengths_of_the_values(tmp_path):
    """They were a ramp from 400 to 700, in silence."""
    found = read_spectrum_file(written(tmp_path, "wavelength intensity\n400,3\n550,1\n700,2\n"))
    assert found.spectrum.values.tolist() == [3, 1, 2]


@pytest.mark.parametrize(("quantity", "absolute"), [("flux", True), ("relative", False), ("irradiance", False)])
def test_the_xml_of_tm_27_is_read_as_another_library_writes_it(tmp_path, quantity, absolute):
    header = colour.io.Header_IESTM2714(description="lamp")
    lamp = colour.SpectralDistribution_IESTM2714(str(tmp_path / "lamp.spdx"), header, spectral_quantity=quantity)
    lamp.wavelengths, lamp.values = [400.0, 555.5, 700.0], [0.5, 1.0, 0.25]
    assert lamp.write()
    found = lamp_spectrum("lamp.spdx", tmp_path)
    assert found.spectrum.wavelengths_nm.tolist() == [400, 555.5, 700]
    assert found.spectrum.values.tolist() == [0.5, 1, 0.25]
    assert found.absolute == absolute


@pytest.mark.parametrize(
    "text", ["<html></html>", "<IESTM2714><SpectralData", "<a><SpectralQuantity/><SpectralQuantity/></a>",
             '<a><SpectralData wavelength="x">1</SpectralData></a>', '<a><SpectralData wavelength="400"/></a>']
)  # fmt: skip
def test_other_xml_is_refused(tmp_path, text):
    with pytest.raises(DatabaseError, match=r"TM-27|a number|wavelengths"):
        lamp_spectrum(str(written(tmp_path, text).rename(tmp_path / "lamp.spdx")))


def test_of_several_columns_the_one_that_was_taken_is_said(tmp_path):
    (note,) = read_spectrum_file(written(tmp_path, "nm,Lamp A,Lamp B\n400,1,2\n500,3,4\n")).notes
    assert "'Lamp A' was taken, not 'Lamp B'" in note
    for text in ("nm,Lamp A,remark\n400,1,x\n500,3,4\n", "index,nm,Lamp A\n1,400,1\n2,500,3\n"):
        assert not read_spectrum_file(written(tmp_path, text)).notes


def test_lines_out_of_order_are_sorted_and_said(tmp_path):
    found = read_spectrum_file(written(tmp_path, "410,2\n400,1\n"))
    assert found.spectrum.values.tolist() == [1, 2]
    assert "sorted" in found.notes[0]


def test_noise_just_below_zero_is_set_to_zero_and_said(tmp_path):
    found = read_spectrum_file(written(tmp_path, "400,-0.001\n410,2\n"))
    assert found.spectrum.values.tolist() == [0, 2]
    assert "below zero" in found.notes[0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "two or more lines"),
        ("wavelength,value\n400,1\n", "two or more lines"),
        ("400,1\n410,abc\n", "line 2"),
        ("400,1\n410,nan\n", "line 2"),
        ("400,1\n410\n", "line 2"),
        ("400,1\n400,2\n", "line 2"),
        ("400,-1\n410,2\n", "line 1"),
        ("400,0\n410,0\n", "somewhere positive"),
        ("0.4,1\n0.41,2\n", "nm"),
        ("wavelength [Å],value\n4000,1\n4100,2\n", "ångström"),
        ("Wavelength (A),value\n4000,1\n4100,2\n", "ångström"),
        ("wavelength_um;value\n400;1\n410;2\n", "micrometres"),
        ("wavenumber [cm-1],value\n10000,1\n12000,2\n", "wavenumber"),
        ("wavelength_nm,reflectance\n400,0,05\n410,0,06\n", "line 2.*decimal"),
        ("400,0,05\n410,0,06\n", "line 1.*decimal"),
        (b"\xff\xfe\x00400", "UTF-8"),
    ],
)
def test_what_is_no_spectrum_is_refused_with_its_place(tmp_path, text, words):
    with pytest.raises(DatabaseError, match=words):
        read_spectrum_file(written(tmp_path, text))


def test_zero_everywhere_is_a_black_surface_but_no_light(tmp_path):
    path = written(tmp_path, "400,0\n410,0\n")
    assert read_spectrum_file(path, black_allowed=True).spectrum.values.tolist() == [0, 0]
    with pytest.raises(DatabaseError, match="nowhere negative"):
        read_spectrum_file(written(tmp_path, "400,0\n410,-1\n"), black_allowed=True)


def test_a_missing_file_is_our_error(tmp_path):
    with pytest.raises(DatabaseError, match="nothing-here"):
        read_spectrum_file(tmp_path / "nothing-here.csv")


@given(st.binary(max_size=200))
def test_any_bytes_give_a_spectrum_or_our_error(tmp_path_factory, data):
    path = written(tmp_path_factory.mktemp("bytes"), data)
    for reader in (read_spectrum_file, read_table):
        try:
            reader(path)
        except DatabaseError:
            continue


def row(identifier: str, wavelengths: list[float], values: list[float], **properties: str) -> TableRow:
    spectrum = Spectrum(wavelengths_nm=np.array(wavelengths), values=np.array(values))
    return TableRow(id=identifier, name=f"name of {identifier}", category="c", spectrum=spectrum, properties=properties)


def test_a_table_keeps_rows_of_different_grids_apart(tmp_path):
    rows = [
        row("a", [400, 410, 420], [0.1, 0.2, 0.3], note='with "quotes", commas\nand a new line'),
        row("b", [405, 410], [0.25, 1 / 3]),
    ]
    write_table(tmp_path / "t.csv", rows)
    found = read_table(tmp_path / "t.csv")
    assert [r.id for r in found] == ["a", "b"]
    assert found[0].properties == {"note": 'with "quotes", commas\nand a new line'}
    assert found[1].spectrum.range_nm == (405, 410)
    # six digits are written
    assert np.allclose(found[1].spectrum.values, [0.25, 1 / 3], rtol=5e-6)


def test_a_table_of_grids_that_hardly_differ_can_be_read_again(tmp_path):
    """Wavelengths of two files that round alike made two columns of one name: no run with both got beyond it."""
    rows = [row("a", [380, 380.3, 390], [0.1, 0.2, 0.3]), row("b", [380.0001, 380.1 + 0.2, 390], [0.4, 0.5, 0.6])]
    write_table(tmp_path / "t.csv", rows)
    first, second = read_table(tmp_path / "t.csv")
    assert first.spectrum.values.tolist() == [0.1, 0.2, 0.3]
    assert second.spectrum.wavelengths_nm.tolist() == [380.0001, 380.3, 390]
    assert second.spectrum.values.tolist() == [0.4, 0.5, 0.6]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "header"),
        ("name,id,category,400,410\n", "header"),
        ("id,name,category,400\n", "two or more wavelength"),
        ("id,name,category,410,400\n", "ascending"),
        ("id,name,category,400,410\na,a,c,0.1\n", "row 2"),
        ("id,name,category,400,410\na,a,c,0.1,x\n", "row 2, column 410"),
        ('id,name,category,400,410\na,a,c,0.1,"0,2"\n', "row 2, column 410"),
        ("id,name,category,400,410\na,a,c,0.1,2e30\n", "row 2, column 410"),
        ("id,name,category,400,410\na,a,c,0.1,\n", "row 2"),
        ("id,name,category,400,410\na,a,c,0.1,0.2\na,b,c,0.1,0.2\n", "row 3"),
    ],
)
def test_what_is_no_table_is_refused_with_row_and_column(tmp_path, text, words):
    with pytest.raises(DatabaseError, match=words):
        read_table(written(tmp_path, text))
