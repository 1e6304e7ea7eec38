"""Lamps as Radiance sees them: one modifier with the radiance that sends their flux, and their surfaces under it.

What is written follows from a lamp's surfaces (`lamps.surfaces`) and from how its light spreads (`lamps.patterns`), so
that a new shape made of those needs nothing here. Windows with daylight and the sun are written by `daylight`.
"""

from lidarspectra.errors import SceneError
from lidarspectra.lamps.ies import CandelaTable
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.patterns import CandelaPattern, CosinePower, Lambertian
from lidarspectra.lamps.surfaces import Circle, Rectangle, Sphere
from lidarspectra.radiance.scene import primitives
from lidarspectra.radiance.scene.primitives import Color

SHADOW_RAY_WEIGHT = (0.11145837, 0.55139723, 0.4512956, 0.61041684, 0.1142228)
"""[1] a, b, c, d, e of w = a + b (1 - ρ²)^c + d (1 - ρ²)^e, which makes shadow rays to a circle fall evenly on it.

Radiance's srcsamp.c draws (u, v) evenly from a square and aims at x = u √(1 - v²/2), y = v √(1 - u²/2) of the unit
disc, too rarely at its middle (.79 of the even density) and too often at its rim. The density over all turns of the
square, which is turned by chance, is p(ρ) = (π/4) <√((1 + q)/2 - ρ²/4)/q>, q² = 1 - ρ² + ρ⁴ cos²2φ/4, < > the mean over
φ; w is 1/p within 2e-5. Without it the irradiance below the middle came out 20 % low at a tenth of the radius.
"""
_SHARE = "max(1-((Px-A1)^2+(Py-A2)^2+(Pz-A3)^2)/A4,0)"
_WEIGHT_TEXT = f"A5+A6*{_SHARE}^A7+A8*{_SHARE}^A9"


def candela_file(modifier: str) -> str:
    """Name of a lamp's data file, if it has one."""
    return f"{modifier}_candela.dat"


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

    Raises
    ------
    SceneError
        If its light comes from outside the room (see `daylight`).
    """
    pattern = lamp.shape.pattern
    match pattern:
        case Lambertian() | CosinePower(exponent=1.0):
            return _light(name, lamp, _times(flux, pattern.radiance_per_flux(lamp.shape.area)))
        case CosinePower(exponent=exponent):
            beam = f"{name}_beam"
            # Rdot is the cosine to the ring's own normal; '.' stands for no function file.
            text = primitives.primitive(
                "void", "brightfunc", beam, words=["if(Rdot,Rdot^A1,0)", "."], numbers=[exponent - 1.0]
            )
            radiance = _times(flux, pattern.radiance_per_flux(lamp.shape.area))
            return text + _light(name, lamp, radiance, modifier=beam)
        case CandelaPattern(table=table):
            return _candela_pattern(name, lamp, table) + _light(name, lamp, flux, modifier=f"{name}_candela")
        case _:
            raise SceneError(
                expected="a lamp that shines in the room", found=type(pattern).__name__, where=f"lamp '{lamp.name}'"
            )


def lamp_geometry_text(name: str, lamp: Lamp) -> str:
    """The lamp's surfaces as Radiance geometry with the modifier `name`; nothing for the sun."""
    texts = []
    for index, surface in enumerate(lamp.surfaces):
        part = f"{name}_shape{index or ''}"
        match surface:
            case Rectangle():
                texts.append(primitives.polygon(name, part, surface.corners()))
            case Circle(place=place):
                texts.append(primitives.ring(name, part, place.center, place.normal, surface.radius))
            case Sphere(center=center):
                texts.append(primitives.sphere(name, part, center, surface.radius))
            case _:
                raise SceneError(
                    expected="rectangles, circles and spheres",
                    found=type(surface).__name__,
                    where=f"lamp '{lamp.name}'",
                )
    return "".join(texts)


def lamp_data_text(lamp: Lamp) -> str | None:
    """Radiance data of a candela table, I/Φ_v [1/sr] over φ (unless axial) and θ [deg]; None for other lamps."""
    if not isinstance(lamp.shape.pattern, CandelaPattern):
        return None
    table = lamp.shape.pattern.table
    axes = [table.vertical_deg] if table.is_axial else [table.horizontal_deg, table.vertical_deg]
    head = "".join(f"0 0 {axis.size} {' '.join(map(primitives.number, axis))}\n" for axis in axes)
    values = table.candela / table.luminous_flux_lm()
    return f"{len(axes)}\n{head}" + "".join(" ".join(map(primitives.number, row)) + "\n" for row in values)


def _light(name: str, lamp: Lamp, radiance: Color, *, modifier: str = "void") -> str:
    """Light of a lamp; of a single circle with its shadow rays weighted, which is Radiance's `illum`.

    Seen by any other ray an illum is its alternative material, here the light as it is.
    """
    surfaces = lamp.surfaces
    if len(surfaces) != 1 or not isinstance(surfaces[0], Circle):
        return primitives.light(name, radiance, modifier=modifier)
    circle, seen, evenly = surfaces[0], f"{name}_seen", f"{name}_evenly"
    numbers = [*circle.place.center, circle.radius**2, *SHADOW_RAY_WEIGHT]
    weight = primitives.primitive(modifier, "brightfunc", evenly, words=[_WEIGHT_TEXT, "."], numbers=numbers)
    return (
        primitives.light(seen, radiance, modifier=modifier)
        + weight
        + primitives.illum(name, radiance, alternative=seen, modifier=evenly)
    )


def _times(flux: Color, factor: float) -> Color:
    return Color(group=flux.group, slots=flux.slots * factor)


def _candela_pattern(name: str, lamp: Lamp, table: CandelaTable) -> str:
    """Pattern (I/Φ_v)/(A cosθ) of a flat opening.

    The ray runs towards the lamp along D; so light leaves along -D, and θ and φ follow from its parts along the lamp's
    normal (straight down in the file), its length (φ = 0) and -width (φ = 90°, counter-clockwise seen from behind).
    """
    place = lamp.place
    theta = "Acos(-(Dx*A2+Dy*A3+Dz*A4))/DEGREE"
    phi = "mod(Atan2(-(Dx*A8+Dy*A9+Dz*A10),-(Dx*A5+Dy*A6+Dz*A7))/DEGREE,360)"
    angles = [theta] if table.is_axial else [phi, theta]
    return primitives.primitive(
        "void",
        "brightdata",
        f"{name}_candela",
        words=["flatcorr", primitives.file_word(candela_file(name)), "source.cal", *angles],
        numbers=[1.0 / lamp.shape.area, *place.normal, *place.length, *-place.width],
    )
