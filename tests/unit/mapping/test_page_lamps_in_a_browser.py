"""The page's lamps in Chromium without a window: the light of `relight`, and a scenario as a link and a command."""

import json
import shlex

import numpy as np
import pytest

from lidarspectra.cli.relight import parse_orders
from lidarspectra.lamps.lamp_spectra import luminous_flux_lm
from lidarspectra.mapping.maps.spectral_map import LampChange, relight
from lidarspectra.mapping.photometry import light_of_lamps
from lidarspectra.mapping.photometry.color_quality import COLOR_GRID_NM, color_temperature
from lidarspectra.mapping.photometry.quantities import light_quantity
from lidarspectra.mapping.photovoltaics.cells import find_cell
from lidarspectra.mapping.report.key_figures import key_figures
from lidarspectra.mapping.report.lamp_light import lamp_light, quantised
from lidarspectra.mapping.report.report_page import Section, page, room_view
from lidarspectra.mapping.report.room_view import room_view_data
from lidarspectra.radiance.sampling.folding import with_spectrum
from lidarspectra.spectra.databases import lamp_spectrum

PATIENCE_MS = 60_000  # a loaded machine without a graphics card draws slowly
WITHIN = 5e-3  # of what `relight` gives; the page's coefficients are rounded by 0.03 %
OTHER = "LED-B1"  # a spectrum of the databases that differs from both lamps'
ANSWER = """([wanted]) => {
  const room = RoomPicture.unpacked(JSON.parse(document.getElementById("room-data").textContent));
  const light = new RoomLight(room.light, room.bands.length);
  const wrong = light.apply(wanted);
  const points = Array.from({ length: light.points }, (_, point) => point);
  const rows = light.data.responses.map((_, row) => points.map((point) => light.quantity(row, point)));
  const kelvin = points.map((point) => light.colorTemperature(point));
  return { wrong, irradiance: [...light.irradiance], rows, kelvin };
}"""


@pytest.fixture
def page_file(split_transport, make_report, bands, tmp_path):
    """A page of the room and its lamps alone, and the report that it is of."""
    report = make_report(split_transport)
    cells = ((find_cell("silicon"), 1.0),)
    light = lamp_light(split_transport, report.lamps, bands, cells, np.arange(split_transport.sizes["point"]))
    data = room_view_data(
        report.spectral_map, report.surfaces, report.materials, report.material_areas_m2, report.lamps,
        light=light, run="my room.run",
    )  # fmt: skip
    file = tmp_path / "index.html"
    section = Section(anchor="room-in-3d", title="Room in 3D", content=room_view())
    figures = key_figures(report) + '<div id="trust"></div>'
    text = page(title="Room", lead="", sections=[section], footer="", room_data=data, key_figures=figures)
    file.write_text(text, encoding="utf-8")
    return file


@pytest.fixture
def open_page(browser, page_file):
    """Open the page, with a fragment, in a fresh window; afterwards nothing may have gone wrong in it."""
    windows, wrong = [], []

    def open_it(fragment="", *, size=(1400, 900), **options):
        window = browser.new_context(viewport={"width": size[0], "height": size[1]}, **options)
        window.set_default_timeout(PATIENCE_MS)
        windows.append(window)
        opened = window.new_page()
        opened.on("pageerror", lambda error: wrong.append(str(error)))
        opened.goto(page_file.as_uri() + fragment)
        return opened

    yield open_it
    for window in windows:
        window.close()
    assert wrong == []


def _relit(transport, lamps, bands, orders):
    """What `relight` gives for orders of the command line: the map, and the light at the points."""
    changes, fluxes, dims = {}, {lamp.name: lamp.flux for lamp in lamps}, {}
    for order in orders:
        flux = fluxes[order.lamp]
        lumens = order.luminous_flux_lm or luminous_flux_lm(flux)
        if order.spectrum is not None:
            flux = lamp_spectrum(order.spectrum).spectrum
            transport = with_spectrum(transport, order.lamp, flux)
        fluxes[order.lamp] = flux.scaled(lumens / luminous_flux_lm(flux))
        dims[order.lamp] = order.dim
        changes[order.lamp] = LampChange(flux=fluxes[order.lamp], dim=order.dim)
    light = relight(transport, changes, bands=bands, lamps=lamps)
    flux = [bands.band_values(fluxes[lamp.name], outside="zero") for lamp in lamps]
    return light, light_of_lamps(transport.assign(flux=(("lamp", "band"), flux)), fluxes, dims)


