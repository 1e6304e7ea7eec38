"""What a calibration gives: the run file with its factors, and tables of unknowns and readings."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from lidarspectra.arrays import FloatArray
from lidarspectra.config import CalibrationSection, LampSection, RunFile
from lidarspectra.io.files import hash_file
from lidarspectra.io.toml_text import toml_value
from lidarspectra.mapping.calibration.model import LightModel
from lidarspectra.mapping.calibration.posterior import Posterior
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.maps.visible_bands import covers_vision
from lidarspectra.room.surface_parts import PARTS
from lidarspectra.workflow.calibration.light import RunRoom
from lidarspectra.workflow.calibration.readings import Readings, unit_of

SUFFIX = ".calibrated"  # of the run file's name
SUMMARY = "calibration.json"  # beside the tables, for the report
REPORTED = ("unknowns.csv", "readings.csv", "points.csv")  # tables that the report shows
MAX_SHARE_OF_PRIOR = 0.9  # [1] of the prior's deviation that is left, up to which the readings determined an unknown


def found_by_calibration(
    section: CalibrationSection | None, run: Path, names: Sequence[str]
) -> dict[str, dict[str, str]]:
    """What a stage depends on of the calibration in its run folder: SHA-256 of its files, if there are any.

    They are none where the run file has no `[calibration]`.
    """
    folder = run / "calibration"
    found = {} if section is None else {name: folder / name for name in names}
    hashes = {name: hash_file(path) for name, path in found.items() if path.is_file()}
    return {"calibration": hashes} if hashes else {}


def calibrated_run_file(room: RunRoom, posterior: Posterior, measured: Path, spectra: Mapping[str, str]) -> RunFile:
    """The run file with the factors that readings determined, times those that it had, and other spectra by name.

    Lamps whose flux the readings determined are listed so: it is assumed no longer, though their spectra may
    be. The text keeps its comments unless it had a calibration, or gets other spectra.
    """
    old = room.run_file.calibration or CalibrationSection()
    flux = np.exp(posterior.flux)
    reflectance = dict(zip(PARTS, np.exp(posterior.reflectance), strict=True))
    lamp_factors = {
        lamp.name: float(f"{old.lamps.get(lamp.name, 1.0) * factor:.6g}")
        for lamp, factor in zip(room.lamps, flux, strict=True)
    }
    part_factors = {part: float(f"{getattr(old.reflectance, part) * reflectance[part]:.6g}") for part in PARTS}
    determined = [
        lamp.name
        for lamp, is_determined in zip(room.lamps, _determined(posterior)[: len(room.lamps)], strict=True)
        if is_determined or lamp.name in old.determined
    ]
    section = {
        "measured": measured.name,
        "lamps": lamp_factors,
        "determined": determined,
        "reflectance": part_factors,
    }
    lamps = [_lamp_table(lamp, spectra.get(lamp.name)) for lamp in room.run_file.lamps]
    origin = room.run_file.with_origin(folder=room.base, name=f"{room.name}{SUFFIX}")
    changed = origin.changed(calibration=section, **({"lamps": lamps} if spectra else {}))
    if spectra or room.run_file.calibration is not None:
        return changed
    tables = [
        f"[calibration]\nmeasured = {toml_value(measured.name)}\ndetermined = {toml_value(determined)}",
        "\n".join(["[calibration.lamps]", *(f"{toml_value(name)} = {each}" for name, each in lamp_factors.items())]),
        "\n".join(["[calibration.reflectance]", *(f"{part} = {each}" for part, each in part_factors.items())]),
    ]
    text = room.run_file.text.rstrip() + "\n\n" + "\n\n".join(tables) + "\n"
    return changed.with_origin(folder=room.base, name=f"{room.name}{SUFFIX}", text=text)


def _lamp_table(lamp: LampSection, spectrum: str | None) -> dict[str, object]:
    """A lamp's table in the run file, with the spectrum that fits the readings, which is assumed no longer."""
    table = lamp.model_dump(exclude_unset=True)
    if spectrum is not None:
        if lamp.assumed:
            table["assumed"] = [each for each in ("flux", "place") if each in lamp.guesses] or False
        table.pop("cct_k", None)
        table["spectrum"] = spectrum
    return table


