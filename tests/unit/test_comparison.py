"""Readings are compared where they belong, or refused in words."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from lidarspectra.errors import MapError, WorkspaceError
from lidarspectra.hardware.sensor.as7265x import (
    GAUSSIAN_WIDTH_NM,
    SATURATED_COUNT,
    UW_CM2_TO_W_M2,
    nominal_responsivity,
)
from lidarspectra.hardware.sensor.measured_readings import fitted_factors, read_readings
from lidarspectra.mapping.figures.floor_plan import FloorPlan
from lidarspectra.mapping.maps.map_schema import UNKNOWN_CHANNELS
from lidarspectra.mapping.maps.metrics import Comparison
from lidarspectra.mapping.maps.readings_on_map import ComparedReadings
from lidarspectra.workflow.applications import evaluation as comparison
from lidarspectra.workflow.applications.evaluation import Evaluation, evaluate_run, save_evaluation

LABELS = ("410", "435", "460")
LEVELS = np.array([1.0, 2.0, 3.0])


@pytest.fixture
def light() -> xr.Dataset:
    """A map of 12 points on a line, brighter along it."""
    return xr.Dataset(
        {"irradiance": (("point", "band"), np.linspace(1.0, 2.0, 12)[:, None] * LEVELS)},
        coords={
            "band": [float(label) for label in LABELS],
            "x": ("point", np.arange(12.0)),
            "y": ("point", np.zeros(12)),
            "z": ("point", np.ones(12)),
            **{name: ("point", np.full(12, float(name == "nz"))) for name in ("nx", "ny", "nz")},
            "buried": ("point", np.arange(12) == 11),
        },
    )


@pytest.fixture
def run(light: xr.Dataset, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A run with that map."""

    class Scene:
        class bands:  # noqa: N801
            labels = LABELS

    monkeypatch.setattr(comparison, "load_map", lambda path: light)
    monkeypatch.setattr(comparison, "load_scene", lambda folder: Scene)
    monkeypatch.setattr(comparison, "require_stage", lambda folder, stage: folder)
    monkeypatch.setattr(comparison, "plan_of_run", lambda folder: FloorPlan(outline=np.eye(3, 2)))
    return tmp_path


def readings(folder: Path, factor: float | np.ndarray = 1.0, shift_m: float = 0.0) -> Path:
    table = pd.DataFrame({"x": np.arange(12.0) + shift_m, "y": 0.0, "z": 1.0})
    values = np.linspace(1.0, 2.0, 12)[:, None] * LEVELS * factor
    for number, label in enumerate(LABELS):
        table[f"E_{label}"] = values[:, number]
    table.to_csv(folder / "measured.csv", index=False)
    return folder / "measured.csv"


def spectra(found: Evaluation) -> ComparedReadings:
    assert found.spectra is not None
    return found.spectra


def absolute(found: Evaluation) -> Comparison:
    return spectra(found).comparisons[0]


def test_the_same_values_have_no_error_and_buried_points_are_left_out(run: Path, tmp_path: Path) -> None:
    found = evaluate_run(run, readings(tmp_path))
    assert absolute(found).points == 11
    assert absolute(found).nrmse_mean == pytest.approx(0.0, abs=1e-9)  # rounding
    assert "1 of 12 readings" in found.notes[0]
    assert (save_evaluation(found, tmp_path / "out") / "evaluation.csv").is_file()


def test_a_reading_without_light_in_a_channel_is_left_out_and_said(run: Path, tmp_path: Path) -> None:
    path = readings(tmp_path)
    table = pd.read_csv(path)
    table.loc[2, f"E_{LABELS[0]}"] = 0.0  # fewer counts than in the dark are read as that, or as less
    table.loc[5, f"E_{LABELS[1]}"] = -1e-6
    table.to_csv(path, index=False)
    found = evaluate_run(run, path)
    assert absolute(found).points == 9
    assert "2 readings are left out, since a channel is zero" in found.notes[1]


