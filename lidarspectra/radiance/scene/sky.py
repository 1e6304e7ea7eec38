"""Daylight: the sky's spectrum by direction and the sun's, for a place and time, by Radiance's genssky and SPECTRL2.

genssky solves the scattering of sunlight in air and aerosol (Rayleigh and Mie) in 20 bins of 20 nm from 380 to 780 nm.
Its numbers are W/m²/sr over that whole range, shared out evenly: a bin of value v holds v/400 W/m²/sr/nm. The chain was
checked against gensky's CIE skies: see `tests/engine`. What a phone's scan cannot show, houses opposite and trees, is
not there; below the horizon lies an even ground.

The clear sky's and sun's strength in each bin is that of SPECTRL2 (`clear_sky`); how it spreads is genssky's.

A sky with cloud cover c is (1 - c) of the clear sky and its sun, and c of the overcast one. Of the overcast sky genssky
gives the zenith; its spread is the CIE standard overcast sky, L(γ) = L_z (1 + 2 sin γ)/3 (ISO 15469:2004, type 16).
genssky's own, like gensky's, blends into the ground near the horizon: .53 of the zenith at the horizon instead of .33.

The scene's x and y are turned to east and north by `north_deg`. Night, from the end of civil twilight on, is dark, and
makes no lamp: genssky's tables end at a sun 11.5 degrees below the horizon, so that its darkest night still has 5 lx.
"""

import math
import re
import shutil
import tempfile
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import partial
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.errors import EngineError, LampError
from lidarspectra.radiance.engine.engine import Engine, EngineRun, float_rows
from lidarspectra.radiance.scene.clear_sky import scaling, spectrl2_light
from lidarspectra.spectra.spectrum import Spectrum

SKY_WAVELENGTHS_NM = np.arange(390.0, 771.0, 20.0)  # [nm] centres of genssky's bins
SKY_ENDS_NM = np.array([360.0, 800.0])  # [nm] the tail of a 760 nm channel reaches 1 % beyond genssky's bins
SKY_SPAN_NM = 400.0  # [nm] of its bins together, 380 to 780
SUN_ANGLE_DEG = 0.533  # [deg] apex angle of the sun's disc, as genssky writes it
AZIMUTHS_DEG = np.arange(0.0, 361.0, 7.5)  # [deg] of the sampled sky; it changes slowly but around the sun
ALTITUDES_DEG = np.concatenate([[-90.0, -0.01], np.arange(0.01, 10.0, 2.5), np.arange(12.5, 91.0, 5.0), [90.0]])
"""[deg] Denser near the horizon, where the sky brightens; a step at the ground."""
NIGHT_DEG = -6.0  # [deg] sun's altitude at the end of civil twilight; a clear sky then gives 3 lx outdoors
SKY_FILE = "sky"
PICTURE_FILE = f"{SKY_FILE}_sky.hsr"  # as genssky names it
OCTREE_FILE = "sky.oct"
TABLES_FOLDER = "atmos_data"  # as genssky names it
PICTURE_WIDTH = 512  # [pixel] genssky's picture is shifted by up to half a pixel: .35 degrees; its own 64 make it 2.8
HEMISPHERE_STEP_DEG = 0.5  # [deg] of the integral over the sky
_GLOW = "\nskyfunc glow skyglow\n0\n0\n4 1 1 1 0\n\nskyglow source skydome\n0\n0\n4 0 0 1 180\n"


