"""The card and the table 'Trust': what a map rests on, and that its standard error never stands alone."""

from dataclasses import replace

import numpy as np
import pytest

from lidarspectra.lamps.shapes import Window
from lidarspectra.mapping.maps.assumptions import Assumptions, mark_assumed
from lidarspectra.mapping.report.key_figures import key_figures
from lidarspectra.mapping.report.report import write_report
from lidarspectra.mapping.report.report_tables import bands_table, lamps_table
from lidarspectra.mapping.report.trust import trust_card, trust_rows, trust_table
from lidarspectra.spectra.spectrum import Spectrum


@pytest.fixture
def report(make_transport, make_report):
    return make_report(make_transport(points=36).isel(band=[1, 5]))


def assuming(report, **assumed):
    return replace(report, spectral_map=mark_assumed(report.spectral_map, Assumptions(**assumed)))


def rows_of(report) -> dict[str, tuple[str, str, str]]:
    return {f"{row.what} ({row.known})": (row.known, row.how, row.effect) for row in trust_rows(report)}


def test_nothing_assumed_is_said_too(report):
    assert trust_card(report) == ("Trust", "no guesses", "see the table below")
    rows = rows_of(report)
    assert rows["flux and spectrum of both lamps (given)"][2].startswith("100 % of the light")
    assert rows["flux and spectrum of both lamps (given)"][1] == "by the run file"
    by_day = replace(report, lamps=(replace(report.lamps[0], shape=Window(1.0, 1.0)), report.lamps[1]))
    assert (
        rows_of(by_day)["flux and spectrum of both lamps (given)"][1]
        == "by the run file; daylight by a model of the sky"
    )
    assert "assumed" not in lamps_table(report.lamps, Assumptions()).frame["assumed"].tolist()


def test_assumed_lamps_are_told_with_their_share_of_the_light(report):
    first = str(report.transport["lamp"].to_numpy()[0])
    one = assuming(report, lamps=(first,))
    coefficient, flux = report.transport["coefficient"].to_numpy(), report.transport["flux"].to_numpy()
    by_lamp = np.einsum("lpb,lb->l", coefficient, flux)
    share = by_lamp[0] / by_lamp.sum()
    assert trust_card(one) == ("Trust", "guesses", f"flux and spectrum of 1 lamp ({100 * share:.0f} % of the light)")
    rows = rows_of(one)
    assert rows["flux and spectrum of 1 of 2 lamps (assumed)"][2].startswith(f"{100 * share:.0f} % of the light")
    assert rows["flux and spectrum of 1 of 2 lamps (given)"][2].startswith(f"{100 - 100 * share:.0f} % of the light")
    assert lamps_table(one.lamps, Assumptions(lamps=(first,))).frame["assumed"].tolist() == [
        "flux and spectrum",
        "nothing",
    ]
    assert "no standard error: flux and spectrum of 1 lamp" in bands_table(one.spectral_map).caption


def test_a_lamp_whose_flux_alone_is_known_has_a_row_of_each(report):
    first, second = (lamp.name for lamp in report.lamps)
    rows = rows_of(assuming(report, fluxes=(first,), spectra=(second,)))
    assert "it scales with the flux" in rows["flux of 1 of 2 lamps (assumed)"][2]
    assert rows["flux of 1 of 2 lamps (given)"][1] == "by the run file or by readings"
    assert rows["spectrum of 1 of 2 lamps (assumed)"][2].endswith("it has the spectrum's colours")
    assert not any(row.startswith("flux and spectrum") for row in rows)


