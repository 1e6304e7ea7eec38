"""What readings before tell of the next one: the forward algorithm, gaps, cuts, lost sensors, and no over-counting."""

import itertools
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.localization import memory as memory_module
from lidarspectra.mapping.localization.fingerprint_table import save_fingerprints
from lidarspectra.mapping.localization.frames import Frame
from lidarspectra.mapping.localization.live import LiveLocator, LiveSettings
from lidarspectra.mapping.localization.location_model import LocationModel, TrainingSettings
from lidarspectra.mapping.localization.location_model_files import save_locator
from lidarspectra.mapping.localization.memory import FLOOR, Memory, people_transitions, place_transitions, remember
from lidarspectra.mapping.localization.scoring import errors_of, score_within, times_in_order
from lidarspectra.workflow.applications.localization_jobs import (
    EACH_ALONE,
    WITH_MEMORY,
    errors_from_files,
    score_nights,
)

Maker = Callable[..., xr.Dataset]
GAINS = np.full(6, 1e6)  # [count per W/m²/nm]
CORNERS_M = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [6.0, 6.0, 0.0]])
ONE = np.array([0.1, 0.8, 0.1])  # one person, most likely
NOISE = 0.6  # [1] difference of two readings of the same


def sure_of(place: int, probability: float = 0.85, count: int = 4) -> FloatArray:
    scores = np.full(count, (1.0 - probability) / (count - 1))
    scores[place] = probability
    return scores


def floored(probability: FloatArray) -> FloatArray:
    return (1.0 - FLOOR) * probability + FLOOR / probability.shape[-1]


def features_of(stance: int) -> FloatArray:
    """Far from those of any other stance."""
    return np.where(np.arange(8) == stance % 8, 40.0, 0.0)


def places_after(told: list[FloatArray], stances: list[int], times_s: list[float]) -> FloatArray:
    memory = Memory(CORNERS_M, NOISE)
    features = np.array([features_of(stance) for stance in stances])
    return remember(memory, np.array(times_s), features, np.array(told), np.array([ONE] * len(told)))[0]


DISTANCE_M = np.linalg.norm(CORNERS_M[:, None] - CORNERS_M[None], axis=2)


def chance_of_a_move(features: list[FloatArray], difference_noise: float = NOISE) -> float:
    """c of the last of readings a second apart, from what is known before it and after it."""
    memory = Memory(CORNERS_M, difference_noise)
    known = [memory.take(float(turn), each, sure_of(0, 0.4), ONE)[0] for turn, each in enumerate(features[:-1])][-1]
    found, _ = memory.take(float(len(features) - 1), features[-1], sure_of(3), ONE)
    told, tempered, newer = floored(sure_of(3)), np.sqrt(known), 1.0 - np.exp(-0.1)
    still, moved = known ** (1.0 - newer) * told**newer, told * (tempered @ place_transitions(DISTANCE_M, 1.0))
    still, moved = still / still.sum(), moved / moved.sum()
    return float((found - still)[3] / (moved - still)[3])


def differing(difference: float, count: int = 8, readings: int = 2) -> list[FloatArray]:
    """Readings in turn whose features differ by so much each time."""
    return [np.full(count, difference * (turn % 2)) for turn in range(readings)]


def test_the_odds_of_a_move_are_as_written() -> None:
    even = NOISE * (1.0 + 3.7 / np.sqrt(16.0))
    assert chance_of_a_move(differing(NOISE)) == pytest.approx(0.06 / 1.06)
    assert chance_of_a_move(differing(even)) == pytest.approx(0.5)
    lost = [np.append(each, [np.nan, np.nan]) for each in differing(even)]
    assert chance_of_a_move(lost) == pytest.approx(0.5)  # two sensors that are lost tell nothing of the scatter


def test_noise_is_learned_from_ten_differences_of_the_last_minute_and_is_at_least_a_quarter() -> None:
    quiet, loud = differing(0.3 * NOISE, readings=10), differing(NOISE)[1]
    assert chance_of_a_move([*quiet[:5], quiet[4] + loud]) == pytest.approx(0.06 / 1.06)
    assert chance_of_a_move([*quiet, *quiet, quiet[9] + loud]) > 0.8
    louder = differing(NOISE, readings=40)
    assert chance_of_a_move([*quiet * 8, *louder]) == pytest.approx(0.06 / 1.06)
    assert chance_of_a_move([*quiet * 8, *louder[:14]]) > 0.8  # most of the minute was quiet
    hardly = differing(0.01 * NOISE, readings=20)
    assert chance_of_a_move([*hardly, hardly[-1] + 0.25 * loud]) == pytest.approx(0.06 / 1.06)


