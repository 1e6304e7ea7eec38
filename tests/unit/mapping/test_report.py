"""The report: whole, self-contained, and deaf to what users write into names."""

import base64
import hashlib
import re
from dataclasses import replace
from html.parser import HTMLParser
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from lidarspectra.errors import ArrayError, MapError
from lidarspectra.mapping.figures.figure_style import new_figure
from lidarspectra.mapping.figures.floor_plan import FloorPlan
from lidarspectra.mapping.figures.tables import table_html
from lidarspectra.mapping.maps.spectral_map import spectral_map
from lidarspectra.mapping.report import report_writer
from lidarspectra.mapping.report.key_figures import key_figures
from lidarspectra.mapping.report.report import ReportInput, ReportView, StageRow, write_report
from lidarspectra.mapping.report.report_sections import illuminance_section, light_of_report, maps_section
from lidarspectra.mapping.report.report_tables import materials_table
from lidarspectra.mapping.report.report_writer import ReportWriter
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.workflow.report.report_of_run import kept_svg

OWN_SCRIPTS = (
    "three.js", "room-picture.js", "room-light.js", "room-chart.js", "room-lamps.js", "room-view.js", "script.js"
)  # fmt: skip
VOID = {"area", "base", "br", "col", "embed", "hr", "img", "input", "link", "meta", "source", "track", "wbr"}
HOSTILE = "\"><script>alert(1)</script><img src=x onerror=alert(2)>\x00' & </style></script>"


class _Page(HTMLParser):
    """Tags, attributes and words of a page; counts tags that are closed out of order."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.open: list[str] = []
        self.wrong = 0
        self.text = ""

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        if self.open and self.open[-1] == tag:
            self.open.pop()
        else:
            self.wrong += 1

    def handle_data(self, data):
        self.text += data


@pytest.fixture(scope="module")
def report(make_transport, make_report) -> ReportInput:
    """A small room of two bands, quick to draw."""
    return make_report(make_transport(points=36, buried=(9,)).isel(band=[1, 5]))


@pytest.fixture(scope="module")
def whole(make_transport, make_report, tmp_path_factory):
    """The folder of a report of all bands, written once."""
    folder = tmp_path_factory.mktemp("whole")
    report = make_report(make_transport(points=64, buried=(9,)))
    write_report(folder, replace(report, figure_files=("svg", "png")))
    return folder


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures are made and not drawn, for a page whose words are read: `whole` and `written` hold drawings."""
    svg = '<svg xmlns="http://www.w3.org/2000/svg" width="72pt" height="72pt" viewBox="0 0 72 72"/>'
    monkeypatch.setattr(report_writer, "svg_text", lambda figure: svg)


@pytest.fixture(scope="module")
def written(report, tmp_path_factory) -> tuple[Path, list[float]]:
    """The page of the small room, written once, and the progress that was told meanwhile."""
    heard: list[float] = []
    page = write_report(
        tmp_path_factory.mktemp("small"), report, progress=lambda fraction, message: heard.append(fraction)
    )
    return page, heard


def _read(path) -> tuple[str, _Page]:
    text = path.read_text(encoding="utf-8")
    page = _Page()
    page.feed(text)
    return text, page


def test_the_report_tells_of_everything_it_was_given(whole):
    text, page = _read(whole / "index.html")
    for words in ("Office", "scan.glb", "1 of 64 points is buried", "100 triangles", "panel 2", "wall", "east", "9.9.9",
                  "ultra, at most 20 reflections", "target 1 %, met", "0.4", "lx"):  # fmt: skip
        assert words in page.text or any(words in str(value) for _, attrs in page.tags for value in attrs.values())
    titles = ["Mean illuminance", "Uniformity U0", "Melanopic EDI", "Room in 3D", "Summary", "Spectral maps", "Spectra",
              "Accuracy", "Lamps and sensors", "Materials", "Views", "Scan", "All points", "Provenance",
              "Time and memory"]  # fmt: skip
    assert all(title in page.text for title in titles)
    headings = re.findall(r"<h2 [^>]*>(.*?)</h2>", text)
    assert (headings[0], headings[-1]) == ("Room in 3D", "Time and memory")  # the room first, tables of time last
    assert text.index('class="facts"') < text.index("<h2")


