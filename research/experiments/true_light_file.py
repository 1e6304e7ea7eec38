"""True light in a file beside its scene: truth/light.nc, a few hundred kilobytes with its error and who checked it."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.errors import MapError
from lidarspectra.io.netcdf import read_netcdf, write_netcdf
from lidarspectra.mapping.figures.tables import Table
from research.experiments.true_light import TrueLight

SCHEMA = "lidarspectra true light 1"
UNIT = "W m-2 nm-1"


@dataclass(frozen=True, kw_only=True)
class SecondOpinion:
    """How far another engine is from the true light, over points and the wavelengths that it was asked for.

    Parameters
    ----------
    engine : str
        Its name and version.
    wavelengths : int
        How many were compared.
    nrmse_percent : float
        Root mean square difference over the mean, its own noise taken out, averaged over wavelengths. [%]
    bias_percent, bias_se_percent : float
        Mean difference over the mean, and the standard error that both engines' noise leaves it. [%]
    """

    engine: str
    wavelengths: int
    nrmse_percent: float
    bias_percent: float
    bias_se_percent: float


@dataclass(frozen=True, kw_only=True, eq=False)
class StoredLight:
    """What a file holds.

    Parameters
    ----------
    positions, normals : (point, 3) float
        [m, 1]
    buried : (point,) bool
    wavelengths_nm : (wavelength,) float
        [nm]
    irradiance, irradiance_se : (point, wavelength) float
        [W/m²/nm]
    channel_nm : (band,) float
        Centres. [nm]
    channel_irradiance, channel_se : (point, band) float
        [W/m²/nm]
    opinion : SecondOpinion or None
    """

    positions: FloatArray
    normals: FloatArray
    buried: BoolArray
    wavelengths_nm: FloatArray
    irradiance: FloatArray
    irradiance_se: FloatArray
    channel_nm: FloatArray
    channel_irradiance: FloatArray
    channel_se: FloatArray
    opinion: SecondOpinion | None


def save_true_light(light: TrueLight, path: Path, opinion: SecondOpinion | None = None) -> Path:
    """Write true light as NetCDF, four bytes a number, compressed.

    Parameters
    ----------
    light : TrueLight
    path : Path
    opinion : SecondOpinion, optional
        Of another engine.

    Returns
    -------
    path : Path
    """
    text = "standard error of the same"
    values = {
        "irradiance": (("point", "wavelength"), light.irradiance, "spectral irradiance at single wavelengths"),
        "irradiance_se": (("point", "wavelength"), light.irradiance_se, text),
        "channel_irradiance": (
            ("point", "band"),
            light.channel_irradiance,
            "spectral irradiance as a channel weighs it",
        ),
        "channel_se": (("point", "band"), light.channel_se, text),
    }
    dataset = xr.Dataset(
        {
            name: (dims, array.astype(np.float32), {"units": UNIT, "long_name": words})
            for name, (dims, array, words) in values.items()
        },
        {
            "wavelength": ("wavelength", light.wavelengths_nm, {"units": "nm"}),
            "band": ("band", light.channels.centers_nm, {"units": "nm"}),
            **{axis: ("point", light.points.positions[:, i], {"units": "m"}) for i, axis in enumerate("xyz")},
            **{f"n{axis}": ("point", light.points.normals[:, i], {"units": "1"}) for i, axis in enumerate("xyz")},
            "buried": ("point", light.points.buried.astype(np.int8)),
        },
        {"Conventions": "CF-1.11", "schema": SCHEMA, **(_opinion_attributes(opinion) if opinion else {})},
    )
    compressed = {name: {"zlib": True, "complevel": 9, "shuffle": True} for name in values}
    write_netcdf(dataset, path, encoding=compressed)
    return path


def load_true_light(path: Path) -> StoredLight:
    """Read true light.

    Raises
    ------
    MapError
        If there is no such file, or it holds something else.
    """
    try:
        dataset = read_netcdf(path)
    except ValueError as cause:
        raise MapError(
            expected="the true light of a scene", found=str(cause), where=str(path),
            todo="Make it with 'python -m research.scenes.true_light SCENE'.",
        ) from cause  # fmt: skip
    if dataset.attrs.get("schema") != SCHEMA:
        raise MapError(expected=SCHEMA, found=str(dataset.attrs.get("schema")), where=str(path))
    numbers = {name: dataset[name].to_numpy().astype(np.float64) for name in dataset.variables}
    return StoredLight(
        positions=np.stack([numbers[axis] for axis in "xyz"], axis=1),
        normals=np.stack([numbers[f"n{axis}"] for axis in "xyz"], axis=1),
        buried=numbers["buried"] > 0,
        wavelengths_nm=numbers["wavelength"],
        irradiance=numbers["irradiance"],
        irradiance_se=numbers["irradiance_se"],
        channel_nm=numbers["band"],
        channel_irradiance=numbers["channel_irradiance"],
        channel_se=numbers["channel_se"],
        opinion=_opinion(dataset),
    )


def truth_table(lights: Mapping[str, StoredLight]) -> Table:
    """One line a scene: the error of its true light, and what another engine says of it."""
    rows = []
    for scene, light in lights.items():
        error = 100.0 * np.sqrt((light.channel_se**2).mean(axis=0)) / light.channel_irradiance.mean(axis=0)
        opinion = light.opinion
        rows.append(
            {
                "scene": scene,
                "points": int((~light.buried).sum()),
                "standard error [%]": float(error.mean()),
                "worst channel [%]": float(error.max()),
                "second engine": opinion.engine if opinion else "not asked",
                "NRMSE against it [%]": opinion.nrmse_percent if opinion else float("nan"),
                "bias [%]": opinion.bias_percent if opinion else float("nan"),
                "bias's standard error [%]": opinion.bias_se_percent if opinion else float("nan"),
            }
        )
    frame = pd.DataFrame(rows)
    formats = {str(name): ".2f" for name in frame.columns if "[%]" in str(name)}
    caption = "The true light's own standard error at a point, and how far another engine is from it."
    return Table(name="truth", caption=caption, frame=frame, formats=formats)


def _opinion_attributes(opinion: SecondOpinion) -> dict[str, str | int | float]:
    return {
        "second_opinion_engine": opinion.engine,
        "second_opinion_wavelengths": opinion.wavelengths,
        "second_opinion_nrmse_percent": opinion.nrmse_percent,
        "second_opinion_bias_percent": opinion.bias_percent,
        "second_opinion_bias_se_percent": opinion.bias_se_percent,
    }


def _opinion(dataset: xr.Dataset) -> SecondOpinion | None:
    if "second_opinion_engine" not in dataset.attrs:
        return None
    told = dataset.attrs
    return SecondOpinion(
        engine=str(told["second_opinion_engine"]),
        wavelengths=int(told["second_opinion_wavelengths"]),
        nrmse_percent=float(told["second_opinion_nrmse_percent"]),
        bias_percent=float(told["second_opinion_bias_percent"]),
        bias_se_percent=float(told["second_opinion_bias_se_percent"]),
    )
