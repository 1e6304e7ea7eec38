"""Metrics of a year, on years made by hand whose answer is known."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from lidarspectra.mapping.photometry.annual_metrics import OCCUPIED_HOURS, SUMMER_TIME, point_metrics, room_metrics

TIMES = pd.date_range("2023-01-01 00:30", periods=8760, freq="h")


def year(
    illuminance: "dict[int, float] | float",
    *,
    points: int = 2,
    sun: float = 0.0,
    melanopic: float = 0.0,
    se: float = 0.0,
) -> xr.Dataset:
    """All hours of a year at points; of each hour of the day one illuminance, or one for all."""
    by_hour = illuminance if isinstance(illuminance, dict) else dict.fromkeys(range(24), illuminance)
    light = np.array([by_hour.get(hour, 0.0) for hour in TIMES.hour])
    shape = (len(TIMES), points)
    grid = np.broadcast_to(light[:, None], shape).copy()
    return xr.Dataset(
        {
            "illuminance": (("hour", "point"), grid),
            "illuminance_se": (("hour", "point"), np.full(shape, se)),
            "sun_illuminance": (("hour", "point"), np.full(shape, sun)),
            "melanopic_edi": (("hour", "point"), np.full(shape, melanopic)),
        },
        {"time": ("hour", TIMES), "buried": ("point", np.zeros(points, dtype=bool))},
    )


def test_only_the_hours_from_8_to_18_count() -> None:
    by_night = point_metrics(year(dict.fromkeys((*range(8), *range(18, 24)), 1000.0)))
    assert by_night["DA300"].tolist() == [0.0, 0.0]
    assert by_night["UDI_below_100"].tolist() == [100.0, 100.0]
    by_day = point_metrics(year(dict.fromkeys(range(8, 18), 1000.0)))
    assert by_day["DA300"].tolist() == pytest.approx([100.0, 100.0])
    assert by_day["mean_illuminance_lx"].tolist() == pytest.approx([1000.0, 1000.0])


def test_dark_hours_that_a_year_leaves_out_count_as_dark() -> None:
    whole = year(dict.fromkeys(range(8, 13), 500.0))
    short = whole.isel(hour=np.flatnonzero(whole["illuminance"].to_numpy()[:, 0] > 0))
    assert point_metrics(short)["DA300"].tolist() == pytest.approx([50.0, 50.0])
    assert point_metrics(whole)["DA300"].tolist() == pytest.approx([50.0, 50.0])


def test_useful_illuminance_is_parted_at_100_300_and_3000_lx() -> None:
    values = {8: 99.0, 9: 100.0, 10: 299.0, 11: 300.0, 12: 3000.0, 13: 3001.0, 14: 50.0, 15: 50.0, 16: 50.0, 17: 50.0}
    found = point_metrics(year(values)).iloc[0]
    assert found["UDI_below_100"] == pytest.approx(50.0)
    assert found["UDI_100_300"] == pytest.approx(20.0)
    assert found["UDI_300_3000"] == pytest.approx(20.0)
    assert found["UDI_100_3000"] == pytest.approx(40.0)
    assert found["UDI_above_3000"] == pytest.approx(10.0)


def test_sunlight_counts_above_1000_lx_and_more_than_250_hours() -> None:
    lit = year(500.0)
    sun = lit["sun_illuminance"].to_numpy()
    occupied = np.flatnonzero((TIMES.hour >= 8) & (TIMES.hour < 18))
    sun[occupied[:251], 0], sun[occupied[:250], 1] = 1001.0, 1001.0
    assert point_metrics(lit)["sun_hours"].tolist() == [251.0, 250.0]
    room = room_metrics(lit).set_index("metric")["value"]
    assert room["ASE1000,250h"] == 50.0
    sun[:] = 1000.0
    assert room_metrics(lit).set_index("metric")["value"]["ASE1000,250h"] == 0.0


def test_half_of_the_hours_suffice_for_autonomy_and_buried_points_do_not_count() -> None:
    half = year(dict.fromkeys(range(8, 13), 300.0), points=3)
    half["illuminance"][:, 1] = 299.0
    half["buried"][2] = True
    room = room_metrics(half).set_index("metric")["value"]
    assert room["sDA300/50%"] == 50.0


def test_melanopic_hours_are_hours_of_250_lx() -> None:
    found = point_metrics(year(100.0, melanopic=250.0))
    assert found["melanopic_hours"].tolist() == [OCCUPIED_HOURS] * 2
    assert point_metrics(year(100.0, melanopic=249.0))["melanopic_hours"].tolist() == [0, 0]


def test_the_noise_widens_what_lies_near_a_limit_and_nothing_else() -> None:
    near = room_metrics(year(301.0, se=1.0)).set_index("metric").loc["sDA300/50%"]
    assert (near["value"], near["low"], near["high"]) == (100.0, 0.0, 100.0)
    far = room_metrics(year(400.0, se=1.0)).set_index("metric").loc["sDA300/50%"]
    assert (far["low"], far["high"]) == (100.0, 100.0)
    mean = room_metrics(year(400.0, se=1.0)).set_index("metric").loc["mean illuminance"]
    assert (mean["low"], mean["high"]) == pytest.approx((398.0, 402.0))


def test_by_a_clock_of_summer_time_the_hours_begin_at_7_in_standard_time() -> None:
    early = year({7: 1000.0})
    assert point_metrics(early)["mean_illuminance_lx"].tolist() == [0.0, 0.0]
    early.attrs[SUMMER_TIME] = "03-31 10-27"
    days = 211  # from 31 March to 27 October, both with them
    assert point_metrics(early)["mean_illuminance_lx"].tolist() == pytest.approx([1000.0 * days / OCCUPIED_HOURS] * 2)
    early.attrs[SUMMER_TIME] = "10-27 03-31"  # south of the equator: over New Year
    assert point_metrics(early)["mean_illuminance_lx"].tolist() == pytest.approx([1e3 * 156 / OCCUPIED_HOURS] * 2)
    late = year({17: 1000.0})
    late.attrs[SUMMER_TIME] = "03-31 10-27"
    found = point_metrics(late)["mean_illuminance_lx"].tolist()
    assert found == pytest.approx([1000.0 * (365 - days) / OCCUPIED_HOURS] * 2)
