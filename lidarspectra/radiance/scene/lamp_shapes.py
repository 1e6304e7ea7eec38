"""Lamps as Radiance sees them: geometry, and the radiance that sends their flux.

    panel, strip, window   Lambertian rectangle       L = Φ/(πA), A = length x width
    disc                   Lambertian disc            L = Φ/(πA), A = πr²
    bulb, point            Lambertian sphere          L = Φ/(πA), A = 4πr²
    spot                   disc, I(θ) = I₀ cosⁿθ      L(θ) = (n + 1)Φ/(2πA) cosⁿ⁻¹θ, n = ln ½ / ln cos(beam/2)
    ies                    flat opening, I(θ, φ)      L(θ, φ) = (I/Φ_v) Φ / (A cosθ), on both faces where it shines up

The first three follow from the exitance of a Lambertian surface, M = πL = Φ/A. The spot's flux is
∫I dω = 2πI₀ ∫cosⁿθ sinθ dθ = 2πI₀/(n + 1), and L = I/(A cosθ).
"""

import math
from functools import lru_cache

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import LampError
from lidarspectra.lamps.ies import CandelaTable, read_ies
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.radiance.scene import primitives
from lidarspectra.radiance.scene.primitives import Color

TWO_FACES_APART_M = 0.002  # [m] between the lower and upper face of a luminaire that shines both ways
MIN_SHARE = 1e-4  # [1] of the flux, below which one way is not worth a face
WIDEST_BEAM_DEG = 120.0  # [deg] a Lambertian disc's own beam, n = 1; wider needs infinite radiance at the edge


def candela_file(modifier: str) -> str:
    """Name of a lamp's data file, if it has one."""
    return f"{modifier}_candela.dat"


def lamp_axes(lamp: Lamp) -> tuple[FloatArray, FloatArray]:
    """Directions of a rectangle's length and width; length x width = normal.

    The length lies along the x axis as far as the normal allows (along y where the normal is along x), turned by
    `rotation_deg` about the normal.

    Returns
    -------
    length, width : (3,) float
        Unit vectors.
    """
    reference = np.array([1.0, 0.0, 0.0])
    if abs(lamp.normal[0]) > 0.999:
        reference = np.array([0.0, 1.0, 0.0])
    length = reference - (reference @ lamp.normal) * lamp.normal
    length /= np.linalg.norm(length)
    width = np.cross(lamp.normal, length)
    angle = math.radians(lamp.rotation_deg)
    turned = math.cos(angle) * length + math.sin(angle) * width
    return turned, np.cross(lamp.normal, turned)


def lamp_corners(lamp: Lamp) -> FloatArray:
    """(4, 3) corners of a rectangular lamp [m], counter-clockwise seen from where it shines."""
    length, width = lamp_axes(lamp)
    along, across = 0.5 * lamp.size[0] * length, 0.5 * lamp.size[1] * width
    return np.asarray(lamp.center + np.stack([-along - across, along - across, along + across, across - along]))


def distance_to_lamp(lamp: Lamp, places: FloatArray) -> FloatArray:
    """Distance of places from the surface that shines.

    Parameters
    ----------
    lamp : Lamp
    places : (n, 3) float
        [m]

    Returns
    -------
    distance : (n,) float
        0 within a sphere. [m]
    """
    away = places - lamp.center
    radius = 0.5 * lamp.size[0]
    if lamp.shape in ("bulb", "point"):
        return np.asarray(np.maximum(np.linalg.norm(away, axis=1) - radius, 0.0), dtype=np.float64)
    height = away @ lamp.normal
    if len(lamp.size) == 1:
        beside = np.maximum(np.linalg.norm(away - height[:, None] * lamp.normal, axis=1) - radius, 0.0)
        return np.asarray(np.hypot(height, beside), dtype=np.float64)
    in_plane = np.abs(away @ np.stack(lamp_axes(lamp), axis=1))
    beside = np.linalg.norm(np.maximum(in_plane - 0.5 * np.array(lamp.size), 0.0), axis=1)
    return np.asarray(np.hypot(height, beside), dtype=np.float64)


def emitting_area_m2(lamp: Lamp) -> float:
    """Area of the surface that sends light [m²]."""
    match lamp.shape:
        case "panel" | "strip" | "window":
            return lamp.size[0] * lamp.size[1]
        case "disc" | "spot":
            return math.pi * (0.5 * lamp.size[0]) ** 2
        case "bulb" | "point":
            return 4.0 * math.pi * (0.5 * lamp.size[0]) ** 2
        case "ies":
            return lamp.size[0] * lamp.size[1] if len(lamp.size) == 2 else math.pi * (0.5 * lamp.size[0]) ** 2
        case "sun":
            raise LampError(expected="a lamp in the room", found="the sun", where=f"lamp '{lamp.name}'")


def beam_exponent(beam_angle_deg: float) -> float:
    """Exponent n of I(θ) = I₀ cosⁿθ that halves the intensity at half the beam angle.

    Parameters
    ----------
    beam_angle_deg : float
        Full angle at half the peak intensity, above 0 and at most 120. [deg]

    Returns
    -------
    exponent : float
        n >= 1.

    Raises
    ------
    LampError
        If the beam is wider than a flat lamp's can be.
    """
    if not 0.0 < beam_angle_deg <= WIDEST_BEAM_DEG + 1e-9:
        raise LampError(
            expected=f"a beam angle above 0 and at most {WIDEST_BEAM_DEG:g} degrees, a flat diffuse lamp's own",
            found=f"{beam_angle_deg:g}",
            where="spot lamp",
            todo="Use shape 'disc' for 120 degrees, 'bulb' for light to all sides, or an IES file.",
        )
    return max(1.0, math.log(0.5) / math.log(math.cos(math.radians(0.5 * beam_angle_deg))))


