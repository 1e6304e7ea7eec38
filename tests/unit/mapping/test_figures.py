"""Figures: units on every axis, the right things shown, and no trouble with odd rooms and names."""

import base64
import io
import re
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.container import ErrorbarContainer
from matplotlib.contour import ContourSet
from PIL import Image

from lidarspectra.errors import MapError
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Disc
from lidarspectra.mapping.figures.channel_figures import (
    ReportView,
    choose_points,
    reflectances_figure,
    spectra_figure,
)
from lidarspectra.mapping.figures.figure_style import (
    PAGE_DPI,
    STYLE,
    new_figure,
    page_svg,
    place,
    plain,
    prefix_of,
    save_figure,
    svg_text,
)
from lidarspectra.mapping.figures.floor_plan import AirOnLevel, FloorPlan
from lidarspectra.mapping.figures.map_figures import (
    error_figure,
    illuminance_figure,
    maps_figure,
    plan_figure,
    relative_error,
)
from lidarspectra.mapping.maps.spectral_map import spectral_map
from lidarspectra.mapping.photometry.figures import point_maps
from lidarspectra.material.material_map import Material
from lidarspectra.room.plan_cells import within_polygon
from lidarspectra.spectra.spectrum import Spectrum

SQUARE = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [0.0, 3.0]])
TABLE = np.array([[0.2, 0.2], [1.4, 0.2], [1.4, 1.0], [0.2, 1.0]])
UNIT = re.compile(r"\[[^\]]+\]")


@pytest.fixture
def plan() -> FloorPlan:
    return FloorPlan(outline=SQUARE, furniture=(TABLE,))


def _material(name: str, level: float = 0.5) -> Material:
    return Material(
        name=name,
        category="wood",
        reflectance=Spectrum(wavelengths_nm=[380.0, 780.0], values=[level, level]),
        source="builtin:x",
        provenance="measured",
        confidence=0.9,
        measured_range_nm=(400.0, 700.0),
        color=(level, level, level),
    )


def _labels(figure) -> list[str]:
    shown = []
    for axes in figure.axes:
        shown += [axes.get_xlabel(), axes.get_ylabel()]
    return [label for label in shown if label]


def test_there_is_one_panel_a_band_each_named_by_its_wavelength(make_transport, plan, bands):
    figure = maps_figure(spectral_map(make_transport()), plan)
    titles = [axes.get_title() for axes in figure.axes if axes.get_title()]
    assert titles == [f"{label} nm" for label in bands.labels]


def test_panels_show_the_numbers_of_their_own_band(make_transport, plan):
    one_map = spectral_map(make_transport())
    one_map["irradiance"][:] = 1e-3 * (1 + np.arange(14))[None, :]
    figure = maps_figure(one_map, plan)
    fields = [axes.images[0].get_array() for axes in figure.axes if axes.images]
    assert len(fields) == 14
    for number, field in enumerate(fields):
        np.testing.assert_allclose(field.compressed(), 1 + number, rtol=1e-9)  # constant readings, drawn in mW


@pytest.mark.parametrize(("count", "dots"), [(2500, 2500), (2601, 0)])
def test_so_many_points_that_they_would_cover_the_map_are_not_drawn_on_it(make_transport, plan, count, dots):
    figure = maps_figure(spectral_map(make_transport(points=count)).isel(band=[0]), plan)
    assert sum(np.shape(drawn.get_offsets())[0] for axes in figure.axes[:1] for drawn in axes.collections) == dots
    assert figure.axes[0].images
    (legend,) = figure.legends
    assert ("sensor" in [text.get_text() for text in legend.get_texts()]) == (dots > 0)


def test_the_plan_draws_some_of_many_points_and_says_so(make_transport, plan, lamps):
    figure = plan_figure(spectral_map(make_transport(points=5200)), plan, lamps)
    points = max(figure.axes[0].lines, key=lambda line: len(line.get_xdata()))
    assert len(points.get_xdata()) == 1734  # every third
    assert "5200 sensor points,\none in 3 drawn" in [
        text.get_text() for text in figure.axes[0].get_legend().get_texts()
    ]


