"""A room whose paint has a steep edge within a channel, traced, against its closed form at 1 nm; and relit."""

import numpy as np
import pytest

from lidarspectra.mapping.maps.spectral_map import LampChange, relight, spectral_map
from lidarspectra.radiance.engine.options import BOUNCES
from lidarspectra.radiance.sampling.folding import spectrum_error
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.spectra.databases import lamp_spectrum
from lidarspectra.spectra.spectrum import Spectrum, sensor_bands

from .conftest import Rooms

BANDS = sensor_bands("as7265x-14")
GRID = BANDS.wavelengths_nm
BULB_M = 0.004  # [m] diameter
ORANGE = Spectrum(wavelengths_nm=[380, 575, 585, 780], values=[0.05, 0.05, 0.7, 0.7])
WOOD = Spectrum(wavelengths_nm=[380, 480, 620, 780], values=[0.1, 0.2, 0.55, 0.65])


def narrow_led() -> Spectrum:
    """A lamp of 20 nm full width at half maximum at 585 nm."""
    grid = np.arange(380.0, 781.0)
    return Spectrum(wavelengths_nm=grid, values=1e-3 + np.exp(-4 * np.log(2) * ((grid - 585.0) / 20.0) ** 2))


LAMPS = {"white LED": lamp_spectrum("LED-B3").spectrum, "tri-phosphor": lamp_spectrum("FL11").spectrum}
LAMPS |= {"20 nm LED": narrow_led()}


def in_sphere(lamp: Spectrum, paint: Spectrum, bounces: int) -> np.ndarray:
    """(band,) irradiance at 0.99 of a unit sphere's radius, Φ (Σ ρⁿ - 1 + 0.99⁻²) / 4π at each nanometre."""
    rho = paint.at(GRID, outside="nearest")
    series = (1 - rho ** (bounces + 1)) / (1 - rho)
    return BANDS.weights @ (lamp.at(GRID, outside="zero") * (series - 1 + 0.99**-2)) / (4 * np.pi)


def sphere(rooms, lamp: Spectrum, paint: Spectrum):
    return rooms.scene([rooms.lamp("bulb", (0, 0, 0), BULB_M, flux=lamp)], [(rooms.ball(1.0), paint)], bands=BANDS)


def points(sensors):
    outwards = np.random.default_rng(1).standard_normal((12, 3))
    places = 0.99 * outwards / np.linalg.norm(outwards, axis=1, keepdims=True)
    return sensors(places, -places)


@pytest.mark.parametrize("name", LAMPS)
def test_an_all_orange_room_is_right_in_its_worst_channel(rooms, sensors, section, name: str) -> None:
    lamp = LAMPS[name]
    found = spectral_map(trace(sphere(rooms, lamp, ORANGE), points(sensors), **section("ultra", "fine"), seed=1))
    expected = in_sphere(lamp, ORANGE, BOUNCES["ultra"])
    lit = expected > 1e-3 * expected.max()
    mean = found["irradiance"].mean("point").to_numpy()
    # 1 % for the slots, as promised; 0.5 % for the sphere of triangles, and 0.3 % for the noise of a mean of 12.
    np.testing.assert_allclose(mean[lit], expected[lit], rtol=0.018)
    # With one slot a channel these rooms come out 12 to 18 % too dark in one channel; none may lean that way.
    assert (mean[lit] / expected[lit]).min() > 0.985


@pytest.fixture(scope="module")
def in_wood(tmp_path_factory, sensors, section):
    """A sphere of wood as traced under a white LED, and the ratio of that light to its closed form."""
    rooms = Rooms(tmp_path_factory.mktemp("wood"))
    transport = trace(sphere(rooms, LAMPS["white LED"], WOOD), points(sensors), **section("ultra", "fine"), seed=1)
    expected = in_sphere(LAMPS["white LED"], WOOD, BOUNCES["ultra"])
    return transport, spectral_map(transport)["irradiance"].mean("point").to_numpy() / expected


def relit_error(in_wood, other: Spectrum) -> tuple[np.ndarray, np.ndarray]:
    """(band,) error of light of another spectrum through the traced transport, and the one foretold; lit channels.

    Over the traced light's own ratio to its closed form, which cancels the sphere's triangles and the shared noise.
    """
    transport, own = in_wood
    lamp = str(transport["lamp"].to_numpy()[0])
    relit = relight(transport, {lamp: LampChange(flux=other)}, bands=BANDS)
    assert np.all(relit["irradiance_se"].to_numpy() >= 0)
    expected = in_sphere(other, WOOD, BOUNCES["ultra"])
    lit = expected > 2e-3 * expected.max()
    error = relit["irradiance"].mean("point").to_numpy() / expected / own - 1
    return error[lit], spectrum_error(transport, lamp, other)[lit]


@pytest.mark.parametrize("name", ["FL11", "FL2", "A", "HP5", "LED-RGB1"])
def test_relighting_with_a_common_lamp_is_as_good_as_tracing_it(in_wood, name: str) -> None:
    error, _ = relit_error(in_wood, lamp_spectrum(name).spectrum)
    assert np.abs(error).max() < 0.01


def test_a_spectrum_that_asks_for_more_than_the_run_has_is_foretold(in_wood) -> None:
    # A narrow LED's tails in the neighbouring channels lie where the traced one had little light.
    error, foretold = relit_error(in_wood, LAMPS["20 nm LED"])
    assert np.abs(foretold).max() > 0.02
    # Foretold is the error of reflected light, in the limit of many reflections; direct light, which has none, is half
    # of what arrives here. Noise and the finite number of reflections leave half a per cent.
    assert np.all(np.abs(error) <= np.abs(foretold) + 0.005)
    assert np.abs(error).max() > 0.25 * np.abs(foretold).max()
