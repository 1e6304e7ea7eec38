"""Readings told into a light model: what they tell comes out, its deviation holds, and what is wrong is named."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import block_diag

from lidarspectra.config import GridSection, SensorsSection
from lidarspectra.errors import MapError
from lidarspectra.lamps.make_lamp import make_lamp
from lidarspectra.mapping.calibration.model import (
    UNKNOWN_METER_SD,
    LightModel,
    Observations,
    Priors,
    error_covariance,
)
from lidarspectra.mapping.calibration.model_error import SIZES, fit_with_model_error, prior_of_sizes
from lidarspectra.mapping.calibration.planning import choose_readings
from lidarspectra.mapping.calibration.posterior import disagreement, fit, swapped, turned_over
from lidarspectra.mapping.calibration.promised import stated_after, stated_of
from lidarspectra.mapping.maps.light_unknowns import error_scale
from lidarspectra.spectra.spectrum import sensor_bands
from lidarspectra.workflow.calibration.calibrating import _receptor_notes
from lidarspectra.workflow.calibration.doubts import doubts, without_dark_channels
from lidarspectra.workflow.calibration.readings import LUX, Readings, calibration_readings

LAMPS, PARTS, ROWS = 3, 4, 8
LEVELS = 0.1**2 * (0.5 * np.eye(PARTS) + 0.5)  # half of the variance in common


def model(seed: int = 0, rows: int = ROWS) -> LightModel:
    """Lamps over different places; sensors that look up are lit by lamps, those that look down by the floor's light."""
    draw = np.random.default_rng(seed)
    light = draw.uniform(20.0, 300.0, (rows, LAMPS))
    light[1::2] *= 0.2
    slope = np.abs(draw.normal(0.15, 0.05, (rows, LAMPS, PARTS)))
    slope[1::2, :, 0] += 0.9
    return LightModel(light=light, slope=slope)


def priors(meter_sd: float = 0.03) -> Priors:
    return Priors(
        flux_sd=np.full(LAMPS, 0.2), levels_covariance=LEVELS, meter_sd=np.array([meter_sd]),
        reading_sd=0.02, local_sd=0.02,
    )  # fmt: skip


def drawn(
    light: LightModel, known: Priors, generator: np.random.Generator, model_error: np.ndarray | None = None
) -> tuple[Observations, np.ndarray]:
    """Readings of a room drawn from the priors, and its unknowns."""
    root = np.linalg.cholesky(known.covariance())
    unknowns = root @ generator.standard_normal(root.shape[0])
    row = np.arange(light.light.shape[0])
    true = light.at(unknowns[:LAMPS], unknowns[LAMPS : LAMPS + PARTS]).sum(axis=1)
    meter = np.zeros(row.size, dtype=np.int64)
    exact = Observations(value=true, row=row, meter=meter, model_error=model_error)
    noise = np.linalg.cholesky(known.noise(exact)) @ generator.standard_normal(row.size)
    return replace(exact, value=true * np.exp(unknowns[-1] + noise)), unknowns


def test_the_gradient_is_that_of_the_logarithm() -> None:
    light, flux, reflectance = model(), np.array([0.1, -0.2, 0.3]), np.array([0.1, 0.0, -0.1, 0.05])
    gradient = light.gradient(flux, reflectance)
    for index in range(LAMPS + PARTS):
        step = 1e-6 * (np.arange(LAMPS + PARTS) == index)
        up = np.log(light.at(flux + step[:LAMPS], reflectance + step[LAMPS:]).sum(axis=1))
        down = np.log(light.at(flux - step[:LAMPS], reflectance - step[LAMPS:]).sum(axis=1))
        assert gradient[:, index] == pytest.approx((up - down) / 2e-6, rel=1e-5)


def test_deviations_hold_over_many_rooms() -> None:
    generator, light, known = np.random.default_rng(1), model(), priors()
    within, chi = [], []
    for _ in range(100):
        readings, unknowns = drawn(light, known, generator)
        found = fit(light, readings, known)
        within.append(np.abs(found.unknowns - unknowns) <= found.sd)
        chi.append(found.chi_square)
    # 68 % of 1,600 deviations that go together in eights lie within one; two per cent of scatter.
    assert np.mean(within) == pytest.approx(0.683, abs=0.05)
    assert np.mean(chi) == pytest.approx(ROWS, rel=0.1)