def test_a_shared_scale_is_the_same_in_all_panels(make_transport, plan):
    one_map = spectral_map(make_transport())
    limits = {axes.images[0].get_clim() for axes in maps_figure(one_map, plan, scale="shared").axes if axes.images}
    own = {axes.images[0].get_clim() for axes in maps_figure(one_map, plan).axes if axes.images}
    assert len(limits) == 1
    assert len(own) == 14


def _cell_centers(first: float, last: float, count: int):
    return first + (np.arange(count) + 0.5) * (last - first) / count


def test_no_map_is_drawn_inside_what_is_solid_and_the_height_is_said(make_transport, plan):
    one_map = spectral_map(make_transport())
    is_air = np.ones((30, 30), dtype=np.bool_)
    is_air[2:10, 2:14] = False  # the table, as if it were a cupboard
    air = AirOnLevel(height_m=0.3, lowest=np.array([0.05, 0.05]), cell_m=0.1, is_air=is_air)
    solid = FloorPlan(outline=SQUARE, furniture=(TABLE,), air=air)
    drawings = {
        "maps": maps_figure(one_map, solid),
        "error": error_figure(one_map, solid),
        "illuminance": illuminance_figure(one_map, solid, np.linspace(100, 500, 176)),
    }
    for name, figure in drawings.items():
        field = next(axes.images[0] for axes in figure.axes if axes.images)
        left, right, bottom, top = field.get_extent()
        down, across = field.get_array().shape
        columns, rows = _cell_centers(left, right, across), _cell_centers(bottom, top, down)
        x, y = np.meshgrid(columns, rows)
        inside = (x > 0.25) & (x < 1.35) & (y > 0.25) & (y < 0.95)
        assert np.ma.getmaskarray(field.get_array())[inside].all(), name
        assert not np.ma.getmaskarray(field.get_array())[(x > 1.6) & (y > 1.2)].any(), name
        words = [axes.get_title() for axes in figure.axes] + [
            legend.get_title().get_text() for legend in figure.legends
        ]
        assert any("0.30 m above the floor" in each for each in words), name
        shown = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
        assert {"walls", "furniture", "solid or unknown"} <= set(shown), name


def test_every_room_of_a_scan_has_its_map_from_its_own_points(make_transport):
    one_map = spectral_map(make_transport())  # from .15 to 2.85 m
    left, right = (np.array([[x, 0.0], [x + 1.4, 0.0], [x + 1.4, 3.0], [x, 3.0]]) for x in (0.0, 1.6))
    lux = np.where(one_map["x"].to_numpy() < 1.5, 400.0, 5.0)
    figure = illuminance_figure(one_map, FloorPlan(outline=left, other_outlines=(right,)), lux)
    field = next(axes.images[0] for axes in figure.axes if axes.images)
    first, last, bottom, top = field.get_extent()
    down, across = field.get_array().shape
    x, y = np.meshgrid(_cell_centers(first, last, across), _cell_centers(bottom, top, down))
    for walls, level in ((left, 400.0), (right, 5.0)):
        within = within_polygon(np.stack([x.ravel(), y.ravel()], axis=1), walls).reshape(x.shape)
        values = field.get_array()[within]
        assert not np.ma.getmaskarray(values).any()
        np.testing.assert_allclose(values, level, rtol=1e-6)  # up to the wall between them, too


def test_isolux_lines_end_at_the_walls(make_transport):
    corner = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 3.0], [1.5, 3.0], [1.5, 1.5], [0.0, 1.5]])  # of an L
    figure = illuminance_figure(spectral_map(make_transport()), FloorPlan(outline=corner), np.linspace(100, 500, 176))
    lines = next(each for each in figure.axes[0].collections if isinstance(each, ContourSet))
    points = np.concatenate([path.vertices for path in lines.get_paths() if len(path.vertices)])
    assert len(points) > 20
    assert not ((points[:, 0] < 1.45) & (points[:, 1] > 1.55)).any()


