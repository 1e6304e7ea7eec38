"""Surfaces: from a material's reflectance spectrum to Radiance's modifiers, the total reflectance kept.

A material's reflectance ρ is total and hemispherical. Radiance's materials split it their own way (refman,
"Materials"); each split below is solved so that what comes back in slot b, over all directions, is ρ_b again:

    plastic   c(1 - s) + s = ρ         the diffuse part c is scaled by 1 - s, the specular part s has no colour
    metal     c(1 - s) + cs = ρ        both parts have the colour
    mirror    c = ρ                    written as metal with s = 1
    trans     c(1 - s)(1 - t) + s = ρ,  c(1 - s)t = τ
    glass     by the transmissivity that gives the transmittance τ at normal incidence; what its two surfaces
              reflect follows from the refractive index 1.52 that Radiance takes, so its ρ is not used

Whatever is specular, glass apart, is written with a roughness of at least 0.05 (a blur of 3 degrees). On a perfectly
smooth surface Radiance follows no lamp's light to where it is reflected next: a closed room of ρ = 0.7 loses 6 % of its
light with s = 0.05 and 69 % with mirrors, but 1 % or less from a roughness of 0.02 on (measured; `tests/engine`). Flat
mirrors have a smooth one written before them, in which shadow rays find lamps' images (`pane_text`). Above a roughness
of 0.2 Radiance's reflection model itself loses some per cent at grazing angles.
"""

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MaterialError
from lidarspectra.material.material_map import MAX_REFLECTANCE, Material
from lidarspectra.radiance.engine.bands import BandGroup
from lidarspectra.radiance.scene import primitives
from lidarspectra.radiance.scene.primitives import Color
from lidarspectra.spectra.spectrum import BandSet, Spectrum

MIN_ROUGHNESS = 0.05  # [1] of specular surfaces: below it noise grows, at 0 lamps' light is lost (see above)
ROUNDING = 1e-9  # [1] of a weighted mean of reflectances that are all at the limit


def surface_slots(material: Material, light: Spectrum, bands: BandSet, group: BandGroup) -> Color:
    """Band reflectances of a material under the light of a spectral group (`BandSet.reflected_values`), as slots."""
    return Color(group=group, slots=group.to_slots(bands.reflected_values(material.reflectance, light)))


def surface_text(name: str, material: Material, reflectance: Color) -> str:
    """Radiance primitives of a material.

    Parameters
    ----------
    name : str
        Safe modifier name.
    material : Material
        How it scatters.
    reflectance : Color
        Total reflectance ρ in each slot (`surface_slots`).

    Returns
    -------
    text : str

    Raises
    ------
    MaterialError
        If the surface would return more light than it gets.
    """
    rho = reflectance.slots
    _check_energy(material, rho)
    specularity, roughness = material.specularity, max(material.roughness, MIN_ROUGHNESS)
    match material.kind:
        case "plastic":
            specularity = min(specularity, float(rho.min()))  # the uncoloured part cannot exceed the whole
            diffuse = _share(rho - specularity, 1.0 - specularity)
            return primitives.plastic(
                name,
                _like(reflectance, diffuse),
                specularity=specularity,
                roughness=roughness if specularity > 0 else 0.0,
            )
        case "metal":
            return primitives.metal(name, reflectance, specularity=specularity, roughness=roughness)
        case "mirror":
            return primitives.metal(name, reflectance, specularity=1.0, roughness=roughness)
        case "trans":
            return _trans(name, material, reflectance)
        case "glass":
            slots = np.full(rho.shape, transmissivity(material.transmittance))
            return primitives.glass(name, _like(reflectance, slots))


def transmissivity(transmittance: float) -> float:
    """Transmissivity t of one passage through a pane of index 1.52, from its transmittance T at normal incidence.

    t = (sqrt(.8402528435 + .0072522239 T²) - .9166530661) / (.0036261119 T), with interreflections between the
    two surfaces (Ward, "The RADIANCE 5.x synthetic imaging system" refman, `glass`).

    Parameters
    ----------
    transmittance : float
        T. [0-1]

    Returns
    -------
    transmissivity : float
        t; 1 where T is above what a clear pane of that index passes, about 0.917: with more it would send out more
        light than it gets, since it reflects the rest.
    """
    if transmittance <= 0:
        return 0.0
    root = np.sqrt(0.8402528435 + 0.0072522239 * transmittance**2)
    return min(1.0, float((root - 0.9166530661) / (0.0036261119 * transmittance)))


def _trans(name: str, material: Material, reflectance: Color) -> str:
    """Translucent sheet; what it transmits has the colour of its diffuse reflection, and τ as its mean over slots."""
    rho = reflectance.slots
    specularity = min(material.specularity, float(rho.min()))
    diffuse = rho - specularity  # c (1 - s)(1 - t)
    back = float(diffuse.mean())
    through = material.transmittance
    if back <= 0 and through > 0:  # nothing to share a colour with: a neutral sheet that only transmits
        color, transmitted = np.full(rho.shape, through / (1.0 - specularity)), 1.0
    else:
        transmitted = through / (back + through) if through > 0 else 0.0
        color = _share(diffuse, (1.0 - specularity) * (1.0 - transmitted))
    return primitives.trans(
        name,
        _like(reflectance, color),
        specularity=specularity,
        roughness=max(material.roughness, MIN_ROUGHNESS) if specularity > 0 else 0.0,
        transmitted=transmitted,
    )


def _share(part: FloatArray, of: float) -> FloatArray:
    """A part as a fraction of what is there to share; zero where nothing is."""
    return np.zeros_like(part) if of <= 0 else np.asarray(part / of, dtype=np.float64)


def _check_energy(material: Material, rho: FloatArray) -> None:
    most = float(rho.max())
    if material.kind == "trans":
        diffuse = rho - min(material.specularity, float(rho.min()))
        mean = float(diffuse.mean())
        most = float((rho + material.transmittance * (diffuse / mean if mean > 0 else 1.0)).max())
    if material.kind == "glass":
        most = material.transmittance
    if most > MAX_REFLECTANCE + ROUNDING:
        raise MaterialError(
            expected=f"a surface that returns and passes at most {MAX_REFLECTANCE} of the light",
            found=f"{most:.3f} in one band",
            where=f"material '{material.name}' ({material.kind})",
            todo="Lower its reflectance or transmittance: otherwise light would grow with every bounce.",
        )


def _like(color: Color, slots: FloatArray) -> Color:
    return Color(group=color.group, slots=slots)