@dataclass(frozen=True, kw_only=True)
class Daylight:
    """Place, time and weather.

    Parameters
    ----------
    latitude_deg, longitude_deg : float
        North and east are positive. [deg]
    time : datetime
        With its offset from UTC.
    north_deg : float
        Turn of north from the scan's y axis, counter-clockwise seen from above. [deg]
    cloud_cover : float
        0 clear, 1 overcast. [0-1]
    aerosol_optical_depth : float
        At 550 nm; 0.1 is clean air. [1]
    ground_reflectance : float
        Of what lies outside, at all wavelengths. [0-1]
    """

    latitude_deg: float
    longitude_deg: float
    time: datetime
    north_deg: float = 0.0
    cloud_cover: float = 0.0
    aerosol_optical_depth: float = 0.1
    ground_reflectance: float = 0.2

    def __post_init__(self) -> None:
        faults = [
            word
            for word, wrong in (
                ("a latitude from -90 to 90", not -90 <= self.latitude_deg <= 90),
                ("a longitude from -180 to 180", not -180 <= self.longitude_deg <= 180),
                ("a cloud cover from 0 to 1", not 0 <= self.cloud_cover <= 1),
                ("an aerosol optical depth from 0 to 1", not 0 <= self.aerosol_optical_depth <= 1),
                ("a ground reflectance from 0 to 0.99", not 0 <= self.ground_reflectance <= 0.99),
                ("a finite direction of north", not math.isfinite(self.north_deg)),
                ("a time with its offset from UTC", self.time.utcoffset() is None),
            )
            if wrong
        ]
        if faults:
            raise LampError(expected=", ".join(faults), found="another value", where="[daylight]")


@dataclass(frozen=True, kw_only=True, eq=False)
class Sky:
    """Daylight by direction, in the scan's axes.

    Parameters
    ----------
    radiance : (azimuth, altitude, wavelength) float
        On `AZIMUTHS_DEG` (from x, counter-clockwise), `ALTITUDES_DEG` and `SKY_WAVELENGTHS_NM`, without the sun's disc.
        [W/m²/sr/nm]
    sun_direction : (3,) float or None
        Unit vector towards the sun; None when it is below the horizon.
    sun_irradiance : (wavelength,) float
        On a plane that faces the sun. [W/m²/nm]
    run : EngineRun or None
        What genssky was asked; None at night.
    """

    radiance: FloatArray
    sun_direction: FloatArray | None
    sun_irradiance: FloatArray
    run: EngineRun | None = field(repr=False, default=None)

    def __post_init__(self) -> None:
        shape = (AZIMUTHS_DEG.size, ALTITUDES_DEG.size, SKY_WAVELENGTHS_NM.size)
        object.__setattr__(self, "radiance", float_array(self.radiance, name="Sky.radiance", shape=shape))
        sun = float_array(self.sun_irradiance, name="Sky.sun_irradiance", shape=SKY_WAVELENGTHS_NM.shape)
        object.__setattr__(self, "sun_irradiance", sun)

    @property
    def horizontal_irradiance(self) -> FloatArray:
        """(wavelength,) of sky and sun on open level ground [W/m²/nm]."""
        sun = 0.0 if self.sun_direction is None else max(float(self.sun_direction[2]), 0.0) * self.sun_irradiance
        above = ALTITUDES_DEG > 0
        return np.asarray(_hemisphere(self.radiance[:, above], ALTITUDES_DEG[above]) + sun, dtype=np.float64)


def compute_sky(daylight: Daylight, folder: Path, engine: Engine, *, atmosphere: Path) -> Sky:
    """The sky of a place and time.

    Parameters
    ----------
    daylight : Daylight
    folder : Path
        For its files; made if it is not there.
    engine : Engine
    atmosphere : Path
        Where tables of the air's scattering are kept, 70 MB a climate and aerosol depth. The first sky of each takes
        about a minute of two cores, later ones a second.

    Returns
    -------
    sky : Sky
        Zero everywhere at night.

    Raises
    ------
    EngineError
        If genssky fails or its output is no sky.
    """
    shape = (AZIMUTHS_DEG.size, ALTITUDES_DEG.size, SKY_WAVELENGTHS_NM.size)
    if sun_altitude_deg(daylight.time, daylight.latitude_deg, daylight.longitude_deg) < NIGHT_DEG:
        return Sky(radiance=np.zeros(shape), sun_direction=None, sun_irradiance=np.zeros(shape[2]))
    above = ALTITUDES_DEG > 0
    turn = math.radians(daylight.north_deg)
    radiance = np.zeros(shape)
    direction, irradiance, run = None, np.zeros(shape[2]), None
    if daylight.cloud_cover > 0:
        run = _ask(replace(daylight, cloud_cover=1.0), folder / "overcast", engine, atmosphere)
        zenith = _sample(engine, folder / "overcast", np.array([90.0]), turn).mean(axis=(0, 1))
        radiance[:, above] = daylight.cloud_cover * cie_overcast(ALTITUDES_DEG[above])[:, None] * zenith
    if daylight.cloud_cover < 1:
        clear = genssky_clear_sky(daylight, folder / "clear", engine, atmosphere=atmosphere)
        sun_only, sky_only, altitude = spectrl2_light(daylight)
        of_sky = replace(clear, sun_direction=None).horizontal_irradiance
        radiance += (1.0 - daylight.cloud_cover) * clear.radiance * scaling(sky_only, of_sky, altitude)
        direction, run = clear.sun_direction, clear.run
        irradiance = (1.0 - daylight.cloud_cover) * clear.sun_irradiance
        irradiance = irradiance * scaling(sun_only, clear.sun_irradiance, altitude)
    sky = Sky(radiance=radiance, sun_direction=direction, sun_irradiance=irradiance, run=run)
    radiance[:, ~above] = daylight.ground_reflectance / math.pi * sky.horizontal_irradiance
    return Sky(radiance=radiance, sun_direction=direction, sun_irradiance=irradiance, run=run)