def test_of_sensors_that_flicker_by_more_than_is_expected_each_reading_is_a_move() -> None:
    assert chance_of_a_move(differing(4.0 * NOISE, readings=40)) > 0.9


def test_readings_of_one_stance_are_averaged_over_ten_seconds_at_the_first_place_and_at_the_next() -> None:
    told = [sure_of(1), sure_of(2), sure_of(3), sure_of(0)]
    found = places_after(told, [0, 0, 1, 1], [0.0, 1.0, 2.0, 3.0])
    for turn in (1, 3):
        expected = found[turn - 1] ** np.exp(-0.1) * floored(told[turn]) ** (1.0 - np.exp(-0.1))
        assert found[turn] == pytest.approx(expected / expected.sum(), abs=2e-3)  # that somebody moved is left


def test_how_many_there_are_is_remembered_as_places_are(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory_module, "FORGETTING", 1.0)
    told = floored(np.random.default_rng(1).dirichlet(np.ones(3), 3))
    transitions = np.full((3, 3), 0.7 / 3.0) + 0.3 * np.eye(3)
    scores, times_s = np.full((3, 4), 0.25), np.arange(3.0)
    given = (told - FLOOR / 3.0) / (1.0 - FLOOR)
    walking = np.array([features_of(stance) for stance in range(3)])
    _, found = remember(Memory(CORNERS_M, NOISE), times_s, walking, scores, given)
    expected = told[2] * ((told[1] * (told[0] @ transitions)) @ transitions)
    assert found[2] == pytest.approx(expected / expected.sum(), rel=1e-4)
    _, stood = remember(Memory(CORNERS_M, NOISE), times_s[:2], walking[[0, 0]], scores[:2], given[:2])
    averaged = told[0] ** np.exp(-0.1) * told[1] ** (1.0 - np.exp(-0.1))
    assert stood[1] == pytest.approx(averaged / averaged.sum(), abs=2e-3)