def test_scan_and_surfaces_say_how_they_are_known(report):
    scan = replace(report.scan, closed_area_m2=12.0, open_share=0.04)
    told = assuming(replace(report, scan=scan, floor_scanned=0.97, ceiling_scanned=0.0), scan=("unit", "ceiling"))
    rows = rows_of(told)
    assert rows["unit of the scan (assumed)"][1] == "m, 90 % sure"
    assert "nothing here holds" in rows["unit of the scan (assumed)"][2]
    assert rows["upward axis (estimated)"][1] == "+y, 80 % sure"
    assert rows["floor (measured)"][1] == "97 % of the plan was scanned"
    assert rows["ceiling (assumed)"][1] == "0 % of the plan was scanned"
    assert rows["closed surfaces (assumed)"][1].startswith("12.0 m² of ceiling, floor or sides that were not scanned")
    assert "too dark" in rows["open sides (measured)"][2]
    assert "open sides (measured)" not in rows_of(report)
    assert rows["holes of the scan (assumed)"][1].startswith("3 closed like their surroundings: 0.40 m², 1.0 %")


def test_a_pane_that_init_guessed_is_not_called_given(report):
    wall, floor = report.materials
    told = replace(report, materials=(replace(wall, source="pane:glass", provenance="assigned"), floor))
    row = "glass, mirrors and screens"
    guessed, given = rows_of(assuming(told, scan=("panes",))), rows_of(told)
    assert guessed[f"{row} (assumed)"][1].endswith("by the run file: some or all by signs in the scan")
    assert given[f"{row} (given)"][1].endswith("by the run file")
    assert "reflectances (given)" not in guessed


def test_reflectances_that_are_off_alike_change_the_reflected_light_as_in_an_integrating_sphere(report):
    wall, floor = report.materials
    off = Spectrum(wavelengths_nm=[380.0, 780.0], values=[0.05, 0.05])
    told = replace(report, materials=(replace(wall, uncertainty=off), replace(floor, provenance="default")))
    rows = rows_of(told)
    mean, deviation = 0.4 + 0.2 * (555 - 380) / 400, 0.05 * 30 / 39  # on 30 of 39 m²
    closed = [(mean + sign * deviation) / (1 - mean - sign * deviation) for sign in (-1, 1)]
    change = (closed[1] - closed[0]) / (closed[1] + closed[0])
    _, how, effect = rows["reflectances (estimated)"]
    assert how == "from the scan's colours, for 77 % of the surface"
    assert f"± {100 * change:.0f} % if all are off alike" in effect
    assert rows["reflectances (assumed)"][1] == "a default or typical material, for 23 % of the surface"
    assert "not known" in rows_of(report)["reflectances (estimated)"][2]


def test_a_little_is_more_than_none(report):
    wall, floor = report.materials
    told = replace(
        report, materials=(wall, replace(floor, provenance="default")), material_areas_m2=np.array([30.0, 0.1])
    )
    assert (
        rows_of(told)["reflectances (assumed)"][1] == "a default or typical material, for less than 1 % of the surface"
    )


def test_the_page_shows_the_card_and_the_table_and_no_standard_error_alone(report, tmp_path):
    write_report(tmp_path, assuming(report, lamps=tuple(lamp.name for lamp in report.lamps)))
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    facts = page[page.index('class="facts"') : page.index('<section id="room-in-3d"')]
    assert "flux and spectrum of 2 lamps (100 % of the light)" in facts
    assert '<a href="#trust">Trust</a>' in facts
    summary = page[page.index('<section id="summary"') : page.index('<section id="spectral-maps"')]
    assert "of the simulation alone, not of what is assumed" in summary
    assert "over points and bands, from an assumed flux" in summary
    assert 'data-name="trust"' in summary
    accuracy = page[page.index('<section id="accuracy"') : page.index('<section id="lamps-and-sensors"')]
    assert "guesses that no standard error knows of" in accuracy
    assert (tmp_path / "tables" / "trust.csv").is_file()
    assert list(trust_table(report).frame) == ["what", "known", "how", "what it does to the map"]


def test_melanopic_light_by_an_assumed_spectrum_says_so(make_transport, make_report):
    report = make_report(make_transport(points=36))
    first = str(report.transport["lamp"].to_numpy()[0])
    assert "by an assumed spectrum" not in key_figures(report)
    assert "of the illuminance, by an assumed spectrum" in key_figures(assuming(report, spectra=(first,)))
