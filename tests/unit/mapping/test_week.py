"""A week of light by the hour, held against closed forms and colour-science."""

from pathlib import Path

import colour
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy import constants

from lidarspectra.errors import MapError
from lidarspectra.mapping.photometry.annual_metrics import SUMMER_TIME
from lidarspectra.mapping.photometry.point_light import LampShare, PointLight
from lidarspectra.mapping.photometry.week import (
    daylight_of_week,
    hourly_dims,
    read_week,
    week_figure,
    week_of_light,
    week_table,
)
from lidarspectra.spectra.spectrum import Spectrum

NM = np.arange(380.0, 781.0)
LAMPS = ("shelf", "office")


def spectrum_of(name: str) -> Spectrum:
    values = colour.SDS_ILLUMINANTS[name].copy().align(colour.SpectralShape(380, 780, 1)).values
    return Spectrum(wavelengths_nm=NM, values=np.asarray(values) / np.sum(values), name=name)


@pytest.fixture
def light() -> PointLight:
    """Two points: 40 and 20 W/m² of D65 by the shelf's lamp, 2 and 3 W/m² of FL2 by the office's."""
    centers = np.array([400.0, 500.0, 600.0, 700.0])
    levels = (np.array([40.0, 20.0]), np.array([2.0, 3.0]))
    shares = tuple(
        LampShare(flux=spectrum_of(name), coefficient=np.repeat(level[:, None], 4, axis=1))
        for name, level in zip(("D65", "FL2"), levels, strict=True)
    )
    return PointLight(centers_nm=centers, irradiance=np.ones((2, 4)), irradiance_se=np.zeros((2, 4)), lamps=shares)


def schedule(folder: Path, text: str) -> Path:
    path = folder / "week.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_doses_are_those_of_an_independent_library(light: PointLight, tmp_path: Path) -> None:
    path = schedule(tmp_path, "days,lamp,from,to,dim\nmon-fri,shelf,6,22,0.5\nsat+sun,office,9:30,12,1\n")
    week = week_of_light(light, LAMPS, read_week(path))
    d65, fl2 = spectrum_of("D65").values, spectrum_of("FL2").values
    # illuminance by colour-science, its own V(λ)
    lit = colour.SpectralDistribution(40.0 * 0.5 * d65, NM)
    assert week["illuminance_lx"].to_numpy()[10, 0] == pytest.approx(colour.luminous_flux(lit), rel=2e-3)
    # photons by the constants: 16 h at half of 40 W/m²
    photons = np.trapezoid((d65 * NM)[20:321], NM[20:321]) * 1e-9 / (constants.h * constants.c * constants.N_A)
    assert week["dli_mol_m2"].to_numpy()[0, 0] == pytest.approx(20.0 * photons * 16 * 3600, rel=2e-3)
    # α-opic EDI of D65 is its illuminance; 16 h of it
    dose = colour.luminous_flux(lit) * 16.0
    assert week["melanopic_dose_lx_h"].to_numpy()[2, 0] == pytest.approx(dose, rel=5e-3)
    # on Saturday the other lamp for two and a half hours, half of the first
    office = colour.luminous_flux(colour.SpectralDistribution(3.0 * fl2, NM))
    saturday = week["illuminance_lx"].to_numpy()[5 * 24 : 6 * 24, 1]
    assert saturday[9] == pytest.approx(0.5 * office, rel=2e-3)
    assert saturday.sum() == pytest.approx(2.5 * office, rel=2e-3)


def test_a_shift_over_midnight_and_over_the_end_of_the_week(tmp_path: Path) -> None:
    dims = hourly_dims(read_week(schedule(tmp_path, "lamp,from,to,days\n*,22,2,sun\n")), LAMPS)
    lit = np.flatnonzero(dims[0])
    assert lit.tolist() == [0, 1, 166, 167]
    capitals = hourly_dims(read_week(schedule(tmp_path, "Lamp,From,To,Days\n*,22,2,Sun\n")), LAMPS)
    assert np.flatnonzero(capitals[0]).tolist() == lit.tolist()
    german = "lamp;from;to;days\n\n*;21,5;2;sun\n;;;\n"  # of a spreadsheet, with the empty row that it leaves
    assert hourly_dims(read_week(schedule(tmp_path, german)), LAMPS)[0, -3:].tolist() == [0.5, 1.0, 1.0]
    both = hourly_dims(read_week(schedule(tmp_path, "lamp,from,to,dim\n*,8,9,.3\nshelf,8,9,.5\n")), LAMPS)
    assert both[:, 8] == pytest.approx([0.8, 0.3])
    assert both[:, 8 + 24 * 6] == pytest.approx([0.8, 0.3])  # without days: every day
    for text, says in (("*,8,9,1\nshelf,8,9,.4", "'shelf' by 1.4"), ("shelf,8,9,50", "from 0 to 1")):
        with pytest.raises(MapError, match=says):
            hourly_dims(read_week(schedule(tmp_path, f"lamp,from,to,dim\n{text}\n")), LAMPS)
    with pytest.raises(MapError, match="mon-fri"):
        read_week(schedule(tmp_path, "lamp,from,to,days\n*,8,9,friday\n"))
    with pytest.raises(MapError, match="'attic'"):
        hourly_dims(read_week(schedule(tmp_path, "lamp,from,to\nattic,8,9\n")), LAMPS)


