"""Values at points, each with its place and direction: a Dataset with the dim point, and its file."""

from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.errors import MapError
from lidarspectra.io.files import write_whole, writing

PLACE = ("x", "y", "z", "nx", "ny", "nz", "buried")
POINTS_FILE = "points.csv"


def places_of(dataset: xr.Dataset) -> dict[str, xr.DataArray]:
    """Coordinates of the points of a map or transport: x, y, z [m], nx, ny, nz [1], buried."""
    return {name: dataset[name] for name in PLACE}


def points_frame(values: xr.Dataset) -> pd.DataFrame:
    """One row a point: place, direction, then every variable (dim point)."""
    columns = {name: values[name].to_numpy() for name in (*PLACE, *map(str, values.data_vars))}
    columns["buried"] = columns["buried"].astype(np.int64)
    return pd.DataFrame(columns)


def save_points(values: xr.Dataset, folder: Path) -> Path:
    """Write `points_frame` as points.csv with six digits, atomically; raises MapError if that fails."""
    path = folder / POINTS_FILE
    with writing(folder, error=MapError):
        write_whole(path, points_frame(values).to_csv(index=False, float_format="%.6g", lineterminator="\n"))
    return path
