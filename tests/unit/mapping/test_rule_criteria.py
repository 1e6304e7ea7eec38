"""What rules ask, of a room whose light is written down: one lamp and one window over a flat grid."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import xarray as xr

import lidarspectra as ls
from lidarspectra.config import AreaSection, RulesSection
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Panel, Window
from lidarspectra.mapping.rules.chances import Draws
from lidarspectra.spectra.spectrum import uniform_bands
from lidarspectra.workflow.rule_criteria import eye_criteria, plant_criteria
from lidarspectra.workflow.rule_light import EDI, PPFD, RuleLight
from lidarspectra.workflow.rule_points import AreaPoints, RulePoints

TASK, EYES = 4, 2
DRAWS = 50
BANDS = uniform_bands(380.0, 780.0, 20)
WHITE = ls.Spectrum(wavelengths_nm=[300.0, 900.0], values=[1.0, 1.0], name="white")


def flat_light(shapes: list[Any], coefficients: list[float]) -> tuple[RuleLight, AreaPoints]:
    """Light of lamps that is the same at all points, with nothing unknown of it."""
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
    flat = np.zeros((count, len(lamps), 4))
    light = RuleLight(
        room=SimpleNamespace(lamps=lamps, bands=BANDS),  # type: ignore[arg-type]
        points=RulePoints(
            points=ls.SensorPoints(positions=np.zeros((count, 3)), normals=np.tile([0.0, 0, 1], (count, 1))),
            areas=(points,),
            surfaces={},
        ),
        transport=xr.Dataset({"coefficient": (("lamp", "point", "band"), values)}),
        slopes=SimpleNamespace(model=lambda weights, chosen: SimpleNamespace(slope=flat[chosen])),  # type: ignore[arg-type]
        uncertainty=None,  # type: ignore[arg-type]
        draws=Draws(
            flux=np.zeros((DRAWS, len(lamps))),
            reflectance=np.zeros((DRAWS, 4)),
            level=np.ones(DRAWS),
            spectrum=np.ones(DRAWS),
        ),
        own_error=np.ones((DRAWS, count)),
        noise=np.ones((DRAWS, count)),
    )
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
