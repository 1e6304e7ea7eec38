"""The program that prints what a calibration is worth: its rooms, draws and table, without a trace."""

from dataclasses import replace

import numpy as np
import pytest

from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Bulb, Disc, Luminaire, Panel, Spot
from lidarspectra.mapping.calibration.model import LightModel, Priors
from lidarspectra.room.surface_parts import PARTS
from lidarspectra.spectra.spectrum import Spectrum
from research.benchmarks.calibration import print_choices, print_faults, row
from research.benchmarks.calibration_causes import flux_bound
from research.benchmarks.calibration_causes import row as row_of_causes
from research.benchmarks.calibration_draws import CASES, Case, by_habit, by_lot, drawn_light, outcomes, planned
from research.benchmarks.calibration_rooms import FAULTS, RoomLight, other_lamp

PLACES, WAYS, MAP = 8, 6, 30


@pytest.fixture(scope="module")
def room() -> RoomLight:
    """Two lamps over a row of places, six directions at each; downwards there is reflected light alone."""
    generator = np.random.default_rng(0)
    ways = np.array([[0, 0, 1.0], [0, 0, -1.0], [1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]])
    along = np.concatenate([np.repeat(np.linspace(0.0, 7.0, PLACES), WAYS), [1.0, 6.0], np.linspace(0.0, 7.0, MAP)])
    normals = np.concatenate([np.tile(ways, (PLACES, 1)), np.tile(ways[0], (2 + MAP, 1))])
    near = np.exp(-0.2 * np.abs(along[:, None] - np.array([1.0, 6.0])))
    facing = np.where(normals[:, 2] > 0.5, 1.0, np.where(normals[:, 2] < -0.5, 0.2, 0.4))
    light = 300.0 * near * facing[:, None]
    slope = np.repeat(np.repeat((0.1 / facing)[:, None, None], 2, axis=1), len(PARTS), axis=2)
    slope = slope * generator.uniform(0.8, 1.2, slope.shape)
    numbers = np.arange(along.size)
    return RoomLight(
        name="row",
        model=LightModel(light=light, slope=slope),
        truth={fault: light * generator.lognormal(0.0, 0.05, light.shape) for fault in FAULTS},
        positions=np.stack([along, np.zeros_like(along), np.ones_like(along)], axis=1),
        normals=normals,
        place=np.concatenate([np.repeat(np.arange(PLACES), WAYS), PLACES + np.arange(2 + MAP)]),
        candidates=numbers[: PLACES * WAYS],
        habit=numbers[PLACES * WAYS : PLACES * WAYS + 2],
        on_map=numbers[PLACES * WAYS + 2 :],
        priors=Priors(flux_sd=np.full(2, 0.15), levels_covariance=0.07**2 * (0.5 * np.eye(len(PARTS)) + 0.5)),
    )


def test_a_calibrated_map_is_nearer_to_the_truth_and_the_table_says_so(room: RoomLight) -> None:
    case = CASES["fluxes 20 %"]
    found = outcomes(room, case, planned(room, case.meter_sd), 30, seed=1)
    before, after = np.array([each.nrmse for each in found]).T
    assert np.sqrt((after**2).mean()) < 0.4 * np.sqrt((before**2).mean())
    words = row("row", "fluxes", found)
    assert f"{100 * np.sqrt((after**2).mean()):4.1f}" in words


def test_what_is_not_off_is_drawn_as_it_is(room: RoomLight) -> None:
    generator = np.random.default_rng(0)
    same = drawn_light(room, Case(flux_off=0.0), generator)
    assert same == pytest.approx(room.model.light.sum(axis=1))
    gloss = drawn_light(room, Case(flux_off=0.0, faults=("gloss",)), generator)
    assert gloss == pytest.approx(room.truth["gloss"].sum(axis=1))


def test_plan_lot_and_habit_choose_as_they_say(room: RoomLight) -> None:
    generator = np.random.default_rng(0)
    for choose in (planned(room, 0.03), by_lot(room)):
        assert len(set(choose(generator).tolist())) == 6
    assert np.unique(room.place[by_lot(room)(generator)]).size == 3
    assert sorted(by_habit(room)(generator)) == room.habit.tolist()


def test_the_program_prints_every_fault_and_choice(room: RoomLight, capsys: pytest.CaptureFixture[str]) -> None:
    print_faults([room], 2)
    print_choices([room], 2)
    printed = capsys.readouterr().out
    assert all(f"row           {label}" in printed for label in (*CASES, "by plan", "by lot", "below the lamps"))


@pytest.mark.parametrize("shape", [Panel(0.6, 0.6), Bulb(0.1), Spot(0.16, beam_angle_deg=100.0)])
def test_a_lamp_of_another_type_has_its_place_and_flux(shape: Panel | Bulb | Spot) -> None:
    flux = Spectrum(wavelengths_nm=np.array([400.0, 700.0]), values=np.ones(2))
    lamp = Lamp(name="lamp", shape=shape, center=np.zeros(3), flux=flux)
    other = other_lamp(lamp)
    assert isinstance(other.shape, Disc if isinstance(shape, Spot) else Luminaire)
    assert other.flux is flux
    assert other.size == pytest.approx(shape.size)
    if isinstance(other.shape, Luminaire):
        upwards = other.shape.table.luminous_flux_lm(upward=True) / other.shape.table.luminous_flux_lm()
        assert upwards == pytest.approx(0.375 if isinstance(shape, Bulb) else 0.0, abs=0.01)  # (1 - 1/4) / 2


def test_the_bound_of_fluxes_is_the_whole_error_before_and_nothing_once_all_lamps_are_known(room: RoomLight) -> None:
    case = Case(faults=("scan",))
    exact = replace(room, truth={"scan": room.model.light})
    drawn = outcomes(exact, case, planned(room, case.meter_sd), 200, seed=2)
    before = np.sqrt(np.mean([each.nrmse[0] ** 2 for each in drawn]))
    # Errors are over the truth's mean, which itself varies by the fluxes: a few per cent with two lamps.
    assert flux_bound(room, 0) == pytest.approx(before, rel=0.15)
    assert flux_bound(room, 1) < 0.7 * flux_bound(room, 0)
    assert flux_bound(room, 2) == pytest.approx(0.0, abs=1e-9)


def test_causes_are_the_errors_that_stay_when_the_others_are_taken_away(room: RoomLight) -> None:
    generator = np.random.default_rng(4)
    of_scan = room.model.light * generator.lognormal(0.0, 0.05, (room.model.light.shape[0], 1))
    told = row_of_causes(replace(room, truth={"scan": of_scan}), 6, 20)
    error = {name: float(str(value)) for name, value in told.items()}
    assert error["after"] < 0.5 * error["before"]
    assert error["scan right, no noise"] < error["scan right"] < error["after"]
    assert error["fluxes known"] == pytest.approx(0.05, rel=0.4)  # 5 % at each of 30 points of the map
