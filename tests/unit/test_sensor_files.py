"""Any sensor's channels go in: by name, by centre and width, or by curve."""

from pathlib import Path

import numpy as np
import pytest

from lidarspectra.errors import DatabaseError
from lidarspectra.spectra.sensor_files import find_bands
from lidarspectra.spectra.spectrum import Spectrum


def written(folder: Path, text: str) -> str:
    (folder / "my sensor.csv").write_text(text, encoding="utf-8")
    return "my sensor.csv"


def test_full_spectrum_has_a_channel_every_5_nm_without_gaps(tmp_path: Path) -> None:
    bands = find_bands("full-spectrum", tmp_path)
    assert len(bands) == 80
    np.testing.assert_allclose(np.diff(bands.centers_nm), 5.0)
    assert (bands.centers_nm[0], bands.centers_nm[-1]) == (382.5, 777.5)


def test_centres_and_widths_give_gaussians_in_ascending_order(tmp_path: Path) -> None:
    bands = find_bands(written(tmp_path, "# mine\ncenter_nm,fwhm_nm\n525,30\n450,25\n"), tmp_path)
    assert list(bands.centers_nm) == [450.0, 525.0]
    assert list(bands.widths_nm) == [25.0, 30.0]


def test_a_response_curve_weighs_as_it_is_drawn(tmp_path: Path) -> None:
    bands = find_bands(written(tmp_path, "wavelength_nm,triangle\n500,0\n520,1\n540,0\n"), tmp_path)
    line = Spectrum(wavelengths_nm=[400.0, 700.0], values=[1.0, 4.0])
    # A symmetric response reads a straight line at its centre; the 1 nm grid hits every corner.
    np.testing.assert_allclose(bands.band_values(line, outside="zero"), 1.0 + 0.01 * 120.0, rtol=1e-12)
    np.testing.assert_allclose(bands.centers_nm, 520.0)
    np.testing.assert_allclose(bands.widths_nm, 20.0)  # a triangle's half width at half height, twice


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("center_nm,fwhm_nm\n450,-3\n", "positive widths"),
        ("center_nm,fwhm_nm\n450\n", "2 cells"),
        ("center_nm,fwhm_nm\n450,wide\n", "row 2"),
        ("channel,peak\n1,2\n", "header"),
        ("wavelength_nm,a\n500,0\n520,0\n", "no response"),
        ("wavelength_nm,a\n520,1\n500,1\n", "out of order"),
        ("", "header"),
    ],
)
def test_malformed_files_are_refused_in_words(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(DatabaseError, match=words):
        find_bands(written(tmp_path, text), tmp_path)


def test_an_unknown_sensor_is_refused_with_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(DatabaseError, match="as7265x-14"):
        find_bands("as7262", tmp_path)
    with pytest.raises(DatabaseError, match=r"none\.csv"):
        find_bands("none.csv", tmp_path)
