"""The map: schema, files, superposition and relighting."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from lidarspectra.errors import MapError, WorkspaceError
from lidarspectra.mapping.maps.map_files import load_map, map_table, read_map_table, save_map, save_map_table
from lidarspectra.mapping.maps.map_schema import check_map
from lidarspectra.mapping.maps.spectral_map import LampChange, relight, spectral_map
from lidarspectra.spectra.spectrum import Spectrum, gaussian_bands


def test_map_is_the_sum_over_lamps_of_coefficient_times_flux(make_transport):
    transport = make_transport()
    one_map = spectral_map(transport)
    by_hand = sum(
        transport["coefficient"].isel(lamp=i).to_numpy() * transport["flux"].isel(lamp=i).to_numpy() for i in range(2)
    )
    np.testing.assert_allclose(one_map["irradiance"], by_hand, rtol=1e-12)  # float rounding of one product and sum
    assert one_map["irradiance"].attrs["units"] == "W m-2 nm-1"
    assert one_map["band"].attrs["standard_name"] == "radiation_wavelength"
    assert one_map.attrs["accuracy"] == "ultra"


def test_standard_error_of_the_sum_is_never_below_that_of_independent_lamps(make_transport):
    transport = make_transport()
    errors = spectral_map(transport)["irradiance_se"].to_numpy()
    each = transport["coefficient_se"].to_numpy() * transport["flux"].to_numpy()[:, None, :]
    assert np.all(errors >= np.sqrt((each**2).sum(axis=0)))
    assert np.all(errors <= each.sum(axis=0) * (1 + 1e-12))  # the triangle inequality, with float rounding


def test_the_trace_s_own_error_of_the_sum_is_used_for_the_traced_flux_only(make_transport):
    transport = make_transport()
    own = np.full((176, 14), 1e-6)
    transport["irradiance_se"] = (("point", "band"), own)
    np.testing.assert_array_equal(spectral_map(transport)["irradiance_se"], own)
    assert not np.array_equal(relight(transport, {"panel 1": LampChange(dim=0.5)})["irradiance_se"], own)


def test_dim_order_of_the_transport_does_not_matter(make_transport):
    transport = make_transport()
    turned = transport.transpose("band", "point", "lamp")
    np.testing.assert_allclose(spectral_map(turned)["irradiance"], spectral_map(transport)["irradiance"], rtol=1e-13)


def test_dimming_all_lamps_scales_the_map_and_its_error(make_transport):
    transport = make_transport()
    dimmed = relight(transport, {name: LampChange(dim=0.4) for name in ("panel 1", "panel 2")})
    full = relight(transport, {})
    np.testing.assert_allclose(dimmed["irradiance"], 0.4 * full["irradiance"], rtol=1e-12)
    np.testing.assert_allclose(dimmed["irradiance_se"], 0.4 * full["irradiance_se"], rtol=1e-12)


def test_lamps_relit_one_by_one_add_up_to_the_whole(make_transport):
    transport = make_transport()
    parts = [
        relight(transport, {other: LampChange(dim=0.0)})["irradiance"].to_numpy() for other in ("panel 1", "panel 2")
    ]
    np.testing.assert_allclose(parts[0] + parts[1], spectral_map(transport)["irradiance"], rtol=1e-12)


def test_relighting_with_a_spectrum_equals_relighting_with_its_band_values(make_transport, bands):
    transport = make_transport()
    flux = Spectrum(wavelengths_nm=[300.0, 900.0], values=[0.0, 0.3], name="ramp")
    by_spectrum = relight(transport, {"panel 2": LampChange(flux=flux, dim=0.5)}, bands=bands)
    values = bands.band_values(flux, outside="zero")
    by_values = relight(transport, {"panel 2": LampChange(flux=values, dim=0.5)})
    xr.testing.assert_identical(by_spectrum, by_values)
    assert not np.allclose(by_values["irradiance"], spectral_map(transport)["irradiance"])


def test_relighting_leaves_the_transport_as_it_was(make_transport):
    transport = make_transport()
    before = transport.copy(deep=True)
    relight(transport, {"panel 1": LampChange(dim=0.0)})
    xr.testing.assert_identical(transport, before)


def test_relighting_an_unknown_lamp_names_the_lamps_that_are_there(make_transport):
    with pytest.raises(MapError, match="panel 1, panel 2"):
        relight(make_transport(), {"panel 9": LampChange(dim=0.0)})


def test_relighting_with_a_spectrum_needs_the_bands_of_the_trace(make_transport):
    flux = Spectrum(wavelengths_nm=[300.0, 900.0], values=[0.0, 0.3])
    with pytest.raises(MapError, match="14 channels"):
        relight(make_transport(), {"panel 1": LampChange(flux=flux)})
    with pytest.raises(MapError, match="'two' with 2 channels"):
        relight(make_transport(), {"panel 1": LampChange(flux=flux)}, bands=gaussian_bands("two", [500.0, 600.0], 20.0))


@pytest.mark.parametrize("dim", [-0.1, np.nan, np.inf])
def test_a_dim_factor_that_is_no_factor_is_refused(dim):
    with pytest.raises(MapError, match="dim factor"):
        LampChange(dim=dim)


@pytest.mark.parametrize("flux", [np.full((2, 14), -1.0), np.ones((3, 14)), np.full((2, 14), np.nan)])
def test_a_flux_that_no_lamp_can_have_is_refused(make_transport, flux):
    with pytest.raises(MapError, match="flux of the lamps"):
        spectral_map(make_transport(), flux)


def test_map_survives_netcdf_bit_for_bit(make_transport, tmp_path):
    one_map = spectral_map(make_transport(buried=(3, 9)))
    path = save_map(one_map, tmp_path / "räum #1.nc")
    xr.testing.assert_identical(load_map(path), one_map)
    assert [entry.name for entry in tmp_path.iterdir()] == ["räum #1.nc"]


def test_map_survives_csv_within_nine_digits(make_transport, bands, tmp_path):
    one_map = spectral_map(make_transport(buried=(3, 9)))
    path = save_map_table(one_map, tmp_path / "map.csv")
    again = read_map_table(path, bands=bands)
    for name in ("irradiance", "irradiance_se", "illuminance", "illuminance_se", "x", "band_width"):
        np.testing.assert_allclose(again[name], one_map[name], rtol=1e-8)  # nine significant digits are written
    np.testing.assert_array_equal(again["buried"], one_map["buried"])


def test_table_has_one_named_column_a_channel(make_transport):
    table = map_table(spectral_map(make_transport()))
    assert list(table.columns[:9]) == ["x", "y", "z", "nx", "ny", "nz", "buried", "E_410", "E_435"]
    assert "SE_760" in table.columns
    assert list(table.columns[-2:]) == ["illuminance_lx", "SE_illuminance_lx"]
    assert table.shape == (176, 7 + 2 * 14 + 2)


def test_a_map_of_before_illuminance_was_part_of_it_is_read(make_transport, tmp_path):
    old = spectral_map(make_transport()).drop_vars(["illuminance", "illuminance_se"])
    again = load_map(save_map(old, tmp_path / "map.nc"))
    assert "illuminance" not in again
    assert "illuminance_lx" not in map_table(again).columns


def test_illuminance_survives_its_file_and_is_held_to_its_unit(make_transport, tmp_path):
    one_map = spectral_map(make_transport())
    again = load_map(save_map(one_map, tmp_path / "map.nc"))
    np.testing.assert_array_equal(again["illuminance"], one_map["illuminance"])
    assert again["illuminance"].attrs["units"] == "lx"
    again["illuminance"].attrs["units"] = "fc"
    with pytest.raises(MapError, match="'illuminance' in lx"):
        check_map(again, where="map")


def test_channels_of_a_table_are_known_by_name_not_position(make_transport, bands, tmp_path):
    one_map = spectral_map(make_transport())
    table = map_table(one_map)
    table[list(reversed(table.columns))].to_csv(tmp_path / "turned.csv", index=False, float_format="%.17g")
    again = read_map_table(tmp_path / "turned.csv", bands=bands)
    np.testing.assert_allclose(
        again["irradiance"], one_map["irradiance"], rtol=1e-12
    )  # 17 digits are exact; the reader rounds in its last bit


def test_a_table_without_a_channel_is_refused_by_its_name(make_transport, bands, tmp_path):
    map_table(spectral_map(make_transport())).drop(columns="E_610").to_csv(tmp_path / "map.csv", index=False)
    with pytest.raises(MapError, match="a column 'E_610'"):
        read_map_table(tmp_path / "map.csv", bands=bands)


def test_a_table_with_words_for_numbers_is_refused_by_its_column(make_transport, bands, tmp_path):
    table = map_table(spectral_map(make_transport())).astype({"E_610": object})
    table.loc[4, "E_610"] = "bright"
    table.to_csv(tmp_path / "map.csv", index=False)
    with pytest.raises(MapError, match="E_610"):
        read_map_table(tmp_path / "map.csv", bands=bands)


def _without(name: str):
    return lambda good: good.drop_vars(name)


def _with(name: str, change):
    def spoil(good: xr.Dataset) -> xr.Dataset:
        values = good[name].to_numpy().copy()
        return good.assign_coords({name: (good[name].dims, change(values), good[name].attrs)})

    return spoil


def _first(value: float):
    def change(values: np.ndarray) -> np.ndarray:
        values.flat[0] = value
        return values

    return change


@pytest.mark.parametrize(
    ("spoil", "word"),
    [
        (_without("irradiance_se"), "irradiance_se"),
        (_without("buried"), "buried"),
        (_without("band_label"), "band_label"),
        (_with("irradiance", _first(np.nan)), "NaN"),
        (_with("irradiance", _first(-1.0)), "negative"),
        (_with("irradiance_se", _first(-1.0)), "negative"),
        (_with("x", _first(np.inf)), "infinite"),
        (_with("nz", _first(0.5)), "length 1"),
        (_with("band", lambda values: values[::-1]), "ascending"),
        (_with("band_width", _first(0.0)), "positive"),
        (_with("band_label", lambda values: np.full(values.shape, "410")), "label of its own"),
        (lambda good: good.assign_coords(z=good["z"].assign_attrs(units="mm")), "'z' in m"),
        (lambda good: good.rename(point="station"), "dims"),
        (lambda good: good.isel(point=slice(0, 0)), "at least one point"),
    ],
)
def test_a_dataset_that_breaks_the_schema_is_refused_with_the_reason(make_transport, spoil, word):
    with pytest.raises(MapError, match=word):
        check_map(spoil(spectral_map(make_transport(points=9))), where="a test")


def test_noise_below_zero_within_its_error_is_kept(make_transport):
    good = spectral_map(make_transport(points=9))
    good["irradiance"][0, 0] = -2.0 * good["irradiance_se"][0, 0]
    assert float(check_map(good, where="a test")["irradiance"].min()) < 0


@pytest.mark.parametrize("content", [b"", b"no NetCDF at all", b"\x89HDF\r\n\x1a\n" + bytes(40)])
def test_a_file_that_is_no_map_is_one_clear_error(tmp_path, content):
    path = tmp_path / "broken.nc"
    path.write_bytes(content)
    with pytest.raises(MapError, match=r"broken\.nc"):
        load_map(path)


def test_a_truncated_map_is_one_clear_error(make_transport, tmp_path):
    path = save_map(spectral_map(make_transport()), tmp_path / "map.nc")
    whole = path.read_bytes()
    for share in (0.1, 0.5, 0.9):
        path.write_bytes(whole[: int(share * len(whole))])
        with pytest.raises(MapError, match=r"map\.nc"):
            load_map(path)


def test_a_map_that_is_not_there_is_one_clear_error(tmp_path):
    with pytest.raises(MapError, match=r"nowhere\.nc"):
        load_map(tmp_path / "nowhere.nc")


def test_a_map_cannot_be_written_into_a_missing_folder(make_transport, tmp_path):
    one_map = spectral_map(make_transport(points=9))
    with pytest.raises(WorkspaceError, match="can be written"):
        save_map(one_map, tmp_path / "no" / "map.nc")
    with pytest.raises(MapError, match="can be written"):
        save_map_table(one_map, Path(tmp_path / "no" / "map.csv"))


def test_an_empty_table_is_refused(tmp_path, bands):
    (tmp_path / "empty.csv").write_text("", encoding="utf-8")
    with pytest.raises(MapError, match=r"empty\.csv"):
        read_map_table(tmp_path / "empty.csv", bands=bands)
    pd.DataFrame({"x": [1.0]}).to_csv(tmp_path / "short.csv", index=False)
    with pytest.raises(MapError, match="a column 'y'"):
        read_map_table(tmp_path / "short.csv", bands=bands)


def test_errors_of_lamps_that_share_paths_are_taken_from_their_sum(make_transport):
    transport = make_transport(points=40)
    flux = transport["flux"].to_numpy()
    wobble = 1e-3 * np.random.default_rng(2).normal(size=(8, 40, 14))
    opposite = np.stack([wobble / flux[0], -wobble / flux[1]], axis=1)
    batches = transport["coefficient"].to_numpy() + opposite
    transport["coefficient_batches"] = (("batch", "lamp", "point", "band"), batches)
    both = spectral_map(transport)["irradiance_se"].to_numpy()
    one = relight(transport, {"panel 2": LampChange(dim=0.0)})["irradiance_se"].to_numpy()
    assert both.max() < 1e-12  # what one lamp gains the other loses: float rounding is left
    # Alone, 8 batches of a wobble of 1e-3 leave 1e-3/sqrt(8), known within 1/sqrt(2 x 7) a point and far better pooled.
    np.testing.assert_allclose(np.median(one), 1e-3 / np.sqrt(8), rtol=0.15)


def test_a_relit_map_states_its_own_error_and_not_the_traced_light_s(make_transport):
    transport = make_transport(points=12)
    shape = transport["coefficient"].shape
    missing = np.zeros(shape)
    missing[1] = 0.03 * transport["coefficient"].to_numpy()[1]  # of the second lamp's light alone
    transport["truncation_coefficient"] = (("lamp", "point", "band"), missing, {"units": "m-2"})
    names = [str(name) for name in transport["lamp"].to_numpy()]
    first = relight(transport, {names[1]: LampChange(dim=0.0)})
    second = relight(transport, {names[0]: LampChange(dim=0.0)})
    assert (first.attrs["truncated_share"], float(first["truncation"].max())) == (0.0, 0.0)
    assert second.attrs["truncated_share"] == pytest.approx(0.03, rel=0.2)  # rms over points, of the mean
    assert (first.attrs["achieved_relative_se"] > 0, second.attrs["target_met"]) == (True, 0)


def test_a_map_of_an_earlier_trace_that_knew_nothing_of_truncation_has_none(make_transport):
    transport = make_transport(points=12).assign_attrs(truncated_share=0.5, target_met=0)
    light = relight(transport, {})
    assert "truncation" not in light
    assert "truncated_share" not in light.attrs


def test_a_truncation_survives_its_file_and_is_checked_there(make_transport, tmp_path):
    transport = make_transport(points=12)
    transport["truncation_coefficient"] = transport["coefficient"] * 0.01
    light = spectral_map(transport)
    read = load_map(save_map(light, tmp_path / "map.nc"))
    assert np.array_equal(read["truncation"], light["truncation"])
    with pytest.raises(MapError, match="truncation"):
        save_map(light.assign(truncation=light["truncation"] * np.nan), tmp_path / "map.nc")
