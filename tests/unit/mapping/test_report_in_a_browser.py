"""The report in Chromium without a window: no error; its 3D view, slider, keys, tables and print do what they say."""

import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.report.report import write_report
from lidarspectra.mapping.report.report_page import Section, room_view
from lidarspectra.mapping.report.report_page import page as page_text
from lidarspectra.mapping.report.report_writer import ReportWriter
from lidarspectra.mapping.report.room_view import room_view_data

HOSTILE = "</script><img src=x onerror=document.title='bad'><script>document.title='bad'</script>"
BANDS_NM = [410.0, 560.0, 760.0]
SIZE = {"width": 1300, "height": 900}  # [px]
PATIENCE_MS = 60_000  # a loaded machine without a graphics card draws slowly


@pytest.fixture(scope="module")
def report(make_transport, make_report):
    """A small room of three bands, quick to draw."""
    return make_report(make_transport(points=25, buried=(3,)).sel(band=BANDS_NM))


@pytest.fixture(scope="module")
def page_file(report, tmp_path_factory):
    """The whole report."""
    return write_report(tmp_path_factory.mktemp("report"), report)


@pytest.fixture
def open_page(browser):
    """Open a page in a fresh window; afterwards nothing may have gone wrong in it."""
    windows, wrong, asked = [], [], []

    def open_it(file, *, before="", **options):
        window = browser.new_context(viewport=SIZE, **options)
        window.set_default_timeout(PATIENCE_MS)
        windows.append(window)
        page = window.new_page()
        page.on("console", lambda message: wrong.append(message.text) if _is_ours(message) else None)
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        page.on("dialog", lambda dialog: wrong.append(dialog.message))
        if before:
            page.add_init_script(before)
        page.goto(file.as_uri())
        return page

    open_it.wrong = wrong  # type: ignore[attr-defined]
    yield open_it
    for window in windows:
        window.close()
    assert wrong == []
    assert all(re.match(r"file:.*index\.html|data:|blob:", address) for address in asked)


def _is_ours(message):
    """Errors and warnings, but for a graphics driver's remarks on how fast it is."""
    return message.type in ("error", "warning") and "GL Driver Message" not in message.text


def _reading(page):
    return page.locator("#room-reading").inner_text()


def _picture(page):
    return page.locator("#room-canvas").screenshot()


def _point_at(page, along, down):
    """Move the pointer to a place of the picture, in shares of its width and height."""
    canvas = page.locator("#room-canvas")
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    page.mouse.move(box["x"] + along * box["width"], box["y"] + down * box["height"])


def _points_under_the_pointer(page):
    """Move over the picture in rows until several points were told of; what was told of each."""
    told = {}
    for down in np.linspace(0.4, 0.7, 9):
        for along in np.linspace(0.25, 0.75, 9):
            _point_at(page, along, down)
            words = _reading(page)
            found = re.match(r"Point (\d+)\n", words)
            if found and int(found[1]) > 1:
                told[int(found[1])] = words
        if len(told) >= 3:
            return told
    return told


def test_pointing_at_a_point_tells_its_place_and_irradiance_as_the_map_has_them(open_page, page_file, report):
    page = open_page(page_file)
    told = _points_under_the_pointer(page)
    assert told
    light = report.spectral_map
    for number, words in told.items():
        point = light.isel(point=number - 1)
        place = map(float, re.search(r"x (\S+), y (\S+), z (\S+) m", words).groups())
        assert list(place) == pytest.approx([float(point[axis]) for axis in "xyz"], abs=5.01e-3)  # two decimals
        milli, error = (1e3 * float(point[name].sel(band=560.0)) for name in ("irradiance", "irradiance_se"))
        value, se = map(float, re.search(r"560 nm: (\S+) ± (\S+) mW", words).groups())
        assert value == pytest.approx(milli, rel=5e-3)  # three digits are shown
        assert se == pytest.approx(error, rel=5e-2)  # two
        assert ("buried" in words) == bool(point["buried"])
    page.mouse.move(1, 1)  # off the picture: the chosen point is told of again
    assert _reading(page).startswith("Point 1\n")
    assert page.locator("#room-chart circle").count() == len(BANDS_NM)
    assert page.locator("#room-chart .bar").count() == len(BANDS_NM)