def genssky_clear_sky(daylight: Daylight, folder: Path, engine: Engine, *, atmosphere: Path) -> Sky:
    """The clear sky as genssky has it, without cloud and with nothing below the horizon; see `compute_sky`."""
    run = _ask(replace(daylight, cloud_cover=0.0), folder, engine, atmosphere)
    turn, above = math.radians(daylight.north_deg), ALTITUDES_DEG > 0
    radiance = np.zeros((AZIMUTHS_DEG.size, ALTITUDES_DEG.size, SKY_WAVELENGTHS_NM.size))
    radiance[:, above] = _sample(engine, folder, ALTITUDES_DEG[above], turn)
    direction, irradiance = _sun(run.output.decode("utf-8", errors="replace"), turn)
    return Sky(radiance=radiance, sun_direction=direction, sun_irradiance=irradiance, run=run)


def cie_overcast(altitudes_deg: FloatArray) -> FloatArray:
    """Luminance of the CIE standard overcast sky as a fraction of the zenith's, (1 + 2 sin γ)/3.

    Parameters
    ----------
    altitudes_deg : (...) float
        γ above the horizon. [deg]

    Returns
    -------
    fraction : (...) float

    References
    ----------
    ISO 15469:2004 (CIE S 011/E:2003), Spatial distribution of daylight, type 16.
    """
    return np.asarray((1.0 + 2.0 * np.sin(np.radians(altitudes_deg))) / 3.0)


def sun_altitude_deg(time: datetime, latitude_deg: float, longitude_deg: float) -> float:
    """Altitude of the sun above the horizon, without refraction, by pvlib.

    Parameters
    ----------
    time : datetime
        With its offset from UTC.
    latitude_deg, longitude_deg : float
        North and east are positive. [deg]

    Returns
    -------
    altitude : float
        [deg]
    """
    import pandas as pd
    import pvlib  # here, since it takes over a second

    found = pvlib.solarposition.get_solarposition(pd.DatetimeIndex([time]), latitude_deg, longitude_deg)
    return float(found["elevation"].iloc[0])


def _ask(daylight: Daylight, folder: Path, engine: Engine, atmosphere: Path) -> EngineRun:
    """Ask genssky for a clear or overcast sky; the folder then holds `OCTREE_FILE`, the sky without the sun."""
    folder.mkdir(parents=True, exist_ok=True)
    run = _run_genssky(daylight, folder, engine, atmosphere)
    text = run.output.decode("utf-8", errors="replace")
    start = text.find("void specpict")
    if start < 0 or not (folder / PICTURE_FILE).is_file():
        raise EngineError(expected="a sky from genssky", found=run.stderr or text[-200:], where=run.command)
    # The picture is named without its folder; the sun's disc is left out: it is a source of its own.
    scene = re.sub(r"noop .*_sky\.hsr", f"noop {PICTURE_FILE}", text[start:], count=1) + _GLOW
    (folder / "sky.rad").write_text(scene, encoding="utf-8", newline="\n")
    (folder / OCTREE_FILE).write_bytes(engine.run("oconv", ["sky.rad"], folder=folder).output)
    return run