def test_maps_of_shape_show_what_differs_between_the_bands_alone(make_transport, plan):
    one_map = spectral_map(make_transport())
    place = np.linspace(1.0, 2.0, 176)
    light = place[:, None] * np.arange(1.0, 15.0)[None, :]  # the same shape, fourteen levels
    light[:, 3] *= np.where(place > 1.5, 1.2, 0.8)
    one_map["irradiance"][:] = light
    fields = [axes.images[0].get_array() for axes in maps_figure(one_map, plan, scale="shape").axes if axes.images]
    relative = light / light.mean(axis=0)
    wanted = 100 * (relative / relative.mean(axis=1, keepdims=True) - 1)
    for number in (0, 3):
        assert fields[number].max() == pytest.approx(wanted[:, number].max(), abs=0.3)  # between points linear
        assert fields[number].min() == pytest.approx(wanted[:, number].min(), abs=0.3)
    np.testing.assert_allclose(fields[0].compressed(), fields[5].compressed(), atol=1e-9)


@pytest.mark.parametrize("kind", ["maps", "shared", "error", "illuminance", "plan", "spectra", "reflectances"])
def test_every_axis_that_is_labelled_has_its_unit(make_transport, plan, lamps, kind):
    one_map = spectral_map(make_transport())
    draw = {
        "maps": lambda: maps_figure(one_map, plan),
        "shared": lambda: maps_figure(one_map, plan, scale="shared"),
        "error": lambda: error_figure(one_map, plan, target=0.01),
        "illuminance": lambda: illuminance_figure(one_map, plan, np.linspace(100, 500, 176)),
        "plan": lambda: plan_figure(one_map, plan, lamps),
        "spectra": lambda: spectra_figure(one_map, choose_points(one_map)),
        "reflectances": lambda: reflectances_figure((_material("a"),), np.array([2.0])),
    }
    figure = draw[kind]()
    words = _labels(figure)
    assert words
    assert all(UNIT.search(label) for label in words), words
    told = [text.get_text() for legend in figure.legends for text in (legend.get_title(), *legend.get_texts())]
    if kind == "maps":
        assert any("W m⁻² nm⁻¹" in text for text in told)


def test_figures_leave_the_user_s_matplotlib_settings_alone(make_transport, plan, tmp_path):
    before = dict(mpl.rcParams)
    save_figure(maps_figure(spectral_map(make_transport(points=9)), plan), tmp_path, "maps")
    assert dict(mpl.rcParams) == before


def test_figures_are_saved_as_png_of_200_dpi_and_svg_and_as_pdf_where_asked_for(make_transport, plan, tmp_path):
    figure = plan_figure(spectral_map(make_transport(points=9)), plan, ())
    paths = save_figure(figure, tmp_path, "plan")
    assert [path.suffix for path in paths] == [".png", ".svg"]
    with Image.open(paths[0]) as picture:
        # A pixel is cut off where the size in inches is no whole number of them.
        np.testing.assert_allclose(picture.size, figure.get_size_inches() * 200, atol=1.0)
    assert ElementTree.parse(paths[1]).getroot().tag.endswith("svg")
    assert save_figure(figure, tmp_path, "plan", kinds=["pdf"])[0].read_bytes().startswith(b"%PDF")
    with pytest.raises(MapError, match="can be written"):
        save_figure(figure, tmp_path / "nowhere", "plan")


def test_pictures_within_a_page_have_three_pixels_for_two_of_the_page_s():
    figure = new_figure(3.0, 2.0)
    place(figure, 0.5, 0.5, 2.0, 1.0).imshow(np.random.default_rng(1).random((50, 100)), aspect="auto")
    picture = re.search(r'base64,\s*([^"]+)"', svg_text(figure))
    assert picture is not None
    width, height = Image.open(io.BytesIO(base64.b64decode(picture[1]))).size
    assert (width, height) == pytest.approx((2.0 * PAGE_DPI, 1.0 * PAGE_DPI), abs=2)


def test_the_same_numbers_give_the_same_files(make_transport, plan, tmp_path):
    contents = []
    for run in ("first", "second"):
        (tmp_path / run).mkdir()
        figure = error_figure(spectral_map(make_transport(points=25)), plan)
        contents.append(
            [path.read_bytes() for path in save_figure(figure, tmp_path / run, "error", kinds=["png", "svg", "pdf"])]
        )
        contents[-1].append(page_svg(svg_text(figure), name="error", label="x").encode())
    assert contents[0] == contents[1]