def test_pointing_at_a_wall_tells_its_material(open_page, page_file):
    page = open_page(page_file)
    page.get_by_label("map between points").uncheck()
    _point_at(page, 0.5, 0.17)  # beside the far corner, above the points
    assert _reading(page).startswith("wall\n")
    assert "reflectance 0.49" in _reading(page)  # .4 + .2 (560 - 380) / 400


def test_the_slider_goes_through_the_channels_by_keys_and_recolours_the_picture(open_page, page_file, report):
    page = open_page(page_file)
    slider = page.get_by_label("Quantity or channel")
    slider.focus()
    pictures = {_picture(page)}
    page.keyboard.press("Home")
    assert page.locator("#room-shown-name").inner_text() == "410 nm"
    pictures.add(_picture(page))
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    assert page.locator("#room-shown-name").inner_text() == "760 nm"
    assert slider.get_attribute("aria-valuetext").startswith("760 nm")
    pictures.add(_picture(page))
    assert len(pictures) == 3
    page.get_by_label("one scale for all channels").check()
    highest = 1e3 * float(report.spectral_map["irradiance"].max())
    assert float(page.locator(".room-ends span").last.inner_text()) == pytest.approx(highest, rel=5e-3)
    assert _picture(page) not in pictures


def test_every_way_to_colour_the_surfaces_shows_another_picture(open_page, page_file):
    page = open_page(page_file)
    choice = page.get_by_label("Surfaces")
    pictures = set()
    for value in ("scanned", "reflectance", "code", "daylight", "none"):
        choice.select_option(value)
        pictures.add(_picture(page))
    assert len(pictures) == 5


def test_the_picture_is_turned_moved_and_zoomed_by_keys_alone_and_home_brings_it_back(open_page, page_file):
    page = open_page(page_file)
    page.locator("#room-canvas").focus()
    first = _picture(page)
    seen = {first}
    for key in ("ArrowLeft", "ArrowUp", "+", "Shift+ArrowRight"):
        page.keyboard.press(key)
        seen.add(_picture(page))
    assert len(seen) == 5
    page.keyboard.press("Home")
    assert _picture(page) == first


def test_a_point_can_be_chosen_by_its_number(open_page, page_file):
    page = open_page(page_file)
    page.locator("#room-point").fill("4")
    assert _reading(page).startswith("Point 4\n")
    assert "buried" in _reading(page)
    page.locator("#room-point").fill("99")  # there is none: the last choice stays
    assert _reading(page).startswith("Point 4\n")


def test_without_webgl_the_page_says_so_and_tells_spectra_all_the_same(open_page, page_file):
    page = open_page(page_file, before="HTMLCanvasElement.prototype.getContext = () => null;")
    assert "cannot show 3D" in page.locator("#room-message").inner_text()
    page.locator("#room-point").fill("7")
    assert _reading(page).startswith("Point 7\n")
    assert page.locator("#room-chart circle").count() == len(BANDS_NM)
    assert all("WebGL" in message for message in open_page.wrong)  # three.js says what is missing
    open_page.wrong.clear()


def test_names_from_a_scan_run_nothing_wherever_they_are_shown(open_page, report, make_material, tmp_path):
    lamps = tuple(replace(lamp, name=HOSTILE) for lamp in report.lamps[:1])
    materials = (make_material(HOSTILE), make_material(HOSTILE + "2"))
    data = room_view_data(report.spectral_map, report.surfaces, materials, report.material_areas_m2, lamps)
    section = Section(anchor="room-in-3d", title=HOSTILE, content=room_view())
    file = tmp_path / "index.html"
    text = page_text(title=HOSTILE, lead=HOSTILE, sections=[section], footer=HOSTILE, room_data=data)
    file.write_text(text, encoding="utf-8")
    page = open_page(file)
    page.get_by_label("Surfaces").select_option("code")
    _point_at(page, 0.5, 0.17)
    assert _reading(page).startswith(HOSTILE)
    assert page.locator("img[src=x]").count() == 0
    assert page.title() != "bad"