def _run_genssky(daylight: Daylight, folder: Path, engine: Engine, atmosphere: Path) -> EngineRun:
    """Run genssky on links to the tables that are there, and keep what it adds only when it is done.

    A genssky that was cut leaves half a table, which the next one would take for whole. It puts the sky's picture
    beside the folder of its tables.
    """
    tables = atmosphere / TABLES_FOLDER
    unfinished, is_kept = _unfinished_folder(atmosphere)
    with unfinished as name:
        own = Path(name).resolve() / TABLES_FOLDER
        own.mkdir()
        for table in tables.iterdir() if tables.is_dir() else ():
            _link(table, own / table.name)
        run = engine.run("genssky", _arguments(daylight, own.parent), folder=folder)
        if (own.parent / PICTURE_FILE).is_file():
            shutil.move(own.parent / PICTURE_FILE, folder / PICTURE_FILE)
        for table in own.iterdir() if is_kept else ():
            if not (tables / table.name).exists():
                table.replace(tables / table.name)
    return run


def _unfinished_folder(atmosphere: Path) -> tuple["tempfile.TemporaryDirectory[str]", bool]:
    """A folder for tables that are being made, and whether they can be kept.

    They cannot where the user's folders are read-only, as in containers and on the nodes of clusters.
    """
    make = partial(tempfile.TemporaryDirectory, prefix="unfinished-", ignore_cleanup_errors=True)
    try:
        (atmosphere / TABLES_FOLDER).mkdir(parents=True, exist_ok=True)
        return make(dir=atmosphere), True
    except OSError:
        return make(), False


def _link(source: Path, target: Path) -> None:
    try:
        target.hardlink_to(source)
    except OSError:  # a file system without links
        shutil.copyfile(source, target)


def _arguments(daylight: Daylight, atmosphere: Path) -> list[str]:
    offset = daylight.time.utcoffset()
    hours = 0.0 if offset is None else offset.total_seconds() / 3600.0
    time = daylight.time
    clock = time.hour + time.minute / 60.0 + time.second / 3600.0
    return [
        *(str(time.month), str(time.day), f"{clock:.6f}", "-y", str(time.year)),
        *("-a", f"{daylight.latitude_deg:.6f}", "-o", f"{-daylight.longitude_deg:.6f}", "-m", f"{-15.0 * hours:.6f}"),
        *("-d", f"{daylight.aerosol_optical_depth:.2f}", "-c", f"{daylight.cloud_cover:.3f}"),
        *("-g", f"{daylight.ground_reflectance:.3f}", "-n", "2", "-p", str(atmosphere), "-f", SKY_FILE),
        *("-r", str(PICTURE_WIDTH)),
    ]


def _sample(engine: Engine, folder: Path, altitudes_deg: FloatArray, turn: float) -> FloatArray:
    """(azimuth, altitude, wavelength) radiance of the sky above the horizon [W/m²/sr/nm]."""
    azimuth, altitude = np.meshgrid(np.radians(AZIMUTHS_DEG), np.radians(altitudes_deg), indexing="ij")
    # genssky's x is east and y is north; the scan's are turned by `turn` against them.
    outward = np.stack(
        [np.cos(altitude) * np.cos(azimuth - turn), np.cos(altitude) * np.sin(azimuth - turn), np.sin(altitude)],
        axis=-1,
    ).reshape(-1, 3)
    rays = np.concatenate([np.zeros_like(outward), outward], axis=1).astype("<f4").tobytes()
    options = ["-h-", "-fff", "-ab", "0", "-cs", str(SKY_WAVELENGTHS_NM.size), "-cw", "380", "780", "-co+", OCTREE_FILE]
    run = engine.run("rtrace", options, folder=folder, stdin=rays)
    values = float_rows(run, rows=len(outward), columns=SKY_WAVELENGTHS_NM.size)[:, ::-1] / SKY_SPAN_NM
    return np.maximum(values, 0.0).reshape(*azimuth.shape, -1)


