"""A cell's fit in a file (JSON), and the cell that it makes for maps."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import ReadingError
from lidarspectra.hardware.sensor.photocell import M2_PER_CM2, CellCircuit
from lidarspectra.io.files import write_whole, writing
from lidarspectra.mapping.photovoltaics.cell_fit import CellFit
from lidarspectra.mapping.photovoltaics.response_fit import ResponseFit

SCHEMA = "lidarspectra cell fit 1"
FIT_SUFFIX = ".json"
FitSignal = Literal["irradiance", "module values"]
_ARRAYS = ("weights", "mean", "size", "covariance", "scatter", "renewal")


@dataclass(frozen=True, kw_only=True, eq=False)
class SavedFit:
    """A fit with what is known of its log.

    Parameters
    ----------
    fit : CellFit
    name : str
        Of the cell.
    signal : 'irradiance' or 'module values'
        Unit of its readings: [W/m²/nm], or as a sketch sends them without its gain and time.
    calibration : str
        Of the sensor; 'data sheet' without one.
    circuit : CellCircuit or None
        How the cell was wired; counts are no currents without it.
    """

    fit: CellFit
    name: str
    signal: FitSignal
    calibration: str
    circuit: CellCircuit | None


def save_fit(saved: SavedFit, path: Path) -> None:
    """Write a fit, whole or not at all; raises ReadingError if it cannot be written."""
    fit = saved.fit
    content = {
        "schema": SCHEMA,
        "name": saved.name,
        "signal": saved.signal,
        "calibration": saved.calibration,
        "circuit": None if saved.circuit is None else asdict(saved.circuit),
        "response": {name: _plain(value) for name, value in vars(fit.response).items()},
        "fit": {name: _plain(value) for name, value in vars(fit).items() if name != "response"},
    }
    with writing(path, error=ReadingError):
        write_whole(path, json.dumps(content, indent=1) + "\n")


def load_fit(path: Path) -> SavedFit:
    """Read a fit that `save_fit` wrote.

    Raises
    ------
    ReadingError
        If it is none.
    """
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(content, dict) or content.get("schema") != SCHEMA:
            raise ValueError(f"schema {content.get('schema')!r}" if isinstance(content, dict) else "no object")
        given = dict(content["fit"])
        for name in _ARRAYS:
            given[name] = None if given[name] is None else np.array(given[name], dtype=np.float64)
        given["extras"] = {name: (float(slope), float(mean)) for name, (slope, mean) in given["extras"].items()}
        response = content["response"]
        fit = CellFit(
            response=ResponseFit(
                wavelengths_nm=np.array(response["wavelengths_nm"], dtype=np.float64),
                weights=np.array(response["weights"], dtype=np.float64),
                offset=float(response["offset"]),
                penalty=float(response["penalty"]),
                scale=float(response["scale"]),
            ),
            **given,
        )
        circuit = None if content["circuit"] is None else CellCircuit(**content["circuit"])
        return SavedFit(
            fit=fit,
            name=str(content["name"]),
            signal="irradiance" if content["signal"] == "irradiance" else "module values",
            calibration=str(content["calibration"]),
            circuit=circuit,
        )
    except (OSError, ValueError, KeyError, TypeError) as cause:
        raise ReadingError(
            expected="a fit that 'cells fit --out' wrote",
            found=str(cause)[:200],
            where=str(path),
            todo="Fit the cell again.",
        ) from cause


def efficiency_of_fit(saved: SavedFit) -> tuple[FloatArray, FloatArray, bool]:
    """The cell's a(λ) at the channels by its non-negative curve.

    Where readings are irradiances and the circuit is known, the curve is a quantum efficiency: the fitted current
    density w_c k / A per irradiance is (q/hc) λ a(λ) over the width that a channel stands for.

    Returns
    -------
    wavelengths : (channel,) float
        [nm]
    efficiency : (channel,) float
        A quantum efficiency, or relative with a maximum of 1. [1]
    is_absolute : bool
    """
    wavelengths = saved.fit.response.wavelengths_nm
    if saved.signal != "irradiance" or saved.circuit is None:
        return wavelengths, saved.fit.response.absorption, False
    from scipy import constants

    per_count = saved.circuit.ampere_per_count / (saved.circuit.area_cm2 * M2_PER_CM2)
    ampere_per_watt_nm = constants.e / (constants.h * constants.c) * 1e-9
    width = np.gradient(wavelengths)
    found = saved.fit.gain * saved.fit.response.weights * per_count / (ampere_per_watt_nm * wavelengths * width)
    if found.max() > 1.0:
        return wavelengths, saved.fit.response.absorption, False
    return wavelengths, np.asarray(found, dtype=np.float64), True


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return {name: list(pair) for name, pair in value.items()}
    return value
