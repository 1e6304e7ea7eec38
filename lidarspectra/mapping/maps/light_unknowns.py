"""What is not known behind a map, and how far off each point may be for it: an uncertainty beside the standard error.

The light at a point is Σ_l s_l A_l exp(Σ_k g_k r_k) with lamp fluxes s and the logarithms r of factors on the
reflectances of the room's parts, as in `mapping.calibration.model`. To first order the variance of its logarithm is
J C Jᵀ, with the covariance C of what is not known and J the share of each lamp and the slope g of each part: an error
of a lamp, or of the walls, is the same error at all points. To it are added by how much usual lamps differ from a
spectrum that is a guess, what openings may hide, what the scan lacks (furniture, gloss, edges: an error of its own at
each place), and the simulation's own error.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import xarray as xr

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, float_array
from lidarspectra.errors import MapError
from lidarspectra.io.netcdf import read_netcdf, write_netcdf
from lidarspectra.words import two_digits

UNKNOWNS_FILE = "uncertainty.nc"  # beside the map
Cause = Literal["lamps", "reflectances", "spectra", "openings", "scan", "simulation"]
CAUSES: tuple[Cause, ...] = get_args(Cause)
OF_CAUSE = "uncertainty_of_"  # attributes of a map, one a cause
ALL_CAUSES = "uncertainty"  # attribute of a map
POINTS_AT_ONCE = 20_000
NAMED_CAUSES = 2  # in words, the largest
UNIFORM = 3.0**-0.5  # [1] root mean square of what lies anywhere between nothing and the whole
MAX_ERROR_SCALE = 4.0  # [1]


@dataclass(frozen=True, kw_only=True, eq=False)
class LightUnknowns:
    """What is not known of a room's light.

    Parameters
    ----------
    covariance : (lamp + part, lamp + part) float
        Of the logarithms of the lamps' fluxes and of the parts' reflectances. [1]
    slope : (part, point, band) float
        d ln irradiance / d ln reflectance. [1]
    spread : (part, band) float
        Deviation of a part's reflectance in each band over that in `covariance`. [1]
    local_sd : float
        Of the light at a place of usual light for what the scan lacks, relative. [1]
    spectrum_sd : (lamp, band) float, optional
        Deviation of the logarithm of each lamp's light in a band for a spectrum that is a guess, at its luminous flux;
        0 for one that is known, as all are by default. All guesses err alike. [1]
    beyond : (lamp, band) float, optional
        What each lamp may send into a band at most beyond the ends of its spectrum, over its flux in its brightest
        band; nothing by default (`lamps.lamp_spectra.beyond_ends`). [1]
    """

    covariance: FloatArray
    slope: FloatArray
    spread: FloatArray
    local_sd: float
    spectrum_sd: FloatArray | None = None
    beyond: FloatArray | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "slope", float_array(self.slope, name="slope", shape=(None, None, None)))
        parts, _, bands = self.slope.shape
        object.__setattr__(self, "spread", float_array(self.spread, name="spread", shape=(parts, bands)))
        covariance = float_array(self.covariance, name="covariance", shape=(None, None))
        if covariance.shape[0] != covariance.shape[1] or covariance.shape[0] < parts:
            raise MapError(
                expected=f"a square covariance of the lamps and {parts} parts",
                found=f"shape {covariance.shape}",
                where="LightUnknowns.covariance",
            )
        object.__setattr__(self, "covariance", covariance)
        shape = (len(covariance) - parts, bands)
        for name in ("spectrum_sd", "beyond"):
            given = getattr(self, name)
            values = np.zeros(shape) if given is None else given
            object.__setattr__(self, name, float_array(values, name=name, shape=shape))

    @property
    def lamps(self) -> int:
        """Number of lamps."""
        return len(self.covariance) - len(self.slope)

    def with_given_fluxes(self, lamps: IntArray, given: FloatArray) -> "LightUnknowns":
        """The same where the fluxes of some lamps are given anew, whatever guess or readings told of the former ones.

        Parameters
        ----------
        lamps : (some,) int
            Rows of the covariance.
        given : (some, some) float
            Covariance of their logarithms; with all else they have none in common. [1]
        """
        covariance = self.covariance.copy()
        covariance[lamps] = 0.0
        covariance[:, lamps] = 0.0
        covariance[np.ix_(lamps, lamps)] = given
        return replace(self, covariance=covariance)

    def off_by_spectra(self, coefficient: FloatArray, flux: FloatArray) -> FloatArray:
        """(point, band) deviation for spectra that are guesses, or end where there is light [W/m²/nm].

        Parameters
        ----------
        coefficient : (lamp, point, band) float
            [m⁻²]
        flux : (lamp, band) float
            [W/nm]
        """
        assert self.spectrum_sd is not None  # since it was checked
        assert self.beyond is not None
        guessed = np.einsum("lpb,lb->pb", coefficient, flux * self.spectrum_sd)
        most = np.einsum("lpb,lb->pb", coefficient, flux.max(axis=1, keepdims=True) * self.beyond)
        return np.asarray(np.hypot(guessed, UNIFORM * most), dtype=np.float64)

    def with_given_spectra(self, lamps: IntArray, beyond: FloatArray) -> "LightUnknowns":
        """The same where the spectra of some lamps, by their number, are given, with their `beyond` (some, band)."""
        assert self.spectrum_sd is not None  # since it was checked
        assert self.beyond is not None
        spectrum_sd, now = self.spectrum_sd.copy(), self.beyond.copy()
        spectrum_sd[lamps], now[lamps] = 0.0, beyond
        return replace(self, spectrum_sd=spectrum_sd, beyond=now)


@dataclass(frozen=True, kw_only=True, eq=False)
class Deviations:
    """Standard deviations of the light at points, in all and by cause.

    Parameters
    ----------
    total : (point, number) float
        In the light's unit.
    by_cause : dict of str to (point, number) float
        Each cause's own; lamps and reflectances may cancel in the total where readings determined their product only.
    """

    total: FloatArray
    by_cause: dict[Cause, FloatArray]


def deviations(
    unknowns: LightUnknowns,
    by_lamp: FloatArray,
    slope: FloatArray,
    *,
    spectra: FloatArray,
    opening: FloatArray,
    simulation: FloatArray,
    counted: BoolArray,
) -> Deviations:
    """How far the light may be off.

    Parameters
    ----------
    unknowns : LightUnknowns
    by_lamp : (lamp, point, number) float
        Light of every lamp, in one or more quantities.
    slope : (part, point, number) float
        Of the sum over lamps, in these quantities. [1]
    spectra : (point, number) float
        Deviation for spectra that are guesses, in the light's unit.
    opening : (point, number) float
        What openings may hide at most, in the light's unit.
    simulation : (point, number) float
        Standard error of the simulation, in the light's unit.
    counted : (point,) bool
        Points that count in the mean by which a place is called dark.
    """
    light = by_lamp.sum(axis=0)
    mean = light[counted].mean(axis=0) if counted.any() else light.mean(axis=0)
    lamps = _spread_of(by_lamp, unknowns.covariance[: unknowns.lamps, : unknowns.lamps])
    effect = slope * light
    surfaces = _spread_of(effect, unknowns.covariance[unknowns.lamps :, unknowns.lamps :])
    both = _spread_of(np.concatenate([by_lamp, effect]), unknowns.covariance)
    own = unknowns.local_sd * error_scale(light, mean) * light
    by_cause: dict[Cause, FloatArray] = {
        "lamps": lamps,
        "reflectances": surfaces,
        "spectra": np.abs(spectra),
        "openings": UNIFORM * np.abs(opening),
        "scan": np.abs(own),
        "simulation": np.abs(simulation),
    }
    rest = [by_cause[cause] ** 2 for cause in CAUSES[2:]]
    return Deviations(total=np.sqrt(both**2 + np.sum(rest, axis=0)), by_cause=by_cause)


def _spread_of(effect: FloatArray, covariance: FloatArray) -> FloatArray:
    """(point, number) root of Jᵀ C J for (unknown, point, number) J."""
    _, points, numbers = effect.shape
    found = np.zeros((points, numbers))
    for first in range(0, points, POINTS_AT_ONCE):
        some = effect[:, first : first + POINTS_AT_ONCE]
        moved = np.tensordot(covariance, some, axes=1)
        found[first : first + POINTS_AT_ONCE] = np.einsum("upn,upn->pn", moved, some)
    return np.sqrt(np.maximum(found, 0.0))


def error_scale(light: FloatArray, typical: FloatArray | float) -> FloatArray:
    """By how much the model's own error is larger at dark places, sqrt(typical / light) from 1 to `MAX_ERROR_SCALE`.

    Where little light comes, each shadow and each reflection that the model lacks is a larger part of it.

    Parameters
    ----------
    light : (n, ...) float
        By all lamps. [unit of the quantity]
    typical : float or (...) float
        Mean of the map in the same quantity.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sqrt(np.maximum(typical, 0.0) / np.maximum(light, 0.0))
    return np.asarray(np.clip(np.nan_to_num(ratio, nan=1.0), 1.0, MAX_ERROR_SCALE), dtype=np.float64)


