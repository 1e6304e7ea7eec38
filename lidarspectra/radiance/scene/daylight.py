"""Daylight as lamps: each window sends the sky that is seen through it, and the sun shines through all of them.

A window is a rectangle just inside its pane. From direction ω it sends the radiance L(ω)T(θ) of the sky or ground
behind it, through a pane of transmittance T (`sky.pane_transmittance`); the flux that this lamp has is

    Φ = A ∫ L(ω) T(θ) cosθ dω.

L is tabulated by direction, with a step at the horizon; how T changes with the angle is a formula, for Radiance too,
since a table with its two altitudes below the horizon would draw a straight line from the horizon to the nadir.

The sun is a source of 0.533 degrees at infinity. Its rays reach the room only through the windows: the scan is put in
a black box, whose walls let a ray through where its line meets a window, and the mesh within the windows is taken out.
Its flux is Φ = E_n Σ A T(θ) cosθ over the windows. In its pass the windows themselves are left out, so as not to stand
in its way.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import LampError
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.patterns import Opening, SkyLight, SunBeam
from lidarspectra.lamps.shapes import Sun
from lidarspectra.lamps.shapes import Window as WindowShape
from lidarspectra.lamps.surfaces import Place, Rectangle
from lidarspectra.radiance.engine.bands import BandGroup
from lidarspectra.radiance.scene import primitives
from lidarspectra.radiance.scene.lamp_text import lamp_geometry_text
from lidarspectra.radiance.scene.primitives import Color
from lidarspectra.radiance.scene.sky import (
    ALTITUDES_DEG,
    AZIMUTHS_DEG,
    PANE_FACTOR_TEXT,
    SKY_WAVELENGTHS_NM,
    SUN_ANGLE_DEG,
    Sky,
    directions,
    pane_factor,
    pane_transmittance,
    sky_spectrum,
)
from lidarspectra.spectra.spectrum import BandSet

SUN_NAME = "sun"
BOX_MARGIN_M = 0.5  # [m] between the scan and the box around it
FLUX_STEP_DEG = 1.0  # [deg] of the integral for a window's flux


@dataclass(frozen=True, kw_only=True)
class Window:
    """An opening to the outside.

    Parameters
    ----------
    name : str
        The user's words.
    center, normal : (float, float, float)
        Middle, just inside the pane [m], and direction into the room.
    size : (float, float)
        Length and width of the glass. [m]
    rotation_deg : float
        As `Lamp.rotation_deg`. [deg]
    transmittance : float
        At normal incidence, of pane and frame. [0-1]
    factor : float
        Of a calibration, on all its light: above 1 where more comes in than its sky sends through clear glass. [1]
    """

    name: str
    center: tuple[float, float, float]
    normal: tuple[float, float, float]
    size: tuple[float, float]
    rotation_deg: float = 0.0
    transmittance: float = 0.8
    factor: float = 1.0

    @property
    def passes(self) -> float:
        """Share of the light at normal incidence that it sends into the room [1]."""
        return self.transmittance * self.factor


def daylight_lamps(sky: Sky, windows: Sequence[Window]) -> tuple[Lamp, ...]:
    """The lamps that daylight makes of the windows.

    Parameters
    ----------
    sky : Sky
    windows : sequence of Window

    Returns
    -------
    lamps : tuple of Lamp
        One a window, and one for the sun where it shines in; none at night.

    Raises
    ------
    LampError
        If a window has no size, no direction, or a transmittance outside 0 to 1.
    """
    lamps = [lamp for window in windows if (lamp := _window_lamp(sky, window)) is not None]
    sun = _sun_lamp(sky, windows)
    return tuple(lamps) if sun is None else (*lamps, sun)


def outward_of(window: Window) -> FloatArray:
    """(3,) unit vector out of the room, in the scan's axes."""
    normal = np.array(window.normal, dtype=np.float64)
    return np.asarray(-normal / max(float(np.linalg.norm(normal)), 1e-300))


def _window_lamp(sky: Sky, window: Window) -> Lamp | None:
    if not 0.0 <= window.transmittance <= 1.0:
        raise LampError(
            expected="a transmittance from 0 to 1", found=f"{window.transmittance}", where=f"window '{window.name}'"
        )
    outward = outward_of(window)
    incoming = sky.radiance * window.passes
    flux = window.size[0] * window.size[1] * _flux_density(incoming, outward)
    if flux.max() <= 0:
        return None  # night, or a shuttered window
    return Lamp(
        name=window.name,
        shape=WindowShape(*window.size, incoming=incoming),
        center=np.array(window.center),
        normal=np.array(window.normal),
        rotation_deg=window.rotation_deg,
        flux=sky_spectrum(flux, f"sky through {window.name}"),
    )


