"""A run's map against measured readings: the paper's Table 1 for any room that was measured, and in lux."""

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from lidarspectra.arguments import path_of
from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.hardware.sensor.measured_readings import (
    Scale,
    Unit,
    channel_columns,
    irradiance_of,
    lux_column,
    numbers_of,
    read_readings,
)
from lidarspectra.mapping.figures.figure_style import save_figure
from lidarspectra.mapping.figures.illuminance_comparison_figure import illuminance_comparison_figure
from lidarspectra.mapping.figures.map_comparison_figure import map_comparison_figure
from lidarspectra.mapping.figures.tables import Table, save_table
from lidarspectra.mapping.maps.assumptions import assumptions_of
from lidarspectra.mapping.maps.map_files import MAP_FILE, load_map
from lidarspectra.mapping.maps.map_schema import UNKNOWN_CHANNELS, dark_bands, has_illuminance
from lidarspectra.mapping.maps.readings_on_map import ComparedReadings, compare_readings, match_readings
from lidarspectra.radiance.scene.scene import load_scene
from lidarspectra.words import two_digits, were
from lidarspectra.workflow.applications.evaluation_tables import TABLES, band_table, comparison_table, illuminance_table
from lidarspectra.workflow.run_folder.assumed import result_notes
from lidarspectra.workflow.run_folder.light_of_run import plan_of_run
from lidarspectra.workflow.run_folder.workspace import made_folder, require_stage, writing_run

FIGURES = ("evaluation-maps", "evaluation-illuminance")
KINDS = ("csv", "md", "html", "png", "svg")
UNLIKELY_RATIO = 10.0  # [1] of readings to the map or the reverse: a unit is wrong rather than a lamp


@dataclass(frozen=True, kw_only=True, eq=False)
class Evaluation:
    """Comparison of a map with readings.

    Parameters
    ----------
    spectra : ComparedReadings or None
        Spectral irradiance, where channels were read.
    centers_nm : (band,) float
        Of the channels that were read. [nm]
    illuminance : ComparedReadings or None
        Where lux were read.
    tables : tuple of Table
        The comparisons, for people.
    notes : tuple of str
        What was left out or fitted, as full sentences.
    """

    spectra: ComparedReadings | None
    centers_nm: FloatArray
    illuminance: ComparedReadings | None
    tables: tuple[Table, ...]
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        parts = []
        for name, compared in (("spectra", self.spectra), ("illuminance", self.illuminance)):
            if compared is not None:
                error = compared.comparisons[0]
                parts.append(
                    f"{name}: {error.points} points, {error.bands} bands, NRMSE {error.nrmse_mean:.3f}, "
                    f"MAPE {error.mape_mean:.1f} %, bias {error.bias_percent:+.1f} %"
                )
        return f"<Evaluation: {'; '.join(parts)}>"