def unknowns_table(room: RunRoom, readings: Readings, posterior: Posterior) -> Table:
    """Every factor: what it is on, its value, and its deviation before and after the readings."""
    names = [*(lamp.name for lamp in room.lamps), *PARTS, *readings.meters]
    kinds = ["lamp flux"] * len(room.lamps) + ["reflectance"] * len(PARTS) + ["meter"] * len(readings.meters)
    before, after = np.sqrt(np.diag(posterior.prior)), posterior.sd
    frame = pd.DataFrame(
        {
            "factor on": kinds,
            "name": names,
            "factor [1]": np.exp(posterior.unknowns),
            "deviation before [%]": 100 * before,
            "deviation after [%]": 100 * after,
            "determined by the readings": ["yes" if each else "no" for each in _determined(posterior)],
        }
    )
    return Table(
        name="unknowns",
        caption="What the readings determine of lamps, reflectances and meters; elsewhere the prior stays.",
        frame=frame,
        formats={"factor [1]": ".3f", "deviation before [%]": ".1f", "deviation after [%]": ".1f"},
    )


def readings_table(
    readings: Readings,
    before: LightModel,
    after: LightModel,
    posterior: Posterior,
    probability: np.ndarray,
    room: RunRoom,
) -> Table:
    """Every number as it was read, and as the model has it before and after."""
    numbers = readings.numbers
    meters = posterior.unknowns[posterior.lamps + posterior.parts :][numbers.meter]
    predicted = after.at(posterior.flux, posterior.reflectance).sum(axis=1) * np.exp(meters)
    labels = [
        quantity if isinstance(quantity, str) else f"{room.bands.labels[quantity]} nm"
        for quantity in readings.quantities
    ]
    positions = readings.positions[numbers.row]
    frame = pd.DataFrame(
        {
            "reading": [readings.names[row] for row in numbers.row],
            "x [m]": positions[:, 0],
            "y [m]": positions[:, 1],
            "z [m]": positions[:, 2],
            "quantity": labels,
            "unit": [unit_of(quantity) for quantity in readings.quantities],
            "measured": numbers.value,
            "run before": before.light.sum(axis=1),
            "model after": predicted,
            "off before [%]": 100 * (before.light.sum(axis=1) / numbers.value - 1),
            "off after [%]": 100 * (predicted / numbers.value - 1),
            "probability [1]": probability[numbers.row],
        }
    )
    return Table(
        name="readings",
        caption="The readings, and what the run has there before and after. The probability is that of so large a "
        "deviation from what all other readings tell of the place.",
        frame=frame,
        formats={"off before [%]": "+.1f", "off after [%]": "+.1f", "probability [1]": ".2g"},
    )


def points_table(
    positions: FloatArray,
    models: tuple[LightModel, LightModel],
    posterior: Posterior,
    deviations: tuple[FloatArray, FloatArray],
    room: RunRoom,
) -> Table:
    """The run's own points: their light before and after, in lux where the channels allow it, and its deviations."""
    before, after = models
    unit = "lx" if covers_vision(room.bands.centers_nm) else "W/m²/nm, sum over channels"
    frame = pd.DataFrame(
        {
            **{f"{axis} [m]": positions[:, index] for index, axis in enumerate("xyz")},
            f"before [{unit}]": before.light.sum(axis=1),
            f"after [{unit}]": after.at(posterior.flux, posterior.reflectance).sum(axis=1),
            "deviation before [%]": 100 * deviations[0],
            "deviation after [%]": 100 * deviations[1],
        }
    )
    return Table(
        name="points",
        caption="The run's own points before and after the readings.",
        frame=frame,
        formats={"deviation before [%]": ".1f", "deviation after [%]": ".1f"},
    )


def undetermined_note(room: RunRoom, posterior: Posterior) -> tuple[str, ...]:
    """A note on lamps and parts that no reading determines; a meter's factor is nobody's aim."""
    names = [f"the flux of '{lamp.name}'" for lamp in room.lamps]
    names += [f"the reflectance of the {part}" for part in PARTS]
    determined = _determined(posterior)[: len(names)]
    left = [name for name, is_determined in zip(names, determined, strict=True) if not is_determined]
    if not left:
        return ()
    return (f"No reading determines {', '.join(left)}: what the run had stays. '--plan' shows where a reading would.",)


def _determined(posterior: Posterior) -> list[bool]:
    """Of each unknown (lamps, parts, meters), whether the readings narrowed its prior."""
    before = np.sqrt(np.diag(posterior.prior))
    return [bool(each) for each in posterior.sd <= MAX_SHARE_OF_PRIOR * before]