@pytest.mark.parametrize("count", [1, 3, 4])
def test_a_room_with_few_points_has_figures_too(make_transport, plan, lamps, count):
    one_map = spectral_map(make_transport(points=count))
    assert maps_figure(one_map, plan).axes
    assert error_figure(one_map, plan).axes
    assert illuminance_figure(one_map, plan, np.full(count, 200.0)).axes
    assert plan_figure(one_map, plan, lamps).axes
    assert spectra_figure(one_map, choose_points(one_map)).axes


def test_a_map_of_buried_points_still_has_figures(make_transport, plan, lamps):
    one_map = spectral_map(make_transport(points=9, buried=tuple(range(9))))
    assert maps_figure(one_map, plan).axes
    assert error_figure(one_map, plan).axes
    assert plan_figure(one_map, plan, lamps).axes
    assert choose_points(one_map) == ()


def test_a_dark_room_has_figures(make_transport, plan):
    one_map = spectral_map(make_transport())
    one_map["irradiance"][:] = 0.0
    one_map["irradiance_se"][:] = 0.0
    assert maps_figure(one_map, plan).axes
    assert maps_figure(one_map, plan, scale="shared").axes
    assert error_figure(one_map, plan).axes
    assert illuminance_figure(one_map, plan, np.zeros(176)).axes
    assert spectra_figure(one_map, choose_points(one_map)).axes


@pytest.mark.parametrize("size", [(12.0, 2.0), (2.0, 12.0)])
def test_long_and_deep_rooms_fit_on_the_page(make_transport, lamps, size):
    outline = SQUARE / 3.0 * np.array(size)
    one_map = spectral_map(make_transport())
    spread = one_map.assign_coords(
        x=("point", one_map["x"].to_numpy() / 3 * size[0], one_map["x"].attrs),
        y=("point", one_map["y"].to_numpy() / 3 * size[1], one_map["y"].attrs),
    )
    for figure in (
        maps_figure(spread, FloorPlan(outline=outline)),
        plan_figure(spread, FloorPlan(outline=outline), lamps),
    ):
        width, height = figure.get_size_inches()
        assert width <= 10.0
        assert 1.0 < height < 14.0  # one printed page and a little


def test_many_bands_are_thinned_out_and_it_says_so(make_transport, plan):
    one_map = spectral_map(make_transport(points=16))
    many = one_map.isel(band=np.arange(60) % 14)
    many = many.assign_coords(
        band=("band", 400.0 + 5 * np.arange(60), one_map["band"].attrs),
        band_label=("band", [f"{400 + 5 * i}" for i in range(60)]),
    )
    figure = maps_figure(many, plan)
    assert sum(bool(axes.images) for axes in figure.axes) == 24
    told = [text.get_text() for text in figure.texts] + [legend.get_title().get_text() for legend in figure.legends]
    assert any("24 of 60 bands" in text for text in told)


def test_names_from_users_cannot_upset_a_figure(make_transport, plan, lamps):
    odd = "\x00$\\frac{$ <b>&\n電灯 🎉 " + "long " * 40
    lamp = lamps[0]
    named = Lamp(name=odd, shape=Disc(0.2), center=lamp.center, flux=lamp.flux, normal=np.array([0.0, 0.0, -1.0]))
    one_map = spectral_map(make_transport(points=9))
    for figure in (
        plan_figure(one_map, plan, (named,) * 30),
        reflectances_figure((_material(odd),), np.array([1.0])),
    ):
        svg = page_svg(svg_text(figure), name="odd", label=odd)
        ElementTree.fromstring(svg)
        assert "<b>" not in svg


def test_plain_words_are_one_line_of_letters_that_can_be_drawn():
    assert plain("a\n b\t c") == "a b c"
    assert plain("電 lamp") == "□ lamp"
    assert len(plain("x" * 500)) == 40