def test_how_long_a_number_of_people_lasts_is_another_constant_than_how_long_a_place_does(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    places = place_transitions(DISTANCE_M, 1.0)
    monkeypatch.setattr(memory_module, "SAME_PEOPLE", 0.5)
    assert place_transitions(DISTANCE_M, 1.0) == pytest.approx(places)
    assert people_transitions() == pytest.approx(0.5 * np.eye(3) + 0.5 / 3.0)
    monkeypatch.setattr(memory_module, "STAYS", 0.9)
    assert people_transitions() == pytest.approx(0.5 * np.eye(3) + 0.5 / 3.0)


def test_it_is_the_sum_over_all_paths_where_everybody_moves_and_nothing_is_tempered(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(memory_module, "FORGETTING", 1.0)
    told = np.random.default_rng(0).dirichlet(np.ones(4), 4)
    transitions = place_transitions(DISTANCE_M, 1.0)
    given, expected = floored(told), np.zeros(4)
    for path in itertools.product(range(4), repeat=4):
        chance = np.prod([given[turn, place] for turn, place in enumerate(path)])
        expected[path[-1]] += chance * np.prod([transitions[pair] for pair in itertools.pairwise(path)])
    found = places_after(list(told), [0, 1, 2, 3], [0.0, 1.0, 2.0, 3.0])[-1]
    assert found == pytest.approx(expected / expected.sum(), rel=1e-4)  # that nobody moved is left with 1e-5


def test_readings_of_one_stance_are_no_further_evidence() -> None:
    found = places_after([sure_of(1)] * 600, [0] * 600, list(np.arange(600.0)))
    assert found[-1] == pytest.approx(found[0], abs=0.002)


def test_another_stance_is_and_what_was_known_counts_by_half() -> None:
    told = floored(np.array([sure_of(1, 0.6), sure_of(1, 0.7)]))
    found = places_after([sure_of(1, 0.6), sure_of(1, 0.7)], [0, 1], [0.0, 1.0])
    known = np.sqrt(told[0]) / np.sqrt(told[0]).sum()
    transitions = place_transitions(DISTANCE_M, 1.0)
    expected = told[1] * (known @ transitions)
    assert found[1] == pytest.approx(expected / expected.sum(), rel=1e-4)
    assert found[1, 1] > told[1, 1] + 0.02


def test_forty_stances_leave_a_doubt() -> None:
    found = places_after([sure_of(1, 0.6)] * 40, list(range(40)), list(np.arange(40.0)))
    assert 0.6 < found[-1, 1] < 0.9  # forty independent ones would leave none


def test_one_wrong_stance_among_right_ones_is_outvoted() -> None:
    positions = np.array([(x, y, 0.0) for x in range(6) for y in range(6)], dtype=float)
    wrong = np.zeros(36)
    wrong[7], wrong[20] = 0.4, 0.6
    told = np.array([sure_of(7, count=36)] * 3 + [wrong])
    features = np.array([features_of(stance) for stance in range(4)])
    found, _ = remember(Memory(positions, NOISE), np.arange(4.0), features, told, np.array([ONE] * 4))
    assert found[-1].argmax() == 7


def test_who_moves_after_a_long_stay_is_told_at_once_even_far_away() -> None:
    told = [sure_of(0, 0.95)] * 300 + [sure_of(3, 0.7)]
    found = places_after(told, [0] * 300 + [5], list(np.arange(301.0)))
    assert found[-1].argmax() == 3


def test_a_small_move_is_told_at_once_between_readings_quieter_than_expected() -> None:
    generator, memory = np.random.default_rng(5), Memory(CORNERS_M, 3.0 * NOISE)
    found = []
    for turn in range(60):
        features = 1.8 * (turn >= 50) + NOISE / np.sqrt(2.0) * generator.standard_normal(8)
        told = sure_of(1 if turn >= 50 else 0, 0.9)
        found.append(memory.take(float(turn), features, told, ONE)[0].argmax())
    assert found == [0] * 50 + [1] * 10


@pytest.mark.parametrize("count", [3, 6, 27, 300])
def test_noise_of_few_and_of_many_sensors_is_no_move_and_a_step_is(count: int) -> None:
    generator, memory = np.random.default_rng(count), Memory(CORNERS_M, NOISE)
    readings = NOISE / np.sqrt(2.0) * generator.standard_normal((200, count))
    found = [memory.take(float(turn), each, sure_of(1, 0.6), ONE)[0] for turn, each in enumerate(readings)]
    assert np.mean([each[1] for each in found]) < 0.68  # were each a move, it would be .74
    moved, _ = memory.take(200.0, readings[0] + 6.0 * NOISE, sure_of(2, 0.6), ONE)
    assert moved.argmax() == 2


def test_frames_faster_than_readings_make_no_move_of_every_new_reading() -> None:
    generator, memory = np.random.default_rng(8), Memory(CORNERS_M, NOISE)
    readings = NOISE / np.sqrt(2.0) * generator.standard_normal((60, 27))
    frames = np.repeat(readings, 10, axis=0)
    found = [memory.take(0.1 * turn, each, sure_of(1, 0.6), ONE)[0] for turn, each in enumerate(frames)]
    assert np.mean([each[1] for each in found]) < 0.62  # were each new one a move, it would be .635


def test_readings_that_never_change_are_no_noise_of_nothing() -> None:
    found = places_after([sure_of(1)] * 80 + [sure_of(2)], [0] * 80 + [1], list(np.arange(81.0)))
    assert found[79].argmax() == 1
    assert found[80].argmax() == 2


def test_who_creeps_without_a_visible_step_is_followed() -> None:
    memory, found = Memory(CORNERS_M, NOISE), []
    for turn in range(90):
        share = turn / 89.0
        scores = (1.0 - share) * sure_of(0, 0.95) + share * sure_of(1, 0.95)
        features = share * (features_of(1) - features_of(0)) / 20.0
        found.append(memory.take(float(turn), features, scores, ONE)[0])
    assert found[-1].argmax() == 1


@pytest.mark.parametrize("next_s", [1e6, 40.0, -5.0, -1e9])
def test_after_a_cut_or_in_another_recording_nothing_is_remembered(next_s: float) -> None:
    told = [sure_of(1, 0.99), sure_of(1, 0.99), np.array([0.0, 0.4, 0.45, 0.15])]
    found = places_after(told, [0, 1, 2], [0.0, 1.0, next_s])
    assert found[-1] == pytest.approx(floored(told[-1]))


def test_a_gap_of_less_than_half_a_minute_is_bridged() -> None:
    found = places_after([sure_of(1, 0.99), np.array([0.0, 0.4, 0.45, 0.15])], [0, 0], [0.0, 29.0])
    assert found[-1].argmax() == 1


def test_times_out_of_order_give_probabilities_all_the_same() -> None:
    generator = np.random.default_rng(3)
    told = generator.dirichlet(np.ones(4), 60)
    times_s = generator.permutation(60).astype(float)
    found = places_after(list(told), list(range(60)), list(times_s))
    assert found.sum(axis=1) == pytest.approx(1.0)
    back = np.flatnonzero(np.diff(times_s) < 0) + 1
    assert found[back] == pytest.approx(floored(told[back]))


def test_readings_of_one_time_tell_as_much_as_those_a_second_apart() -> None:
    """As of a clock that tells whole minutes."""
    told, stances = [sure_of(0)] * 20 + [sure_of(3)] * 20, [0] * 20 + [1] * 20
    found = places_after(told, stances, [60.0] * 40)
    assert found == pytest.approx(places_after(told, stances, list(np.arange(40.0))))
    assert found[20].argmax() == 3


def test_one_reading_and_a_score_below_zero_give_what_they_say() -> None:
    places, people = Memory(CORNERS_M, NOISE).take(0.0, np.full(8, np.nan), np.array([0.7, -0.1, 0.5, -0.2]), ONE)
    assert places == pytest.approx(floored(np.array([0.7, 0.0, 0.5, 0.0]) / 1.2))
    assert people == pytest.approx(floored(ONE))
    nothing, _ = Memory(CORNERS_M, NOISE).take(0.0, np.zeros(8), np.full(4, -1.0), ONE)
    assert nothing == pytest.approx(0.25)


def test_a_sensor_that_is_lost_is_no_movement_and_without_any_in_common_somebody_may_have_moved() -> None:
    stood = np.random.default_rng(1).standard_normal(8)
    weak = np.array([0.0, 0.4, 0.45, 0.15])

    def after(features: FloatArray) -> FloatArray:
        memory = Memory(CORNERS_M, NOISE)
        memory.take(0.0, stood, sure_of(1), ONE)
        return memory.take(1.0, features, weak, ONE)[0]

    lost = np.where(np.arange(8) == 2, np.nan, stood)
    assert after(lost) == pytest.approx(after(stood), rel=1e-3)
    nothing = after(np.full(8, np.nan))
    assert nothing.sum() == pytest.approx(1.0)
    assert nothing[2] > after(stood)[2]


def test_far_places_are_less_likely_a_second_later_but_never_impossible() -> None:
    soon, later = place_transitions(DISTANCE_M, 1.0), place_transitions(DISTANCE_M, 25.0)
    walked = soon[0, 1:] - 0.7 * 0.5 / 3.0  # half of the moves go anywhere
    assert walked / walked[0] == pytest.approx(np.exp(-(DISTANCE_M[0, 1:] - 1.0) / 1.4))
    assert place_transitions(DISTANCE_M, 0.1) == pytest.approx(soon)
    assert soon[0, 1] > 2.0 * soon[0, 3] > 0.1
    assert later[0, 3] > soon[0, 3]
    for each in (soon, later, place_transitions(1e4 * DISTANCE_M, 0.0)):
        assert each.sum(axis=1) == pytest.approx(1.0)
        assert each.min() > 0.0
    unknown = place_transitions(np.full((4, 4), np.nan), 1.0)
    assert unknown[0, 1:] == pytest.approx(unknown[0, 1])


def test_live_and_a_recording_agree_and_each_alone_is_as_before(model: LocationModel, make_table: Maker) -> None:
    readings = make_table(9, gains=GAINS)
    reference, times_s = readings["empty"].to_numpy(), np.arange(float(readings.sizes["fingerprint"]))
    located = model.locate_in_order(model.features(readings), times_s)
    for settings, expected in ((LiveSettings(), located), (LiveSettings(each_alone=True), model.locate(readings))):
        locator = LiveLocator(model, settings, reference)
        for number, time_s in enumerate(times_s):
            fix = locator.locate(Frame(time_s=time_s, table=readings.isel(fingerprint=[number])))
            assert fix is not None
            assert fix.label == model.places.labels[expected.best[number]]
            assert fix.people == pytest.approx(tuple(expected.people[number]))
            assert fix.position_m == pytest.approx(tuple(expected.positions_m[number, :2]))


def test_difference_noise_is_that_of_two_readings_of_the_same(model: LocationModel, make_table: Maker) -> None:
    table = make_table(9, draws=1, gains=np.full(6, 3e5))
    still = xr.concat([table.isel(fingerprint=[4])] * 400, dim="fingerprint", data_vars="minimal")
    generator = np.random.default_rng(0)
    still["counts"] = np.rint(still["counts"] * (1.0 + 0.004 * generator.standard_normal(still["counts"].shape)))
    found = model.features(still)
    measured = np.sqrt(np.mean(np.diff(found, axis=0) ** 2))
    assert measured == pytest.approx(model.space.difference_noise, rel=0.2)  # the noise is of other counts


def test_rows_without_times_have_an_order_only_in_a_recording(make_table: Maker) -> None:
    table = make_table(9)
    assert times_in_order(table, is_recording=False) is None
    assert times_in_order(table, is_recording=True).tolist()[:3] == [0.0, 1.0, 2.0]  # type: ignore[union-attr]
    timed = table.assign_coords(time_s=("fingerprint", 5.0 * np.arange(table.sizes["fingerprint"])))
    assert times_in_order(timed, is_recording=False).tolist()[:3] == [0.0, 5.0, 10.0]  # type: ignore[union-attr]


def test_a_test_remembers_where_readings_have_times_unless_each_is_judged_alone(
    model: LocationModel, make_table: Maker, tmp_path: Path
) -> None:
    save_locator(model, tmp_path / "model")
    table = make_table(9, draws=3, gains=GAINS / 100.0)  # few counts: rounding tells places wrong
    place = np.repeat(np.arange(12), 3)
    sets = {
        "timed": table.assign_coords(time_s=("fingerprint", np.arange(float(place.size)), {"units": "s"})),
        "untimed": table,
    }
    found = {}
    for name, readings in sets.items():
        path = save_fingerprints(readings, tmp_path / f"{name}.nc")
        for each_alone in (False, True):
            report = errors_from_files(tmp_path / "model", [path], tmp_path / "out", each_alone=each_alone)
            found[name, each_alone] = report.tables[0].frame.set_index("method")["top 1 [%]"]
            is_remembered = name == "timed" and not each_alone
            assert report.tables[0].caption.endswith(WITH_MEMORY if is_remembered else EACH_ALONE)
    both = errors_from_files(tmp_path / "model", [tmp_path / f"{name}.nc" for name in sets], tmp_path / "out")
    assert both.tables[0].caption.endswith("in files with times, else by itself")
    alone = 100.0 * errors_of(model, table)["together"].top(1)
    remembered = 100.0 * errors_of(model, table, times_s=np.arange(36.0))["together"].top(1)
    assert found["timed", False]["together"] == pytest.approx(remembered)
    for key in (("timed", True), ("untimed", False), ("untimed", True)):
        assert found[key]["together"] == pytest.approx(alone)


def test_a_night_is_scored_with_memory_and_alone(
    make_table: Maker, quick_settings: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[float | None] = []

    def noted(model: LocationModel, table: xr.Dataset, *, times_s: FloatArray | None) -> object:
        given.append(None if times_s is None else float(times_s[0]))
        return errors_of(model, table)

    monkeypatch.setattr("lidarspectra.mapping.localization.scoring.errors_of", noted)
    night = xr.concat(
        [make_table(seed, draws=1, gains=GAINS) for seed in (1, 2)], dim="fingerprint", data_vars="minimal"
    )
    for each_alone in (False, True):
        score_within(night, quick_settings, each_alone=each_alone)  # type: ignore[arg-type]
    assert given == [0.0, 12.0, None, None]


def test_scores_say_whether_readings_had_memory(
    make_table: Maker, quick_settings: TrainingSettings, tmp_path: Path
) -> None:
    night = xr.concat(
        [make_table(seed, draws=1, gains=GAINS) for seed in (1, 2)], dim="fingerprint", data_vars="minimal"
    )
    path = save_fingerprints(night, tmp_path / "night.nc")
    for each_alone, words in ((False, WITH_MEMORY), (True, EACH_ALONE)):
        found = score_nights([path], tmp_path / "out", settings=quick_settings, each_alone=each_alone)
        assert found.tables[0].caption.endswith(words)