def test_the_page_is_well_formed_and_every_link_inside_it_leads_somewhere(whole):
    _, page = _read(whole / "index.html")
    assert page.wrong == 0
    assert page.open == []
    ids = [attrs["id"] for _, attrs in page.tags if "id" in attrs]
    assert len(ids) == len(set(ids))
    inside = [attrs["href"] for tag, attrs in page.tags if tag == "a" and str(attrs["href"]).startswith("#")]
    assert len(inside) > 10
    assert {link[1:] for link in inside} <= set(ids)
    beside = [attrs["href"] for tag, attrs in page.tags if tag == "a" and not str(attrs["href"]).startswith("#")]
    assert beside
    assert all((whole / link).is_file() for link in beside)


def test_the_page_loads_nothing_from_anywhere(whole):
    text, page = _read(whole / "index.html")
    for tag, attrs in page.tags:
        assert tag not in {"link", "iframe", "object", "embed", "base", "form"}
        source = attrs.get("src") or ""
        assert not source or source.startswith("data:image/")
        if tag in ("image", "use"):
            link = attrs.get("xlink:href") or attrs.get("href") or ""
            assert link.startswith(("data:image/", "#"))
    assert not re.search(r"url\((?!#)", text)
    assert "@import" not in text
    names = {f"http://www.w3.org/{name}" for name in ("2000/svg", "1999/xlink", "1999/xhtml")}  # of XML, not addresses
    credit = {"https://threejs.org"}  # in the comment that holds its licence
    assert set(re.findall(r"https?://[^\s\"'<]+", text)) <= names | credit


def test_only_our_own_script_may_run(whole):
    text, page = _read(whole / "index.html")
    scripts = re.findall(r"<script>(.*?)</script>", text, flags=re.DOTALL)
    folder = resources.files("lidarspectra.mapping.report") / "page"
    assert scripts == [(folder / name).read_text(encoding="utf-8") for name in OWN_SCRIPTS]
    digests = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    policy = next(attrs["content"] for tag, attrs in page.tags if "http-equiv" in attrs)
    assert policy.partition("script-src ")[2].split() == [f"'sha256-{digest}'" for digest in digests]
    assert "default-src 'none'" in policy


def test_words_from_users_stay_words_wherever_they_stand(report, lamps, make_material, tmp_path):
    named = tuple(replace(lamp, name=HOSTILE if number else lamp.name) for number, lamp in enumerate(lamps))
    hostile = replace(
        report,
        title=HOSTILE,
        lamps=named,
        scan=replace(report.scan, file=HOSTILE, unit=HOSTILE, up_axis=HOSTILE, notes=(HOSTILE,)),
        materials=(make_material(HOSTILE), make_material("floor")),
        views=(ReportView(name=HOSTILE, image=report.views[0].image),),
        view_notes=HOSTILE,
        room_notes=HOSTILE,
        stages=(StageRow(stage=HOSTILE, summary=HOSTILE, seconds=1.0, peak_memory_mib=1.0),),
        warnings=(HOSTILE,),
        provenance={HOSTILE: HOSTILE, "lidarspectra": HOSTILE},
        run_file=HOSTILE,
    )
    text, page = _read(write_report(tmp_path, hostile))
    assert [tag for tag, _ in page.tags].count("script") == len(OWN_SCRIPTS) + 1  # and the 3D view's data
    assert page.wrong == 0
    assert not [key for _, attrs in page.tags for key in attrs if key.startswith("on")]
    assert "\x00" not in text
    assert page.text.count("<script>alert(1)</script>") >= 10
    assert {path.name for path in tmp_path.iterdir()} == {"index.html", "figures", "tables"}