def test_a_channel_without_light_in_the_map_is_not_compared(run: Path, light: xr.Dataset, tmp_path: Path) -> None:
    light["irradiance"][:, 0] = 1e-80  # as 940 nm of lamps whose spectrum ends at 780
    path = readings(tmp_path)
    table = pd.read_csv(path)
    table.loc[3, f"E_{LABELS[0]}"] = 0.0  # which is no reason to leave the reading out
    table.to_csv(path, index=False)
    found = evaluate_run(run, path)
    assert (absolute(found).points, absolute(found).bands) == (11, 2)
    assert absolute(found).nrmse_mean == pytest.approx(0.0, abs=1e-9)
    assert "are not compared: 410 nm" in found.notes[1]
    assert not any("not measured" in note or "no channels of the map" in note for note in found.notes)
    table[["x", "y", "z", f"E_{LABELS[0]}"]].to_csv(path, index=False)
    with pytest.raises(MapError, match="found 410 nm alone"):
        evaluate_run(run, path)


def test_a_channel_that_the_map_lacks_is_told_and_a_word_is_named_where_it_stands(run: Path, tmp_path: Path) -> None:
    path = readings(tmp_path)
    table = pd.read_csv(path)
    table.rename(columns={"E_460": "E_461"}).to_csv(path, index=False)
    notes = evaluate_run(run, path).notes
    assert "Columns that are no channels of the map are not compared: E_461." in notes
    assert "1 channel was not measured, of those of the map, and not compared." in notes
    assert not any("E_" in note for note in evaluate_run(run, readings(tmp_path)).notes)
    table.astype({"E_435": object}).assign(E_435=[*table["E_435"][:3], "over", *table["E_435"][4:]]).to_csv(
        path, index=False
    )
    with pytest.raises(MapError, match="column 'E_435', reading 4: expected numbers, found 'over'"):
        evaluate_run(run, path)


def test_a_tenth_more_is_a_tenth_off_until_it_is_fitted(run: Path, tmp_path: Path) -> None:
    path = readings(tmp_path, factor=1.0 / 1.1)
    assert absolute(evaluate_run(run, path)).bias_percent == pytest.approx(10.0)
    fitted = evaluate_run(run, path, scale="one")
    assert absolute(fitted).nrmse_mean == pytest.approx(0.0, abs=1e-9)
    assert "1.1" in fitted.notes[-1]


def test_channels_of_three_dies_are_fitted_apart(run: Path, tmp_path: Path) -> None:
    path = readings(tmp_path, factor=np.array([1.0, 2.0, 4.0]))
    np.testing.assert_allclose(spectra(evaluate_run(run, path, scale="channel")).scale, [1.0, 0.5, 0.25], rtol=1e-12)


def test_each_die_gets_one_factor(run: Path, tmp_path: Path) -> None:
    path = readings(tmp_path, factor=np.array([1.0, 2.0, 4.0]))  # 410, 435 and 460 nm sit on one die
    found = evaluate_run(run, path, scale="die")
    assert np.unique(spectra(found).scale).size == 1
    assert "each die" in found.notes[-1]
    with pytest.raises(MapError, match="three dies"):
        fitted_factors(np.ones((3, 1)), np.ones((3, 1)), "die", ["412.5"])


def test_uw_per_cm2_and_counts_are_the_same_light_in_other_words(run: Path, tmp_path: Path) -> None:
    table = pd.read_csv(readings(tmp_path))
    columns = {f"E_{label}": label for label in LABELS}
    (table.rename(columns=columns)[list(LABELS)] * GAUSSIAN_WIDTH_NM / UW_CM2_TO_W_M2).join(
        table[["x", "y", "z"]]
    ).to_csv(tmp_path / "uw.csv", index=False)
    found = evaluate_run(run, tmp_path / "uw.csv", unit="uW/cm2")
    assert absolute(found).nrmse_mean == pytest.approx(0.0, abs=1e-9)  # rounding
    counts = table.rename(
        columns={f"E_{label}": f"{letter}_{label}:count" for label, letter in zip(LABELS, "ABC", strict=True)}
    )
    counts[["gain", "integration_ms"]] = (16.0, 10.0)
    names = [name for name in counts if ":count" in name]
    counts[names] *= nominal_responsivity()[0] * 160.0
    counts.loc[3, names[0]] = SATURATED_COUNT
    counts.to_csv(tmp_path / "counts.csv", index=False)
    found = evaluate_run(run, tmp_path / "counts.csv", unit="counts")
    assert absolute(found).nrmse_mean == pytest.approx(0.0, abs=1e-9)  # rounding
    assert absolute(found).points == 10  # one buried, one saturated