def test_the_map_is_known_better_after_and_as_well_as_it_says() -> None:
    generator, light, known, on_map = np.random.default_rng(2), model(), priors(), model(seed=9, rows=40)
    ratios, shares = [], []
    for _ in range(60):
        readings, unknowns = drawn(light, known, generator)
        found = fit(light, readings, known)
        truth = on_map.at(unknowns[:LAMPS], unknowns[LAMPS : LAMPS + PARTS]).sum(axis=1)
        after = np.log(on_map.at(found.flux, found.reflectance).sum(axis=1) / truth)
        before = np.log(on_map.light.sum(axis=1) / truth)
        ratios.append(np.sqrt(np.mean(after**2)) / np.sqrt(np.mean(before**2)))
        shares.append(np.abs(after) / found.light_sd(on_map))
    assert np.median(ratios) < 0.5
    assert 0.6 < np.mean(np.array(shares) <= 1.0) < 0.76
    assert 0.92 < np.mean(np.array(shares) <= 2.0) < 0.985


def test_readings_of_another_room_are_refused_beside_what_the_run_has(tmp_path: Path) -> None:
    light, known = model(rows=4), priors()
    factors = np.array([2.5, 0.4, 2.5, 0.4])
    numbers = Observations(
        value=light.light.sum(axis=1) * factors, row=np.arange(4), meter=np.zeros(4, dtype=np.int64), model_error=None
    )
    readings = Readings(
        names=("desk", "shelf", "door", "sill"), positions=np.zeros((4, 3)), normals=np.tile([0.0, 0.0, 1.0], (4, 1)),
        quantities=(LUX,) * 4, numbers=numbers, meters=("meter",), meter_sd=np.array([0.03]),
    )  # fmt: skip
    run = light.light.sum(axis=1)[0]
    with pytest.raises(MapError, match=f"'desk' {2.5 * run:.3g} lx where the run has {run:.3g}"):
        doubts(light, light, readings, known, tmp_path / "readings.csv", despite=False)
    assert len(doubts(light, light, readings, known, tmp_path / "readings.csv", despite=True)) == 1


def test_an_unknown_meter_still_tells_the_pattern() -> None:
    generator, light, known = np.random.default_rng(3), model(), priors(UNKNOWN_METER_SD)
    readings, _ = drawn(light, known, generator)
    found = fit(light, readings, known)
    shifted = Observations(value=readings.value * 1000.0, row=readings.row, meter=readings.meter)
    again = fit(light, shifted, known)
    # Units off by a thousand change the meter's factor, and its wide prior moves the others by next to nothing.
    assert again.unknowns[:-1] == pytest.approx(found.unknowns[:-1], abs=0.02)
    assert again.unknowns[-1] - found.unknowns[-1] == pytest.approx(np.log(1000.0), abs=0.05)


def test_a_strange_reading_is_named_and_the_others_are_not() -> None:
    generator, light, known = np.random.default_rng(4), model(), priors()
    readings, _ = drawn(light, known, generator)
    value = readings.value.copy()
    value[4] *= 3.0  # a lamp of somebody's desk
    wrong = Observations(value=value, row=readings.row, meter=readings.meter)
    assert np.argmin(disagreement(light, wrong, known)) == 4
    assert disagreement(light, wrong, known)[4] < 1e-6
    assert disagreement(light, readings, known).min() > 1e-3


def test_two_rows_that_were_exchanged_are_found() -> None:
    generator, light, known = np.random.default_rng(5), model(), priors()
    readings, _ = drawn(light, known, generator)
    value = readings.value.copy()
    value[[0, 3]] = value[[3, 0]]
    wrong = Observations(value=value, row=readings.row, meter=readings.meter)
    assert swapped(light, wrong, known, np.arange(ROWS)) == (0, 3)
    assert swapped(light, readings, known, np.arange(ROWS)) is None