def test_every_figure_lies_beside_the_page_in_the_kinds_asked_for_and_every_table_in_three_forms(whole):
    figures = {"maps", "maps-shared", "maps-shape", "spectra", "illuminance", "standard-error", "plan", "reflectances"}
    assert {path.name for path in (whole / "figures").iterdir()} == {
        f"{name}.{kind}" for name in figures for kind in ("svg", "png")
    }
    tables = {"stages", "bands", "chosen-points", "lamps", "materials", "scan", "points", "provenance", "trust"}
    assert {path.name for path in (whole / "tables").iterdir()} == {
        f"{name}.{kind}" for name in tables for kind in ("csv", "md", "html")
    }


def test_the_same_run_gives_the_same_page(report, written, tmp_path):
    assert write_report(tmp_path, report).read_bytes() == written[0].read_bytes()


def test_maps_drawn_beside_the_page_are_those_drawn_for_it(report, tmp_path):
    pages = [write_report(tmp_path / str(workers), report, workers=workers) for workers in (1, 2)]
    assert pages[0].read_bytes() == pages[1].read_bytes()
    files = [{path.name: path.read_bytes() for path in (page.parent / "figures").iterdir()} for page in pages]
    assert files[0] == files[1]


@pytest.mark.parametrize("workers", [1, 2])
def test_figures_made_beside_the_others_stand_in_their_own_sections(report, tmp_path, workers):
    text = write_report(tmp_path, report, workers=workers).read_text(encoding="utf-8")
    sections = {part.split('"', 1)[0]: part for part in text.split('<section id="')[1:]}
    for anchor, names in {
        "spectral-maps": ["maps", "maps-shared", "maps-shape"],
        "accuracy": ["standard-error"],
        "materials": ["reflectances"],
    }.items():
        found = re.findall(r'<figure id="figure-([\w-]+)"', sections[anchor])
        assert found[: len(names)] == names


def test_figures_are_numbered_in_the_order_of_the_page(written):
    numbers = re.findall(r"<b>Figure (.*?)\.</b>", written[0].read_text(encoding="utf-8"))
    assert numbers == [str(number) for number in range(1, len(numbers) + 1)]
    assert len(numbers) > 5


@pytest.mark.usefixtures("undrawn")
def test_a_bare_report_leaves_out_what_it_does_not_have(report, tmp_path):
    bare = replace(
        report, materials=(), material_areas_m2=np.empty(0), lamps=(), surfaces=None, views=(), stages=(), warnings=(),
        provenance={}, run_file="",
    )  # fmt: skip
    _, page = _read(write_report(tmp_path, bare))
    assert page.wrong == 0
    assert "Please note" not in page.text


@pytest.mark.slow
@pytest.mark.usefixtures("undrawn")
def test_without_lamp_spectra_illuminance_comes_from_the_bands_and_says_so(make_transport, make_report, tmp_path):
    _, page = _read(write_report(tmp_path, make_report(make_transport(points=16), lamps=())))
    assert "from the channels alone" in page.text


@pytest.mark.usefixtures("undrawn")
def test_a_report_of_buried_points_says_that_none_can_be_trusted(report, make_transport, tmp_path):
    transport = make_transport(points=9, buried=tuple(range(9)))
    transport = transport.isel(band=[1, 5])
    buried = replace(report, transport=transport, spectral_map=spectral_map(transport))
    _, page = _read(write_report(tmp_path, buried))
    assert "no spectrum is meaningful" in page.text
    assert "9 buried" in page.text


def test_bands_that_cannot_follow_the_eye_give_no_illuminance_and_say_why(written):
    _, page = _read(written[0])
    assert "no illuminance can be computed" in page.text


@pytest.mark.usefixtures("undrawn")
def test_points_on_several_levels_are_said_to_be(report, tmp_path):
    one_map = report.spectral_map
    height = one_map["z"].to_numpy().copy()
    height[:20] = 1.1
    _, page = _read(
        write_report(tmp_path, replace(report, spectral_map=one_map.assign_coords(z=("point", height, {"units": "m"}))))
    )
    assert "2 groups that differ in height or direction" in page.text