def test_counts_without_settings_are_refused_until_a_scale_is_fitted(run: Path, tmp_path: Path) -> None:
    table = pd.read_csv(readings(tmp_path, factor=250.0))
    table.columns = [str(name).replace("E_", "") for name in table]
    table.to_csv(tmp_path / "counts.csv", index=False)
    with pytest.raises(MapError, match="integration_ms"):
        evaluate_run(run, tmp_path / "counts.csv", unit="counts")
    fitted = evaluate_run(run, tmp_path / "counts.csv", unit="counts", scale="one")
    assert absolute(fitted).nrmse_mean == pytest.approx(0.0, abs=1e-9)  # rounding


@pytest.mark.parametrize(
    "form",
    [
        {"sep": ";", "decimal": ",", "encoding": "utf-8-sig"},  # Excel in German
        {"sep": "\t", "encoding": "utf-16"},  # Excel's "Unicode text"
        {"sep": ";", "encoding": "utf-8"},
    ],
)
def test_tables_as_spreadsheets_write_them_are_read(run: Path, tmp_path: Path, form: dict[str, Any]) -> None:
    table = pd.read_csv(readings(tmp_path)).assign(place="über dem Tisch")
    table.to_csv(tmp_path / "sheet.csv", index=False, **form)
    found = evaluate_run(run, tmp_path / "sheet.csv")
    assert absolute(found).nrmse_mean == pytest.approx(0.0, abs=1e-9)  # rounding


def test_headings_in_capitals_and_behind_blanks_are_known(run: Path, tmp_path: Path) -> None:
    table = pd.read_csv(readings(tmp_path)).rename(columns={"x": "X", "y": " Y", "z": "Z "})
    table.to_csv(tmp_path / "typed.csv", index=False)
    assert absolute(evaluate_run(run, tmp_path / "typed.csv")).nrmse_mean == pytest.approx(0.0, abs=1e-9)
    (tmp_path / "typed.csv").write_text("x, y, z, Lux, lux , X\n1, 2, 3, 4, 5, 6\n", encoding="utf-8")
    found = read_readings(tmp_path / "typed.csv")  # a word that is there already is not given twice
    assert found.columns.tolist() == ["x", "y", "z", "Lux", "lux", "X"]


def test_a_comma_in_a_comment_makes_no_decimal_commas(run: Path, tmp_path: Path) -> None:
    text = pd.read_csv(readings(tmp_path)).to_csv(index=False, sep=";")
    (tmp_path / "sheet.csv").write_text(f"# desks, 0,75 m high\n{text}", encoding="utf-8")
    assert absolute(evaluate_run(run, tmp_path / "sheet.csv")).nrmse_mean == pytest.approx(0.0, abs=1e-9)


def test_a_reading_that_looks_another_way_than_its_point_is_left_out_and_said(run: Path, tmp_path: Path) -> None:
    table = pd.read_csv(readings(tmp_path)).assign(nx=0.0, ny=0.0, nz=1.0)
    table.loc[[1, 4], "nz"] = -1.0  # a sensor that looks down reads what the table reflects
    table.loc[[1, 4], "E_410"] = 0.01
    table.to_csv(tmp_path / "measured.csv", index=False)
    found = evaluate_run(run, tmp_path / "measured.csv")
    assert absolute(found).points == 9
    assert absolute(found).nrmse_mean == pytest.approx(0.0, abs=1e-9)
    assert "2 readings are left out, since the map's points beside them look another way" in found.notes[0]
    table.assign(nz=-1.0).to_csv(tmp_path / "measured.csv", index=False)
    with pytest.raises(MapError, match="11 more look another way"):
        evaluate_run(run, tmp_path / "measured.csv")


def test_readings_in_another_unit_than_was_said_are_pointed_out(run: Path, tmp_path: Path) -> None:
    path = readings(tmp_path, factor=2000.0)
    assert "The readings are 2000 times the map in the median, taken as W/m2/nm" in evaluate_run(run, path).notes[-1]
    assert not any("times the map" in note for note in evaluate_run(run, path, scale="one").notes)
    assert not any("times the map" in note for note in evaluate_run(run, readings(tmp_path, factor=2.0)).notes)


