"""Glare in a fisheye picture: UGR of the luminaires that are seen, and what Radiance's `evalglare` says.

UGR = 8 lg(0.25/L_b Σ L² ω / p²) over the luminaires in view: luminance L and solid angle ω of the shining surface of
each, its position index p, and the background's luminance L_b = E_i/π with the illuminance E_i at the eye of all that
is no luminaire (CIE 117:1995). Which pixels are a luminaire's is known here, not guessed from a threshold, and small
luminaires are looked at in finer parts (`lamp_rays`). UGR is made for electric luminaires: the light of windows counts
to the background, and their glare is DGP's.

`evalglare` (Wienold) finds sources of glare by their luminance, here above `THRESHOLD_CD_M2`, as it must in daylight,
and gives DGP, the daylight glare probability, with its own UGR beside it.

References
----------
CIE 117:1995, Discomfort glare in interior lighting. Guth's position index above the line of sight as Levin 1975 fitted
it, below it that of Iwata and Tokura 1997, both as in evalglare. Wienold and Christoffersen, Energy and Buildings 38,
2006: DGP.
"""

import tempfile
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import EngineError, SceneError
from lidarspectra.radiance.engine.engine import Engine, find_engine
from lidarspectra.radiance.pictures.hdr_file import save_hdr
from lidarspectra.radiance.pictures.lamp_rays import LampRays
from lidarspectra.radiance.pictures.render import Picture

THRESHOLD_CD_M2 = (
    2000.0  # [cd/m²] above which evalglare takes a pixel for glare: its manual's for electric and daylight
)
MAX_RADIUS = 3.0  # [1] of Iwata and Tokura below the line of sight, in which p is at most 4.6; as evalglare
MAX_INDEX = 16.0  # of the position: farther from the line of sight than any table goes
LEAST_UGR = 5.0  # below it there is no glare; CIE 117 gives the range of UGR as 10 to 30
_COLUMNS = ("dgp", "ugr")


@dataclass(frozen=True, kw_only=True, eq=False)
class Luminaires:
    """The luminaires that a fisheye shows.

    Parameters
    ----------
    lamp : (source,) int
        Index of each in the scene; of lamps of one shape in one place, of the first.
    weight : (source,) float
        L² ω / p². [cd²/m⁴ sr]
    luminance : (source,) float
        Mean. [cd/m²]
    solid_angle : (source,) float
        [sr]
    direct_lx : (source,) float
        Illuminance that it sends straight to the eye. [lx]
    indirect_lx : float
        Illuminance at the eye of all the rest. [lx]
    """

    lamp: IntArray
    weight: FloatArray
    luminance: FloatArray
    solid_angle: FloatArray
    direct_lx: FloatArray
    indirect_lx: float

    @property
    def ugr(self) -> float:
        """UGR; minus infinity where no luminaire is seen."""
        return float(ugr_of(self.weight, np.array(self.indirect_lx)))


@dataclass(frozen=True, kw_only=True)
class Glare:
    """What evalglare says.

    Parameters
    ----------
    dgp : float
        Daylight glare probability: above .35 perceptible, above .4 disturbing, above .45 intolerable. [1]
    ugr : float
        Its UGR, of what is brighter than the threshold.
    """

    dgp: float
    ugr: float


def ugr_of(weight: FloatArray, indirect_lx: FloatArray) -> FloatArray:
    """UGR of luminaires.

    Parameters
    ----------
    weight : (..., source) float
        L² ω / p². [cd²/m⁴ sr]
    indirect_lx : (...) float
        At the eye, without what luminaires send straight to it. [lx]

    Returns
    -------
    ugr : (...) float
        Minus infinity where no luminaire is seen.
    """
    background = np.maximum(indirect_lx, 1e-12) / np.pi
    with np.errstate(divide="ignore"):
        return np.asarray(8.0 * np.log10(0.25 * weight.sum(axis=-1) / background), dtype=np.float64)


