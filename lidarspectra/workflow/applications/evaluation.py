"""A run's map against measured readings: the paper's Table 1 for any room that was measured."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from scipy.spatial import cKDTree

from lidarspectra.arguments import path_of
from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import MapError
from lidarspectra.hardware.sensor.measured_readings import (
    Scale,
    Unit,
    channel_columns,
    fitted_factors,
    irradiance_of,
    read_readings,
)
from lidarspectra.mapping.figures.figure_style import save_figure
from lidarspectra.mapping.figures.floor_plan import FloorPlan
from lidarspectra.mapping.figures.map_comparison_figure import map_comparison_figure
from lidarspectra.mapping.figures.tables import Table, save_table
from lidarspectra.mapping.maps.assumptions import assumptions_of
from lidarspectra.mapping.maps.map_files import MAP_FILE, load_map
from lidarspectra.mapping.maps.metrics import Comparison, Normalisation, compare_maps
from lidarspectra.radiance.scene.scene import load_scene
from lidarspectra.room.room import load_room
from lidarspectra.words import two_digits, were
from lidarspectra.workflow.run_folder.assumed import result_notes
from lidarspectra.workflow.run_folder.workspace import made_folder, require_stage

MIN_POINTS = 3  # fewer do not characterise a map
MAX_TURN_DEG = 20.0  # [deg] between a reading's direction and its point's; more is other light
UNLIKELY_RATIO = 10.0  # [1] of readings to the map or the reverse: a unit is wrong rather than a lamp
DIRECTION = ("nx", "ny", "nz")
NOWHERE_M = 1e9  # [m] stands for a place that is not known: far from everything
NORMALISATIONS: tuple[Normalisation, ...] = ("absolute", "band", "all")


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """Comparison of a map with readings.

    Parameters
    ----------
    comparisons : tuple of Comparison
        Absolute, and with the 0-1 normalisation by band and by map.
    scale : (band,) float
        What the readings were multiplied by before comparing. [1]
    table : Table
        The comparisons, for people.
    bands : Table
        Errors of each channel.
    notes : tuple of str
        What was left out or fitted, as full sentences.
    places : (point, 2) float
        Of the points that were compared, from above. [m]
    centers_nm : (band,) float
        [nm]
    synthetic, real : (point, band) float
        [W/m²/nm]
    """

    comparisons: tuple[Comparison, ...]
    scale: FloatArray
    table: Table
    bands: Table
    notes: tuple[str, ...]
    places: FloatArray
    centers_nm: FloatArray
    synthetic: FloatArray
    real: FloatArray

    def __repr__(self) -> str:
        absolute = self.comparisons[0]
        return (
            f"<Evaluation: {absolute.points} points, {absolute.bands} bands, NRMSE {absolute.nrmse_mean:.3f}, "
            f"MAPE {absolute.mape_mean:.1f} %, bias {absolute.bias_percent:+.1f} %>"
        )


def evaluate_run(
    run: str | PathLike[str],
    measured: str | PathLike[str],
    *,
    within_m: float = 0.15,
    scale: Scale = "none",
    unit: Unit = "W/m2/nm",
) -> Evaluation:
    """Compare the map of a run with measured spectral irradiance.

    Parameters
    ----------
    run : str or path
        Run folder with a finished map.
    measured : str or path
        CSV with the columns x, y, z [m] in the scan's frame and E_<channel> [W/m²/nm], as 'sensor join' writes it;
        channels that it lacks are left out. In other units the columns may have any name of a channel.
    within_m : float
        Readings farther than this from every point of the map are left out. [m]
    scale : 'none', 'one', 'die' or 'channel'
        Fit one factor on all readings, one per die, or one per channel, before comparing, for a sensor that is not
        calibrated.
    unit : 'W/m2/nm', 'uW/cm2' or 'counts'
        Of the readings.

    Returns
    -------
    evaluation : Evaluation

    Raises
    ------
    WorkspaceError
        If the run has no finished map.
    MapError
        If the readings lack columns, are not numbers, or too few of them lie on the map.
    """
    run, measured = path_of(run, name="run"), path_of(measured, name="measured")
    light = load_map(require_stage(run, "map") / MAP_FILE)
    labels = load_scene(require_stage(run, "scene")).bands.labels
    table = read_readings(measured)
    columns = channel_columns(table, labels, unit)
    kept = list(columns)
    if not kept:
        raise MapError(
            expected=f"columns E_<channel> [W/m²/nm], such as E_{labels[0]}",
            found=", ".join(map(str, table.columns[:8])),
            where=str(measured),
            todo="'lidarspectra sensor join' turns a log of counts into such a file; or name their unit with --unit. "
            "Readings in lux serve 'lidarspectra calibrate'.",
        )
    points, rows, turned = _matched(light, table, within_m, measured)
    synthetic = light["irradiance"].to_numpy()[points][:, kept]
    real = irradiance_of(table, list(columns.values()), unit, scale, measured)[rows]
    complete = np.isfinite(real).all(axis=1)
    whole = complete & (np.nan_to_num(real) > 0).all(axis=1)  # Eq. 9 divides by what was read
    dark = int(complete.sum() - whole.sum())
    if whole.sum() < MIN_POINTS:
        raise MapError(
            expected=f"{MIN_POINTS} or more readings with light in all channels",
            found=f"{int(whole.sum())}",
            where=str(measured),
            todo="Readings with saturated, missing or dark channels are left out; measure again with another gain.",
        )
    synthetic, real = synthetic[whole], real[whole]
    names = [labels[index] for index in kept]
    factors = fitted_factors(synthetic, real, scale, names)
    real = real * factors
    comparisons = tuple(compare_maps(synthetic, real, normalisation=each) for each in NORMALISATIONS)
    return Evaluation(
        comparisons=comparisons,
        scale=factors,
        table=_comparison_table(comparisons),
        bands=_band_table(synthetic, real, names),
        notes=(
            *result_notes(assumptions_of(light)),
            *_turned_note(turned),
            *_notes(
                len(table) - turned,
                len(rows),
                int(complete.sum()),
                dark,
                len(labels) - len(kept),
                factors,
                scale,
                within_m,
            ),
            *_foreign_note(table, list(columns.values())),
            *_level_note(synthetic, real, unit, scale),
        ),
        places=np.stack([light[axis].to_numpy() for axis in "xy"], axis=1)[points[whole]],
        centers_nm=light["band"].to_numpy()[kept],
        synthetic=synthetic,
        real=real,
    )


def save_evaluation(evaluation: Evaluation, folder: Path) -> Path:
    """Write the tables as CSV, Markdown and HTML, in a folder that is made if absent; raises WorkspaceError."""
    made_folder(folder)
    for table in (evaluation.table, evaluation.bands):
        save_table(table, folder)
    return folder


def draw_evaluation(evaluation: Evaluation, run: Path, folder: Path) -> tuple[Path, ...]:
    """Draw measured and simulated maps side by side, as PNG and PDF, in a folder that exists; raises MapError."""
    outline = load_room(require_stage(run, "scan")).outline
    maps = {"measured": evaluation.real, "simulated": evaluation.synthetic}
    figure = map_comparison_figure(maps, evaluation.places, evaluation.centers_nm, FloorPlan(outline=outline))
    return save_figure(figure, folder, "evaluation-maps")


def _matched(light: xr.Dataset, table: pd.DataFrame, within_m: float, where: Path) -> tuple[IntArray, IntArray, int]:
    """For each reading on the map the nearest of its points that look its way, its row, and how many find none such.

    Buried points do not count. Readings without nx, ny, nz are taken to look the way of the nearest point.
    """
    usable = np.flatnonzero(~light["buried"].to_numpy())
    places = np.stack([light[axis].to_numpy() for axis in "xyz"], axis=1)[usable]
    readings = table[["x", "y", "z"]].to_numpy(dtype=np.float64)
    placed = np.isfinite(readings).all(axis=1)
    tree = cKDTree(places)
    distance, nearest = tree.query(np.where(placed[:, None], readings, NOWHERE_M))
    near = placed & (distance <= within_m)
    agrees = near.copy()
    if set(DIRECTION) <= set(table.columns):
        looks, wanted = _directions(light, usable), table[list(DIRECTION)].to_numpy(dtype=np.float64)
        wanted = wanted / np.maximum(np.linalg.norm(wanted, axis=1, keepdims=True), 1e-12)
        for row in np.flatnonzero(near & np.isfinite(wanted).all(axis=1)):
            about = np.array(tree.query_ball_point(readings[row], within_m), dtype=np.int64)
            about = about[looks[about] @ wanted[row] >= np.cos(np.radians(MAX_TURN_DEG))]
            agrees[row] = about.size > 0
            if about.size:
                nearest[row] = about[np.argmin(np.linalg.norm(places[about] - readings[row], axis=1))]
    rows = np.flatnonzero(agrees)
    if rows.size < MIN_POINTS:
        closest = f"{float(distance[placed].min()):.2f} m" if placed.any() else "no reading has a place"
        turned = (
            f"; {int(near.sum() - rows.size)} more look another way than its points" if near.sum() > rows.size else ""
        )
        todo = "Measure at more of its points, looking as they do"
        if near.sum() < MIN_POINTS and not near.any():
            todo = "Bring the readings into the scan's coordinates with 'lidarspectra sensor join --align'"
        raise MapError(
            expected=f"{MIN_POINTS} or more readings within {within_m:g} m of the map's points",
            found=f"{rows.size}; the nearest is at {closest}{turned}",
            where=str(where),
            todo=f"{todo}.",
        )
    return usable[nearest[rows]].astype(np.int64), rows.astype(np.int64), int(near.sum() - rows.size)


def _directions(light: xr.Dataset, points: IntArray) -> FloatArray:
    """(point, 3) where some of the map's points look."""
    return np.stack([light[axis].to_numpy() for axis in DIRECTION], axis=1)[points].astype(np.float64)


