"""Interreflection in closed rooms, against closed forms.

In a closed room of diffuse reflectance ρ and wall area S, a lamp of flux Φ gives a mean wall irradiance of
Φ/S Σ ρⁿ = Φ/(S(1-ρ)); the reflected part alone is Φρ/(S(1-ρ)), as in the analytical cases of CIE 171:2006, 5.8. With
at most N reflections the sum ends at ρᴺ. In a sphere with the lamp in its centre every point has the mean.
"""

import numpy as np
import pytest
import trimesh

from lidarspectra.errors import ArrayError
from lidarspectra.mapping.maps.spectral_map import LampChange, relight, spectral_map
from lidarspectra.radiance.engine.options import BOUNCES
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.spectra.spectrum import Spectrum, uniform_bands

BY_ITS_ERROR = pytest.mark.chance(
    "held to a standard error that, known from eight batches, has the long tails of a t of seven degrees"
)

BULB_M = 0.004  # [m] diameter; its surface takes 5e-5 / 6 of the light that crosses a unit cube
SPHERE = 5e-3  # [1] a sphere of 5120 triangles has 0.2 % less area, and light meets facets up to 3 degrees off
SIDES = [
    ((0.5, 0.5, 0), (0, 0, 1)),
    ((0.5, 0.5, 1), (0, 0, -1)),
    ((0, 0.5, 0.5), (1, 0, 0)),
    ((1, 0.5, 0.5), (-1, 0, 0)),
    ((0.5, 0, 0.5), (0, 1, 0)),
    ((0.5, 1, 0.5), (0, -1, 0)),
]
"""Centres and inward normals of a unit cube's walls."""


def series(reflectance, bounces: int):
    """Σ ρⁿ for n from 0 to the most reflections."""
    return (1.0 - np.power(reflectance, bounces + 1)) / (1.0 - np.asarray(reflectance))


def in_sphere(reflectance, bounces: int):
    """Coefficient [m⁻²] at 0.99 of a unit sphere's radius, where direct light is 1/0.99² of that on the wall."""
    return (series(reflectance, bounces) - 1.0 + 0.99**-2) / (4 * np.pi)


def sphere_points(count: int) -> np.ndarray:
    """Points all around at 0.99 of the radius."""
    outwards = np.random.default_rng(1).standard_normal((count, 3))
    return 0.99 * outwards / np.linalg.norm(outwards, axis=1, keepdims=True)


@BY_ITS_ERROR
@pytest.mark.parametrize("reflectance", [0.0, 0.3, 0.6, 0.9])
def test_every_point_of_a_sphere_has_the_closed_form(rooms, sensors, section, check, reflectance: float) -> None:
    scene = rooms.scene([rooms.lamp("bulb", (0, 0, 0), BULB_M)], [(rooms.ball(1.0), reflectance)])
    places = sphere_points(12)
    transport = trace(scene, sensors(places, -places), **section("ultra", "standard"), seed=1)
    expected = in_sphere(reflectance, BOUNCES["ultra"])
    check(transport, expected, shape=SPHERE)
    mean = transport["coefficient"].to_numpy().mean()
    assert mean == pytest.approx(expected, rel=SPHERE + 5 * 0.01 / np.sqrt(12))  # five errors of a mean of 12


@BY_ITS_ERROR
@pytest.mark.slow
@pytest.mark.parametrize("reflectance", [0.5, 0.8])
def test_the_mean_over_a_cubes_walls_has_the_closed_form(rooms, sensors, section, reflectance: float) -> None:
    # Points on a lattice on each wall, so that direct light, which differs over the walls by 38 %, averages out.
    scene = rooms.scene([rooms.lamp("bulb", (0.5, 0.5, 0.5), BULB_M)], [(rooms.room(), reflectance)])
    ticks = (np.arange(10) + 0.5) / 10 - 0.5
    flat = np.stack([*np.meshgrid(ticks, ticks), np.zeros((10, 10))], axis=-1).reshape(-1, 3)
    places, normals = [], []
    for centre, normal in SIDES:
        shift = np.argmax(np.abs(normal)) - 2
        places.append(np.roll(flat, shift, axis=1) + np.asarray(centre) + 1e-4 * np.asarray(normal))
        normals.append(np.broadcast_to(normal, flat.shape))
    points = sensors(np.concatenate(places), np.concatenate(normals))
    transport = trace(scene, points, **section("ultra", "standard"), seed=1)
    direct = 6 * np.mean(0.5 / (4 * np.pi * ((flat**2).sum(axis=1) + 0.25) ** 1.5))  # 1 but for the lattice's 0.25 %
    expected = (series(reflectance, BOUNCES["ultra"]) - 1.0 + direct) / 6.0
    # Sensors share paths, so that the mean's noise is 0.3 % rather than 1 % / sqrt(600): five of it, and 0.4 % for the
    # lattice's share in reflected light, the bulb and the lift off the wall.
    assert transport["coefficient"].to_numpy().mean() == pytest.approx(expected, rel=0.019)