@pytest.mark.parametrize(
    "acting",
    [
        "<SCRIPT>b()</SCRIPT>",
        '<script xmlns="">b()</script>',
        '<g ONLOAD="b()"/>',
        '<a><animate attributeName="href" values="javascript:b()"/><path d="M0 0"/></a>',
        '<set attributeName="onclick" to="b()"/>',
        '<use href="data:image/svg+xml,b()#c"/>',
        '<rect style="fill: URL(https://b().example)"/>',
        "<rect filter=\"url( 'https://b().example/f')\"/>",
        '<rect style="fill: u\\72l(https://b().example)"/>',
        "<h:p xmlns:h='http://www.w3.org/1999/xhtml'>b()</h:p>",
        "<metadata>b()</metadata>",
        "<style>b()</style>",
    ],
)
def test_of_a_kept_svg_only_shapes_come_into_the_page(acting: str) -> None:
    svg = f'<svg xmlns="http://www.w3.org/2000/svg" width="72pt"><g>{acting}<path id="known" d="M0 0"/></g></svg>'
    page = page_svg(svg, name="kept", label="x")
    assert "b()" not in page
    assert 'id="kept-known"' in page
    assert "max-width: 100px" in page


def test_nothing_that_our_figures_draw_is_dropped(make_transport, plan) -> None:
    svg = svg_text(maps_figure(spectral_map(make_transport(points=25)), plan))
    page = page_svg(svg, name="maps", label="x")
    for tag in ("g", "path", "use", "image", "rect", "pattern", "clipPath"):
        given = len(re.findall(f"<{tag}[ />]", svg))
        assert len(re.findall(f"<{tag}[ />]", page)) == given > 0
    assert page.count("url(#maps-") == svg.count("url(#")


def test_of_shapes_of_one_name_the_first_has_it() -> None:
    svg = '<svg xmlns="http://www.w3.org/2000/svg" width="72pt"><path id="m" d="M0 0"/><path id="m" d="M1 1"/></svg>'
    assert page_svg(svg, name="kept", label="x").count('id="kept-m"') == 1


@pytest.mark.parametrize(
    "svg", ['<svg width="72pt"/>', '<svg xmlns="http://www.w3.org/2000/svg" width="210mm"/>', "<html/>"]
)
def test_what_is_no_figure_of_ours_is_refused(svg: str) -> None:
    with pytest.raises(ValueError, match="whose width is in pt"):
        page_svg(svg, name="kept", label="x")


def test_of_a_kept_svg_nothing_acts_and_nothing_outside_is_asked_for() -> None:
    svg = (
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" width="72pt" onload="a()">'
        '<script>b()</script><foreignObject><p>c</p></foreignObject><a xlink:href="javascript:d()"><path d="M0 0"/></a>'
        '<image href="https://example.org/e.png"/><image href="data:image/png;base64,AA=="/><use href="#f"/></svg>'
    )
    page = page_svg(svg, name="kept", label="x")
    for word in ("onload", "script", "foreignObject", "example.org"):
        assert word not in page
    assert "data:image/png;base64,AA==" in page
    assert 'href="#kept-f"' in page


def test_inline_svg_takes_the_page_s_colours_and_refers_to_nothing_outside(make_transport, plan):
    svg = page_svg(svg_text(maps_figure(spectral_map(make_transport(points=25)), plan)), name="maps", label='a "label"')
    root = ElementTree.fromstring(svg)
    assert root.get("role") == "img"
    assert root.get("aria-label") == 'a "label"'
    assert "currentColor" in svg
    assert "#1d2126" not in svg
    assert "<!--" not in svg
    assert "<script" not in svg
    assert "<style" not in svg
    ids = {element.get("id") for element in root.iter()} - {None}
    assert all(name.startswith("maps-") for name in ids)
    links = [value for element in root.iter() for key, value in element.attrib.items() if key.endswith("href")]
    assert links
    assert all(link.startswith("data:image/png;base64,") or link[1:] in ids for link in links)
    clips = re.findall(r"url\(#([^)]+)\)", svg)
    assert clips
    assert set(clips) <= ids


def test_the_points_chosen_are_those_that_are_named(make_transport):
    one_map = spectral_map(make_transport(buried=(90,)))
    one_map["irradiance"][90] *= 1e-3  # buried and darkest: must not be chosen
    x, y = one_map["x"].to_numpy(), one_map["y"].to_numpy()
    covered = (x > 0.2) & (x < 1.4) & (y > 0.2) & (y < 1.0)
    points = {point.reason: point.index for point in choose_points(one_map, covered)}
    total = one_map["irradiance"].sum("band").to_numpy()
    kept = np.delete(np.arange(176), 90)
    assert points["highest"] == kept[total[kept].argmax()]
    assert points["lowest under furniture"] == kept[total[kept].argmin()]
    assert not covered[points["lowest in the open"]]
    assert sorted(total[list(points.values())])[::-1] == list(total[list(points.values())])