@pytest.mark.usefixtures("undrawn")
def test_a_target_that_was_not_reached_is_said_so(report, tmp_path):
    noisy = report.transport.assign_attrs(achieved_relative_se=0.02)
    _, page = _read(write_report(tmp_path, replace(report, transport=noisy)))
    assert "target 1 %, not met" in page.text


@pytest.mark.usefixtures("undrawn")
def test_points_that_missed_a_target_of_their_own_are_named(report, tmp_path):
    missed = np.zeros(report.transport.sizes["point"], dtype=bool)
    met = report.transport.assign(missed_target=("point", missed))
    _, page = _read(write_report(tmp_path / "met", replace(report, transport=met)))
    assert "target 1 % of each point's own light, met" in page.text
    assert f"none of {missed.size}" in page.text
    missed[[3, 5]] = True
    transport = report.transport.assign(missed_target=("point", missed))
    _, page = _read(write_report(tmp_path / "missed", replace(report, transport=transport)))
    assert "target 1 % of each point's own light, not met" in page.text
    x, y, z = (float(transport[axis][5]) for axis in "xyz")
    assert f"2 of {missed.size}, numbered as in the room in 3D: 4 at" in page.text
    assert f"6 at ({x:.2f}, {y:.2f}, {z:.2f}) m." in page.text


@pytest.mark.usefixtures("undrawn")
def test_a_run_by_plain_rtrace_says_so_and_that_it_does_not_know_what_is_missing(report, tmp_path):
    plain = report.transport.drop_vars("truncation", errors="ignore").assign_attrs(method="rtrace")
    plain.attrs.pop("truncated_share", None)
    _, page = _read(write_report(tmp_path, replace(report, transport=plain)))
    assert "missing, and not estimated by plain runs of rtrace" in page.text


def test_progress_ends_at_one(written):
    _, heard = written
    assert heard == sorted(heard)
    assert heard[0] == 0.0
    assert heard[-1] == 1.0


def test_a_folder_that_cannot_be_made_is_one_clear_error(report, tmp_path):
    (tmp_path / "file").write_text("in the way", encoding="utf-8")
    with pytest.raises(MapError, match="can be written"):
        write_report(tmp_path / "file", report)


def test_materials_have_the_numbers_by_which_a_file_of_assignments_names_them(make_material) -> None:
    materials = [make_material("small"), make_material("large"), make_material("middle")]
    frame = materials_table(materials, np.array([1.0, 9.0, 4.0]), np.array([410.0, 560.0])).frame
    assert dict(zip(frame["material"], frame["group"], strict=True)) == {"large": 1, "middle": 2, "small": 0}
    assert frame["area [m²]"].tolist() == [9.0, 4.0, 1.0]


def test_materials_have_the_standard_deviation_of_their_reflectances_where_one_is_stated(make_material) -> None:
    told = replace(
        make_material("told"),
        uncertainty=Spectrum(wavelengths_nm=np.array([400.0, 800.0]), values=np.array([0.02, 0.04])),
    )
    materials = [told, replace(make_material("given"), uncertainty=None)]
    table = materials_table(materials, np.array([2.0, 1.0]), np.array([400.0, 800.0]))
    assert table.frame["its deviation [1]"].tolist() == pytest.approx([0.03, np.nan], nan_ok=True)
    assert ">0.03<" in table_html(table)
    assert ">–<" in table_html(table)


def test_areas_that_do_not_fit_the_materials_are_refused(report):
    with pytest.raises(ArrayError, match="material_areas_m2"):
        replace(report, material_areas_m2=np.array([1.0]))


