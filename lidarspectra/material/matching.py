"""From a colour to a reflectance spectrum: the nearest surface of a library, or an estimate from many near ones.

`nearest` is the paper's database matching: the surface of least colour difference (CIEDE2000), here scaled to the
luminance that was seen. `wiener` is our default: of all spectra that have exactly the colour seen, the likeliest under
the near surfaces' statistics. With z = logit(reflectance), which keeps estimates between 0 and 1, near surfaces give a
mean m and covariance C; the estimate minimises (z - m)' C^-1 (z - m) under XYZ(z) = XYZ seen, by Newton steps,

    z <- m + C B (B' C B)^-1 [XYZ seen - XYZ(z) + B' (z - m)],        B = d XYZ / d z.

A smooth covariance is added to C, which regularizes the spectra of colours unlike any neighbour.
Beyond 690 nm a colour tells nothing. Some black dyes reflect ten times as much at 740 nm, most blacks as much as
before; a mean is true of neither, so that there the dark go on from 690 nm by the median of what near surfaces do.
A surface of the right hue that is too light or too dark is a neighbour too, once scaled to the luminance seen; the
larger the factor, the larger its distance.

Surfaces of the material class that a segment seems to be of are favoured, not demanded: the paper's search within the
class alone measures worse even where the class is right (6.0 % against 5.7 %), a slight preference measures better.
Leave-one-out on spectraldb (885 surfaces, 400 to 740 nm): `research/benchmarks/reflectance.py`.

References
----------
Shimano, Terai, Hironaga (2007) Recovery of spectral reflectances by multispectral cameras, JOSA A 24, 3211 (Wiener
estimates from near training samples). Jakob, Hanika (2019) A low-dimensional function space for spectral upsampling,
Computer Graphics Forum 38, 147 (used where the library is too small for statistics).
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, cast

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.errors import MaterialError
from lidarspectra.material.colors import color_difference
from lidarspectra.spectra.colorimetry import xyz_to_lab
from lidarspectra.spectra.reflectance_library import COLOR_GRID_NM, MAX_REFLECTANCE, Reflectance, ReflectanceLibrary
from lidarspectra.spectra.spectrum import Spectrum

MatchMethod = Literal["wiener", "nearest"]
FAR_COLOR = 5.0  # [1] CIEDE2000: beyond it two colours are plainly not the same, and `nearest` is no match
NEIGHBORS = 80  # near surfaces whose statistics are used (leave-one-out: 40 to 160 differ by 0.2 %)
NEIGHBOR_POWER = 3.0  # [1] weight of a neighbour, 1 / (1 + colour difference) to this power
SCALING = 8.0  # [1] CIEDE2000 that a neighbour e times too light or dark counts farther: 6.2 to 5.6 % MAPE with the
# built-in library on spectraldb's surfaces
CLASS_WEIGHT = 2.0  # [1] of a neighbour of the segment's class: 4.2 to 4.0 % MAPE, and 4.2 where the class is wrong
CLASS_BONUS = 1.0  # [1] CIEDE2000 that the nearest of the class may be farther: 5.7 to 5.4 % MAPE, 6.0 if it is wrong
MIN_FOR_STATISTICS = 40  # surfaces; in a smaller library the covariance is not determined
SMOOTH_VARIANCE = 0.1  # [1] in logit², of the smooth part that is added to the covariance, and of its level
SMOOTH_LENGTH_NM = 60.0  # [nm] correlation length of that part
# Greys are flat, whatever else is near them in colour: of the normal law's deviation a smaller share is stated there.
# `research/benchmarks/reflectance.py` prints what then lies within it, of surfaces of buildings and of test colours.
GREY_CHROMA, VIVID_CHROMA = 8.0, 40.0  # [1] in CIELAB
GREY_SHARE, VIVID_SHARE = 0.29, 1.0  # [1]
UNSEEN_NM = 690.0  # [nm] from here on the eye's response is below a hundredth
BLACK_Y, DARK_Y = 0.04, 0.10  # [1] luminance up to which the median counts alone, and from which it does not
UNSEEN_NEARNESS = 4.0  # [1] CIEDE2000 that counts as one there: which of two near blacks is nearer says little of it
LOGIT_RANGE = (0.002, 0.985)  # [1] to which reflectances are clipped before their logit
NEWTON_STEPS = 15  # 3 to 8 suffice for 1e-6 with colours of surfaces
DARKEST_Y = 1e-4  # [1] of a colour that can be matched: darker than any surface, or no light at all


@dataclass(frozen=True, kw_only=True, eq=False)
class Match:
    """A reflectance for a colour.

    Parameters
    ----------
    spectrum : Spectrum
        0 to `MAX_REFLECTANCE`. [1]
    uncertainty : Spectrum
        Standard deviation by the method; the uncertainty of the colour itself is not included. [1]
    nearest : Reflectance
        The surface nearest in colour.
    difference : float
        CIEDE2000 to it.
    color_error : float
        CIEDE2000 of the spectrum's own colour to the colour asked for; above 0 where no reflectance has that colour.
    measured_range_nm : (float, float)
        Beyond it the spectrum is extrapolated. [nm]
    provenance : 'measured' or 'recovered'
    method : str
        'wiener', 'nearest' or 'smooth'.
    """

    spectrum: Spectrum
    uncertainty: Spectrum
    nearest: Reflectance
    difference: float
    color_error: float
    measured_range_nm: tuple[float, float]
    provenance: Literal["measured", "recovered"]
    method: str


def match_color(
    xyz: FloatArray,
    library: ReflectanceLibrary,
    *,
    method: MatchMethod = "wiener",
    among: BoolArray | None = None,
    favored: BoolArray | None = None,
) -> Match:
    """Reflectance spectrum of a surface of this colour.

    Parameters
    ----------
    xyz : (3,) float
        CIE XYZ under D65, white Y = 1.
    library : ReflectanceLibrary
    method : str
        'wiener' estimates from near surfaces, and in a library of fewer than 40 does as 'nearest'. 'nearest' takes the
        nearest surface and scales it to the luminance asked for; where even that one is farther than `FAR_COLOR`, the
        spectrum is recovered instead.
    among : (surface,) bool, optional
        Surfaces that may be used; all that are matchable where it is not given.
    favored : (surface,) bool, optional
        Surfaces of the estimated class, which are preferred to others of the same colour.

    Returns
    -------
    match : Match

    Raises
    ------
    MaterialError
        If no surface may be used, or the colour is not finite.
    """
    wanted = np.asarray(xyz, dtype=np.float64)
    allowed = np.flatnonzero(library.matchable if among is None else library.matchable & among)
    if not allowed.size or wanted.shape != (3,) or not np.isfinite(wanted).all():
        raise MaterialError(
            expected="a finite colour and a library with surfaces to match it to",
            found=f"colour {wanted.tolist()}, {allowed.size} surfaces",
            where="matching",
        )
    wanted = wanted if wanted[1] >= DARKEST_Y else np.maximum(wanted, DARKEST_Y * library.weights.sum(axis=0))
    differences = color_difference(xyz_to_lab(wanted), library.lab[allowed])
    enough = allowed.size >= MIN_FOR_STATISTICS
    likely = np.zeros(allowed.size, dtype=np.bool_) if favored is None else favored[allowed]
    if enough and (method == "wiener" or differences.min() > FAR_COLOR):
        return _wiener(wanted, library, allowed, differences, likely)
    if differences.min() > FAR_COLOR:
        return _smooth(wanted, library, allowed, differences)
    return _nearest(wanted, library, allowed, differences, likely)


def _nearest(
    wanted: FloatArray, library: ReflectanceLibrary, allowed: IntArray, differences: FloatArray, likely: BoolArray
) -> Match:
    """Take the nearest surface, scaled to the luminance asked for, as far as energy allows."""
    chosen = int((differences - CLASS_BONUS * likely).argmin())
    row = int(allowed[chosen])
    surface = library.rows[row]
    brightest = max(float(surface.spectrum.values.max()), DARKEST_Y)
    scale = min(wanted[1] / max(float(library.xyz[row, 1]), DARKEST_Y), MAX_REFLECTANCE / brightest)
    near = allowed[np.argsort(differences, kind="stable")[:NEIGHBORS]]
    spread = np.std(library.values[near[:5]], axis=0) if near.size > 1 else np.zeros(COLOR_GRID_NM.size)
    return Match(
        spectrum=Spectrum(
            wavelengths_nm=surface.spectrum.wavelengths_nm,
            # The scale ends at the limit; rounding may step over it.
            values=np.minimum(scale * surface.spectrum.values, MAX_REFLECTANCE),
            name=surface.name,
        ),
        uncertainty=Spectrum(wavelengths_nm=COLOR_GRID_NM, values=spread),
        nearest=surface,
        difference=float(differences[chosen]),
        color_error=_color_error(wanted, scale * library.values[row], library),
        measured_range_nm=surface.range_nm,
        provenance="measured",
        method="nearest",
    )


def _wiener(
    wanted: FloatArray, library: ReflectanceLibrary, allowed: IntArray, differences: FloatArray, likely: BoolArray
) -> Match:
    """Estimate by the near surfaces' statistics (see the module's text)."""
    factors, distances = _brought_to_luminance(wanted, library, allowed, differences)
    order = np.argsort(distances, kind="stable")[:NEIGHBORS]
    near = allowed[order]
    weight = (1.0 + distances[order]) ** -NEIGHBOR_POWER * np.where(likely[order], CLASS_WEIGHT, 1.0)
    weight /= weight.sum()
    reflectances = factors[order, None] * library.values[near]
    mean, covariance = logit_statistics(reflectances, weight)
    values, deviation = constrained_estimate(wanted, mean, covariance, library.weights)
    narrower = stated_share(wanted)
    stated = narrower * deviation
    if wanted[1] < DARK_Y:
        loose = (1.0 + distances[order] / UNSEEN_NEARNESS) ** -NEIGHBOR_POWER
        share = min((DARK_Y - float(wanted[1])) / (DARK_Y - BLACK_Y), 1.0)
        values = with_usual_rise(values, reflectances, loose, share)
        stated = np.where(COLOR_GRID_NM > UNSEEN_NM, narrower ** (1.0 - share) * deviation, stated)  # few dyes do rise
    ranges = np.array([library.rows[row].range_nm for row in near])
    return Match(
        spectrum=Spectrum(wavelengths_nm=COLOR_GRID_NM, values=values),
        uncertainty=Spectrum(wavelengths_nm=COLOR_GRID_NM, values=stated),
        nearest=library.rows[int(allowed[differences.argmin()])],
        difference=float(differences.min()),
        color_error=_color_error(wanted, values, library),
        measured_range_nm=_common_range(ranges, weight),
        provenance="recovered",
        method="wiener",
    )


def _brought_to_luminance(
    wanted: FloatArray, library: ReflectanceLibrary, allowed: IntArray, differences: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """(surface,) factors that bring surfaces nearest to a colour, and how far they count then; 1 where none helps."""
    xyz, brightest = library.xyz[allowed], library.values[allowed].max(axis=1)
    factor = np.minimum(wanted[1] / np.maximum(xyz[:, 1], DARKEST_Y), LOGIT_RANGE[1] / np.maximum(brightest, DARKEST_Y))
    moved = color_difference(xyz_to_lab(wanted), xyz_to_lab(factor[:, None] * xyz)) + SCALING * np.abs(np.log(factor))
    nearer = moved < differences
    return np.where(nearer, factor, 1.0), np.where(nearer, moved, differences)


def logit_statistics(reflectances: FloatArray, weight: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean and covariance of logit reflectances, a smooth part added to the covariance.

    Parameters
    ----------
    reflectances : (surface, wavelength) float
        On `COLOR_GRID_NM`. [1]
    weight : (surface,) float
        Summing to 1.

    Returns
    -------
    mean : (wavelength,) float
    covariance : (wavelength, wavelength) float
    """
    logits = _logit(reflectances)
    mean = weight @ logits
    away = logits - mean
    return mean, np.asarray(away.T @ (away * weight[:, None]) + _smooth_part(), dtype=np.float64)