def _flux_density(incoming: FloatArray, outward: FloatArray) -> FloatArray:
    """(wavelength,) ∫ L T(θ)/T(0) cosθ dω over the outer half [W/m²/nm], on a degree's grid."""
    azimuths = np.arange(0.5 * FLUX_STEP_DEG, 360.0, FLUX_STEP_DEG)
    altitudes = np.arange(-90.0 + 0.5 * FLUX_STEP_DEG, 90.0, FLUX_STEP_DEG)
    from scipy.interpolate import RegularGridInterpolator  # loads slowly, and few runs need it

    table = RegularGridInterpolator((AZIMUTHS_DEG, ALTITUDES_DEG), incoming)
    grid = np.stack(np.meshgrid(azimuths, altitudes, indexing="ij"), axis=-1)
    solid_angles = np.cos(np.radians(altitudes)) * math.radians(FLUX_STEP_DEG) ** 2
    cosines = directions(azimuths, altitudes) @ outward
    weights = np.clip(cosines, 0.0, None) * pane_factor(cosines) * solid_angles
    return np.asarray(np.einsum("ahw,ah->w", table(grid), weights))


def _sun_lamp(sky: Sky, windows: Sequence[Window]) -> Lamp | None:
    if sky.sun_direction is None:
        return None
    openings = []
    passed = 0.0
    for window in windows:
        shape = window_shape(window)
        inward = shape.normal
        cosine = float(-inward @ sky.sun_direction)
        transmittance = float(pane_transmittance(np.array(cosine), window.passes))
        if transmittance > 0:
            openings.append(Opening(corners=shape.corners(), inward=inward, transmittance=transmittance))
            passed += window.size[0] * window.size[1] * cosine * transmittance
    if passed <= 0:
        return None
    return Lamp(
        name=SUN_NAME,
        shape=Sun(tuple(openings)),
        center=np.mean([opening.corners.mean(axis=0) for opening in openings], axis=0),
        normal=-sky.sun_direction,
        flux=sky_spectrum(passed * sky.sun_irradiance, SUN_NAME),
    )


def window_shape(window: Window) -> Rectangle:
    """The glass in its place, facing the room."""
    normal = np.array(window.normal, dtype=np.float64)
    normal /= max(float(np.linalg.norm(normal)), 1e-300)
    return Rectangle(Place.facing(np.array(window.center), normal, window.rotation_deg), *window.size)


def openings_of(sun: Lamp) -> tuple[Opening, ...]:
    """What the sun shines through."""
    pattern = sun.shape.pattern
    if not isinstance(pattern, SunBeam):
        raise LampError(expected="the sun", found=sun.shape.word, where=f"lamp '{sun.name}'")
    return pattern.openings


def _incoming(lamp: Lamp) -> FloatArray:
    """(azimuth, altitude, wavelength) radiance of a window with daylight [W/m²/sr/nm]."""
    pattern = lamp.shape.pattern
    if not isinstance(pattern, SkyLight):
        raise LampError(expected="a window with daylight", found="none", where=f"lamp '{lamp.name}'")
    return pattern.incoming


def sky_data_texts(lamp: Lamp, bands: BandSet, group: BandGroup) -> tuple[str, ...]:
    """Radiance data of a window: radiance by direction over the flux that it makes [1/(m² sr)], in each slot.

    It is the radiance at normal incidence: `window_text` adds how the pane passes other angles.

    Parameters
    ----------
    lamp : Lamp
        A window with daylight.
    bands : BandSet
    group : BandGroup
        The pass's.

    Returns
    -------
    texts : tuple of str
        Natively one with the slots as its last axis; in rgb mode one a colour, red first.
    """
    incoming = _incoming(lamp)
    units = np.eye(SKY_WAVELENGTHS_NM.size)
    to_bands = np.array([bands.band_values(sky_spectrum(unit, "bin"), outside="zero") for unit in units])
    flux = lamp.size[0] * lamp.size[1] * _flux_density(incoming, -lamp.normal) @ to_bands
    dark = flux <= 0
    spread = incoming @ to_bands / np.where(dark, 1.0, flux)
    lambertian = 1.0 / (math.pi * lamp.size[0] * lamp.size[1])  # where no light comes in, any distribution is right
    values = group.to_slots(np.where(dark, lambertian, spread))
    axes = [_axis_text(AZIMUTHS_DEG), _axis_text(ALTITUDES_DEG)]
    if group.mode == "rgb":
        return tuple(_data_text(axes, values[..., slot]) for slot in reversed(range(group.slot_count)))
    first, last = group.slot_ends_nm
    return (_data_text([*axes, f"{first} {last} {group.slot_count}"], values),)


def _axis_text(values: FloatArray) -> str:
    return f"0 0 {values.size} {' '.join(map(primitives.number, values))}"


def _data_text(axes: list[str], values: FloatArray) -> str:
    rows = values.reshape(-1, values.shape[-1])
    lines = [str(len(axes)), *axes, *(" ".join(map(primitives.number, row)) for row in rows)]
    return "\n".join(lines) + "\n"


