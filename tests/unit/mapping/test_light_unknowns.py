"""The uncertainty of a map: lamps, reflectances, openings, what the scan lacks, and the simulation."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from lidarspectra.errors import MapError
from lidarspectra.lamps.lamp_spectra import beyond_ends
from lidarspectra.mapping.maps.assumptions import Assumptions
from lidarspectra.mapping.maps.light_unknowns import (
    ALL_CAUSES,
    CAUSES,
    OF_CAUSE,
    UNKNOWNS_FILE,
    LightUnknowns,
    error_bars,
    load_unknowns,
    save_unknowns,
    uncertainty_in_words,
)
from lidarspectra.mapping.maps.map_files import load_map, map_table, read_map_table, save_map, save_map_table
from lidarspectra.mapping.maps.spectral_map import LampChange, relight, spectral_map
from lidarspectra.spectra.spectrum import Spectrum, sensor_bands
from lidarspectra.workflow.scenarios import relighting
from lidarspectra.workflow.scenarios.relighting import LampOrder

LAMPS, PARTS, POINTS, BANDS = 2, 4, 176, 14


def unknowns(covariance: np.ndarray, *, slope: float = 0.3, local_sd: float = 0.0) -> LightUnknowns:
    return LightUnknowns(
        covariance=covariance,
        slope=np.full((PARTS, POINTS, BANDS), slope),
        spread=np.ones((PARTS, BANDS)),
        local_sd=local_sd,
    )


def known_but(**of: float) -> np.ndarray:
    """Variances by number of the unknown, all others exact."""
    variance = np.zeros(LAMPS + PARTS)
    for name, deviation in of.items():
        variance[int(name.removeprefix("u"))] = deviation**2
    return np.diag(variance)


@pytest.fixture
def exact(make_transport):
    """A transport without noise."""
    transport = make_transport()
    return transport.assign(coefficient_se=transport["coefficient_se"] * 0)


def test_an_unknown_flux_is_that_lamp_s_share_of_the_light(exact):
    found = spectral_map(exact, unknowns=unknowns(known_but(u1=0.2)))
    of_lamp = (exact["coefficient"] * exact["flux"]).isel(lamp=1).transpose("point", "band").to_numpy()
    np.testing.assert_allclose(found["irradiance_sd"], 0.2 * of_lamp, rtol=1e-9)


def test_fluxes_that_err_by_themselves_add_as_squares_and_those_that_err_alike_add_up(exact):
    light = spectral_map(exact)["irradiance"].to_numpy()
    each = 0.1 * (exact["coefficient"] * exact["flux"]).transpose("lamp", "point", "band").to_numpy()
    apart = spectral_map(exact, unknowns=unknowns(known_but(u0=0.1, u1=0.1)))["irradiance_sd"]
    np.testing.assert_allclose(apart, np.sqrt((each**2).sum(axis=0)), rtol=1e-9)
    alike = known_but(u0=0.1, u1=0.1)
    alike[0, 1] = alike[1, 0] = 0.01
    np.testing.assert_allclose(spectral_map(exact, unknowns=unknowns(alike))["irradiance_sd"], 0.1 * light, rtol=1e-9)


def test_an_unknown_reflectance_counts_by_its_slope_and_its_spread_in_the_band(exact):
    wide = np.ones((PARTS, BANDS))
    wide[2, 5] = 3.0
    found = spectral_map(exact, unknowns=replace(unknowns(known_but(u4=0.1)), spread=wide))  # u4 is part 2
    relative = (found["irradiance_sd"] / found["irradiance"]).to_numpy()
    np.testing.assert_allclose(np.delete(relative, 5, axis=1), 0.03, rtol=1e-9)
    np.testing.assert_allclose(relative[:, 5], 0.09, rtol=1e-9)


def test_what_readings_told_of_a_product_cancels(exact):
    """After a calibration, a brighter lamp and a darker wall may be as likely: the light is known, neither is."""
    covariance = known_but(u0=0.1, u1=0.1, u2=0.1)
    covariance[np.ix_([0, 1], [0, 1])] = 0.01
    covariance[2, :2] = covariance[:2, 2] = -0.01
    found = spectral_map(exact, unknowns=unknowns(covariance, slope=1.0))
    np.testing.assert_allclose(found["irradiance_sd"], 0.0, atol=1e-6 * float(found["irradiance"].max()))
    assert found.attrs[f"{OF_CAUSE}lamps"] == pytest.approx(found.attrs[f"{OF_CAUSE}reflectances"])


def test_dark_places_are_known_less_well_for_what_the_scan_lacks(exact):
    found = spectral_map(exact, unknowns=unknowns(known_but(), local_sd=0.03))
    light, deviation = (found[name].to_numpy()[:, 3] for name in ("irradiance", "irradiance_sd"))
    bright = light >= light.mean()
    np.testing.assert_allclose(deviation[bright] / light[bright], 0.03, rtol=1e-9)
    assert (deviation[~bright] / light[~bright] > 0.03).all()


def test_where_light_is_usual_is_told_by_the_points_that_are_not_buried(make_transport):
    """Sensors within furniture see nothing: were they counted, a dark corner would seem to be in usual light."""
    transport = make_transport()
    transport = transport.assign(coefficient_se=transport["coefficient_se"] * 0)
    points = transport.sizes["point"]
    buried = np.arange(points) >= points // 2
    shaded = xr.where(xr.DataArray(buried, dims="point"), 1e-6, 1.0)
    dark = transport.assign(coefficient=transport["coefficient"] * shaded, buried=("point", buried))
    state = unknowns(known_but(), local_sd=0.03)
    relative = {}
    for name, each in (("furnished", dark), ("bare", dark.isel(point=~buried))):
        state_of = replace(state, slope=state.slope[:, : each.sizes["point"]])
        found = spectral_map(each, unknowns=state_of)
        relative[name] = (found["irradiance_sd"] / found["irradiance"]).to_numpy()
    np.testing.assert_allclose(relative["furnished"][~buried], relative["bare"], rtol=1e-9)


@pytest.mark.parametrize("shape", [(LAMPS + PARTS, LAMPS + PARTS + 1), (PARTS - 1, PARTS - 1)])
def test_a_covariance_that_is_not_of_the_lamps_and_parts_is_refused(shape):
    with pytest.raises(MapError, match=f"a square covariance of the lamps and {PARTS} parts"):
        unknowns(np.zeros(shape))


def test_openings_and_the_simulation_count_too(make_transport):
    transport = make_transport()
    none = unknowns(known_but())
    found = spectral_map(transport, unknowns=none)
    np.testing.assert_allclose(found["irradiance_sd"], found["irradiance_se"], rtol=1e-9)
    opened = transport.assign(opening_coefficient=0.5 * transport["coefficient"])
    wider = spectral_map(opened, unknowns=none)
    expected = np.hypot(found["irradiance_se"], 0.5 / np.sqrt(3) * found["irradiance"])
    np.testing.assert_allclose(wider["irradiance_sd"], expected, rtol=1e-9)


def test_spectra_that_are_guesses_err_alike_in_each_channel_and_not_in_lux(exact):
    guesses = np.zeros((LAMPS, BANDS))
    guesses[0, 3], guesses[1, 3], guesses[1, 9] = 0.5, 0.4, 0.8
    state = replace(unknowns(known_but()), spectrum_sd=guesses)
    found = spectral_map(exact, unknowns=state)
    first, second = (exact["coefficient"] * exact["flux"]).transpose("lamp", "point", "band").to_numpy()
    deviation = found["irradiance_sd"].to_numpy()
    np.testing.assert_allclose(deviation[:, 3], 0.5 * first[:, 3] + 0.4 * second[:, 3], rtol=1e-9)
    np.testing.assert_allclose(deviation[:, 9], 0.8 * second[:, 9], rtol=1e-9)
    np.testing.assert_allclose(np.delete(deviation, (3, 9), axis=1), 0.0, atol=1e-12)
    np.testing.assert_allclose(found["illuminance_sd"], 0.0, atol=1e-12)  # lumens are what is given
    given = state.with_given_spectra(np.array([1]), np.zeros((1, BANDS)))
    one = spectral_map(exact, unknowns=given)["irradiance_sd"].to_numpy()
    np.testing.assert_allclose(one[:, 3], 0.5 * first[:, 3], rtol=1e-9)
    np.testing.assert_allclose(one[:, 9], 0.0, atol=1e-12)


def test_beyond_the_end_of_a_spectrum_light_is_not_known_and_no_darkness(make_transport, tmp_path):
    """An incandescent lamp that was measured to 700 nm: 760 nm has what it tells, 0, and a deviation as of its end."""
    bands = sensor_bands("as7265x-14")
    cut = Spectrum(wavelengths_nm=[380.0, 700.0], values=[0.2, 1.0])
    ends_dark = Spectrum(wavelengths_nm=[380.0, 500.0, 700.0], values=[0.2, 1.0, 0.0])
    beyond = beyond_ends([cut, ends_dark], bands)
    brightest = bands.band_values(cut, outside="zero").max()
    assert beyond[0, -1] == pytest.approx(1.0 / brightest)
    assert beyond[0, 3] < 1e-12
    assert beyond[1, 1:].max() < 1e-6
    transport = make_transport()
    transport = transport.assign(coefficient_se=transport["coefficient_se"] * 0)
    flux = np.stack([bands.band_values(each, outside="zero") for each in (cut, ends_dark)])
    transport = transport.assign(flux=(("lamp", "band"), flux, transport["flux"].attrs))
    state = replace(unknowns(known_but()), beyond=beyond)
    save_unknowns(state, tmp_path)
    kept = load_unknowns(tmp_path)
    assert kept is not None
    found = spectral_map(transport, unknowns=kept)
    coefficient = transport["coefficient"].transpose("lamp", "point", "band").to_numpy()
    np.testing.assert_allclose(found["irradiance_sd"][:, -1], coefficient[0, :, -1] / np.sqrt(3), rtol=1e-6)
    np.testing.assert_allclose(found["irradiance_sd"][:, 3], 0.0, atol=1e-12)
    off = relight(transport, {"panel 1": LampChange(dim=0.0)}, unknowns=kept)
    assert off["irradiance_sd"][:, -1].max() == 0.0
    bluer = kept.with_given_spectra(np.array([0]), beyond_ends([ends_dark], bands))
    assert spectral_map(transport, unknowns=bluer)["irradiance_sd"][:, -1].max() < 1e-12


def test_a_map_of_an_earlier_version_that_knows_no_spectra_is_told_in_words_and_read(exact, tmp_path):
    attributes = spectral_map(exact, unknowns=unknowns(known_but(u0=0.1))).attrs
    del attributes[f"{OF_CAUSE}spectra"]
    assert "lamps" in uncertainty_in_words(attributes)
    save_unknowns(unknowns(known_but(u0=0.1)), tmp_path)
    with xr.open_dataset(tmp_path / UNKNOWNS_FILE) as stored:
        earlier = stored.load().drop_vars(["spectrum_sd", "beyond"])
    earlier.to_netcdf(tmp_path / UNKNOWNS_FILE, engine="h5netcdf")
    back = load_unknowns(tmp_path)
    assert back is not None
    np.testing.assert_array_equal(back.spectrum_sd, np.zeros((LAMPS, BANDS)))
    np.testing.assert_array_equal(back.beyond, np.zeros((LAMPS, BANDS)))


def test_illuminance_has_an_uncertainty_of_its_own(exact):
    found = spectral_map(exact, unknowns=unknowns(known_but(u0=0.1, u1=0.1, u2=0.05)))
    relative = (found["illuminance_sd"] / found["illuminance"]).to_numpy()
    assert np.all(relative > 0.3 * 0.05)
    assert np.all(relative < np.hypot(0.1, 0.3 * 0.05) + 1e-9)  # two lamps that err apart are at most 10 %
    assert found.attrs[ALL_CAUSES] == pytest.approx(
        np.sqrt((found["illuminance_sd"] ** 2).mean() / found["illuminance"].mean() ** 2)
    )
    squares = sum(found.attrs[f"{OF_CAUSE}{cause}"] ** 2 for cause in CAUSES)
    assert found.attrs[ALL_CAUSES] == pytest.approx(np.sqrt(squares))
    assert uncertainty_in_words(found.attrs).startswith("± ")
    assert "lamps" in uncertainty_in_words(found.attrs)
    assert uncertainty_in_words({}) == ""


def test_a_map_that_is_hardly_known_says_so_in_plain_digits():
    attributes = {ALL_CAUSES: 2.574, **{f"{OF_CAUSE}{cause}": 0.0 for cause in CAUSES}, f"{OF_CAUSE}{CAUSES[0]}": 2.51}
    assert uncertainty_in_words(attributes) == f"± 260 % at a point ({CAUSES[0]} 250 %)"


def test_a_relit_map_has_the_uncertainty_of_its_lamps(exact):
    state = unknowns(known_but(u0=0.3))
    assert relight(exact, {"panel 1": LampChange(dim=0.0)}, unknowns=state)["irradiance_sd"].max() == 0
    assert relight(exact, {"panel 2": LampChange(dim=0.0)}, unknowns=state)["irradiance_sd"].max() > 0
    assert "irradiance_sd" not in relight(exact, {})


@pytest.mark.parametrize(("before", "after"), [(0.4, 0.15), (0.02, 0.15)])  # guessed; told by readings
def test_lumens_that_are_given_anew_are_known_as_those_of_a_data_sheet(exact, lamps, monkeypatch, before, after):
    alike = known_but(u0=before, u1=before)
    alike[0, 1] = alike[1, 0] = 0.85 * before**2
    stands = {
        "transport_of_run": exact, "present_lamps_of_run": lamps, "current_stage": "map",
        "scene_of_run": SimpleNamespace(bands=sensor_bands("as7265x-14")), "load_unknowns": unknowns(alike, slope=0.0),
        "assumptions_of_run": Assumptions(),
    }  # fmt: skip
    for name, value in stands.items():
        monkeypatch.setattr(relighting, name, lambda *_, value=value: value)
    off = LampOrder(lamp="panel 2", dim=0.0)
    for order, wanted in (
        (LampOrder(lamp="panel 1", luminous_flux_lm=1e3), after),
        (LampOrder(lamp="panel 1"), before),
    ):
        light = relighting.relight_run("run", [order, off])
        np.testing.assert_allclose(light["irradiance_sd"] / light["irradiance"], wanted, rtol=1e-6)
    as_one = relighting.relight_run("run", [LampOrder(lamp="*", luminous_flux_lm=1e3)])  # by one data sheet
    both = relighting.relight_run(
        "run", [LampOrder(lamp=lamp.name, luminous_flux_lm=lm) for lamp, lm in zip(lamps, (1e3, 1.0001e3), strict=True)]
    )
    alone = [
        relighting.relight_run("run", [LampOrder(lamp=lamp.name, luminous_flux_lm=1e3), LampOrder(lamp="*", dim=0.0)])
        for lamp in lamps
    ]
    apart = np.sqrt(alone[0]["irradiance_sd"] ** 2 + alone[1]["irradiance_sd"] ** 2)
    np.testing.assert_allclose(both["irradiance_sd"], apart, rtol=1e-3)
    in_common = 2.0 * 0.5 * alone[0]["irradiance_sd"] * alone[1]["irradiance_sd"]
    np.testing.assert_allclose(as_one["irradiance_sd"], np.sqrt(apart**2 + in_common), rtol=1e-6)


def test_a_spectrum_that_is_given_anew_is_no_guess_any_more(exact, lamps, monkeypatch):
    guessed = replace(unknowns(known_but()), spectrum_sd=np.full((LAMPS, BANDS), 0.5))
    stands = {
        "transport_of_run": exact, "present_lamps_of_run": lamps, "current_stage": "map",
        "scene_of_run": SimpleNamespace(bands=sensor_bands("as7265x-14")), "load_unknowns": guessed,
        "assumptions_of_run": Assumptions(),
    }  # fmt: skip
    for name, value in stands.items():
        monkeypatch.setattr(relighting, name, lambda *_, value=value: value)
    off = LampOrder(lamp="panel 2", dim=0.0)
    for order, wanted in ((LampOrder(lamp="panel 1", spectrum="A"), 0.0), (LampOrder(lamp="panel 1", dim=0.7), 0.5)):
        light = relighting.relight_run("run", [order, off])
        np.testing.assert_allclose(light["irradiance_sd"] / light["irradiance"], wanted, atol=1e-9)


def test_error_bars_are_the_uncertainty_where_a_map_has_it(exact, make_transport):
    assert error_bars(spectral_map(exact, unknowns=unknowns(known_but(u0=0.1))))[1] == "standard uncertainties"
    assert error_bars(spectral_map(make_transport()))[1] == "standard errors of the simulation"


def test_files_keep_it(exact, tmp_path):
    guesses = np.linspace(0.0, 1.0, LAMPS * BANDS).reshape(LAMPS, BANDS)
    state = replace(unknowns(known_but(u0=0.1, u3=0.2), slope=0.25, local_sd=0.03), spectrum_sd=guesses)
    save_unknowns(state, tmp_path)
    back = load_unknowns(tmp_path)
    assert back is not None
    np.testing.assert_array_equal(back.covariance, state.covariance)
    np.testing.assert_array_equal(back.slope, state.slope)
    np.testing.assert_array_equal(back.spectrum_sd, guesses)
    assert back.local_sd == state.local_sd
    assert load_unknowns(tmp_path / "elsewhere") is None
    found = spectral_map(exact, unknowns=state)
    again = load_map(save_map(found, tmp_path / "map.nc"))
    np.testing.assert_array_equal(again["illuminance_sd"], found["illuminance_sd"])
    assert again.attrs[ALL_CAUSES] == found.attrs[ALL_CAUSES]
    assert {"SD_410", "SD_illuminance_lx"} <= set(map_table(found).columns)
    table = read_map_table(save_map_table(found, tmp_path / "map.csv"), bands=sensor_bands("as7265x-14"))
    np.testing.assert_allclose(table["irradiance_sd"], found["irradiance_sd"], rtol=1e-8)


def test_a_damaged_file_is_told(tmp_path):
    (tmp_path / UNKNOWNS_FILE).write_bytes(b"no")
    with pytest.raises(MapError, match="map stage"):
        load_unknowns(tmp_path)


def test_a_new_spectrum_that_ends_in_light_is_told_and_uncertain_beyond(exact, lamps, monkeypatch, tmp_path):
    path = tmp_path / "to-700.csv"
    path.write_text("wavelength_nm,relative\n380,0\n400,0.3\n700,1\n", encoding="utf-8")
    stands = {
        "transport_of_run": exact, "present_lamps_of_run": lamps, "current_stage": "map",
        "scene_of_run": SimpleNamespace(bands=sensor_bands("as7265x-14")), "load_unknowns": unknowns(known_but()),
        "assumptions_of_run": Assumptions(),
    }  # fmt: skip
    for name, value in stands.items():
        monkeypatch.setattr(relighting, name, lambda *_, value=value: value)
    relit = relighting.relit_run("run", [LampOrder(lamp="panel 1", spectrum=str(path))])
    (note,) = relit.notes
    assert note.startswith("The spectrum of 'panel 1' goes from 380 to 700 nm and not into the dark")
    assert "705, 730, 760 nm" in note
    assert (relit.light_map["irradiance_sd"][:, -1] > 0).all()
    assert relighting.relit_run("run", [LampOrder(lamp="panel 1", dim=0.5)]).notes == ()
