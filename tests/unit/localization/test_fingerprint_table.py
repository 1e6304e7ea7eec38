"""The form that fingerprints have: kept through a file, and refused where it is broken."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from lidarspectra.errors import MapError, WorkspaceError
from lidarspectra.mapping.localization.fingerprint_table import (
    check_fingerprints,
    load_fingerprints,
    make_fingerprints,
    quantity_of,
    save_fingerprints,
)
from lidarspectra.spectra.spectrum import gaussian_bands
from lidarspectra.workflow.applications.fingerprints import missed_targets

BANDS = gaussian_bands("two", [500.0, 600.0], 20.0)
SHAPE = (3, 4, 2)  # fingerprints, sensors, bands


def table(**more: object) -> xr.Dataset:
    values = np.arange(1.0, 25.0).reshape(SHAPE)
    given: dict[str, object] = {
        "quantity": "irradiance",
        "labels": ["door", "desk", "desk"],
        "positions_m": [[1, 2, 0], [3, 1, 0], [3, 1, 0]],
        "sensors": ["a", "b", "c", "d"],
        "bands": BANDS,
        "readings_se": 0.01 * values,
        "empty": values[0],
        "empty_se": 0.01 * values[0],
        "extra": {"posture": ["standing", "sitting", "standing"], "height_m": [1.7, 1.6, 1.8], "draw": [0, 0, 1]},
        "attributes": {"accuracy": "high", "seed": 3},
    }
    return make_fingerprints(values, **(given | more))


def test_a_file_gives_back_what_was_saved(tmp_path: Path) -> None:
    saved = table()
    xr.testing.assert_identical(load_fingerprints(save_fingerprints(saved, tmp_path / "table.nc")), saved)
    assert quantity_of(saved) == "irradiance"
    assert saved["irradiance"].attrs["units"] == "W m-2 nm-1"
    assert saved["band_label"].to_numpy().tolist() == ["500", "600"]


def test_counts_may_be_missing_and_need_neither_errors_nor_an_empty_room(tmp_path: Path) -> None:
    counts = np.full(SHAPE, 7.0)
    counts[1, 2] = np.nan
    found = table_of_counts = make_fingerprints(
        counts,
        quantity="counts",
        labels=["p1", "p1", "p2"],
        positions_m=np.full((3, 3), np.nan),
        sensors=list("abcd"),
        bands=BANDS,
        extra={"time_s": [0.0, 1.0, 2.0]},
    )
    assert quantity_of(load_fingerprints(save_fingerprints(found, tmp_path / "counts.nc"))) == "counts"
    assert table_of_counts["counts"].isnull().sum() == 2


def test_dims_come_in_one_order() -> None:
    turned = table().transpose("band", "axis", "sensor", "fingerprint")
    assert check_fingerprints(turned, where="test")["irradiance"].dims == ("fingerprint", "sensor", "band")


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"labels": ["door", "desk"]}, "fit together"),
        ({"positions_m": [[1, 2], [3, 1], [3, 1]]}, "fit together|three numbers"),
        ({"positions_m": [[1, np.nan, 0], [3, 1, 0], [3, 1, 0]]}, "all known or all NaN"),
        ({"sensors": ["a", "b", "c", "a"]}, "used twice"),
        ({"readings_se": None}, "'irradiance_se'"),
        ({"empty": None}, "'empty'"),
        ({"empty_se": -np.ones(SHAPE[1:])}, "negative"),
        ({"empty": np.full(SHAPE[1:], np.nan)}, "NaN"),
        ({"effect_se": np.full(SHAPE, np.inf)}, "infinity"),
        ({"extra": {"shoe_size": [42, 43, 44]}}, "shoe_size"),
        ({"extra": {"height_m": [[1.7]]}}, "height"),
    ],
)
def test_what_does_not_fit_is_refused(more: dict[str, object], words: str) -> None:
    with pytest.raises(MapError, match=words):
        table(**more)


@pytest.mark.parametrize("broken", ["irradiance", "band", "label"])
def test_a_table_without_one_of_its_parts_is_refused(broken: str) -> None:
    with pytest.raises(MapError):
        check_fingerprints(table().drop_vars(broken), where="test")


def test_a_wrong_unit_and_two_quantities_are_refused() -> None:
    wrong = table()
    wrong["irradiance"].attrs["units"] = "lx"
    with pytest.raises(MapError, match="unit 'lx'"):
        check_fingerprints(wrong, where="test")
    both = table().assign(counts=table()["irradiance"])
    with pytest.raises(MapError, match="as 'counts'"):
        quantity_of(both)


def test_files_that_are_none_are_refused(tmp_path: Path) -> None:
    with pytest.raises(MapError, match="NetCDF"):
        load_fingerprints(tmp_path / "none.nc")
    (tmp_path / "text.nc").write_text("no table", encoding="utf-8")
    with pytest.raises(MapError, match="NetCDF"):
        load_fingerprints(tmp_path / "text.nc")
    xr.Dataset({"x": 1}).to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
    with pytest.raises(MapError, match="schema"):
        load_fingerprints(tmp_path / "other.nc")
    with pytest.raises(WorkspaceError):
        save_fingerprints(table(), tmp_path / "no folder" / "table.nc")


@pytest.mark.parametrize(
    ("reading", "effect", "said"), [(0.02, 0.004, []), (0.04, 0.004, ["reading"]), (0.02, 0.006, ["person's effect"])]
)
def test_only_errors_above_their_target_are_told(reading: float, effect: float, said: list[str]) -> None:
    traced = table().assign_attrs(
        target_relative_se=0.03, achieved_relative_se=reading,
        target_relative_effect_se=0.005, achieved_relative_effect_se=effect,
    )  # fmt: skip
    notes = missed_targets(traced)
    assert [note.split(" is ")[0].removeprefix("The standard error of a ") for note in notes] == said
