"""The weather of a year: EPW files, what is wrong with them, and the synthetic year."""

from pathlib import Path

import numpy as np
import pytest

from lidarspectra.errors import LampError
from lidarspectra.radiance.scene.clear_sky import clear_light
from lidarspectra.radiance.scene.weather import read_epw, synthetic_year

HEAD = "LOCATION,Nowhere,-,XXX,made up,000000,48.00,11.00,1.0,500.0\n" + "".join(f"LINE {n}\n" for n in range(7))


def epw(path: Path, dni: float = 400.0, hours: int = 8760) -> Path:
    """A file whose radiation counts the hours of the day; `dni` at noon."""
    rows = []
    for hour in range(hours):
        month, day = divmod(hour // 24, 31)
        values = ["0"] * 29
        values[8], values[9] = ("0", "0")
        of_day = hour % 24
        fields = [1999, min(month + 1, 12), day + 1, of_day + 1, 0, "?", *["9"] * 29]
        fields[14] = dni if of_day == 12 else of_day  # direct normal radiation
        fields[15] = 2 * of_day  # diffuse horizontal radiation
        rows.append(",".join(map(str, fields)))
    path.write_text(HEAD + "\n".join(_dated(rows)) + "\n", encoding="ascii")
    return path


def _dated(rows: list[str]) -> list[str]:
    """With the dates of a year of 365 days."""
    days = np.arange("2023-01-01", "2024-01-01", dtype="datetime64[D]").astype(str)
    dated = []
    for number, row in enumerate(rows):
        _, month, day = days[number // 24].split("-")
        parts = row.split(",")
        parts[1:3] = [str(int(month)), str(int(day))]
        dated.append(",".join(parts))
    return dated


def test_an_epw_files_hours_stand_for_their_middles(tmp_path: Path) -> None:
    weather = read_epw(epw(tmp_path / "year.epw"))
    assert weather.name == "Nowhere"
    assert (weather.latitude_deg, weather.longitude_deg, weather.offset_h) == (48.0, 11.0, 1.0)
    assert len(weather.times) == 8760
    assert weather.times[0].strftime("%m-%d %H:%M") == "01-01 00:30"
    assert weather.times[-1].strftime("%m-%d %H:%M") == "12-31 23:30"
    assert weather.dni[12] == 400.0
    assert weather.dhi[36 + 3] == 2 * 15


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda path: epw(path, dni=9999.0), "1500"),  # EPW's word for a missing value
        (lambda path: epw(path, hours=100), "8760 hours"),
        (lambda path: (path.write_text("x,y\n1,2\n", encoding="ascii"), path)[1], "EPW"),
        (lambda path: path, "EPW"),
    ],
)
def test_a_file_that_is_no_whole_year_is_refused(tmp_path: Path, make, words: str) -> None:
    with pytest.raises(LampError, match=words):
        read_epw(make(tmp_path / "year.epw"))


def test_a_leap_year_is_read_without_its_29th_of_february(tmp_path: Path) -> None:
    path = epw(tmp_path / "year.epw")
    lines = path.read_text(encoding="ascii").splitlines()
    before = 8 + 59 * 24
    leap = [
        line.replace("1999,2,28,", "1999,2,29,").replace(",400.0,", ",777.0,") for line in lines[before - 24 : before]
    ]
    path.write_text("\n".join([*lines[:before], *leap, *lines[before:]]) + "\n", encoding="ascii")
    weather = read_epw(path)
    plain = read_epw(epw(tmp_path / "plain.epw"))
    assert weather.times.equals(plain.times)
    np.testing.assert_array_equal(weather.dni, plain.dni)
    assert weather.notes == ("The year's 29th of February is left out: metrics are of 365 days.",)
    assert plain.notes == ()


def test_a_place_whose_name_is_in_latin_1_is_read(tmp_path: Path) -> None:
    path = epw(tmp_path / "year.epw")
    path.write_bytes(path.read_bytes().replace(b"Nowhere", "S\xe3o Paulo".encode("latin-1")))
    assert read_epw(path).name == "S\xe3o Paulo"


def test_hours_from_utc_may_be_halves(tmp_path: Path) -> None:
    path = epw(tmp_path / "year.epw")
    path.write_text(path.read_text(encoding="ascii").replace(",1.0,500.0", ",5.5,500.0"), encoding="ascii")
    weather = read_epw(path)
    assert weather.offset_h == 5.5
    assert weather.times[12].strftime("%H:%M %z") == "12:30 +0530"


def test_the_synthetic_year_is_the_same_at_each_call_and_under_the_places_sun() -> None:
    one, other = synthetic_year(48.0, 11.0), synthetic_year(48.0, 11.0)
    assert np.array_equal(one.dni, other.dni)
    assert one.offset_h == 1.0
    clear = clear_light(one.times, 48.0, 11.0, aerosol_optical_depth=0.1, ground_reflectance=0.2)
    assert np.all(one.dni <= clear.dni + 1e-9)
    assert one.dni[clear.altitude_deg <= 0].max() == 0.0
    full = (one.dni > 0.99 * clear.dni) & (clear.altitude_deg > 20)
    none = (one.dni < 0.01 * clear.dni) & (clear.altitude_deg > 20)
    assert 0.2 < full.mean() / (clear.altitude_deg > 20).mean() < 0.6  # a third of the days is clear,
    assert 0.2 < none.mean() / (clear.altitude_deg > 20).mean() < 0.6  # another overcast
    summer, winter = (one.times.month == month for month in (6, 12))
    assert one.dhi[summer].sum() > 2.0 * one.dhi[winter].sum()
    south = synthetic_year(-35.0, 149.0)
    assert south.offset_h == 10.0
    assert south.dhi[winter].sum() > south.dhi[summer].sum()