def test_the_week_is_told_and_drawn(light: PointLight, tmp_path: Path) -> None:
    path = schedule(tmp_path, "lamp,from,to\nshelf,6,22\n")
    week = week_of_light(light, LAMPS, read_week(path))
    table = week_table(week, np.array([0, 1]))
    assert table.frame["DLI [mol/m²], highest"].iloc[0] == pytest.approx(
        2.0 * table.frame["DLI [mol/m²], lowest"].iloc[0]
    )
    figure = week_figure(week, np.array([0, 1]))
    assert any("mol/m²" in text.get_text() for axes in figure.axes for text in axes.texts)
    with pytest.raises(MapError, match="each lamp"):
        week_of_light(PointLight(centers_nm=light.centers_nm, irradiance=light.irradiance,
                                 irradiance_se=light.irradiance_se), LAMPS, read_week(path))  # fmt: skip


def year_of_daylight(days: int = 365) -> xr.Dataset:
    """A year in which point 0 has 100 lx, 80 lx of EDI and 2 µmol times the day of the year, from 8 to 16 h."""
    hours = pd.date_range("2023-01-01", periods=24 * days, freq="h") + pd.Timedelta(minutes=30)
    lit = hours[(hours.hour >= 8) & (hours.hour < 16)]
    level = np.asarray(lit.day_of_year, dtype=np.float64)[:, None] * np.array([[1.0, 0.5]])
    values = {"illuminance": 100.0 * level, "melanopic_edi": 80.0 * level, "ppfd": 2.0 * level}
    return xr.Dataset({name: (("hour", "point"), each) for name, each in values.items()}, {"time": ("hour", lit)})


def test_daylight_adds_its_own_hours(light: PointLight, tmp_path: Path) -> None:
    week = read_week(schedule(tmp_path, "lamp,from,to\nshelf,6,22\n"))
    by_lamps = week_of_light(light, LAMPS, week)
    both = week_of_light(light, LAMPS, week, daylight_of_week(year_of_daylight(), "03-01"))
    gained = both["dli_mol_m2"].to_numpy() - by_lamps["dli_mol_m2"].to_numpy()
    day = 60.0 + np.arange(7.0)  # of the year: March 1st is the 60th
    assert gained[:, 0] == pytest.approx(2.0 * day * 8 * 3600 / 1e6)
    assert gained[:, 1] == pytest.approx(0.5 * gained[:, 0])
    assert both["daylight_melanopic_dose_lx_h"].to_numpy()[:, 0] == pytest.approx(80.0 * day * 8)
    lux = both["daylight_illuminance_lx"].to_numpy()[:24, 0]
    assert np.flatnonzero(lux).tolist() == list(range(8, 16))
    table = week_table(both, np.array([0, 1]))
    assert 0.0 < table.frame["DLI [mol/m²], by daylight [%]"].iloc[0] < 100.0
    assert "daylight" in table.caption
    assert any(axes.get_legend() is not None for axes in week_figure(both, np.array([0, 1])).axes)


def test_a_room_of_windows_alone_has_a_week_of_daylight(light: PointLight, tmp_path: Path) -> None:
    by_sky = PointLight(
        centers_nm=light.centers_nm, irradiance=light.irradiance, irradiance_se=light.irradiance_se, lamps=()
    )
    week = read_week(schedule(tmp_path, "lamp,from,to\n*,6,22\n"))
    found = week_of_light(by_sky, (), week, daylight_of_week(year_of_daylight(), "03-01"))
    assert found["melanopic_dose_lx_h"].to_numpy()[0, 0] == pytest.approx(80.0 * 60 * 8)
    np.testing.assert_array_equal(found["dli_mol_m2"], found["daylight_dli_mol_m2"])
    with pytest.raises(MapError, match="none is lit"):
        week_of_light(by_sky, (), read_week(schedule(tmp_path, "lamp,from,to\nshelf,6,22\n")))


def test_by_a_clock_of_summer_time_daylight_is_an_hour_later() -> None:
    year = year_of_daylight().assign_attrs({SUMMER_TIME: "03-03 10-27"})
    lit = daylight_of_week(year, "03-01")["illuminance_lx"][:, 0].reshape(7, 24) > 0
    assert [np.flatnonzero(day).tolist() for day in lit] == [list(range(8, 16))] * 2 + [list(range(9, 17))] * 5


def test_a_week_over_new_year_goes_on_with_january() -> None:
    found = daylight_of_week(year_of_daylight(), "12-30")["illuminance_lx"][:, 0].reshape(7, 24).max(axis=1)
    assert found == pytest.approx([36400.0, 36500.0, 100.0, 200.0, 300.0, 400.0, 500.0])
    for wrong in ("13-01", "monday", "2023-03-01"):
        with pytest.raises(MapError, match="06-17"):
            daylight_of_week(year_of_daylight(), wrong)