def with_illuminance(light: xr.Dataset, monkeypatch: pytest.MonkeyPatch) -> None:
    lux = np.linspace(100.0, 210.0, 12)
    lit = light.assign(
        illuminance=("point", lux),
        illuminance_se=("point", 0.0 * lux),
        illuminance_sd=("point", 0.1 * lux),
        irradiance_sd=light["irradiance"] * np.array([0.2, 0.08, 0.02]),
    )
    monkeypatch.setattr(comparison, "load_map", lambda path: lit)


def lux_readings(folder: Path, factor: float = 1.0) -> Path:
    table = pd.DataFrame({"x": np.arange(12.0), "y": 0.0, "z": 1.0, "lux": np.linspace(100.0, 210.0, 12) * factor})
    table.to_csv(folder / "lux.csv", index=False)
    return folder / "lux.csv"


def test_a_lux_meters_readings_are_compared_with_the_maps_illuminance(
    run: Path, light: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(MapError, match="channels cover what the eye sees"):
        evaluate_run(run, lux_readings(tmp_path))  # a map of three channels has no illuminance
    with_illuminance(light, monkeypatch)
    found = evaluate_run(run, lux_readings(tmp_path, factor=1.0 / 1.12))
    assert found.spectra is None
    assert found.illuminance is not None
    assert found.illuminance.comparisons[0].bias_percent == pytest.approx(12.0)
    assert found.illuminance.comparisons[0].points == 11
    assert "illuminance: 11 points" in repr(found)
    (row,) = found.tables[0].frame.to_dict("records")
    assert (row["APE median [%]"], row["measured mean [lx]"]) == pytest.approx((12.0, 150.0 / 1.12))
    # 12 % of the reading is 10.7 % of the map, whose standard uncertainty is a tenth
    assert (row["within 1 SD [%]"], row["within 2 SD [%]"]) == (0.0, 100.0)
    fitted = evaluate_run(run, lux_readings(tmp_path, factor=1.0 / 1.12), scale="die")  # a meter has one factor
    assert fitted.illuminance is not None
    assert fitted.illuminance.scale == pytest.approx([1.12])
    assert fitted.illuminance.uncertainty is None
    assert "fitted factor of 1.12" in fitted.notes[-1]
    doubt = evaluate_run(run, lux_readings(tmp_path, factor=100.0)).notes[-1]
    assert "100 times the map in the median, taken as lx. Check the meter" in doubt
    assert doubt.endswith("the errors in lux say nothing until then.")
    with pytest.raises(MapError, match=r"of the illuminance that are complete and above zero.*a finer range"):
        evaluate_run(run, lux_readings(tmp_path, factor=0.0))


def test_channels_and_lux_of_one_file_are_compared_both_and_the_uncertainty_is_held_to_them(
    run: Path, light: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with_illuminance(light, monkeypatch)
    table = pd.read_csv(readings(tmp_path, factor=1.0 / 1.1)).assign(lux=np.linspace(100.0, 210.0, 12))
    table.loc[4, "lux"], table.loc[6, "lux"] = np.nan, 0.0
    table.to_csv(tmp_path / "both.csv", index=False)
    found = evaluate_run(run, tmp_path / "both.csv")
    assert [table.name for table in found.tables] == ["evaluation", "evaluation-bands", "evaluation-illuminance"]
    assert found.illuminance is not None
    assert (absolute(found).points, found.illuminance.comparisons[0].points) == (11, 9)
    assert "Illuminance: 1 reading is left out for lack of its lux." in found.notes
    assert any(note.startswith("Illuminance: 1 reading is left out, since its lux is zero") for note in found.notes)
    # a tenth of the reading is 9.1 % of the map, with uncertainties of 20, 8 and 2 %
    assert found.tables[1].frame["within 1 SD [%]"].tolist() == [100.0, 0.0, 0.0]
    assert found.tables[1].frame["within 2 SD [%]"].tolist() == [100.0, 100.0, 0.0]
    monkeypatch.setattr(comparison, "load_map", lambda path: light)
    without = evaluate_run(run, tmp_path / "both.csv")
    assert without.illuminance is None
    assert without.notes[-1].startswith("Lux are not compared")


def test_nothing_of_an_earlier_evaluation_stays_beside_the_next(
    run: Path, light: xr.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_evaluation(evaluate_run(run, readings(tmp_path)), tmp_path / "out")
    (tmp_path / "out" / "mine.csv").write_text("kept", encoding="utf-8")
    with_illuminance(light, monkeypatch)
    save_evaluation(evaluate_run(run, lux_readings(tmp_path)), tmp_path / "out")
    left = {path.name for path in (tmp_path / "out").iterdir()}
    assert left == {"mine.csv", *(f"evaluation-illuminance.{kind}" for kind in ("csv", "md", "html"))}
    (tmp_path / "out" / "evaluation.md").mkdir()  # what cannot be removed is named
    with pytest.raises(WorkspaceError, match=r"evaluation\.md"):
        save_evaluation(evaluate_run(run, lux_readings(tmp_path)), tmp_path / "out")


def test_readings_in_another_frame_are_refused(run: Path, tmp_path: Path) -> None:
    with pytest.raises(MapError, match="--align"):
        evaluate_run(run, readings(tmp_path, shift_m=0.4))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a,b\n1,2\n", "columns x, y, z"),
        ("x,y,z\n0,0,1\n", "E_410"),
        ("x,y,z,E_410\n0,0,1,many\n", "E_410.*'many'"),
        ("x,y,z,E_410\n", "one a row below the header, found none"),
        ("x,y,z,E_410\n0,0,1,0.5\n", "Measure at more of its points"),
        ("", "readable CSV"),
    ],
)
def test_other_files_are_refused_in_words(run: Path, tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "other.csv").write_text(text, encoding="utf-8")
    with pytest.raises(MapError, match=words):
        evaluate_run(run, tmp_path / "other.csv")


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_a_number_sign_begins_a_comment_at_the_start_of_a_line_alone(tmp_path: Path, delimiter: str) -> None:
    rows = ["# by hand", "name,x,y,z,lux", "desk #1,1,2,0.8,300", "#desk #2,9,9,9,9", "shelf,3,2,1,100", ""]
    (tmp_path / "typed.csv").write_text("\n".join(rows).replace(",", delimiter), encoding="utf-8")
    found = read_readings(tmp_path / "typed.csv")
    assert found["name"].tolist() == ["desk #1", "shelf"]
    assert found["lux"].tolist() == [300, 100]
    assert found["z"].tolist() == [0.8, 1.0]


def test_names_in_a_table_of_readings_are_words_whatever_they_say(tmp_path: Path) -> None:
    path = tmp_path / "readings.csv"
    path.write_text("name,sensor,x,y,z,lux\nNA,007,0,0,1,300\n1,nan,1,0,1,NA\n", encoding="utf-8")
    table = read_readings(path)
    assert table["name"].tolist() == ["NA", "1"]
    assert table["sensor"].tolist() == ["007", "nan"]
    assert table["lux"].isna().tolist() == [False, True]


def test_a_number_of_hundreds_of_digits_is_refused_in_words(tmp_path: Path) -> None:
    path = tmp_path / "readings.csv"
    path.write_text(f"x,y,z,E_410\n0,0,1,{'9' * 400}\n", encoding="utf-8")
    with pytest.raises(MapError, match="column 'E_410', reading 1"):
        read_readings(path)


def test_a_channel_of_which_the_lamps_spectra_tell_a_part_is_not_compared(
    run: Path, light: xr.Dataset, tmp_path: Path
) -> None:
    light.attrs[UNKNOWN_CHANNELS] = LABELS[1]
    found = evaluate_run(run, readings(tmp_path))
    assert absolute(found).bands == len(LABELS) - 1
    assert any(f"or of which these tell but a part, are not compared: {LABELS[1]} nm" in note for note in found.notes)


def test_a_place_that_was_read_often_counts_once(run: Path) -> None:
    once = pd.read_csv(readings(run))
    off = once.iloc[[2]].copy()
    off[[f"E_{label}" for label in LABELS]] *= 0.8
    pd.concat([once, *[off] * 7, *[once.iloc[[2]]] * 6]).to_csv(run / "often.csv", index=False)  # seven of either
    found = evaluate_run(run, run / "often.csv")
    assert absolute(found).points == 11
    assert absolute(found).mape_mean == pytest.approx(100.0 * (1.0 / 0.9 - 1.0) / 11)
    assert "The 24 readings lie at 11 points of the map" in found.notes[-1]
    pd.concat([once.iloc[[1]], *[once.iloc[[2]]] * 4]).to_csv(run / "two.csv", index=False)
    with pytest.raises(MapError, match="found 5 at 2"):
        evaluate_run(run, run / "two.csv")