@BY_ITS_ERROR
def test_reflectance_of_099_converges_and_creates_no_light(rooms, sensors, section, check) -> None:
    scene = rooms.scene([rooms.lamp("bulb", (0, 0, 0), BULB_M)], [(rooms.ball(1.0), 0.99)])
    places = sphere_points(4)
    transport = trace(scene, sensors(places, -places), **section("ultra", "standard"), seed=1)
    check(transport, in_sphere(0.99, BOUNCES["ultra"]), shape=0.02)  # the area's 0.2 % counts at every reflection
    assert transport["coefficient"].to_numpy().max() * 4 * np.pi < 1.0 / (1.0 - 0.99)


@pytest.mark.parametrize("reflectance", [0.5, 0.8, 0.9, 0.95])
def test_all_reflections_add_up_to_the_closed_form(rooms, sensors, section, check, reflectance: float) -> None:
    scene = rooms.scene([rooms.lamp("bulb", (0, 0, 0), BULB_M)], [(rooms.ball(1.0), reflectance)])
    places = sphere_points(6)
    transport = trace(scene, sensors(places, -places), **section("all", "standard"), seed=1)
    check(transport, (1.0 / (1.0 - reflectance) - 1.0 + 0.99**-2) / (4 * np.pi), shape=2 * SPHERE)
    assert transport.attrs["truncated_share"] < 1e-12


@pytest.mark.parametrize(("reflectance", "accuracy"), [(0.3, "low"), (0.9, "high"), (0.95, "ultra")])
def test_what_is_cut_after_the_last_reflection_is_stated(
    rooms, sensors, section, reflectance: float, accuracy: str
) -> None:
    scene = rooms.scene([rooms.lamp("bulb", (0, 0, 0), BULB_M)], [(rooms.ball(1.0), reflectance)])
    places = sphere_points(6)
    transport = trace(scene, sensors(places, -places), **section(accuracy, "draft"), seed=1)
    tail = reflectance ** (BOUNCES[accuracy] + 1) / (1.0 - reflectance) / (4 * np.pi)
    # Two in a hundred for the sphere's facets, and one ray of 55 that a place's lattice sends past the bulb or at it.
    assert transport["truncation"].to_numpy() == pytest.approx(tail, rel=0.05)
    share = tail / in_sphere(reflectance, BOUNCES[accuracy])
    assert transport.attrs["truncated_share"] == pytest.approx(share, rel=0.1)  # the draft's noise besides


def test_a_relit_map_states_what_is_cut_of_its_own_light(rooms, sensors, section) -> None:
    lamps = [rooms.lamp("bulb", (x, 0, 0), BULB_M, name=name) for name, x in (("left", -0.3), ("right", 0.3))]
    scene = rooms.scene(lamps, [(rooms.ball(1.0), 0.9)])
    places = sphere_points(6)
    transport = trace(scene, sensors(places, -places), **section("high", "draft"), seed=1)
    tail = 0.9 ** (BOUNCES["high"] + 1) / 0.1 / (4 * np.pi)  # from any place in a sphere
    flux = transport["flux"].sel(lamp="right").to_numpy()
    light = relight(transport, {"left": LampChange(dim=0.0), "right": LampChange(dim=0.5)})
    assert light["truncation"].to_numpy() == pytest.approx(np.broadcast_to(0.5 * flux * tail, (6, flux.size)), rel=0.1)
    both = spectral_map(transport)
    assert both["truncation"].to_numpy() == pytest.approx(transport["truncation"].to_numpy(), rel=1e-5)
    # A dimmed lamp takes the share that is missing along: that of the mean irradiance stays.
    assert light.attrs["truncated_share"] == pytest.approx(both.attrs["truncated_share"], rel=0.15)


def test_a_white_room_cut_too_early_misses_its_target_however_little_noise_there_is(rooms, sensors, section) -> None:
    places = sphere_points(6)
    met = []
    for reflectance in (0.5, 0.9):
        scene = rooms.scene([rooms.lamp("bulb", (0, 0, 0), BULB_M)], [(rooms.ball(1.0), reflectance)])
        transport = trace(scene, sensors(places, -places), **section("high", "draft"), seed=1)
        assert transport.attrs["achieved_relative_se"] <= transport.attrs["target_relative_se"]
        met.append(transport.attrs["target_met"])
    assert met == [1, 0]


def test_reflectance_of_one_is_refused(rooms) -> None:
    with pytest.raises(ArrayError, match="no steady state"):
        rooms.scene([rooms.lamp("bulb", (0, 0, 0), BULB_M)], [(rooms.ball(1.0), 1.0)])


