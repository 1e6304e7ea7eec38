"""What rules ask, of a room whose light is written down: one lamp and one window over a flat grid."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr

import lidarspectra as ls
from lidarspectra.config import AreaSection, RulesSection
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Panel, Window
from lidarspectra.mapping.calibration.model import STEEPEST
from lidarspectra.mapping.rules.chances import Draws
from lidarspectra.radiance.pictures.glare import Luminaires
from lidarspectra.spectra.spectrum import uniform_bands
from lidarspectra.workflow.rules.criteria import EN, area_criteria, eye_criteria, plant_criteria, surface_criteria
from lidarspectra.workflow.rules.light import EDI, LUX, PPFD, RuleLight, effects_at
from lidarspectra.workflow.rules.looks import Look, ugr_criteria
from lidarspectra.workflow.rules.points import SURFACE_POINTS, AreaPoints, RulePoints, off_walls, spread_over
from lidarspectra.workflow.rules.rules_of_run import not_judged
from lidarspectra.workflow.rules.year import daylight_factors, plane_notes

TASK, EYES = 4, 2
DRAWS = 50
BANDS = uniform_bands(380.0, 780.0, 20)
WHITE = ls.Spectrum(wavelengths_nm=[300.0, 900.0], values=[1.0, 1.0], name="white")


def flat_light(
    shapes: list[Any], coefficients: list[float], *, slope: float = 0.0, reflectance: float = 0.0
) -> tuple[RuleLight, AreaPoints]:
    """Light of lamps that is the same at all points, with nothing unknown of it but the logarithm of one reflectance.

    In the first draws this is lower by `reflectance`, and then higher.
    """
    lamps = tuple(
        Lamp(name=str(number), shape=shape, center=np.zeros(3), flux=WHITE) for number, shape in enumerate(shapes)
    )
    count = TASK + EYES + 10
    area = AreaSection(name="desk", polygon=((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)), activity="writing", dli_mol_m2=5.0)
    index = np.arange(count)
    points = AreaPoints(
        area=area, task=index[:TASK], eyes=index[TASK : TASK + EYES], cylinder=index[TASK + EYES :].reshape(2, 5)
    )
    values = np.broadcast_to(np.array(coefficients)[:, None, None], (len(lamps), count, len(BANDS)))
    drawn = np.zeros((DRAWS, 4))
    drawn[:, 0] = np.where(np.arange(DRAWS) < DRAWS // 2, -reflectance, reflectance)
    light = RuleLight(
        room=SimpleNamespace(lamps=lamps, bands=BANDS),  # type: ignore[arg-type]
        points=RulePoints(
            points=ls.SensorPoints(positions=np.zeros((count, 3)), normals=np.tile([0.0, 0, 1], (count, 1))),
            areas=(points,),
            surfaces={},
        ),
        transport=xr.Dataset({"coefficient": (("lamp", "point", "band"), values)}),
        effects={quantity: np.zeros((count, len(lamps), 4)) for quantity in (LUX, EDI, PPFD)},
        uncertainty=None,  # type: ignore[arg-type]
        draws=Draws(
            flux=np.zeros((DRAWS, len(lamps))),
            reflectance=drawn,
            level=np.ones(DRAWS),
            spectrum=np.ones(DRAWS),
        ),
        own_error=np.ones((DRAWS, count)),
        noise=np.ones((DRAWS, count)),
    )
    for quantity, effect in light.effects.items():
        effect[..., 0] = slope * light.model(quantity, index).light
    return light, points


def test_well_and_plants_are_judged_by_electric_light_alone() -> None:
    light, points = flat_light([Panel(0.6, 0.6), Window(1.0, 1.0)], [1e-4, 9e-4])
    lamp, _ = flat_light([Panel(0.6, 0.6)], [1e-4])
    section = RulesSection(photoperiod_h=10)
    found = [each.traced for each in eye_criteria(section, points, light)]
    electric = float(lamp.drawn(EDI, points.eyes).traced[0])
    assert found == pytest.approx([electric, electric, 10.0 * electric, 10.0 * electric])
    (plants,) = plant_criteria(section, points, light)
    assert plants.traced == pytest.approx(float(lamp.drawn(PPFD, points.task).traced[0]) * 36_000 / 1e6)


def test_well_asks_less_only_of_a_room_that_earns_points_for_daylight() -> None:
    light, points = flat_light([Panel(0.6, 0.6), Window(1.0, 1.0)], [1e-4, 9e-4])
    limits = [
        [each.limit for each in eye_criteria(RulesSection(well_daylight_points=claimed), points, light)][:2]
        for claimed in (False, True)
    ]
    assert limits == [[136.0, 250.0], [109.0, 163.0]]


def test_walls_that_the_scan_lacks_and_glare_that_was_not_asked_for_are_named_beside_the_whole() -> None:
    light, points = flat_light([Panel(0.6, 0.6)], [1e-4])
    judged = [*surface_criteria(RulesSection(), light), *area_criteria(RulesSection(), points, light)]
    no_walls = not_judged(RulesSection(glare=False), light.points, judged)[EN]
    assert [words.split(" (")[0] for words in no_walls] == ["walls", "ceiling", "UGR"]
    seen = replace(light.points, surfaces={"walls": points.task, "ceiling": points.task})
    assert not_judged(RulesSection(), seen, judged)[EN] == ("UGR in desk (no reflected light behind the luminaires)",)
    plants = replace(points, area=points.area.model_copy(update={"activity": "plants"}))
    assert not_judged(RulesSection(), replace(light.points, areas=(plants,)), ()) == {}


def test_cylindrical_illuminance_is_held_to_its_uniformity() -> None:
    light, points = flat_light([Panel(0.6, 0.6)], [1e-4])
    coefficient = light.transport["coefficient"].to_numpy().copy()
    coefficient[:, points.cylinder[1]] *= 0.04  # one of two places: U0 is .04 / .52
    light = replace(light, transport=xr.Dataset({"coefficient": (("lamp", "point", "band"), coefficient)}))
    found = {each.what: each for each in area_criteria(RulesSection(), points, light)}
    uniformity = found["uniformity U0 of cylindrical illuminance"]
    assert uniformity.traced == pytest.approx(0.04 / 0.52)
    assert (uniformity.limit, uniformity.probability < 0.05) == (0.1, True)


def test_walls_of_two_triangles_are_looked_at_all_over() -> None:
    scan = ls.RoomModel.from_box(4.0, 3.0, 2.7).scan
    walls = np.flatnonzero(np.abs(scan.normals[:, 2]) < 0.5)
    places, normals = spread_over(scan, walls, SURFACE_POINTS)
    on_plane = np.abs(np.stack([places[:, 0], places[:, 0] - 4.0, places[:, 1], places[:, 1] - 3.0])).min(axis=0)
    assert on_plane.max() < 1e-9
    assert np.abs(normals[:, 2]).max() < 1e-9
    # Evenly over the height and along each wall; the triangles' centres have a third of this spread, and no corner.
    assert np.mean(places[:, 2]) == pytest.approx(1.35, abs=0.1)
    assert np.mean((places[:, 2] - 1.35) ** 2) == pytest.approx(2.7**2 / 12.0, rel=0.15)
    long_walls = np.abs(normals[:, 1]) > 0.5
    assert long_walls.mean() == pytest.approx(4.0 / 7.0, abs=0.08)  # three points of 36
    assert np.mean((places[long_walls, 0] - 2.0) ** 2) == pytest.approx(4.0**2 / 12.0, rel=0.2)


def look_at(light: RuleLight, points: AreaPoints, direct_share: float) -> list[Look]:
    """Looks at lamp 0, which sends a share of the light straight to the eye."""
    total = float(light.drawn(LUX, points.eyes).traced[0])
    seen = Luminaires(
        lamp=np.array([0]),
        weight=np.array([5000.0]),
        luminance=np.array([1e4]),
        solid_angle=np.array([0.01]),
        direct_lx=np.array([direct_share * total]),
        indirect_lx=max((1.0 - direct_share) * total, 1.0),
    )
    return [Look(area="desk", angle_deg=0.0, picture=None, luminaires=seen, glare=None)] * EYES  # type: ignore[arg-type]


def test_the_slope_of_reflected_light_stays_that_of_a_room_where_little_is_reflected() -> None:
    light, points = flat_light([Panel(0.6, 0.6)], [1e-4], slope=0.1, reflectance=0.2)
    (ugr,) = ugr_criteria(points, light, look_at(light, points, 0.5))
    # half of the light is reflected: its own slope is .2
    assert ugr.draws.max() - ugr.draws.min() == pytest.approx(8.0 * np.log10(np.exp(2 * 0.2 * 0.2)))
    (ugr,) = ugr_criteria(points, light, look_at(light, points, 0.999))
    assert ugr.draws.max() - ugr.draws.min() == pytest.approx(8.0 * np.log10(np.exp(2 * 0.2 * STEEPEST)))


def test_the_colours_of_one_luminaire_glare_together() -> None:
    light, points = flat_light([Panel(0.6, 0.6), Panel(0.6, 0.6)], [1e-4, 1e-4])
    flux = 0.3 * np.where(np.arange(DRAWS) % 2, 1.0, -1.0)[:, None] * np.array([1.0, -1.0])
    light = replace(light, draws=replace(light.draws, flux=flux))
    (ugr,) = ugr_criteria(points, light, look_at(light, points, 0.5))
    # One gains what the other loses: their luminance and what they send to the walls stay, but for cosh of .3.
    assert np.ptp(ugr.draws) == pytest.approx(0.0, abs=1e-9)
    assert float(ugr.draws[0]) == pytest.approx(ugr.traced + 8.0 * np.log10(np.cosh(0.3)))


def test_ugr_is_left_out_where_all_light_comes_straight_from_the_luminaires() -> None:
    light, points = flat_light([Panel(0.6, 0.6)], [1e-4], slope=0.1, reflectance=0.2)
    assert list(ugr_criteria(points, light, look_at(light, points, 1.01))) == []


def test_a_room_without_a_lit_lamp_has_no_ugr() -> None:
    light, points = flat_light([Window(1.0, 1.0)], [1e-4])
    assert list(ugr_criteria(points, light, look_at(light, points, 0.0))) == []
    judged = [*surface_criteria(RulesSection(), light), *area_criteria(RulesSection(), points, light)]
    assert not_judged(RulesSection(), light.points, judged, lit=False)[EN][-1] == "UGR in desk (no lamp is lit)"


def test_the_whole_plan_keeps_off_the_walls_of_an_l_and_out_of_what_its_box_holds_besides() -> None:
    outline = np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 2.0], [3.0, 2.0], [3.0, 5.0], [0.0, 5.0]])
    plan = np.stack(np.meshgrid(np.arange(0.05, 6.0, 0.2), np.arange(0.05, 5.0, 0.2)), axis=-1).reshape(-1, 2)
    x, y = plan.T
    from_corner = np.hypot(np.maximum(3.0 - x, 0.0), np.maximum(2.0 - y, 0.0))  # of the L, the one that juts in
    in_box = (np.minimum(x, 6.0 - x) >= 0.5) & (np.minimum(y, 5.0 - y) >= 0.5)
    np.testing.assert_array_equal(off_walls(plan, outline), plan[in_box & (from_corner >= 0.5)])
    slit = np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 0.8], [0.0, 0.8]])
    assert set(off_walls(plan, slit)[:, 1].round(2)) == {0.25, 0.45}


def test_a_year_of_daylight_is_as_uncertain_as_the_run_s_windows_are() -> None:
    light, _ = flat_light([Panel(0.6, 0.6), Window(1.0, 1.0)], [1e-4, 9e-4])
    flux = np.array([0.15, 0.4]) * np.random.default_rng(7).standard_normal((DRAWS, 2))
    light = replace(light, draws=replace(light.draws, flux=flux))
    assert daylight_factors(light) == pytest.approx(np.exp(flux[:, 1]))


def test_points_that_are_not_the_plane_of_en_17037_are_said_to_be_elsewhere() -> None:
    def year(height: float, up: float) -> xr.Dataset:
        places = {
            "z": ("point", [0.5 + height, 0.5 + 0.85]),
            "nz": ("point", [up, 1.0]),
            "buried": ("point", [False, False]),
        }
        return xr.Dataset({}, places)

    assert plane_notes(year(0.85, 1.0), 0.5) == ()
    assert "1 are elsewhere (from 0.30 to 0.85 m) and 0 do not face up" in plane_notes(year(0.3, 1.0), 0.5)[0]
    assert "0 are elsewhere (from 0.80 to 0.85 m) and 1 do not face up" in plane_notes(year(0.8, 0.0), 0.5)[0]
    floors = np.where(np.arange(year(0.85, 1.0).sizes["point"]) == 0, 0.2, 0.5)  # one room is down a step
    assert "1 are elsewhere (from 0.85 to 1.15 m)" in plane_notes(year(0.85, 1.0), floors)[0]


def test_how_light_changes_with_reflectances_is_told_lamp_by_lamp_and_without_a_trace() -> None:
    box = ls.RoomModel.from_box(4.0, 3.0, 2.7, floor=0.5, walls=0.5, ceiling=0.5)
    lamps = [
        ls.make_lamp(shape, (1.0 + number, 1.5, 2.0), size=0.1, spectrum=spectrum, luminous_flux_lm=1000.0)
        for number, (shape, spectrum) in enumerate([("bulb", "A"), ("disc", "LED-B3")])
    ]
    points = ls.SensorPoints(positions=np.array([[2.0, 1.0, 1.0]]), normals=np.array([[0.0, 0.0, 1.0]]))

    def effects(some: list[Lamp]) -> np.ndarray:
        part = np.arange(len(box.scan.faces)) % 2
        room = SimpleNamespace(scan=box.scan, part=part, materials=box.materials, lamps=some, bands=BANDS)
        return effects_at(room, points)[LUX][0]  # type: ignore[arg-type]

    both = effects(lamps)
    assert both == pytest.approx(np.concatenate([effects(lamps[:1]), effects(lamps[1:])]), rel=0.01)
    assert not both[:, 2:].any()  # of parts that the room lacks
    # from one reflection to all, d E / d ln rho of reflected light R is R to R / (1 - rho); a bulb lights all the box
    reflected = 1000.0 / box.scan.areas.sum() * 0.5 / (1.0 - 0.5)
    assert 0.7 * reflected < both[0].sum() < 1.4 * reflected / (1.0 - 0.5)
