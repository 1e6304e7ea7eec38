"""The answer to changed lamps: what the light was, what it is, and by how much it changed."""

from dataclasses import replace

import numpy as np
import pytest

from lidarspectra.mapping.maps.map_schema import kept_points
from lidarspectra.mapping.photometry import light_of_lamps
from lidarspectra.mapping.photometry.people_and_plants import light_at_points, summary_table
from lidarspectra.mapping.photometry.quantities import light_quantity
from lidarspectra.workflow.scenarios.relit_answer import answer_table, channels_table


def test_before_and_after_are_those_of_the_points_that_are_not_buried(make_transport, lamps) -> None:
    transport = make_transport(points=25, buried=(3,))
    fluxes = {lamp.name: lamp.flux for lamp in lamps}
    before, after = (light_of_lamps(transport, fluxes, dims) for dims in (None, {"panel 2": 0.25}))
    table = answer_table(before, after, transport).frame.set_index("light")
    kept = kept_points(transport)
    lux = [light.weigh(light_quantity("illuminance_lx").response)[0][kept] for light in (before, after)]
    row = table.loc["mean illuminance [lx]"]
    assert (row["as traced"], row["now"]) == pytest.approx((lux[0].mean(), lux[1].mean()))
    assert row["change [%]"] == pytest.approx(100 * (lux[1].mean() / lux[0].mean() - 1))
    assert table.loc["uniformity U0, lowest over mean [1]", "now"] == pytest.approx(lux[1].min() / lux[1].mean())
    channels = channels_table(before, after, transport).frame
    assert channels["now [mW/m²/nm]"].to_numpy() == pytest.approx(1e3 * after.irradiance[kept].mean(axis=0))


def test_lamps_that_are_off_are_no_error(make_transport, lamps) -> None:
    transport = make_transport(points=16)
    fluxes = {lamp.name: lamp.flux for lamp in lamps}
    dark = light_of_lamps(transport, fluxes, dict.fromkeys(fluxes, 0.0))
    table = answer_table(light_of_lamps(transport, fluxes), dark, transport).frame.set_index("light")
    assert table.loc["mean illuminance [lx]", "change [%]"] == pytest.approx(-100.0)
    assert table.loc["uniformity U0, lowest over mean [1]"].isna()["now"]


def test_a_channel_that_was_dark_has_no_change_of_a_power_of_ten(make_transport, lamps) -> None:
    light = light_of_lamps(make_transport(points=4), {lamp.name: lamp.flux for lamp in lamps})
    dark = np.where(np.arange(light.centers_nm.size) == 0, 1e-70, 1.0)  # as 940 nm of LEDs
    transport = make_transport(points=4)
    table = channels_table(replace(light, irradiance=light.irradiance * dark, lamps=()), light, transport).frame
    assert table["change [%]"].isna().tolist() == [True] + [False] * (light.centers_nm.size - 1)


def test_photometry_says_what_each_quantity_was(make_transport, lamps, bands) -> None:
    transport = make_transport(points=16)
    fluxes = {lamp.name: lamp.flux for lamp in lamps}
    before, after = (light_of_lamps(transport, fluxes, dims) for dims in (None, dict.fromkeys(fluxes, 0.5)))
    table = summary_table(light_at_points(after, transport, bands, rendering=False), before=before).frame
    assert table["quantity"].iloc[0] == "illuminance"
    assert table["change [%]"].dropna().to_numpy() == pytest.approx(-50.0)