def _turned_note(turned: int) -> tuple[str, ...]:
    """A note on readings that no point of the map looks like."""
    if not turned:
        return ()
    return (
        f"{were(turned, 'reading', ('is', 'are'))} left out, since the map's points beside them look another way, by "
        f"more than {MAX_TURN_DEG:g}°. Give their directions nx, ny, nz as the sensor looked, or map those "
        "directions too.",
    )


def _level_note(synthetic: FloatArray, real: FloatArray, unit: Unit, scale: Scale) -> tuple[str, ...]:
    """A note where readings are so far from the map that their unit is in doubt."""
    ratio = float(np.median(real / np.maximum(synthetic, 1e-30)))
    if scale != "none" or 1.0 / UNLIKELY_RATIO < ratio < UNLIKELY_RATIO:
        return ()
    return (
        f"The readings are {two_digits(ratio)} times the map in the median, taken as {unit}. Check their unit (--unit: "
        "W/m2/nm, uW/cm2 or counts), and the lamps' fluxes in the run file; 'absolute' below says nothing until then.",
    )


def _comparison_table(comparisons: tuple[Comparison, ...]) -> Table:
    rows = [asdict(comparison) for comparison in comparisons]
    frame = pd.DataFrame(
        {
            "normalisation": [row["normalisation"] for row in rows],
            "points": [row["points"] for row in rows],
            "bands": [row["bands"] for row in rows],
            "NRMSE mean [1]": [row["nrmse_mean"] for row in rows],
            "NRMSE median [1]": [row["nrmse_median"] for row in rows],
            "MAPE mean [%]": [row["mape_mean"] for row in rows],
            "APE median [%]": [row["mape_median"] for row in rows],
            "bias [%]": [row["bias_percent"] for row in rows],
            "angle median [deg]": [row["angle_median_deg"] for row in rows],
        }
    )
    formats = dict.fromkeys(("NRMSE mean [1]", "NRMSE median [1]"), ".3f")
    formats |= dict.fromkeys(("MAPE mean [%]", "APE median [%]", "bias [%]", "angle median [deg]"), ".2f")
    return Table(name="evaluation", caption="Comparison of the map with the readings.", frame=frame, formats=formats)