@BY_ITS_ERROR
@pytest.mark.parametrize("accuracy", ["low", "medium", "high"])
def test_accuracy_is_the_number_of_reflections(rooms, sensors, section, check, accuracy: str) -> None:
    scene = rooms.scene([rooms.lamp("bulb", (0, 0, 0), BULB_M)], [(rooms.ball(1.0), 0.8)])
    places = sphere_points(4)
    transport = trace(scene, sensors(places, -places), **section(accuracy, "standard"), seed=1)
    check(transport, in_sphere(0.8, BOUNCES[accuracy]), shape=2 * SPHERE)


@BY_ITS_ERROR
@pytest.mark.parametrize("mode", ["native", "rgb"])
def test_bands_keep_their_order_and_do_not_mix(rooms, sensors, section, check, mode: str) -> None:
    # Fourteen bands of fourteen reflectances: each comes back with its own closed form. rgb takes five passes.
    bands = uniform_bands(400.0, 680.0, 14)
    reflectances = np.linspace(0.1, 0.8, 14)
    steps = np.stack([bands.centers_nm - 9.99, bands.centers_nm + 9.99], axis=1).ravel()
    wall = Spectrum(wavelengths_nm=steps, values=np.repeat(reflectances, 2))
    scene = rooms.scene([rooms.lamp("bulb", (0, 0, 0), BULB_M)], [(rooms.ball(1.0), wall)], bands=bands, mode=mode)
    places = sphere_points(3)
    transport = trace(scene, sensors(places, -places), **section("medium", "standard"), seed=1)
    check(transport, in_sphere(reflectances, BOUNCES["medium"]), shape=2 * SPHERE)


def test_a_lamp_of_one_band_lights_no_other(rooms, sensors, section) -> None:
    bands = uniform_bands(400.0, 680.0, 14)
    lamp = Spectrum(wavelengths_nm=np.array([501.0, 502.0, 518.0, 519.0]), values=np.array([0.0, 1.0, 1.0, 0.0]))
    scene = rooms.scene([rooms.lamp("bulb", (0, 0, 0), BULB_M, flux=lamp)], [(rooms.ball(1.0), 0.5)], bands=bands)
    found = trace(scene, sensors((0, 0, -0.99), (0, 0, 1)), **section("medium", "draft"), seed=1)
    light = found["coefficient"].to_numpy()[0, 0] * scene.flux[0]
    assert np.argmax(light) == 5  # 500 to 520 nm
    assert np.all(np.delete(light, 5) == 0.0)


def luminous_walls(rooms):
    """Six panels of 1 W/nm that make up a unit cube, shining inwards with M = 1 W/nm/m² each."""
    return [
        rooms.lamp("panel", centre, (1.0, 1.0), normal=normal, name=str(index))
        for index, (centre, normal) in enumerate(SIDES)
    ]


@BY_ITS_ERROR
def test_inside_a_luminous_box_every_sensor_reads_its_walls(rooms, sensors, section, check) -> None:
    # Furnace: walls of uniform radiance L all around give E = πL = M wherever the sensor is and looks.
    generator = np.random.default_rng(5)
    places = sensors(0.1 + 0.8 * generator.random((10, 3)), generator.standard_normal((10, 3)))
    check(trace(rooms.scene(luminous_walls(rooms)), places, **section(), seed=1), 1.0)


@BY_ITS_ERROR
def test_a_nearly_white_object_in_a_luminous_box_is_invisible(rooms, sensors, section, check) -> None:
    # The ball returns 0.99 of what it gets and a sensor 0.2 m away sees it in (0.2/0.4)² = 1/4 of its view: 0.9975.
    scene = rooms.scene(luminous_walls(rooms), [(rooms.ball(0.2, (0.5, 0.5, 0.5), inside=False), 0.99)])
    transport = trace(scene, sensors((0.5, 0.5, 0.1), (0, 0, 1)), **section("high"), seed=1)
    check(transport, 0.9975)


@BY_ITS_ERROR
def test_light_goes_the_same_both_ways(rooms, sensors, section) -> None:
    # Reciprocity: a small Lambertian lamp at A gives a sensor at B what the lamp at B gives the sensor at A, through
    # any number of diffuse reflections, past any obstacle.
    table = trimesh.creation.box(bounds=[[0.3, 0.0, 0.4], [1.0, 0.7, 0.45]])
    surfaces = [(rooms.room(), 0.7), (table, 0.3)]
    first = ((0.7, 0.3, 0.9), (0.0, 0.0, -1.0))
    second = ((0.35, 0.4, 0.1), (0.0, 0.6, 0.8))
    found, error = [], []
    for (lamp, axis), (place, normal) in ((first, second), (second, first)):
        scene = rooms.scene([rooms.lamp("panel", lamp, (0.01, 0.01), normal=axis)], surfaces)
        transport = trace(scene, sensors(place, normal), **section("high"), seed=1)
        found.append(transport["coefficient"].to_numpy()[0, 0, 0])
        error.append(transport["coefficient_se"].to_numpy()[0, 0, 0])
    assert abs(found[0] - found[1]) < 8.0 * np.hypot(*error)
    assert max(error) < 0.01 * found[0]