def window_text(name: str, lamp: Lamp, flux: Color, files: Sequence[str]) -> str:
    """Material and shape of a window with daylight.

    Parameters
    ----------
    name : str
        Safe modifier name.
    lamp : Lamp
        A window with daylight.
    flux : Color
        As the scene is written. [W/nm]
    files : sequence of str
        Names of the files with `sky_data_texts`.

    Returns
    -------
    text : str
    """
    # A ray towards the window runs outward along D, to where the light comes from.
    angles = ["mod(Atan2(Dy,Dx)/DEGREE,360)", "90-Acos(Dz)/DEGREE"]
    words = [primitives.file_word(file) for file in files]
    pattern = f"{name}_sky"
    if flux.group.mode == "rgb":
        text = primitives.primitive("void", "colordata", pattern, words=["noop"] * 3 + words + [".", *angles])
    else:
        text = primitives.primitive("void", "specdata", pattern, words=["noop", *words, ".", *angles])
    pane = f"{name}_pane"
    text += primitives.primitive(pattern, "brightfunc", pane, words=[PANE_FACTOR_TEXT, "."])
    return text + primitives.light(name, flux, modifier=pane) + window_shape_text(name, lamp)


def window_shape_text(name: str, lamp: Lamp) -> str:
    """Shape of a window, for passes in which it is dark, too."""
    return lamp_geometry_text(name, lamp)


def sun_text(name: str, lamp: Lamp, flux: Color, box: FloatArray, file: str) -> str:
    """The sun, and the box around the room that only lets it through the windows.

    Parameters
    ----------
    name : str
        Safe modifier name.
    lamp : Lamp
        The sun, with its openings.
    flux : Color
        As the scene is written. [W/nm]
    box : (2, 3) float
        Bounds of all that is in the room. [m]
    file : str
        Name of the file with `mask_text`.

    Returns
    -------
    text : str
    """
    solid_angle = 2.0 * math.pi * (1.0 - math.cos(math.radians(0.5 * SUN_ANGLE_DEG)))
    passed = sum(
        _area(opening) * max(float(opening.inward @ lamp.normal), 0.0) * opening.transmittance
        for opening in openings_of(lamp)
    )
    radiance = Color(group=flux.group, slots=flux.slots / (solid_angle * passed))
    text = primitives.light(name, radiance)
    text += primitives.primitive(name, "source", f"{name}_disc", numbers=[*-lamp.normal, SUN_ANGLE_DEG])
    text += primitives.black(f"{name}_black")
    mask = f"{name}_mask"
    text += primitives.primitive(
        "void", "mixfunc", mask, words=["void", f"{name}_black", "through", primitives.file_word(file)]
    )
    return text + "".join(
        primitives.polygon(mask, f"{name}_wall{index}", wall) for index, wall in enumerate(_walls(box))
    )


def mask_text(lamp: Lamp) -> str:
    """Function file of the box: `through` is the transmittance of the window that a ray's line meets, or 0."""
    lines = []
    for index, opening in enumerate(openings_of(lamp)):
        center = opening.corners.mean(axis=0)
        length, width = opening.corners[1] - opening.corners[0], opening.corners[3] - opening.corners[0]
        inward = opening.inward
        lines += [
            f"d{index} = {_dot('D', inward)};",
            f"s{index} = if(abs(d{index})-1e-9, ({_dot('P', inward)}-({inward @ center:.9g}))/d{index}, 1e9);",
            *(
                f"{axis}{index} = abs({_dot('P', side)}-({side @ center:.9g})-s{index}*({_dot('D', side)}));"
                for axis, side in (("u", length / (length @ length)), ("v", width / (width @ width)))
            ),
            f"w{index} = if(.5-u{index}, if(.5-v{index}, {opening.transmittance:.9g}, 0), 0);",
        ]
    total = "+".join(f"w{index}" for index in range(len(openings_of(lamp)))) or "0"
    return "\n".join([*lines, f"through = if({total}-1, 1, {total});"]) + "\n"


def _dot(letter: str, vector: FloatArray) -> str:
    return "+".join(f"{letter}{axis}*({value:.9g})" for axis, value in zip("xyz", vector, strict=True))


def _area(opening: Opening) -> float:
    length, width = opening.corners[1] - opening.corners[0], opening.corners[3] - opening.corners[0]
    return float(np.linalg.norm(length) * np.linalg.norm(width))


def _walls(box: FloatArray) -> list[FloatArray]:
    """Six rectangles of the box, with its margin."""
    low, high = box[0] - BOX_MARGIN_M, box[1] + BOX_MARGIN_M
    walls = []
    for axis in range(3):
        for level in (low, high):
            spots = []
            for first, second in ((low, low), (high, low), (high, high), (low, high)):
                corner = np.empty(3)
                corner[axis] = level[axis]
                corner[(axis + 1) % 3] = first[(axis + 1) % 3]
                corner[(axis + 2) % 3] = second[(axis + 2) % 3]
                spots.append(corner)
            walls.append(np.array(spots))
    return walls