def stated_share(xyz: FloatArray) -> float:
    """Share of the normal law's deviation that is stated of a colour, by its chroma in CIELAB [1]."""
    chroma = float(np.hypot(*xyz_to_lab(xyz)[1:]))
    return float(np.interp(chroma, (GREY_CHROMA, VIVID_CHROMA), (GREY_SHARE, VIVID_SHARE)))


def with_usual_rise(values: FloatArray, reflectances: FloatArray, weight: FloatArray, share: float) -> FloatArray:
    """An estimate that goes on beyond `UNSEEN_NM` as most near surfaces do.

    `research/benchmarks/reflectance.py` prints the error beyond 700 nm with it and without.

    Parameters
    ----------
    values : (wavelength,) float
        On `COLOR_GRID_NM`. [1]
    reflectances : (surface, wavelength) float
        Of near surfaces. [1]
    weight : (surface,) float
    share : float
        Of the median; the rest is the estimate's own, in a geometric mean. [0-1]

    Returns
    -------
    values : (wavelength,) float
        [1]
    """
    start = int(np.searchsorted(COLOR_GRID_NM, UNSEEN_NM))
    logits = _logit(reflectances[:, start:])
    rise = logits - logits[:, :1]
    median = np.quantile(rise, 0.5, axis=0, weights=weight, method="inverted_cdf")
    usual = _logistic(_logit(values[start]) + median)
    unseen = values[start:] ** (1.0 - share) * usual**share
    return np.concatenate([values[:start], np.minimum(unseen, MAX_REFLECTANCE)])