def test_without_furniture_there_is_a_plain_lowest_point(make_transport):
    reasons = [point.reason for point in choose_points(spectral_map(make_transport()))]
    assert reasons == ["highest", "median", "lowest"]


def test_a_channel_without_light_does_not_hide_what_differs_between_the_others(plan, make_transport):
    one_map = spectral_map(make_transport())
    dark = one_map.copy(deep=True)
    for name in ("irradiance", "irradiance_se"):
        dark[name][:, 3] = 1e-80
    titles = {axes.get_title() for axes in maps_figure(dark, plan, scale="shape").axes} - {""}
    assert "485 nm" not in titles
    assert len(titles) == 13
    without = one_map.isel(band=np.delete(np.arange(14), 3))
    bars = [maps_figure(each, plan, scale="shape").axes[-1].get_ylim() for each in (dark, without)]
    assert bars[0] == pytest.approx(bars[1])


def test_a_map_without_light_is_drawn_in_the_colour_of_none(plan, make_transport):
    none = spectral_map(make_transport()) * 0.0
    for name, units in (("irradiance", "W m-2 nm-1"), ("irradiance_se", "W m-2 nm-1"), ("illuminance", "lx")):
        none[name].attrs["units"] = units
    none["illuminance_se"].attrs["units"] = "lx"
    for axes in maps_figure(none, plan, scale="shared").axes:
        for image in axes.images:
            assert image.norm(0.0) == 0.0


def test_bars_reach_no_lower_than_no_light(make_transport):
    one_map = spectral_map(make_transport())
    one_map["irradiance_se"][:] = 2.0 * one_map["irradiance"]
    axes = spectra_figure(one_map, choose_points(one_map)).axes[0]
    assert axes.get_ylim()[0] == 0.0
    bars = [bar for bar in axes.containers if isinstance(bar, ErrorbarContainer)]
    lowest = min(bottom[1] for bar in bars for bottom, _ in bar.lines[2][0].get_segments())
    assert lowest == pytest.approx(0.0, abs=1e-9)


def test_error_bars_are_two_standard_errors(make_transport):
    one_map = spectral_map(make_transport())
    points = choose_points(one_map)
    figure = spectra_figure(one_map, points)
    (drawn,) = figure.axes[0].containers[:1]
    assert isinstance(drawn, ErrorbarContainer)
    bars = drawn.lines[2][0].get_segments()
    half = [0.5 * (top[1] - bottom[1]) for bottom, top in bars]
    np.testing.assert_allclose(half, 2e3 * one_map["irradiance_se"].to_numpy()[points[0].index], rtol=1e-9)  # in mW


def test_only_the_measured_part_of_a_reflectance_is_a_full_line():
    figure = reflectances_figure((_material("a"),), np.array([1.0]))
    full, dashed = figure.axes[0].lines
    assert full.get_linestyle() == "-"
    x = full.get_xdata()[np.isfinite(full.get_ydata())]
    assert (x.min(), x.max()) == (400.0, 700.0)
    outside = dashed.get_xdata()[np.isfinite(dashed.get_ydata())]
    assert np.all((outside < 400.0) | (outside > 700.0))


def test_materials_are_drawn_by_area_and_numbered_as_a_file_of_assignments_names_them():
    materials = (_material("small"), _material("middling"), _material("large"))
    figure = reflectances_figure(materials, np.array([1.0, 3.0, 6.0]))
    texts = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert [text.split()[:2] for text in texts] == [["2", "large"], ["1", "middling"], ["0", "small"]]
    assert "60%" in texts[0]
    assert [text.get_text() for text in figure.axes[0].texts] == ["2", "1", "0"]