def radiance_per_flux(lamp: Lamp) -> float:
    """Radiance of the lamp's `light` per unit of flux [1/(m² sr)]: a spot's on its axis; 1 for 'ies'."""
    area = emitting_area_m2(lamp)
    if lamp.shape == "ies":
        return 1.0
    if lamp.shape == "spot":
        return (_exponent(lamp) + 1.0) / (2.0 * math.pi * area)
    return 1.0 / (math.pi * area)


def lamp_material_text(name: str, lamp: Lamp, flux: Color) -> str:
    """The lamp's emission.

    Parameters
    ----------
    name : str
        Safe modifier name that its geometry uses.
    lamp : Lamp
        Shape and distribution.
    flux : Color
        Spectral flux in each slot. [W/nm]

    Returns
    -------
    text : str
        Primitives that end in `light NAME`.
    """
    radiance = Color(group=flux.group, slots=flux.slots * radiance_per_flux(lamp))
    if lamp.shape == "ies":
        return _candela_pattern(name, lamp) + primitives.light(name, radiance, modifier=f"{name}_candela")
    if lamp.shape != "spot" or _exponent(lamp) == 1.0:
        return primitives.light(name, radiance)
    beam = f"{name}_beam"
    # Rdot is the cosine to the ring's own normal; '.' stands for no function file.
    pattern = primitives.primitive(
        "void", "brightfunc", beam, words=["if(Rdot,Rdot^A1,0)", "."], numbers=[_exponent(lamp) - 1.0]
    )
    return pattern + primitives.light(name, radiance, modifier=beam)


def lamp_geometry_text(name: str, lamp: Lamp) -> str:
    """The lamp's shape as Radiance geometry with the modifier `name`."""
    shape_name = f"{name}_shape"
    match lamp.shape:
        case "panel" | "strip" | "window":
            return primitives.polygon(name, shape_name, lamp_corners(lamp))
        case "disc" | "spot":
            return primitives.ring(name, shape_name, lamp.center, lamp.normal, 0.5 * lamp.size[0])
        case "bulb" | "point":
            return primitives.sphere(name, shape_name, lamp.center, 0.5 * lamp.size[0])
        case "ies":
            return _opening_text(name, lamp)
        case "sun":
            return ""  # it is no part of the room: see `daylight`


def lamp_data_text(lamp: Lamp) -> str | None:
    """Radiance data of a lamp's distribution, I/Φ_v [1/sr] over φ (unless axial) and θ [deg]; None for other shapes."""
    if lamp.shape != "ies":
        return None
    table = candela_table(lamp)
    axes = [table.vertical_deg] if table.is_axial else [table.horizontal_deg, table.vertical_deg]
    head = "".join(f"0 0 {axis.size} {' '.join(map(primitives.number, axis))}\n" for axis in axes)
    values = table.candela / table.luminous_flux_lm()
    return f"{len(axes)}\n{head}" + "".join(" ".join(map(primitives.number, row)) + "\n" for row in values)


def candela_table(lamp: Lamp) -> CandelaTable:
    """The lamp's candela table, from the text that it carries."""
    if lamp.candela_file is None:
        raise LampError(expected="an IES LM-63 text", found="none", where=f"lamp '{lamp.name}' (ies)")
    return _table(lamp.candela_file, f"lamp '{lamp.name}'")


@lru_cache(maxsize=64)
def _table(text: str, where: str) -> CandelaTable:
    return read_ies(text, where=where)  # asked for in every pass


def _candela_pattern(name: str, lamp: Lamp) -> str:
    """Pattern (I/Φ_v)/(A cosθ) of a flat opening.

    The ray runs towards the lamp along D; so light leaves along -D, and θ and φ follow from its parts along the lamp's
    normal (straight down in the file), its length (φ = 0) and -width (φ = 90°, counter-clockwise seen from behind).
    """
    length, width = lamp_axes(lamp)
    theta = "Acos(-(Dx*A2+Dy*A3+Dz*A4))/DEGREE"
    phi = "mod(Atan2(-(Dx*A8+Dy*A9+Dz*A10),-(Dx*A5+Dy*A6+Dz*A7))/DEGREE,360)"
    angles = [theta] if candela_table(lamp).is_axial else [phi, theta]
    return primitives.primitive(
        "void",
        "brightdata",
        f"{name}_candela",
        words=["flatcorr", primitives.file_word(candela_file(name)), "source.cal", *angles],
        numbers=[1.0 / emitting_area_m2(lamp), *lamp.normal, *length, *-width],
    )


def _opening_text(name: str, lamp: Lamp) -> str:
    """Flat luminous opening; a second face looks back where the luminaire shines that way too."""
    table = candela_table(lamp)
    sides = [
        sign
        for sign, upward in ((1.0, False), (-1.0, True))
        if table.luminous_flux_lm(upward=upward) > MIN_SHARE * table.luminous_flux_lm()
    ]
    texts = []
    for sign in sides:
        center = lamp.center + (0.5 * TWO_FACES_APART_M * sign if len(sides) == 2 else 0.0) * lamp.normal
        face = f"{name}_shape" if sign > 0 else f"{name}_back"
        if len(lamp.size) == 1:
            texts.append(primitives.ring(name, face, center, sign * lamp.normal, 0.5 * lamp.size[0]))
        else:
            corners = lamp_corners(lamp) - lamp.center + center
            texts.append(primitives.polygon(name, face, corners if sign > 0 else corners[::-1]))
    return "".join(texts)


def _exponent(lamp: Lamp) -> float:
    if lamp.beam_angle_deg is None:
        raise LampError(expected="a beam angle", found="none", where=f"lamp '{lamp.name}' (spot)")
    return beam_exponent(lamp.beam_angle_deg)
