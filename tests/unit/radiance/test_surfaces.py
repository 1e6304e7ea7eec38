"""Materials: Radiance's split of a reflectance adds up to the reflectance again."""

import numpy as np
import pytest

from lidarspectra.errors import MaterialError
from lidarspectra.material.material_map import Material
from lidarspectra.radiance.engine.bands import band_groups
from lidarspectra.radiance.scene.primitives import Color
from lidarspectra.radiance.scene.surfaces import MIN_ROUGHNESS, surface_slots, surface_text, transmissivity
from lidarspectra.spectra.spectrum import Spectrum, uniform_bands

GROUP = band_groups(3, "rgb")[0]
RHO = np.array([0.2, 0.5, 0.7])


def material(kind: str = "plastic", **settings: float) -> Material:
    return Material(
        name="tile",
        category="unknown",
        reflectance=Spectrum(wavelengths_nm=[300, 1000], values=[0.5, 0.5]),
        kind=kind,
        source="default",
        provenance="default",
        confidence=1.0,
        measured_range_nm=(300, 1000),
        color=(0.5, 0.5, 0.5),
        **settings,
    )


def arguments(of: Material, rho: np.ndarray = RHO) -> tuple[np.ndarray, list[float]]:
    """Slots, and the arguments after them, as written in rgb mode."""
    text = surface_text("m0", of, Color(group=GROUP, slots=rho))
    numbers = [float(word) for word in text.splitlines()[-1].split()[1:]]
    return np.array(numbers[:3][::-1]), numbers[3:]


@pytest.mark.parametrize("specularity", [0.0, 0.04, 0.2])
def test_plastic_reflects_its_reflectance_however_glossy(specularity: float) -> None:
    diffuse, (written, _) = arguments(material(specularity=specularity, roughness=0.1))
    np.testing.assert_allclose(diffuse * (1 - written) + written, RHO, rtol=1e-8)  # nine digits are written
    assert written == specularity


def test_gloss_cannot_exceed_the_darkest_band() -> None:
    diffuse, (written, _) = arguments(material(specularity=0.4))
    assert written == pytest.approx(0.2)
    assert diffuse[0] == 0
    np.testing.assert_allclose(diffuse * (1 - written) + written, RHO, rtol=1e-8)


@pytest.mark.parametrize("kind", ["metal", "mirror"])
def test_metals_carry_their_reflectance_as_colour(kind: str) -> None:
    color, (specularity, _) = arguments(material(kind, specularity=0.8))
    np.testing.assert_allclose(color, RHO, rtol=1e-8)
    assert specularity == (1.0 if kind == "mirror" else 0.8)


@pytest.mark.parametrize("specularity", [0.0, 0.05])
@pytest.mark.parametrize("transmittance", [0.0, 0.05, 0.15])
def test_a_translucent_sheet_reflects_and_passes_what_it_says(specularity: float, transmittance: float) -> None:
    color, (written, _, through, _) = arguments(material("trans", specularity=specularity, transmittance=transmittance))
    np.testing.assert_allclose(color * (1 - written) * (1 - through) + written, RHO, rtol=1e-7)
    assert np.mean(color * (1 - written) * through) == pytest.approx(transmittance, rel=1e-7)


def test_a_sheet_that_reflects_nothing_passes_grey_light() -> None:
    color, (_, _, through, _) = arguments(material("trans", transmittance=0.6), np.zeros(3))
    np.testing.assert_allclose(color * through, 0.6, rtol=1e-8)


@pytest.mark.parametrize("transmittance", [0.05, 0.5, 0.88])
def test_glass_passes_its_transmittance_at_normal_incidence(transmittance: float) -> None:
    # Fresnel at normal incidence for index 1.52, with all interreflections between the two surfaces.
    surface = ((1.52 - 1) / (1.52 + 1)) ** 2
    t = transmissivity(transmittance)
    passed = (1 - surface) ** 2 * t / (1 - surface**2 * t**2)
    assert passed == pytest.approx(transmittance, rel=2e-4)  # the formula's constants have four good digits


def test_glass_of_any_transmittance_makes_no_light() -> None:
    # Both surfaces send back .083; data sheets of clear panes say .92, and a fit to frames may say .99.
    surface = ((1.52 - 1) / (1.52 + 1)) ** 2
    for transmittance in (0.917, 0.92, 0.99):
        t = transmissivity(transmittance)
        passed = (1 - surface) ** 2 * t / (1 - surface**2 * t**2)
        reflected = surface * (1 + (1 - 2 * surface) * t**2) / (1 - surface**2 * t**2)
        assert passed + reflected == pytest.approx(1.0, abs=2e-3)


def test_smooth_gloss_is_written_a_little_rough() -> None:
    assert arguments(material(specularity=0.1))[1] == [0.1, MIN_ROUGHNESS]
    assert arguments(material(specularity=0.1, roughness=0.3))[1] == [0.1, 0.3]
    assert arguments(material(roughness=0.3))[1] == [0.0, 0.0]


@pytest.mark.parametrize(
    ("of", "rho"),
    [
        (material(), np.full(3, 1.0)),
        (material("trans", transmittance=0.4), np.array([0.3, 0.5, 0.7])),
        (material("glass", transmittance=1.0), RHO),
    ],
)
def test_surfaces_that_give_more_than_they_get_are_refused(of: Material, rho: np.ndarray) -> None:
    with pytest.raises(MaterialError, match="tile"):
        arguments(of, rho)


def test_slots_are_weighed_by_the_lamp() -> None:
    bands = uniform_bands(400, 700, 3)
    ramp = Material(**{**vars(material()), "reflectance": Spectrum(wavelengths_nm=[400, 700], values=[0.0, 0.9])})
    line = Spectrum(wavelengths_nm=[409, 410, 411, 509, 510, 511, 609, 610, 611], values=[0, 1, 0] * 3)
    slots = surface_slots(ramp, line, bands, GROUP).slots
    np.testing.assert_allclose(slots, [0.03, 0.33, 0.63], atol=1e-3)  # the band grid's 1 nm steps blur the line