def test_rows_exchanged_are_found_where_neighbours_err_alike_and_dark_places_more() -> None:
    light, known = model(), replace(priors(), local_sd=0.06)
    places = np.stack([0.4 * (np.arange(ROWS) % 4), 0.5 * (np.arange(ROWS) // 4), np.zeros(ROWS)], axis=1)
    facing = np.tile([0.0, 0.0, 1.0], (ROWS, 1)) * np.where(np.arange(ROWS) % 2, -1.0, 1.0)[:, None]
    whole = light.light.sum(axis=1)
    error = error_covariance(places, facing, error_scale(whole, 3.0 * whole.mean()))
    # With an error of its own for each row, equal in light and dark, no exchange of these made the readings fit.
    for seed in (5, 9, 11):
        readings, _ = drawn(light, known, np.random.default_rng(seed), error)
        wrong = replace(readings, value=readings.value[[3, 1, 2, 0, 4, 5, 6, 7]])
        assert swapped(light, wrong, known, np.arange(ROWS)) == (0, 3)
        assert swapped(light, readings, known, np.arange(ROWS)) is None


def test_a_sensor_turned_over_is_found() -> None:
    generator, light, known = np.random.default_rng(6), model(), priors()
    reverse = LightModel(light=light.light[::-1].copy(), slope=light.slope[::-1].copy())
    true = LightModel(
        light=np.where(np.arange(ROWS)[:, None] == 2, reverse.light, light.light),
        slope=np.where(np.arange(ROWS)[:, None, None] == 2, reverse.slope, light.slope),
    )
    readings, _ = drawn(true, known, generator)
    assert turned_over(light, reverse, readings, known, np.arange(ROWS)) == (2,)
    readings, _ = drawn(light, known, generator)
    assert turned_over(light, reverse, readings, known, np.arange(ROWS)) == ()


def test_planned_readings_tell_more_than_any_others_of_their_number() -> None:
    light, known, on_map = model(rows=10), priors(), model(seed=9, rows=30)
    place = np.arange(10) // 2
    planned = choose_readings(light, place, on_map, known, 3)
    assert np.all(np.diff(planned.map_sd) < 0)
    assert len(set(planned.chosen.tolist())) == 3

    everywhere = on_map.light.sum(axis=1)

    def spread(chosen: np.ndarray) -> float:
        some = light.some(chosen)
        value = some.light.sum(axis=1)
        readings = Observations(value=value, row=np.arange(chosen.size), meter=np.zeros(chosen.size, dtype=np.int64))
        absolute = fit(some, readings, known).light_sd(on_map) * everywhere / everywhere.mean()
        return float(np.sqrt(np.mean(absolute**2)))

    assert spread(planned.chosen) == pytest.approx(planned.map_sd[-1], rel=1e-6)
    draw = np.random.default_rng(0)
    by_lot = [spread(draw.choice(10, 3, replace=False)) for _ in range(50)]
    assert planned.map_sd[-1] <= 1.1 * min(by_lot)  # greedy, and a new place costs
    assert planned.map_sd[-1] < np.median(by_lot)


@pytest.mark.parametrize("count", [1, 2, 6])
def test_what_is_promised_of_readings_is_what_a_calibration_states(count: int) -> None:
    """Rooms drawn from the priors, the size of the model's own error among them: median and worst tenth of both agree.

    120 rooms tell the median of what they state to 6 %, and where its last tenth begins to 15 %.
    """
    some, on_map, known = model(rows=count), model(seed=9, rows=30), priors()
    own_error = error_scale(on_map.light.sum(axis=1), float(on_map.light.sum(axis=1).mean()))
    promised = stated_after(some, on_map, known, model_error=np.eye(count), own_error=own_error)
    generator, stated = np.random.default_rng(count), []
    for _ in range(120):
        size = float(generator.choice(SIZES, p=prior_of_sizes()))
        readings, _ = drawn(some, replace(known, local_sd=size * known.local_sd), generator)
        found = fit_with_model_error(some, readings, known)
        stated.append(np.hypot(found.light_sd(on_map), found.local_sd * own_error).mean())
    assert np.median(promised[-1]) == pytest.approx(np.median(stated), rel=0.15)
    assert np.quantile(promised[-1], 0.9) == pytest.approx(np.quantile(stated, 0.9), rel=0.3)
    before = np.hypot(found.light_sd(on_map, before=True), known.local_sd * own_error).mean()
    assert promised[0] == pytest.approx(before)


def test_readings_that_are_best_alone_are_exchanged_for_those_that_are_best_together() -> None:
    """Two lamps, and a place in the middle that sees both: one reading is taken there, two below the lamps."""
    light = np.array([[100.0, 100.0], [140.0, 1.0], [1.0, 140.0]])
    candidates = LightModel(light=light, slope=np.zeros((3, 2, PARTS)))
    on_map = LightModel(light=[[140.0, 40.0], [40.0, 140.0]], slope=np.zeros((2, 2, PARTS)))
    known = Priors(flux_sd=np.full(2, 0.2), levels_covariance=LEVELS, meter_sd=np.array([0.001]))
    assert choose_readings(candidates, np.arange(3), on_map, known, 1).chosen.tolist() == [0]
    assert sorted(choose_readings(candidates, np.arange(3), on_map, known, 2).chosen.tolist()) == [1, 2]


def test_a_place_that_is_worth_nothing_more_is_not_walked_to() -> None:
    """One lamp and a meter of unknown factor at places of the same light: all directions are at one of them."""
    light = LightModel(light=np.full((8, 1), 50.0), slope=np.tile(np.eye(PARTS)[:, None], (2, 1, 1)))
    known = Priors(flux_sd=np.array([0.2]), levels_covariance=LEVELS, meter_sd=np.array([0.03]))
    place = np.array([0, 1, 0, 1, 1, 0, 1, 0])
    chosen = choose_readings(light, place, light, known, 3).chosen
    assert np.unique(place[chosen]).size == 1


def test_for_the_same_readings_the_promise_is_what_a_calibration_states() -> None:
    """Readings that fit, and such as contradict each other, which no factor explains: draw by draw."""
    some, on_map = model(rows=2), model(seed=9, rows=30)
    known = replace(priors(), flux_sd=np.full(LAMPS, 0.05), levels_covariance=0.01 * LEVELS, reading_sd=0.001)
    own_error = error_scale(on_map.light.sum(axis=1), float(on_map.light.sum(axis=1).mean()))
    zero = np.zeros(LAMPS), np.zeros(PARTS)
    gradient = np.concatenate([some.gradient(*zero), np.ones((2, 1))], axis=1)
    wanted = np.concatenate([on_map.gradient(*zero), np.zeros((30, 1))], axis=1)
    prior, sizes = known.covariance(), known.local_sd * np.array(SIZES)
    noise = sizes[:, None, None] ** 2 * np.eye(2) + known.reading_sd**2 * np.eye(2)
    read = np.array([[0.0, 0.0], [0.03, 0.02], [0.1, 0.1], [0.1, -0.1], [-0.2, 0.0], [0.25, 0.25]])
    promised = stated_of(gradient, wanted, prior, gradient @ prior @ gradient.T + noise, read, sizes, own_error)
    for logs, each in zip(read, promised, strict=True):
        value = some.light.sum(axis=1) * np.exp(logs)
        readings = Observations(value=value, row=np.arange(2), meter=np.zeros(2, dtype=np.int64))
        found = fit_with_model_error(some, readings, known)
        assert each == pytest.approx(np.hypot(found.light_sd(on_map), found.local_sd * own_error).mean(), rel=0.01)


def test_a_reading_of_nothing_is_refused() -> None:
    with pytest.raises(MapError, match="above 0"):
        Observations(value=[1.0, 0.0], row=[0, 1], meter=[0, 0])


def test_a_reading_that_tells_nothing_leaves_the_uncertainty_of_lamps_and_reflectances_as_it_was() -> None:
    """A single reading by a meter of unknown factor: it may be due to the meter alone."""
    light, on_map, known = model(), model(seed=9, rows=40), priors(UNKNOWN_METER_SD)
    one = np.zeros(1, dtype=np.int64)
    reading = Observations(value=light.light[:1].sum(axis=1) * 1.3, row=one, meter=one)
    told = fit_with_model_error(light.some(one), reading, known)
    gradient = on_map.gradient(np.zeros(LAMPS), np.zeros(PARTS))
    of_map = block_diag(np.diag(known.flux_sd**2), LEVELS)  # as a map without a calibration has it
    stated = np.sqrt(np.einsum("ni,ij,nj->n", gradient, of_map, gradient))
    assert told.light_sd(on_map) == pytest.approx(stated, rel=0.01)


def test_the_size_of_the_models_own_error_is_told_by_the_misfit() -> None:
    """A room that the model fits, and one with errors of 15 % at every place, told as 2 %."""
    generator, light, known, on_map = np.random.default_rng(7), model(), priors(), model(seed=9, rows=40)
    sizes, within = {}, {}
    for own in (0.02, 0.15):
        found, shares = [], []
        for _ in range(25):
            readings, unknowns = drawn(light, replace(known, local_sd=own), generator)
            told = fit_with_model_error(light, readings, known)
            truth = on_map.at(unknowns[:LAMPS], unknowns[LAMPS : LAMPS + PARTS]).sum(axis=1)
            truth = truth * np.exp(own * generator.standard_normal(truth.size))
            off = np.log(on_map.at(told.flux, told.reflectance).sum(axis=1) / truth)
            found.append(told.local_sd)
            shares.append(np.abs(off) <= np.hypot(told.light_sd(on_map), told.local_sd))
        sizes[own], within[own] = np.median(found), np.mean(shares)
    assert sizes[0.15] > 2.0 * sizes[0.02]
    # A few readings tell the size roughly; with deviations of 2 % for errors of 15 % it would be 15 to 20 %.
    assert 0.6 < within[0.02] < 0.85
    assert 0.5 < within[0.15] < 0.85


def test_errors_of_the_model_are_alike_nearby_and_larger_in_the_dark() -> None:
    positions = np.array([[0.0, 0.0, 1.0], [0.1, 0.0, 1.0], [9.0, 0.0, 1.0], [0.0, 0.0, 1.0]])
    normals = np.array([[0.0, 0.0, 1.0]] * 3 + [[0.0, 0.0, -1.0]])
    scale = error_scale(np.array([400.0, 400.0, 100.0, 1.0]), 400.0)
    assert scale == pytest.approx([1.0, 1.0, 2.0, 4.0])
    covariance = error_covariance(positions, normals, scale)
    assert covariance[0, 1] == pytest.approx(1.0, abs=0.01)
    assert covariance[0, 2] == pytest.approx(0.0, abs=1e-12)
    assert covariance[0, 3] == 0.0  # opposite directions have nothing in common
    generator = np.random.default_rng(0)
    many = generator.standard_normal((60, 3))
    many /= np.linalg.norm(many, axis=1, keepdims=True)
    crowded = error_covariance(generator.uniform(0, 2, (60, 3)), many, np.ones(60))
    assert np.linalg.eigvalsh(crowded).min() > -1e-9


def test_guesses_of_one_rule_err_alike_and_do_not_average_out() -> None:
    """The mean of twelve lamps guessed together is hardly better known than one; of twelve stated ones it is."""
    stated = Priors(flux_sd=np.full(12, 0.4), levels_covariance=LEVELS)
    guessed = Priors(flux_sd=np.full(12, 0.4), levels_covariance=LEVELS, guess=np.zeros(12, dtype=np.int64))
    mixed = Priors(flux_sd=np.array([0.4, 0.4, 0.15, 0.4]), levels_covariance=LEVELS, guess=np.array([0, 1, -1, 1]))
    share = np.concatenate([np.full(12, 1 / 12), np.zeros(len(LEVELS))])
    assert np.sqrt(share @ stated.covariance() @ share) == pytest.approx(0.4 / np.sqrt(12))
    assert np.sqrt(share @ guessed.covariance() @ share) == pytest.approx(0.4 * np.sqrt(0.85 + 0.15 / 12))
    assert np.diag(guessed.covariance())[:12] == pytest.approx(0.16)
    own = mixed.covariance()[:4, :4]
    assert own[1, 3] == pytest.approx(0.85 * 0.16)
    own[1, 3] = own[3, 1] = 0.0
    assert own == pytest.approx(np.diag(mixed.flux_sd**2))


def test_lamps_of_one_data_sheet_age_alike_and_average_out_by_half() -> None:
    """Twelve strips of one product are all off by their data sheet, their age and the dirt of the room."""
    sheet = np.array([*[0] * 12, 1, -1, -1])
    known = Priors(flux_sd=np.full(15, 0.15), levels_covariance=LEVELS, sheet=sheet)
    share = np.concatenate([np.full(12, 1 / 12), np.zeros(3 + len(LEVELS))])
    assert np.sqrt(share @ known.covariance() @ share) == pytest.approx(0.15 * np.sqrt(0.5 + 0.5 / 12))
    others = known.covariance()[12:15, :15]
    assert others == pytest.approx(0.15**2 * np.eye(15)[12:])  # other products, and lamps of which nothing is said
    assert np.linalg.eigvalsh(known.covariance()).min() > 0


@pytest.mark.parametrize(
    ("sensors", "quantities", "told"),
    [
        ({"field_of_view_deg": 20.5}, (0, LUX), True),
        ({"field_of_view_deg": 20.5}, (LUX, LUX), False),  # a lux meter sees by the cosine
        ({}, (0, 1), False),
    ],
)
def test_channels_of_a_sensor_without_a_diffuser_are_told(sensors, quantities, told) -> None:
    section = SensorsSection(grid=GridSection(count=4), **sensors)
    room = SimpleNamespace(run_file=SimpleNamespace(sensors=section))
    notes = _receptor_notes(room, SimpleNamespace(quantities=quantities))
    assert bool(notes) == told
    assert all("the cosine" in note for note in notes)


def test_channels_beyond_the_lamps_spectra_do_not_count_as_readings(tmp_path: Path) -> None:
    """Of an LED 940 nm has some 1e-80 of its light in the model, and in a sensor what stray light there is."""
    bands = sensor_bands("as7265x-18")
    lamp = make_lamp("panel", (0, 0, 2), size=0.6, spectrum="LED-B3", luminous_flux_lm=1000)
    room: Any = SimpleNamespace(lamps=(lamp,), bands=bands)
    columns = {f"E_{label}": [0.01, 0.02] for label in bands.labels}
    table = pd.DataFrame({"x": [1.0, 2.0], "y": 1.0, "z": 1.0, **columns})
    path = tmp_path / "readings.csv"
    table.to_csv(path, index=False)
    kept = without_dark_channels(calibration_readings(path, bands.labels), room, path)
    assert set(kept.quantities) == set(range(14))
    assert kept.numbers.value.size == len(kept.quantities) == 28
    assert "8 numbers are left out" in kept.notes[0]
    assert "810, 860, 900, 940 nm" in kept.notes[0]
    table.loc[1, [f"E_{label}" for label in bands.labels[:14]]] = np.nan
    table.to_csv(path, index=False)
    with pytest.raises(MapError, match="none at 'row 2'"):
        without_dark_channels(calibration_readings(path, bands.labels), room, path)


def test_a_reading_without_a_place_is_named(tmp_path: Path) -> None:
    path = tmp_path / "lux.csv"
    path.write_text("x,y,z,lux\n1,1,1,300\n,1,1,200\n", encoding="utf-8")
    with pytest.raises(MapError, match="reading 2"):
        calibration_readings(path, ("560",), unit="W/m2/nm", scale="one", has_cell=False)


def test_few_counts_weigh_little(tmp_path: Path) -> None:
    path = tmp_path / "readings.csv"
    path.write_text("x,y,z,410,560\n1,1,1,1,400\n2,1,1,100,0\n", encoding="utf-8")
    numbers = calibration_readings(path, ("410", "560"), unit="counts", scale="channel").numbers
    assert numbers.own_sd == pytest.approx([12**-0.5, 12**-0.5 / 100, 12**-0.5 / 400])
    path.write_text("x,y,z,E_410,SE_410\n1,1,1,1e-4,3e-5\n2,1,1,1e-3,5e-5\n3,1,1,2e-3,1e-4\n", encoding="utf-8")
    numbers = calibration_readings(path, ("410",)).numbers
    assert numbers.own_sd == pytest.approx([np.sqrt(0.3**2 - 0.05**2), 0.0, 0.0])  # 5 % is the sensor's own
    priors = Priors(flux_sd=np.ones(1), levels_covariance=np.eye(3))
    assert np.diag(priors.noise(numbers))[0] > 0.29**2
    assert np.diag(priors.noise(numbers.some(np.array([1, 2])))) == pytest.approx([2 * 0.03**2] * 2)