def test_lamps_are_drawn_where_they_hang_in_their_true_size(make_transport, plan, lamps):
    figure = plan_figure(spectral_map(make_transport()), plan, lamps[:1])
    shapes = [patch.get_xy() for patch in figure.axes[0].patches if hasattr(patch, "get_xy")]
    corners = [np.unique(np.round(shape, 9), axis=0) for shape in shapes]
    wanted = np.array([[0.6, 1.2], [0.6, 1.8], [1.2, 1.2], [1.2, 1.8]])
    assert any(shape.shape == wanted.shape and np.allclose(shape, wanted) for shape in corners)


def test_relative_error_is_over_the_mean_of_the_band(make_transport):
    one_map = spectral_map(make_transport(buried=(0,)))
    one_map["irradiance"][0] = 1e3
    kept = one_map.isel(point=slice(1, None))
    wanted = one_map["irradiance_se"].to_numpy() / kept["irradiance"].mean("point").to_numpy()
    np.testing.assert_allclose(relative_error(one_map), wanted, rtol=1e-12)


@pytest.mark.parametrize(
    ("values", "symbol"), [([5.0], ""), ([0.0], ""), ([2e-3, 1e-9], "m"), ([3e-5], "µ"), ([1e-9], "n"), ([1e-12], "n")]
)
def test_prefixes_bring_numbers_near_one(values, symbol):
    assert prefix_of(values).symbol == symbol


def test_an_outline_that_is_no_polygon_is_refused():
    with pytest.raises(MapError, match="three or more corners"):
        FloorPlan(outline=SQUARE[:2])


@pytest.mark.parametrize("image", [np.zeros((4, 4), np.uint8), np.zeros((4, 4, 3)), np.zeros((0, 4, 3), np.uint8)])
def test_a_picture_that_is_none_is_refused(image):
    with pytest.raises(MapError, match="uint8 image"):
        ReportView(name="east", image=image)


def test_nothing_to_draw_is_an_error_not_an_empty_picture(make_transport):
    with pytest.raises(MapError, match="at least one point"):
        spectra_figure(spectral_map(make_transport(points=9)), ())
    with pytest.raises(MapError, match="one or more materials"):
        reflectances_figure((), np.empty(0))


def test_maps_of_points_have_the_house_style_and_plain_thousands_beside_them(plan, make_transport):
    one_map = spectral_map(make_transport())
    values = one_map.assign(hours=("point", np.linspace(0.0, 3200.0, 176)))
    figure = point_maps(values, plan, {"hours": "hours [h]"})
    map_axes, bar = figure.axes
    assert map_axes.title.get_fontsize() == STYLE["axes.titlesize"]
    figure.canvas.draw()
    assert "2000" in [label.get_text() for label in bar.get_yticklabels()]


@pytest.mark.parametrize(
    ("way", "words"), [((0, 0, 1), ""), ((0, 0, -1), "looking down"), ((0, 1, 0), "looking along (0, 1, 0)")]
)
def test_a_map_says_where_its_points_look_unless_it_is_up(plan, make_transport, way, words):
    one_map = spectral_map(make_transport(points=25))
    look = zip(("nx", "ny", "nz"), way, strict=True)
    turned = one_map.assign_coords({n: ("point", np.full(25, float(part)), one_map[n].attrs) for n, part in look})
    title = illuminance_figure(turned, plan, turned["illuminance"].to_numpy()).axes[0].get_title()
    assert title == ", ".join(filter(None, ["illuminance", words]))


def test_maps_of_points_of_several_planes_say_which_they_show(plan, make_transport):
    one_map = spectral_map(make_transport(points=25))
    look = np.where(np.arange(25) < 16, 0.0, 1.0)  # nine look up, sixteen along x
    mixed = one_map.assign_coords(
        nx=("point", 1.0 - look, one_map["nx"].attrs), nz=("point", look, one_map["nz"].attrs)
    )
    words = [[text.get_text() for text in point_maps(each, plan, {"illuminance": "illuminance [lx]"}).texts] +
             [legend.get_title().get_text() for legend in point_maps(each, plan, {"illuminance": "E [lx]"}).legends]
             for each in (one_map, mixed)]  # fmt: skip
    assert not any("points" in each for each in words[0])
    assert any(" ".join(each.split()) == "16 of 25 points: z 0.30 m, looking along (1, 0, 0)" for each in words[1])
