"""The page of a year has its metrics, maps, hours and tables, and every metric of a card is one of the room's."""

from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.mapping.figures.floor_plan import FloorPlan
from lidarspectra.mapping.photometry.annual_metrics import point_metrics, room_metrics
from lidarspectra.mapping.report.annual_page import ON_CARDS, write_annual_page

TIMES = pd.date_range("2023-01-01 00:30", periods=8760, freq="h")


def test_the_page_has_metrics_maps_hours_and_tables(tmp_path: Path) -> None:
    x, y = (each.ravel() for each in np.meshgrid([0.5, 1.0, 1.5], [0.5, 1.0, 1.5]))
    light = np.where((TIMES.hour >= 8) & (TIMES.hour < 16), 400.0, 0.0)[:, None] * np.ones(9)
    places = {name: ("point", np.full(9, value)) for name, value in (("nx", 0.0), ("ny", 0.0), ("nz", 1.0), ("z", 0.8))}
    names = ("illuminance", "sun_illuminance", "melanopic_edi")
    year = xr.Dataset(
        dict.fromkeys(names, (("hour", "point"), light)) | {"illuminance_se": (("hour", "point"), 0.01 * light)},
        places | {"x": ("point", x), "y": ("point", y), "buried": ("point", np.zeros(9, bool))},
        {"weather": "<b>nowhere</b>", "latitude_deg": 48.0, "longitude_deg": 11.0},
    )
    year = year.assign_coords(time=("hour", TIMES))
    plan = FloorPlan(outline=np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]))
    room = room_metrics(year)
    page = write_annual_page(tmp_path, year, point_metrics(year), room, plan, title="room", notes=("Look out.",))
    text = page.read_text(encoding="utf-8")
    assert set(ON_CARDS) <= set(room["metric"])
    for words in ("sDA300/50%", "3650 occupied hours", "Look out.", "&lt;b&gt;nowhere", "annual-maps", "annual-hours"):
        assert words in text
    table = pd.read_csv(tmp_path / "tables" / "annual-points.csv")
    assert len(table) == 9
    assert table["hours with 300 lx or more (%)"].iloc[0] == 80.0  # 8 of 10 hours