def stated_uncertainty(found: Deviations, light: FloatArray, counted: BoolArray) -> dict[str, float]:
    """Attributes of a map: root mean square over points of each deviation, over the mean light.

    Parameters
    ----------
    found : Deviations
    light : (point, number) float
        In the unit of the deviations: irradiance in channels, or illuminance.
    counted : (point,) bool
        Points that count.

    Returns
    -------
    attributes : dict of str to float
        By name, `ALL_CAUSES` and one for each cause [1]; empty where there is no light.
    """
    mean = float(light[counted].mean()) if counted.any() else 0.0
    if mean <= 0:
        return {}

    def of(deviation: FloatArray) -> float:
        return float(np.sqrt((deviation[counted] ** 2).mean()) / mean)

    return {ALL_CAUSES: of(found.total), **{f"{OF_CAUSE}{cause}": of(found.by_cause[cause]) for cause in CAUSES}}


def error_bars(light_map: xr.Dataset) -> tuple[FloatArray, str]:
    """(point, band) error of a map [W/m²/nm] and what it is: its uncertainty, or else the simulation's error."""
    if "irradiance_sd" in light_map:
        return light_map["irradiance_sd"].to_numpy(), "standard uncertainties"
    return light_map["irradiance_se"].to_numpy(), "standard errors of the simulation"