def evaluate_run(
    run: str | PathLike[str],
    measured: str | PathLike[str],
    *,
    within_m: float = 0.15,
    scale: Scale = "none",
    unit: Unit = "W/m2/nm",
) -> Evaluation:
    """Compare the map of a run with measured spectral irradiance or illuminance.

    Parameters
    ----------
    run : str or path
        Run folder with a finished map.
    measured : str or path
        CSV with the columns x, y, z [m] in the scan's frame and E_<channel> [W/m²/nm], as 'sensor join' writes it;
        channels that it lacks are left out. In other units the columns may have any name of a channel. In their place
        or beside them 'lux'.
    within_m : float
        Readings farther than this from every point of the map are left out. [m]
    scale : 'none', 'one', 'die' or 'channel'
        Fit one factor on all readings, one per die, or one per channel, before comparing, for a sensor that is not
        calibrated. Lux have a factor of their own.
    unit : 'W/m2/nm', 'uW/cm2' or 'counts'
        Of the channels.

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
    columns, lux = channel_columns(table, labels, unit), lux_column(table)
    if not columns and lux is None:
        raise MapError(
            expected=f"columns E_<channel> [W/m²/nm], such as E_{labels[0]}, or lux",
            found=", ".join(map(str, table.columns[:8])),
            where=str(measured),
            todo="'lidarspectra sensor join' turns a log of counts into such a file; or name their unit with --unit.",
        )
    dark = dark_bands(light) | ~light["irradiance"].any("point").to_numpy()
    dark |= np.isin(labels, str(light.attrs.get(UNKNOWN_CHANNELS, "")).split("\n"))
    read_columns, unlit = set(columns.values()), [index for index in columns if dark[index]]
    columns = {index: name for index, name in columns.items() if not dark[index]}
    if not columns and lux is None:
        raise MapError(
            expected="readings of channels in which the map has light",
            found=f"{', '.join(labels[index] for index in unlit)} nm alone",
            where=str(measured),
            todo="Give the lamps spectra that reach as far, if they send light there.",
        )
    matched = match_readings(light, table, within_m, measured, plan_of_run(run).partitions)
    kept = list(columns)
    names = [labels[index] for index in kept]
    tables, notes = [], [*result_notes(assumptions_of(light)), *matched.notes]
    if unlit:
        notes.append(
            "Channels into which the lamps send next to nothing by their spectra, or of which these tell but a part, "
            f"are not compared: {', '.join(labels[index] for index in unlit)} nm. If they matter, give spectra that "
            "reach as far."
        )
    spectra = illuminance = None
    if columns:
        real = irradiance_of(table, list(columns.values()), unit, scale, measured)
        spectra, said = compare_readings(light.isel(band=kept), "irradiance", real, matched, names, scale, measured)
        foreign = [name for name in map(str, table.columns) if name.startswith("E_") and name not in read_columns]
        lacking = len(labels) - len(kept) - len(unlit)
        notes += [*said, *_channel_notes(lacking, foreign), *_factor_note(spectra.scale, scale)]
        notes += _level_note(spectra, unit, scale)
        tables += [comparison_table(spectra.comparisons), band_table(spectra, names)]
    if lux is not None and not has_illuminance(light):
        refused = MapError(
            expected="a map whose channels cover what the eye sees, for readings in lux",
            found=f"channels from {labels[0]} to {labels[-1]}",
            where=f"{measured}, column '{lux}'",
            todo="Choose a device that does under [sensors] in the run file.",
        )
        if spectra is None:
            raise refused
        notes.append(f"Lux are not compared: {refused}")
    elif lux is not None:
        read = numbers_of(table, lux, measured)[:, None]
        factor: Scale = "none" if scale == "none" else "one"
        illuminance, said = compare_readings(light, "illuminance", read, matched, ["lux"], factor, measured)
        notes += [f"Illuminance: {note}" for note in (*said, *_factor_note(illuminance.scale, factor))]
        notes += _level_note(illuminance, "lx", scale)
        tables.append(illuminance_table(illuminance))
    return Evaluation(
        spectra=spectra,
        centers_nm=light["band"].to_numpy()[kept],
        illuminance=illuminance,
        tables=tuple(tables),
        notes=tuple(notes),
    )


def save_evaluation(evaluation: Evaluation, folder: Path) -> Path:
    """Write the tables as CSV, Markdown and HTML, in a folder that is made if absent; raises WorkspaceError.

    What an earlier evaluation left there is removed: its tables and figures are of other readings.
    """
    made_folder(folder)
    with writing_run(folder):
        for name in (*TABLES, *FIGURES):
            for kind in KINDS:
                (folder / f"{name}.{kind}").unlink(missing_ok=True)
    for table in evaluation.tables:
        save_table(table, folder)
    return folder


def draw_evaluation(evaluation: Evaluation, run: Path, folder: Path) -> tuple[Path, ...]:
    """Draw measured and simulated light side by side, as PNG and SVG, in a folder that exists; raises MapError."""
    plan = plan_of_run(run)
    files: tuple[Path, ...] = ()
    if evaluation.spectra is not None:
        maps = {"measured": evaluation.spectra.real, "simulated": evaluation.spectra.synthetic}
        figure = map_comparison_figure(maps, evaluation.spectra.places, evaluation.centers_nm, plan)
        files += save_figure(figure, folder, FIGURES[0])
    if evaluation.illuminance is not None:
        lux = evaluation.illuminance
        deviation = None if lux.uncertainty is None else lux.uncertainty[:, 0]
        figure = illuminance_comparison_figure(lux.real[:, 0], lux.synthetic[:, 0], lux.places, plan, deviation)
        files += save_figure(figure, folder, FIGURES[1])
    return files


def _channel_notes(lacking: int, foreign: Sequence[str]) -> tuple[str, ...]:
    """Notes on channels of the map that were not read, and on columns that are none: one more, or a slip in a name."""
    notes = []
    if lacking:
        notes.append(f"{were(lacking, 'channel')} not measured, of those of the map, and not compared.")
    if foreign:
        notes.append(f"Columns that are no channels of the map are not compared: {', '.join(foreign[:8])}.")
    return tuple(notes)


def _factor_note(factors: FloatArray, scale: Scale) -> tuple[str, ...]:
    if scale == "none":
        return ()
    if scale == "one":
        said = f"The readings were multiplied by a fitted factor of {factors[0]:.4g}"
    else:
        said = (
            f"The readings of each {scale} were multiplied by a fitted factor ({factors.min():.4g} to "
            f"{factors.max():.4g})"
        )
    return (f"{said}, so that the comparison says nothing on the absolute level.",)


def _level_note(compared: ComparedReadings, unit: str, scale: Scale) -> tuple[str, ...]:
    """A note where readings are so far from the map that their unit is in doubt."""
    ratio = float(np.median(compared.real / np.maximum(compared.synthetic, 1e-30)))
    if scale != "none" or 1.0 / UNLIKELY_RATIO < ratio < UNLIKELY_RATIO:
        return ()
    doubt, errors = "Check their unit (--unit: W/m2/nm, uW/cm2 or counts)", "'absolute' below says nothing"
    if unit == "lx":
        doubt, errors = "Check the meter's range", "the errors in lux say nothing"
    return (
        f"The readings are {two_digits(ratio)} times the map in the median, taken as {unit}. {doubt}, and the lamps' "
        f"fluxes in the run file; {errors} until then.",
    )