def test_the_page_computes_what_relight_does(open_page, split_transport, lamps, bands) -> None:
    command = f'--lamp "panel 1" --spectrum {OTHER} --lumens 1234.5 --dim 0.37 --lamp "panel 2" --lumens 900'
    orders = parse_orders(shlex.split(command))
    wanted = [
        ["lamp", "panel 1"],
        ["spectrum", OTHER],
        ["lumens", "1234.5"],
        ["dim", "0.37"],
        ["lamp", "panel 2"],
        ["lumens", "900"],
    ]
    answer = open_page().evaluate(ANSWER, [wanted])
    assert answer["wrong"] == []
    light, at_points = _relit(split_transport, lamps, bands, orders)
    assert np.array(answer["irradiance"]) == pytest.approx(light["irradiance"].to_numpy().ravel(), rel=WITHIN)
    names = ("illuminance_lx", "melanopic_edi_lx", "ppfd_umol_m2_s")
    responses = [*(light_quantity(name).response for name in names), find_cell("silicon").responsivity.scaled(100.0)]
    for found, response in zip(answer["rows"], responses, strict=True):
        assert np.array(found) == pytest.approx(at_points.weigh(response)[0], rel=WITHIN)
    assert np.array(answer["rows"][0]) == pytest.approx(light["illuminance"].to_numpy(), rel=WITHIN)
    assert np.array(answer["kelvin"]) == pytest.approx(
        color_temperature(at_points.spectra(COLOR_GRID_NM), COLOR_GRID_NM)[0], rel=WITHIN
    )
    # The spectrum matters: with the lamp's own the same orders give other light.
    own = open_page().evaluate(ANSWER, [[pair for pair in wanted if pair[0] != "spectrum"]])
    assert np.abs(np.array(own["irradiance"]) / np.array(answer["irradiance"]) - 1).max() > 10 * WITHIN


def test_switch_dimmer_and_lumens_change_the_numbers_the_picture_the_link_and_the_command(
    open_page, split_transport, lamps
) -> None:
    page = open_page()
    mean = page.locator("[data-key=illuminance_lx][data-fact=mean] .value")
    counted = ~split_transport["buried"].to_numpy()
    luminosity, fluxes = light_quantity("illuminance_lx").response, {lamp.name: lamp.flux for lamp in lamps}
    each = [
        light_of_lamps(split_transport, fluxes, dims).weigh(luminosity)[0][counted].mean()
        for dims in ({"panel 2": 0.0}, {"panel 1": 0.0})
    ]
    assert float(mean.inner_text().split()[0]) == pytest.approx(sum(each), rel=WITHIN)
    before = page.locator("#room-canvas").screenshot()
    second = page.get_by_role("group", name="panel 2")
    second.get_by_role("switch").uncheck()
    assert float(mean.inner_text().split()[0]) == pytest.approx(each[0], rel=WITHIN)
    assert "→" in page.locator("#lamps-now").inner_text()
    assert page.locator("#room-canvas").screenshot() != before
    first = page.get_by_role("group", name="panel 1")
    dimmer = first.get_by_role("slider")
    dimmer.focus()
    for _ in range(50):
        page.keyboard.press("ArrowLeft")  # by keys alone
    assert dimmer.get_attribute("aria-valuetext") == "50 %"
    first.get_by_label("lumens").fill("2000")
    first.get_by_label("lumens").press("Enter")
    first.get_by_label("spectrum").select_option(label=OTHER)
    page.get_by_label("name of this light").fill("late")
    command = shlex.split(page.locator("#lamps-command").inner_text())
    assert command[:5] == ["lidarspectra", "relight", "my room.run", "--name", "late"]
    orders = parse_orders(command[5:])
    assert [(order.lamp, order.spectrum, order.luminous_flux_lm, order.dim) for order in orders] == [
        ("panel 1", OTHER, 2000.0, 0.5),
        ("panel 2", None, None, 0.0),
    ]
    shown = mean.inner_text()
    again = open_page("#" + page.url.partition("#")[2])  # the link tells the same
    assert again.locator("[data-key=illuminance_lx][data-fact=mean] .value").inner_text() == shown
    assert again.locator("#lamps-command").inner_text() == page.locator("#lamps-command").inner_text()
    page.get_by_role("button", name="As traced").click()
    assert float(mean.inner_text().split()[0]) == pytest.approx(sum(each), rel=WITHIN)
    assert "#" not in page.url
    assert page.locator("#lamps-kept").is_hidden()


