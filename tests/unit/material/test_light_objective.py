"""The slopes of de-lighting's objective in closed form are those that differences give."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_array

from lidarspectra.material.delighting import light_objective
from lidarspectra.material.delighting.albedo import MAX_PER_PLACE, LightFit, fit_light
from lidarspectra.material.delighting.light_evidence import LightEvidence, SourceSightings
from lidarspectra.material.delighting.light_objective import (
    CEILING_DEVIATION,
    CEILING_DOUBT,
    CEILING_REFLECTANCE,
    LOG_SCATTER,
    MAX_UNSURE,
    OF_TONE,
    SOURCE_LEVEL,
    SOURCE_LEVEL_DEVIATION,
    LightObjective,
)
from lidarspectra.material.delighting.robust_centers import RobustCenters
from lidarspectra.material.delighting.sharpened_cones import cones_of_srgb, srgb_of_cones
from lidarspectra.material.delighting.surface_light import MIN_LIGHT
from lidarspectra.material.delighting.tone_curve import TonePrior

from .lit_walls import BALANCE, GREY, PER_GROUP, evidence

SMALL = 1e-6  # of a central difference: its error is of the square of it, and rounding 1e-16 / 1e-6


def rich_evidence() -> LightEvidence:
    """The lit walls under three lamps of a beam, with a window, a bright source of no known kind, and two cards."""
    data, random = evidence(2), np.random.default_rng(5)
    count = len(data.shown)
    lit = np.arange(count) >= 3  # nothing arrives at the first
    return replace(
        data,
        direct=data.direct * random.uniform(0.2, 1.0, (3, count, 1)) * lit[:, None],
        emission=random.uniform(0.3, 1.0, (3, count)),
        other=random.uniform(0.0, 0.3, (2, 3, count)) * lit,
        other_upright=np.array([True, False]),
        other_seen=SourceSightings(
            source=np.array([0, 0]),
            lobes=np.array([[0.2, 0.8, 0.0], [0.0, 0.0, 1.0]]),
            light=np.array([[0.3, 0.4, 0.5], [0.1, 0.1, 0.1]]),
            log_deviation=np.array([0.3, 1.5]),
        ),
        lamp_shown=np.array([[9.0, 8.0, 7.0], [np.nan] * 3, [20.0, 21.0, 22.0]]),
        lamp_sent=np.array([[30.0, 20.0, 25.0]] * 3),
        card=np.where(lit & (np.arange(count) % 4 < 2), np.arange(count) % 2, -1),
        card_log=np.log([[0.5, 0.5, 0.5], [0.2, 0.2, 0.2]]),
        card_beside=csr_array(np.stack([(data.group == surface) & (np.arange(count) % 5 == 0) for surface in (0, 2)])),
        ceiling=data.group == 0,
    )


@pytest.mark.parametrize("redescending", [False, True])
def test_slopes_in_closed_form_are_those_of_differences(redescending: bool) -> None:
    model = LightObjective(rich_evidence(), flux_deviation=np.full(3, 0.15), redescending=redescending)
    place = np.random.default_rng(2).uniform(-0.3, 0.3, model.count)
    place[1] = 0.4  # the shoulder, which is not below 0
    found = model.jacobian(place)
    for column in range(model.count):
        step = SMALL * np.eye(model.count)[column]
        wanted = (model.residuals(place + step) - model.residuals(place - step)) / (2 * SMALL)
        # The priors' slopes and the tone curve's are differences over 1e-3: off by half of it times the curvature.
        assert np.abs(found[:, column] - wanted).max() < 0.01 * np.abs(wanted).max(), f"parameter {column}"
        if column >= OF_TONE:
            data = slice(0, 3 * model.rows.size)
            assert np.abs(found[data, column] - wanted[data]).max() < 1e-5 * np.abs(wanted).max(), f"parameter {column}"


def test_errors_of_the_light_are_not_taken_for_a_camera_that_takes_contrast_away(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Points of every light err up and down, in what they show and in their light, all four ways as often."""
    light = 0.7 * LOG_SCATTER
    monkeypatch.setattr(light_objective, "LIGHT_SCATTER", light)
    data = evidence(2)
    levels = np.tile(np.repeat(np.linspace(0.5, 1.5, PER_GROUP // 4), 4), 3)
    of_picture, of_light = (np.resize(signs, len(levels)) for signs in ([1.0, 1.0, -1.0, -1.0], [1.0, -1.0]))
    shown = data.shown * (levels / data.direct[0, :, 0])[:, None]
    data = replace(
        scattered(replace(data, shown=shown), np.sqrt(LOG_SCATTER**2 - light**2) * of_picture),
        direct=np.repeat((levels * np.exp(light * of_light))[None, :, None], 3, axis=2),
    )
    model = LightObjective(data, flux_deviation=np.array([0.15]))
    powers = np.linspace(-0.1, 0.1, 41)

    def scatter(log_power: float) -> float:
        place = np.zeros(model.count)
        place[0] = log_power
        return float(model.scatter(place, model.log_reflectance(place))[0].std())

    best = powers[np.argmin([scatter(each) for each in powers])]
    # By the variance of the light's errors over that of its logarithm, 2.5 %, were they taken for the picture's.
    assert abs(best) < 0.01


def test_where_hardly_any_light_arrives_the_least_light_is_taken_which_no_lamp_moves() -> None:
    dim = replace(rich_evidence(), other=None, other_upright=None, other_seen=None)
    dim.direct[:, 3:6] *= 1e-9
    model = LightObjective(dim, flux_deviation=np.full(3, 0.15))
    place = np.zeros(model.count)
    light = model.light(place)[1]
    slopes = model.straight_slopes(model.some_light, place, light)
    assert (light[:6] == MIN_LIGHT).all()
    assert np.all(slopes[:6] == 0.0)
    assert np.all(slopes[6:, :, 3] != 0.0)


def scattered(data: LightEvidence, logs: np.ndarray) -> LightEvidence:
    """The same evidence, all that it shows being brighter by (sample,) logs."""
    return replace(data, shown=data.shown * np.exp(logs)[:, None])


CELLS, POINTS = 10, 6  # of every wall, and of every cell


def lit_by_places() -> LightEvidence:
    """The lit walls, one of them a ceiling, evenly lit within each of ten places: what a place errs by can mislead."""
    data, random = evidence(2), np.random.default_rng(6)
    count = len(data.shown)
    direct = np.repeat(random.permutation(np.linspace(0.5, 1.5, count // POINTS)), POINTS)
    ratio = direct / data.direct[0, :, 0]
    return replace(
        data,
        direct=data.direct * ratio[:, None],
        shown=data.shown * ratio[:, None],
        cell=np.arange(count) % PER_GROUP // POINTS,
        ceiling=data.group == 0,
    )


def fitted(logs: np.ndarray, observations_per_place: float = 1.0) -> LightFit:
    """Fit to walls whose points show more than they should by (sample,) logs."""
    data = scattered(lit_by_places(), logs)
    return fit_light(data, flux_deviation=np.array([0.15]), observations_per_place=observations_per_place)


def test_a_place_tells_the_more_the_less_its_points_err_and_least_where_they_err_alike() -> None:
    random, count = np.random.default_rng(4), len(evidence(2).shown)
    alone, alike = random.normal(size=count), np.repeat(random.normal(size=count // POINTS), POINTS)
    assert fitted(0.05 * LOG_SCATTER * alone).observations_per_place == MAX_PER_PLACE
    as_assumed = fitted(LOG_SCATTER * alike).observations_per_place
    assert 0.3 < as_assumed < MAX_PER_PLACE  # 1, but that the loss takes the outer ones for less than they are
    assert fitted(3 * LOG_SCATTER * alike).observations_per_place < as_assumed


def test_a_place_is_one_observation_at_most_where_much_of_the_light_is_of_no_known_pattern() -> None:
    known = lit_by_places()
    lobe = np.random.default_rng(9).permutation(known.direct[0, :, 0])
    brighter = 1.0 + lobe / known.direct[0, :, 0]
    unnamed = replace(
        known,
        shown=known.shown * brighter[:, None],
        other=np.stack([lobe, 1e-6 * lobe, 1e-6 * lobe])[None],
        other_upright=np.array([False]),
    )
    window = replace(unnamed, other_upright=np.array([True]), other_window=np.array([True]))
    of_known, of_unnamed, of_window = (
        fit_light(each, flux_deviation=np.array([0.15])) for each in (known, unnamed, window)
    )
    assert of_unnamed.other is not None
    assert of_unnamed.other.mean() > 0.2 * of_unnamed.straight.mean()
    assert of_known.observations_per_place == of_window.observations_per_place == MAX_PER_PLACE
    assert of_unnamed.observations_per_place <= 1.0


def test_fewer_observations_per_place_leave_the_fit_less_sure() -> None:
    logs = 0.5 * LOG_SCATTER * np.random.default_rng(4).normal(size=len(evidence(2).shown))
    few, many = (np.median(fitted(logs, count).log_deviation) for count in (0.1, 4.0))
    assert few > 1.05 * many


@pytest.mark.parametrize("weight", [1.0, 0.25, 0.0])
def test_a_ceiling_is_believed_once_though_it_is_seen_in_three_cones(weight: float) -> None:
    """And the less, the more it is coloured."""
    seen = replace(evidence(2), ceiling=evidence(2).group == 0, ceiling_weight=weight)
    blind = replace(seen, ceiling=np.zeros_like(seen.ceiling))
    models = [LightObjective(each, flux_deviation=np.array([0.15])) for each in (seen, blind)]
    place = np.zeros(models[0].count)
    found, without = (0.5 * float((model.residuals(place) ** 2).sum()) for model in models)
    log_reflectance = np.median(models[0].log_reflectance(place)[models[0].ceiling], axis=0)
    apart = (log_reflectance - np.log(CEILING_REFLECTANCE)) / CEILING_DEVIATION
    of_cones = 0.5 * CEILING_DOUBT**2 * np.log1p((apart / CEILING_DOUBT) ** 2)
    assert found - without == pytest.approx(weight * of_cones.mean())


def test_what_frames_show_of_a_source_stands_in_for_what_is_expected_of_its_level() -> None:
    seen = rich_evidence()
    models = [LightObjective(each, flux_deviation=np.full(3, 0.15)) for each in (seen, replace(seen, other_seen=None))]
    place = np.random.default_rng(2).uniform(-0.3, 0.3, models[0].count)
    found, without = (0.5 * float((model.residuals(place) ** 2).sum()) for model in models)
    assert seen.other_seen is not None
    strengths = models[0].strengths(place)[0]  # of the first source, lobe by lobe, which both sightings show
    off = np.log(seen.other_seen.lobes @ strengths / cones_of_srgb(seen.other_seen.light))
    sightings = 0.5 * ((off / seen.other_seen.log_deviation[:, None]) ** 2).sum()
    level = 0.5 * ((models[0].source_logs(place)[0, 0] - SOURCE_LEVEL) / SOURCE_LEVEL_DEVIATION) ** 2
    assert found - without == pytest.approx(sightings - level)


def test_points_at_the_edges_of_shadows_do_not_count_but_two_thirds_always_do() -> None:
    data = evidence(2)
    edge = np.arange(len(data.shown)) % 4 == 0
    unsure = np.where(edge[:, None], 2.0 * MAX_UNSURE, 0.0) * np.ones(3)
    kept = LightObjective(replace(data, unsure=unsure), flux_deviation=np.array([0.15])).rows
    assert kept.tolist() == np.flatnonzero(~edge).tolist()
    all_unsure = np.linspace(2.0, 3.0, len(edge))[:, None] * MAX_UNSURE * np.ones(3)
    kept = LightObjective(replace(data, unsure=all_unsure), flux_deviation=np.array([0.15])).rows
    assert kept.size == pytest.approx(2 / 3 * len(edge), abs=1)


def test_a_card_errs_as_the_surface_beside_it_does_there() -> None:
    """A tenth less light at one place of a wall: the card there still tells the wall's level."""
    data = evidence(2)
    count = len(data.shown)
    here = (data.group == 0) & (np.arange(count) % 6 == 0)
    card = np.where(here & (np.arange(count) % 12 == 0), 0, -1)
    data = replace(
        data, card=card, group=np.where(card == 0, -1, data.group),
        card_log=np.log(cones_of_srgb(np.full((1, 3), 0.8))), card_beside=csr_array((here & (card < 0))[None]),
    )  # fmt: skip
    darker = scattered(data, np.where(here, -0.1, 0.0))

    def levels(*told: LightEvidence) -> list[float]:
        models = [LightObjective(each, flux_deviation=np.array([0.15])) for each in told]
        place = np.zeros(models[0].count)
        values = [model.log_reflectance(place) for model in models]
        beliefs = zip(models, values, strict=True)
        return [float(m._card_beliefs(place, m._beside_cards(v, m.centers.of(v)))[0, 1]) for m, v in beliefs]

    plain = [replace(each, card_beside=None) for each in (data, darker)]
    even, uneven, even_alone, uneven_alone = levels(data, darker, *plain)
    assert abs(uneven_alone - even_alone) > 1.2
    assert abs(uneven - even) < 0.8 * abs(uneven_alone - even_alone)


@pytest.mark.parametrize("redescending", [False, True])
def test_robust_centres_move_with_their_values_as_told(redescending: bool) -> None:
    random = np.random.default_rng(3)
    group, values = np.repeat([0, 1, 2], 40), random.normal(size=(120, 3))
    values[::10] += 4.0  # outliers
    centers = RobustCenters(group, random.uniform(0.3, 1.0, (120, 3)), scale=0.5, redescending=redescending)
    slopes = random.normal(size=(120, 3, 2))
    found = centers.slopes(values, slopes)
    for column in range(2):
        moved = SMALL * slopes[:, :, column]
        wanted = (centers.of(values + moved) - centers.of(values - moved)) / (2 * SMALL)
        assert np.abs(found[:, :, column] - wanted).max() < 1e-6


def test_a_lamp_that_frames_show_unclipped_tells_the_level_without_any_belief_in_whites() -> None:
    data = replace(evidence(0), white=np.zeros(PER_GROUP, dtype=np.bool_))  # one grey wall
    sent = np.full((1, 3), 50.0)
    shown = srgb_of_cones(BALANCE * sent)
    power = TonePrior(power_deviation=0.02, shoulder=0.0, shoulder_deviation=0.02)
    told = replace(data, lamp_shown=shown, lamp_sent=sent, tone_prior=power)
    without, with_lamp = (
        fit_light(each, flux_deviation=np.full(1, 0.15)) for each in (replace(told, lamp_shown=None), told)
    )
    assert np.median(with_lamp.reflectance, axis=0) == pytest.approx(GREY, rel=0.08)
    assert np.abs(np.log(np.median(without.reflectance, axis=0) / GREY)).max() > 0.3  # nothing tells it


def test_lamps_that_frames_show_tell_their_relative_flux() -> None:
    data, random = evidence(2), np.random.default_rng(6)
    direct = np.repeat(random.uniform(0.4, 0.5, (2, len(data.shown), 1)), 3, axis=2)  # both light everything alike
    sent = np.full((2, 3), 50.0)
    shown = srgb_of_cones(BALANCE * sent * np.array([[1.5], [0.5]]))
    tone = TonePrior(power_deviation=0.02, shoulder=0.0, shoulder_deviation=0.02)
    lamps = replace(data, direct=direct, emission=np.ones((2, len(data.shown))), tone_prior=tone)
    told = replace(lamps, lamp_shown=shown, lamp_sent=sent)
    wide = np.full(2, 0.8)
    without, with_lamps = (fit_light(each, flux_deviation=wide) for each in (lamps, told))
    assert with_lamps.flux_factors[0] / with_lamps.flux_factors[1] == pytest.approx(3.0, rel=0.15)
    assert with_lamps.flux_deviations.max() < 0.5 * without.flux_deviations.max()