def uncertainty_in_words(attributes: Mapping[str, Any]) -> str:
    """What a map states of its uncertainty: '± 14 % at a point (lamps 13 %, reflectances 5 %)'; empty if nothing."""
    if ALL_CAUSES not in attributes:
        return ""
    of = {cause: float(attributes.get(f"{OF_CAUSE}{cause}", 0.0)) for cause in CAUSES}  # an earlier map has fewer
    largest = sorted((cause for cause in CAUSES if of[cause] > 0), key=lambda cause: -of[cause])[:NAMED_CAUSES]
    words = ", ".join(f"{cause} {two_digits(100 * of[cause])} %" for cause in largest)
    return f"± {two_digits(100 * float(attributes[ALL_CAUSES]))} % at a point ({words})"


def save_unknowns(unknowns: LightUnknowns, folder: Path) -> Path:
    """Write them beside a map, as NetCDF."""
    dataset = xr.Dataset(
        {
            "covariance": (("unknown", "other"), unknowns.covariance),
            "slope": (("part", "point", "band"), unknowns.slope.astype(np.float32)),
            "spread": (("part", "band"), unknowns.spread),
            "spectrum_sd": (("lamp", "band"), unknowns.spectrum_sd),
            "beyond": (("lamp", "band"), unknowns.beyond),
        },
        attrs={"local_sd": unknowns.local_sd},
    )
    path = folder / UNKNOWNS_FILE
    write_netcdf(dataset, path, encoding={"slope": {"zlib": True, "complevel": 4}})
    return path


def load_unknowns(folder: Path) -> LightUnknowns | None:
    """Read what `save_unknowns` wrote.

    Parameters
    ----------
    folder : Path
        Of the map stage.

    Returns
    -------
    unknowns : LightUnknowns or None
        None where a map has none, as those of earlier versions.

    Raises
    ------
    MapError
        If the file is damaged.
    """
    path = folder / UNKNOWNS_FILE
    if not path.is_file():
        return None
    try:
        dataset = read_netcdf(path)
        return LightUnknowns(
            covariance=dataset["covariance"].to_numpy(),
            slope=dataset["slope"].to_numpy(),
            spread=dataset["spread"].to_numpy(),
            local_sd=float(dataset.attrs["local_sd"]),
            spectrum_sd=dataset["spectrum_sd"].to_numpy() if "spectrum_sd" in dataset else None,  # an earlier map
            beyond=dataset["beyond"].to_numpy() if "beyond" in dataset else None,
        )
    except (KeyError, TypeError, ValueError, OSError) as cause:
        raise MapError(
            expected="what is not known of a map, as the map stage wrote it",
            found=str(cause),
            where=str(path),
            todo="Run the map stage again.",
        ) from cause