def test_a_table_sorts_by_its_heading_and_downloads_with_all_digits(open_page, page_file):
    page = open_page(page_file)
    table = page.locator("table[data-name=bands]")
    heading = table.get_by_role("button", name="mean [W/m²/nm]")
    heading.click()
    heading.click()
    assert table.locator("th[aria-sort=descending]").count() == 1
    with page.expect_download() as download:
        table.locator("xpath=../following-sibling::p[1]").get_by_role("button", name="Download CSV").click()
    assert download.value.suggested_filename == "bands.csv"
    given = pd.read_csv(io.BytesIO(Path(download.value.path()).read_bytes()))
    whole = pd.read_csv(page_file.parent / "tables" / "bands.csv")
    assert list(given.columns) == list(whole.columns)
    assert given["mean [W/m²/nm]"].is_monotonic_decreasing
    by_band = given.sort_values("band [nm]", ignore_index=True)
    pd.testing.assert_frame_equal(by_band, whole, check_dtype=False, rtol=1e-8)  # the file has nine digits


def test_rows_without_a_number_come_last_however_a_table_is_sorted(open_page, tmp_path):
    numbers = [3.0, np.nan, 1.0, np.inf, np.nan, 2.0]
    table = Table(name="gaps", caption="With gaps.", frame=pd.DataFrame({"number [1]": numbers}))
    section = Section(anchor="gaps", title="Gaps", content=ReportWriter(tmp_path).table(table))
    file = tmp_path / "index.html"
    file.write_text(page_text(title="t", lead="", sections=[section], footer=""), encoding="utf-8")
    page = open_page(file)
    for wanted in (["1", "2", "3", "–", "–", "–"], ["3", "2", "1", "–", "–", "–"]):
        page.get_by_role("button", name="number").click()
        assert page.locator("tbody td").all_inner_texts() == wanted


def test_on_a_phone_no_figure_is_cut_and_a_press_enlarges_it(open_page, page_file):
    page = open_page(page_file)
    page.set_viewport_size({"width": 420, "height": 800})
    assert page.evaluate("document.documentElement.scrollWidth") <= 420
    for plate in page.locator(".plate").all():
        if plate.is_visible():  # some are folded
            assert plate.evaluate("(node) => node.scrollWidth <= node.clientWidth")
    first = page.locator(".plate").first
    first.focus()
    page.keyboard.press("Enter")
    assert first.evaluate("(node) => node.scrollWidth > node.clientWidth")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_words_stand_out_from_the_ground_in_light_and_dark(open_page, page_file, scheme):
    page = open_page(page_file, color_scheme=scheme)
    ink, muted, ground = (
        _luminance(page, *what) for what in (("body", "color"), ("#room-help", "color"), ("body", "backgroundColor"))
    )
    assert (ground < 0.5) == (scheme == "dark")
    for words in (ink, muted):
        brighter, darker = max(words, ground), min(words, ground)
        assert (brighter + 0.05) / (darker + 0.05) >= 4.5  # WCAG 2.2, 1.4.3


def test_on_paper_the_picture_stays_and_what_cannot_be_pressed_goes(open_page, page_file):
    page = open_page(page_file)
    page.emulate_media(media="print")
    for hidden in ("#room-shown", "#room-surfaces", "#room-reset", ".room-help", "nav", "button.download"):
        assert page.locator(hidden).first.is_hidden()
    for shown in ("#room-canvas", "#room-shown-name", "#room-legend"):  # else nobody knew what the colours are
        assert page.locator(shown).is_visible()
    page.set_viewport_size({"width": 688, "height": 1017})  # of an A4 page within its margins, in CSS pixels
    chart, stage = page.locator("#room-chart svg").bounding_box(), page.locator(".room-stage").bounding_box()
    assert chart["width"] < 300  # a point's chart had the width of the page
    assert stage["y"] + stage["height"] < 1017  # on the first page
    paper = page.pdf(format="A4", print_background=True)
    assert paper.startswith(b"%PDF")
    assert 4 <= paper.count(b"/Type /Page\n") <= 14  # no blank pages in between


def _luminance(page, selector, name):
    """WCAG's relative luminance of a colour in the page."""
    color = page.eval_on_selector(selector, f"(element) => getComputedStyle(element).{name}")
    encoded = np.array([float(part) for part in re.findall(r"[\d.]+", color)[:3]]) / 255.0
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])