def position_index(directions: FloatArray, forward: FloatArray, up: FloatArray) -> FloatArray:
    """Guth's position index p of directions in the field of view.

    Parameters
    ----------
    directions : (..., 3) float
        Unit vectors.
    forward, up : (3,) float
        Line of sight, and what is up square to it; unit vectors.

    Returns
    -------
    index : (...) float
        1 in the line of sight, at most 16, and 4.6 below it. [1]
    """
    ahead = np.clip(directions @ forward, -1.0, 1.0)
    sideways, upward = directions @ np.cross(forward, up), directions @ up
    sigma = np.degrees(np.arccos(ahead))  # from the line of sight
    tau = np.degrees(np.arctan2(np.abs(sideways), np.maximum(upward, 0.0)))  # from the upright plane
    above = np.exp(
        (35.2 - 0.31889 * tau - 1.22 * np.exp(-2.0 * tau / 9.0)) * 1e-3 * sigma
        + (21.0 + 0.26667 * tau - 0.002963 * tau**2) * 1e-5 * sigma**2
    )
    # Iwata and Tokura, with R the distance below and beside the line of sight, over the distance along it
    radius = np.minimum(np.hypot(sideways, upward) / np.maximum(ahead, 1e-6), MAX_RADIUS)
    below = np.where(radius < 0.6, 1.0 + 0.8 * radius, 1.0 + 1.2 * radius)
    return np.clip(np.where(upward >= 0.0, above, below), 1.0, MAX_INDEX)


def luminaires_of(picture: Picture, *, daylight: Collection[int] = ()) -> Luminaires:
    """The luminaires in a picture.

    Parameters
    ----------
    picture : Picture
    daylight : collection of int
        Lamps of the scene that are windows or the sun: part of the background, not luminaires.

    Raises
    ------
    SceneError
        If it is no fisheye of 180 degrees.
    """
    _check(picture)
    view = picture.view
    directions, _ = view.directions()
    solid = view.solid_angles()
    cosine = np.clip(directions @ view.direction, 0.0, None)
    shining = (picture.lamp >= 0) & ~np.isin(picture.lamp, list(daylight))
    rays = picture.rays
    if rays is None:
        rays = LampRays(
            lamp=picture.lamp[shining],
            directions=directions[shining],
            solid_angle=solid[shining],
            luminance=picture.luminance[shining],
        )
    found = []
    for lamp in np.setdiff1d(rays.lamp, list(daylight)):
        seen = rays.lamp == lamp
        omega, light = float(rays.solid_angle[seen].sum()), rays.luminance[seen] * rays.solid_angle[seen]
        luminance = float(light.sum()) / max(omega, 1e-300)
        middle = rays.solid_angle[seen] @ rays.directions[seen]
        middle = middle / max(float(np.linalg.norm(middle)), 1e-300)
        index = float(position_index(middle, view.direction, view.axes[1]))
        straight = float(light @ np.clip(rays.directions[seen] @ view.direction, 0.0, None))
        found.append((lamp, luminance**2 * omega / index**2, luminance, omega, straight))
    columns = np.array(found, dtype=np.float64).reshape(-1, 5).T
    return Luminaires(
        lamp=columns[0].astype(np.int64),
        weight=columns[1],
        luminance=columns[2],
        solid_angle=columns[3],
        direct_lx=columns[4],
        indirect_lx=float((picture.luminance * solid * cosine)[~shining].sum()),
    )


def evalglare(picture: Picture, *, engine: Engine | None = None) -> Glare:
    """Ask Radiance's evalglare.

    Parameters
    ----------
    picture : Picture
        A fisheye of 180 degrees.
    engine : Engine, optional
        The installed one by default.

    Returns
    -------
    glare : Glare
        DGP and UGR [1] of sources that it finds by their luminance, above `THRESHOLD_CD_M2`.

    Raises
    ------
    SceneError
        If the picture is no fisheye of 180 degrees.
    EngineError
        If the program fails, or its answer has no DGP and UGR.
    """
    _check(picture)
    engine = find_engine() if engine is None else engine
    with tempfile.TemporaryDirectory(prefix="lidarspectra-") as name:
        path = save_hdr(picture.xyz, picture.view, Path(name) / "fisheye.hdr")
        run = engine.run("evalglare", ["-b", f"{THRESHOLD_CD_M2:g}", path.name], folder=path.parent)
    text = run.output.decode("ascii", errors="replace")
    names, _, numbers = text.partition(":")
    values = dict(zip(names.strip().split(","), numbers.split(), strict=False))
    try:
        return Glare(**{name: float(values[name]) for name in _COLUMNS})
    except (KeyError, ValueError) as cause:
        raise EngineError(expected="dgp and ugr", found=text[:200] or "nothing", where=run.command) from cause


def _check(picture: Picture) -> None:
    view = picture.view
    if view.projection != "fisheye" or view.angle_deg != 180.0:
        raise SceneError(
            expected="a fisheye of 180 degrees", found=f"{view.projection}, {view.angle_deg:g} degrees", where="glare"
        )