def _band_table(synthetic: FloatArray, real: FloatArray, labels: list[str]) -> Table:
    difference = synthetic - real
    frame = pd.DataFrame(
        {
            "band [nm]": labels,
            "NRMSE [1]": np.sqrt((difference**2).mean(axis=0)) / real.mean(axis=0),
            "median error [%]": 100.0 * np.median(np.abs(difference) / real, axis=0),
            "bias [%]": 100.0 * difference.sum(axis=0) / real.sum(axis=0),
        }
    )
    formats = {"NRMSE [1]": ".3f", "median error [%]": ".2f", "bias [%]": ".2f"}
    return Table(name="evaluation-bands", caption="Errors by channel, over the points.", frame=frame, formats=formats)


def _foreign_note(table: pd.DataFrame, used: Sequence[str]) -> tuple[str, ...]:
    """A note on columns of irradiance that are no channel of the map: a channel more, or a slip in a name."""
    foreign = [name for name in map(str, table.columns) if name.startswith("E_") and name not in used]
    if not foreign:
        return ()
    return (f"Columns that are no channels of the map are not compared: {', '.join(foreign[:8])}.",)


def _notes(
    read: int,
    near: int,
    complete: int,
    dark: int,
    lacking: int,
    factors: FloatArray,
    scale: Scale,
    within_m: float,
) -> tuple[str, ...]:
    notes = []
    if near < read:
        notes.append(
            f"{read - near} of {read} readings are left out, since they are farther than {within_m:g} m from the map's "
            "points. Check that they are in the scan's coordinates, or give a larger --within."
        )
    if complete < near:
        notes.append(f"{were(near - complete, 'reading', ('is', 'are'))} left out for lack of a channel.")
    if dark:
        notes.append(
            f"{were(dark, 'reading', ('is', 'are'))} left out, since a channel read zero or less, where a percentage "
            "is undefined. Measure there with a higher gain if they matter."
        )
    if lacking:
        notes.append(f"{were(lacking, 'channel')} not measured, of those of the map, and not compared.")
    if scale == "one":
        notes.append(
            f"The readings were multiplied by a fitted factor of {factors[0]:.4g}, so that the comparison says nothing "
            "on the absolute level."
        )
    if scale in ("die", "channel"):
        notes.append(
            f"The readings of each {scale} were multiplied by a fitted factor ({factors.min():.4g} to "
            f"{factors.max():.4g}), so that the comparison says nothing on its absolute level."
        )
    return tuple(notes)