@lru_cache(maxsize=1)
def _smooth_part() -> FloatArray:
    """Covariance of a level and of gentle bends."""
    apart = (COLOR_GRID_NM[:, None] - COLOR_GRID_NM[None, :]) / SMOOTH_LENGTH_NM
    return np.asarray(SMOOTH_VARIANCE * (1.0 + np.exp(-0.5 * apart**2)), dtype=np.float64)


def constrained_estimate(
    wanted: FloatArray, mean: FloatArray, covariance: FloatArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Likeliest reflectance of the colour, and its standard deviation, under a normal law of its logit.

    Parameters
    ----------
    wanted : (3,) float
        XYZ.
    mean, covariance : (wavelength,), (wavelength, wavelength) float
        Of the logit.
    weights : (wavelength, 3) float
        XYZ of a reflectance.

    Returns
    -------
    values, deviation : (wavelength,) float
        [1]
    """
    logit = mean.copy()
    for _ in range(NEWTON_STEPS):
        values = _logistic(logit)
        slope = weights * (values * (1.0 - values))[:, None]
        spread = covariance @ slope
        gain = _gain(spread, slope)
        step = mean + gain @ (wanted - values @ weights + slope.T @ (logit - mean)) - logit
        logit = logit + np.clip(step, -4.0, 4.0)  # a longer step leaves the range where the linearization holds
        if np.abs(step).max() < 1e-6:
            break
    values = _logistic(logit)
    slope = weights * (values * (1.0 - values))[:, None]
    spread = covariance @ slope
    variance = np.diag(covariance) - np.einsum("ij,ij->i", _gain(spread, slope), spread)
    deviation = values * (1.0 - values) * np.sqrt(np.maximum(variance, 0.0))
    return np.minimum(values, MAX_REFLECTANCE), np.asarray(deviation, dtype=np.float64)


def _gain(spread: FloatArray, slope: FloatArray) -> FloatArray:
    """C B (B' C B)^-1, the three colour numbers' covariance kept from being singular."""
    colors = slope.T @ spread
    colors += 1e-6 * np.trace(colors) / 3.0 * np.eye(3)
    return np.asarray(np.linalg.solve(colors, spread.T).T, dtype=np.float64)


def _logit(reflectance: FloatArray) -> FloatArray:
    inside = np.clip(reflectance, *LOGIT_RANGE)
    return np.asarray(np.log(inside / (1.0 - inside)), dtype=np.float64)


def _logistic(logit: FloatArray) -> FloatArray:
    return np.asarray(1.0 / (1.0 + np.exp(-np.clip(logit, -40.0, 40.0))), dtype=np.float64)


def _smooth(wanted: FloatArray, library: ReflectanceLibrary, allowed: IntArray, differences: FloatArray) -> Match:
    """Recover a smooth spectrum by Jakob and Hanika's method (colour-science), for libraries without statistics."""
    import colour  # loads slowly
    from colour.recovery import XYZ_to_sd_Jakob2019

    shape = colour.SpectralShape(COLOR_GRID_NM[0], COLOR_GRID_NM[-1], COLOR_GRID_NM[1] - COLOR_GRID_NM[0])
    observer = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape)
    daylight = colour.SDS_ILLUMINANTS["D65"].copy().align(shape)
    recovered = cast(colour.SpectralDistribution, XYZ_to_sd_Jakob2019(wanted, observer, daylight))
    values = np.clip(np.asarray(recovered.values, dtype=np.float64), 0.0, MAX_REFLECTANCE)
    surface = library.rows[int(allowed[differences.argmin()])]
    return Match(
        spectrum=Spectrum(wavelengths_nm=COLOR_GRID_NM, values=values),
        uncertainty=Spectrum(wavelengths_nm=COLOR_GRID_NM, values=0.2 * values),
        nearest=surface,
        difference=float(differences.min()),
        color_error=_color_error(wanted, values, library),
        measured_range_nm=(float(COLOR_GRID_NM[0]), float(COLOR_GRID_NM[-1])),
        provenance="recovered",
        method="smooth",
    )


def _color_error(wanted: FloatArray, values: FloatArray, library: ReflectanceLibrary) -> float:
    return float(color_difference(xyz_to_lab(wanted), xyz_to_lab(values @ library.weights)))


def _common_range(ranges: FloatArray, weight: FloatArray) -> tuple[float, float]:
    """Wavelengths at which surfaces of half the weight or more were measured [nm]."""
    lows = np.argsort(ranges[:, 0], kind="stable")
    highs = np.argsort(-ranges[:, 1], kind="stable")
    low = ranges[lows[int((np.cumsum(weight[lows]) >= 0.5).argmax())], 0]
    high = ranges[highs[int((np.cumsum(weight[highs]) >= 0.5).argmax())], 1]
    return max(float(low), float(COLOR_GRID_NM[0])), min(float(high), float(COLOR_GRID_NM[-1]))