def test_a_figure_that_is_drawn_already_is_shown_as_it_is_and_drawn_again_for_files_of_other_kinds(tmp_path) -> None:
    svg = '<svg xmlns="http://www.w3.org/2000/svg" width="72pt"><path id="known" d="M0 0"/></svg>'
    again: list[Figure] = []

    def draw() -> Figure:
        again.append(new_figure(1.0, 1.0))
        return again[0]

    only_svg = ReportWriter(tmp_path / "svg")
    page = only_svg.drawn("kept", svg, draw, "A caption.")
    only_svg.finish()
    assert 'id="kept-known"' in page
    assert "A caption." in page
    assert (tmp_path / "svg" / "figures" / "kept.svg").read_text(encoding="utf-8") == svg
    assert not again
    both = ReportWriter(tmp_path / "both", ("svg", "png"))
    both.drawn("kept", svg, draw, "A caption.")
    both.finish()
    assert len(again) == 1
    assert (tmp_path / "both" / "figures" / "kept.png").is_file()
    only_png = ReportWriter(tmp_path / "png", ("png",))
    assert 'id="kept-known"' in only_png.drawn("kept", svg, draw, "A caption.")
    only_png.finish()
    assert [path.name for path in (tmp_path / "png" / "figures").iterdir()] == ["kept.png"]


def test_a_drawing_of_an_earlier_stage_that_is_missing_damaged_or_saved_by_another_program_is_none(tmp_path) -> None:
    path = tmp_path / "segmentation.svg"
    assert kept_svg(path) == ""
    measured = '<svg xmlns="http://www.w3.org/2000/svg" width="{}"/>'
    for content in ("<svg><path></svg>", "\xff\xfe", "", "<html/>", measured.format("210mm"), measured.format("xpt")):
        path.write_bytes(content.encode("latin-1"))
        assert kept_svg(path) == ""
    svg = measured.format("72pt")
    path.write_text(svg, encoding="utf-8")
    assert kept_svg(path) == svg


@pytest.mark.usefixtures("undrawn")
def test_the_illuminance_map_s_uniformity_is_of_the_points_that_it_shows(make_transport, make_report, tmp_path) -> None:
    transport = make_transport()
    normals = np.tile([0.0, 0.0, 1.0], (176, 1))
    normals[:3] = [0.0, 0.0, -1.0]  # three look down, in the dark
    dark = transport["coefficient"].copy()
    dark.loc[{"point": slice(0, 2)}] = 1e-6
    mixed = transport.assign(coefficient=dark).assign_coords(
        {name: ("point", normals[:, axis]) for axis, name in enumerate(("nx", "ny", "nz"))}
    )
    text = write_report(tmp_path, make_report(mixed)).read_text(encoding="utf-8")
    lux = make_report(mixed).spectral_map["illuminance"].to_numpy()[3:]
    said = re.search(r"the minimum over the mean at the 173 points of this level and direction, is (0\.\d+)", text)
    assert said is not None
    assert float(said.group(1)) == pytest.approx(lux.min() / lux.mean(), abs=0.05)  # from bands alone


OFF_BY = {25: "is off by", 4: "nothing tells how far the map between them is off", 3: "only the points are drawn"}


@pytest.mark.parametrize("points", OFF_BY)
def test_the_maps_caption_says_what_is_drawn_and_how_far_it_may_be_off(make_transport, make_report, tmp_path, points):
    """Four corners span a map, but none of them lies between others, so that its error cannot be tried."""
    words = maps_section(make_report(make_transport(points=points)), ReportWriter(tmp_path))
    assert [each for each in OFF_BY.values() if each in words] == [OFF_BY[points]]


@pytest.mark.usefixtures("undrawn")
def test_a_uniformity_over_several_rooms_says_so(make_transport, make_report, tmp_path) -> None:
    room = make_report(make_transport(points=36))
    assert "rooms together" not in key_figures(room)
    left, right = (np.array([[x, 0.0], [x + 1.5, 0.0], [x + 1.5, 3.0], [x, 3.0]]) for x in (0.0, 1.5))
    two = replace(room, plan=FloorPlan(outline=left, other_outlines=(right,)))
    assert "at 36 points of 2 rooms together" in key_figures(two)
    section = illuminance_section(two, light_of_report(two), ReportWriter(tmp_path))
    assert "the minimum over the mean, 2 rooms together, is 0." in section
