"""Flat mirrors and panes of glass as Radiance text, so that light goes from lamps to what they reflect it to.

A flat mirror is Radiance's `mirror`: shadow rays aimed at a lamp's image in it are sent on to the lamp.

Glass lets other shadow rays through. Radiance has no such mirror: on paths that were reflected diffusely before, a
`mirror` with an alternative material hides what is behind it (m_mirror.c, "avoid double-counting"). So glass, which in
the pass's own octree loses the lamps that it reflects, is in two further ones besides:

    images   a `mirror` before the glass, which rays pass that are not aimed at an image. Exact, for rays that were not
             reflected diffusely before: those of sensors, and those that sensors send to the first surface
    glow     a sheet before the glass, which sends on what a lamp's reflected light would be, in all directions alike:
             right in its flux, for each angle at which light comes in. For later reflections, where only that counts

rtrace, which starts at sensors and cannot choose an octree for each reflection, has a third: `panes`, which is `glow`
with all surfaces black but glass and mirrors. With as many diffuse reflections n as the accuracy has,

    E = E_glow(n) + E_images(0) - E_panes(1)

E_glow has all light, but what lamps send to sensors by way of glass as if it came from all of the pane; E_panes is that
part, and what comes straight from the lamps; E_images has both as they are.

Of glass the share that comes back is Fresnel's, of both surfaces of a pane of refractive index n and inner
transmissivity t, as Radiance's `glass` has it (glass.c):

    r = 1/2 Σ_(s, p) R (1 + (1 - 2R) d)/(1 - R² d),   d = t^(2/c'),  c' = √(1 - (1 - c²)/n²),  c = cos θ
    T = 1/2 Σ_(s, p) (1 - R)² √d/(1 - R² d)
    R_s = ((c - n c')/(c + n c'))²,   R_p = ((n c - c')/(n c + c'))²
"""

from collections.abc import Sequence

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.material.material_map import Material
from lidarspectra.radiance.scene import primitives
from lidarspectra.radiance.scene.panes import PANE, Pane
from lidarspectra.radiance.scene.primitives import Color
from lidarspectra.radiance.scene.surfaces import transmissivity

GLASS_FILE = "glass.cal"
INDEX = 1.52  # [1] n that Radiance's glass has
LEAST_TRANSMISSIVITY = 1e-6  # [1] of opaque glass, which still reflects from its front: the formula takes a logarithm
GLASS_FUNCTIONS = """{ Share of the light that a pane of glass of transmissivity t sends back, c: cosine of the angle }
index = 1.52;
square(x) = x*x;
inner(c) = sqrt(1 - (1 - c*c)/(index*index));
part(r, d) = .5*r*(1 + (1 - 2*r)*d)/(1 - r*r*d);
across(c, i) = square((c - index*i)/(c + index*i));
along(c, i) = square((index*c - i)/(index*c + i));
parts(c, i, d) = part(across(c, i), d) + part(along(c, i), d);
reflects(c, t) = parts(c, inner(c), exp(2*log(t)/inner(c)));
image = if(Rdot, reflects(Rdot, A1), 0);
lit(c, t) = if(c, reflects(c, t)/PI, 0);
glow(x, y, z, o) = if(Rdot, lit(Nx*x + Ny*y + Nz*z, A10), 0);
"""


def pane_transmittance(cosine: FloatArray, clear: FloatArray) -> FloatArray:
    """T of a pane.

    Parameters
    ----------
    cosine : (ray,) float
        c. [0-1]
    clear : (ray,) float
        t. [1]

    Returns
    -------
    transmittance : (ray,) float
    """
    inner = np.sqrt(1.0 - (1.0 - cosine**2) / INDEX**2)
    passed = clear ** (1.0 / inner)
    total = np.zeros(np.shape(cosine))
    for fresnel in (
        ((cosine - INDEX * inner) / (cosine + INDEX * inner)) ** 2,
        ((INDEX * cosine - inner) / (INDEX * cosine + inner)) ** 2,
    ):
        total += 0.5 * (1.0 - fresnel) ** 2 * passed / (1.0 - (fresnel * passed) ** 2)
    return total


def mirrors_text(panes: Sequence[Pane], materials: Sequence[Material], colors: Sequence[Color]) -> str:
    """Flat mirrors, just before their faces.

    Parameters
    ----------
    panes : sequence of Pane
        Those of glass are passed over.
    materials : sequence of Material
        Of the room.
    colors : sequence of Color
        Their reflectance. [1]
    """
    return "".join(
        primitives.mirror(f"{PANE}{number}", colors[pane.material]) + _sides(number, pane)
        for number, pane in enumerate(panes)
        if materials[pane.material].kind == "mirror"
    )


def images_text(panes: Sequence[Pane], materials: Sequence[Material]) -> str:
    """Mirrors before panes of glass, which only shadow rays aimed at a lamp's image see; see `mirrors_text`."""
    texts = []
    for number, pane in enumerate(panes):
        if materials[pane.material].kind == "glass":
            name, pattern = f"{PANE}{number}", f"{PANE}{number}_glass"
            texts += [
                primitives.primitive(
                    "void",
                    "brightfunc",
                    pattern,
                    words=["image", primitives.file_word(GLASS_FILE)],
                    numbers=[_transmissivity(materials[pane.material])],
                ),
                primitives.primitive(pattern, "mirror", name, words=["void"], numbers=[1.0, 1.0, 1.0]),
                _sides(number, pane),
            ]
    return "".join(texts)


def glow_text(panes: Sequence[Pane], materials: Sequence[Material]) -> str:
    """Sheets before panes of glass, which send lamps' reflected light in all directions; see `mirrors_text`."""
    texts = []
    for number, pane in enumerate(panes):
        if materials[pane.material].kind == "glass":
            words = [*3 * ["0"], *3 * ["1"], *3 * ["glow"], primitives.file_word(GLASS_FILE)]
            numbers = [0.0] * 9 + [_transmissivity(materials[pane.material])]
            texts += [
                primitives.primitive("void", "BRTDfunc", f"{PANE}{number}", words=words, numbers=numbers),
                _sides(number, pane),
            ]
    return "".join(texts)


def _sides(number: int, pane: Pane) -> str:
    """The pane's polygons, one for each side."""
    return "".join(
        primitives.polygon(f"{PANE}{number}", f"{PANE}{number}_{side}", corners)
        for side, corners in zip(("front", "back"), pane.sides(), strict=True)
    )


def _transmissivity(material: Material) -> float:
    return max(transmissivity(material.transmittance), LEAST_TRANSMISSIVITY)