def test_a_link_to_what_this_run_does_not_have_says_so(open_page) -> None:
    page = open_page("#lamp=panel+9&dim=0.5&lamp=panel+1&dim=7&spectrum=<b>&lumens=10")
    told = page.locator("#lamps-wrong").inner_text()
    assert "lamp 'panel 9'" in told
    assert "dim '7' of 'panel 1'" in told
    assert "spectrum '<b>' of 'panel 1'" in told
    assert page.get_by_role("group", name="panel 1").get_by_label("lumens").input_value() == "10"


def test_channels_and_quantities_share_one_slider(open_page, bands) -> None:
    page = open_page()
    slider = page.get_by_label("Quantity or channel")
    assert slider.get_attribute("aria-valuetext") == "illuminance [lx]"
    slider.focus()
    told = []
    for _ in range(4 + len(bands)):
        page.keyboard.press("ArrowRight")
        told.append(slider.get_attribute("aria-valuetext"))
    assert told[:4] == [
        "melanopic EDI [lx]",
        "PPFD [µmol/m²/s]",
        "colour temperature [K]",
        "current of silicon [µA/cm²]",
    ]
    assert told[4].startswith("410 nm")
    assert told[-1].startswith("760 nm")


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("size", [(1400, 900), (420, 800)])
def test_the_first_screen_has_the_room_three_numbers_and_the_trust(open_page, size, scheme) -> None:
    page = open_page(size=size, color_scheme=scheme, has_touch=size[0] < 500)
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
    for shown in ("#room-canvas", "#room-legend", "[data-key=illuminance_lx][data-fact=mean]", "[data-fact=uniformity]",
                  "[data-key=melanopic_edi_lx]", ".facts div:last-child"):  # fmt: skip
        box = page.locator(shown).bounding_box()
        assert box["y"] >= 0
        assert box["y"] + box["height"] <= size[1], shown
        assert box["x"] + box["width"] <= size[0], shown
    assert page.locator("#room-canvas").bounding_box()["height"] >= 0.35 * size[1]


def test_a_finger_presses_a_switch_and_turns_the_room_sideways(open_page) -> None:
    page = open_page(size=(420, 800), has_touch=True)
    page.get_by_role("group", name="panel 1").get_by_role("switch").tap()
    page.locator("#lamps-now", has_text="→").wait_for()
    before = page.locator("#room-canvas").screenshot()
    box = page.locator("#room-canvas").bounding_box()
    middle = {"y": box["y"] + box["height"] / 2}
    touch = page.context.new_cdp_session(page)
    touch.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": 150, **middle}]})
    for x in (180, 220, 260):
        touch.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": [{"x": x, **middle}]})
    touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    for _ in range(40):  # touches are handled a moment after they were sent
        if page.locator("#room-canvas").screenshot() != before:
            break
        page.wait_for_timeout(50)
    else:
        pytest.fail("the room did not turn")


def test_rounded_coefficients_are_within_three_parts_in_ten_thousand_and_none_stays_none() -> None:
    values = np.concatenate([[0.0], np.geomspace(1e-12, 1.0, 5000)]).reshape(1, 1, -1)
    codes, lowest, step = quantised(values)
    back = np.where(codes > 0, lowest * np.exp((codes.astype(float) - 1) * step), 0.0)
    assert back == pytest.approx(values, rel=3e-4)
    assert back[0, 0, 0] == 0.0
    assert quantised(np.zeros((2, 3, 4)))[0].max() == 0


def test_spectra_that_the_slots_do_not_carry_are_not_offered(split_transport, lamps, bands) -> None:
    data = lamp_light(split_transport, lamps, bands, (), np.arange(25))
    assert data is not None
    json.dumps(data)
    offered = {data["spectra"][index]["name"] for index in data["lamps"][0]["choices"]}
    assert OTHER in offered
    steep = split_transport.assign(slot_reflectance=0.5 * split_transport["slot_reflectance"])
    fewer = lamp_light(steep, lamps, bands, (), np.arange(25))
    assert fewer is not None
    assert not fewer["lamps"][0]["choices"]