def _sun(text: str, turn: float) -> tuple[FloatArray | None, FloatArray]:
    """Direction and normal irradiance of the sun, out of what genssky wrote."""
    spectrum = re.search(r"void spectrum sunrad\s+0\s+0\s+22 390 770((?: +[-+.\deE]+){20})", text)
    strength = re.search(r"sunrad light solar\s+0\s+0\s+3 ([-+.\deE]+)", text)
    place = re.search(r"solar source sun\s+0\s+0\s+4 ([-+.\deE]+) ([-+.\deE]+) ([-+.\deE]+)", text)
    if spectrum is None or strength is None or place is None:
        return None, np.zeros(SKY_WAVELENGTHS_NM.size)
    solid_angle = 2.0 * math.pi * (1.0 - math.cos(math.radians(0.5 * SUN_ANGLE_DEG)))
    shares = np.array([float(word) for word in spectrum[1].split()])
    east, north, up = (float(place[index]) for index in (1, 2, 3))
    turned = np.array(
        [math.cos(turn) * east - math.sin(turn) * north, math.sin(turn) * east + math.cos(turn) * north, up]
    )
    irradiance = np.maximum(shares, 0.0) * float(strength[1]) * solid_angle / SKY_SPAN_NM
    if up <= 0 or irradiance.max() <= 0:
        return None, np.zeros(SKY_WAVELENGTHS_NM.size)
    return turned / np.linalg.norm(turned), irradiance


def _hemisphere(radiance: FloatArray, altitudes_deg: FloatArray) -> FloatArray:
    """(wavelength,) ∫ L sin(altitude) dω over the upper half, L linear between the grid's directions."""
    rings = np.trapezoid(radiance, np.radians(AZIMUTHS_DEG), axis=0)
    fine = np.arange(0.5 * HEMISPHERE_STEP_DEG, 90.0, HEMISPHERE_STEP_DEG)
    weights = np.sin(np.radians(fine)) * np.cos(np.radians(fine)) * math.radians(HEMISPHERE_STEP_DEG)
    return np.array([weights @ np.interp(fine, altitudes_deg, ring) for ring in rings.T])


def pane_factor(cosines: FloatArray) -> FloatArray:
    """Transmittance of a pane by angle of incidence over that at normal incidence, min(1, 1.018 cosθ (1 + sin³θ)).

    Parameters
    ----------
    cosines : (...) float
        cosθ; 0 or below means from the other side, where nothing comes in.

    Returns
    -------
    factor : (...) float

    References
    ----------
    Rivero, Natural lighting: the calculation of the direct daylight factor, 1958 (for one pane of clear glass).
    """
    cosine = np.clip(cosines, 0.0, 1.0)
    return np.minimum(1.018 * cosine * (1.0 + (1.0 - cosine**2) ** 1.5), 1.0)


PANE_FACTOR_TEXT = "if(Rdot,min(1.018*Rdot*(1+max(1-Rdot*Rdot,0)^1.5),1),0)"
"""`pane_factor` for Radiance, of a ray that meets a window from the room."""


def pane_transmittance(cosines: FloatArray, at_normal: float) -> FloatArray:
    """Transmittance T(θ) of a window: that at normal incidence, of glass and frame together, times `pane_factor`."""
    return at_normal * pane_factor(cosines)


def directions(azimuths_deg: FloatArray, altitudes_deg: FloatArray) -> FloatArray:
    """(azimuth, altitude, 3) unit vectors of a grid of directions."""
    azimuth, altitude = np.meshgrid(np.radians(azimuths_deg), np.radians(altitudes_deg), indexing="ij")
    return np.stack([np.cos(altitude) * np.cos(azimuth), np.cos(altitude) * np.sin(azimuth), np.sin(altitude)], axis=-1)


def sky_spectrum(values: FloatArray, name: str) -> Spectrum:
    """A spectrum on genssky's bins, even out to `SKY_ENDS_NM` and dark beyond [any unit]."""
    return Spectrum(
        wavelengths_nm=np.concatenate([SKY_ENDS_NM[:1], SKY_WAVELENGTHS_NM, SKY_ENDS_NM[1:]]),
        values=np.concatenate([values[:1], values, values[-1:]]),
        name=name,
    )
