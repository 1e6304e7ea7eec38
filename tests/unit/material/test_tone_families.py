"""Families of tone curves: which one a picture was made with, and how far it is not known."""

from dataclasses import replace

import numpy as np
import pytest

from lidarspectra.material.delighting.albedo import BOUND_EXPOSURE, LightFit, fit_light
from lidarspectra.material.delighting.light_evidence import LightEvidence
from lidarspectra.material.delighting.tone_curve import FILMIC_TONE, ToneCurve, TonePrior
from lidarspectra.material.delighting.tone_families import fit_other_families, mean_log, probabilities, with_others
from lidarspectra.workflow.materials.delighting_notes import tone_note

from .lit_walls import evidence

FLUX = np.array([0.15])
FILMIC = ToneCurve(power=1.6, shoulder=6.0)
LINEAR = ToneCurve()


def photographed(tone: ToneCurve) -> LightEvidence:
    """White walls and a grey one, through a tone curve."""
    linear = evidence(3)
    shown = tone.shown(linear.shown)
    return replace(linear, shown=shown, face_shown=shown)


def both(picture: LightEvidence) -> tuple[LightFit, ...]:
    """A fit of each family."""
    usual = fit_light(picture, flux_deviation=FLUX)
    return usual, *fit_other_families(picture, usual, (FILMIC_TONE,), flux_deviation=FLUX)


@pytest.mark.parametrize(("tone", "filmic"), [(LINEAR, False), (ToneCurve(shoulder=0.6), False), (FILMIC, True)])
def test_the_more_probable_family_is_the_camera_s(tone: ToneCurve, filmic: bool) -> None:
    of_filmic = probabilities(both(photographed(tone)))[1]
    assert of_filmic > 0.9 if filmic else of_filmic < 0.1


def test_a_family_that_is_more_probable_but_leaves_more_scatter_counts_as_much_as_the_usual_one() -> None:
    usual, filmic = both(photographed(FILMIC))
    scattered = replace(filmic, scatter=1.01 * usual.scatter)
    assert probabilities((usual, filmic))[1] > 0.9
    assert probabilities((usual, scattered)) == pytest.approx([0.5, 0.5])
    equal = replace(filmic, scatter=usual.scatter)
    assert probabilities((usual, equal)) == pytest.approx([0.5, 0.5])
    less = replace(scattered, log_evidence=usual.log_evidence - 3.0)  # scatter makes nothing more probable
    assert probabilities((usual, less)) == pytest.approx([1.0 / (1.0 + np.exp(-3.0)), 1.0 / (1.0 + np.exp(3.0))])


def test_a_third_family_s_lesser_scatter_does_not_make_the_second_more_probable() -> None:
    usual, filmic = both(photographed(FILMIC))
    second = replace(filmic, log_evidence=usual.log_evidence + 3.0, scatter=usual.scatter)
    third = replace(filmic, log_evidence=usual.log_evidence - 9.0, scatter=0.5 * usual.scatter)
    found = probabilities((usual, second, third))
    assert found[1] == pytest.approx(found[0])


def test_groups_that_favour_one_family_count_no_more_than_those_that_favour_the_other() -> None:
    usual, filmic = both(photographed(FILMIC))
    equal = replace(filmic, log_evidence=usual.log_evidence, scatter=usual.scatter)
    against, for_it = (replace(equal, log_evidence=usual.log_evidence + by) for by in (-4.0, 4.0))
    assert probabilities((usual, against), (usual, for_it)) == pytest.approx([0.5, 0.5])
    less = replace(for_it, log_evidence=usual.log_evidence + 8.0, scatter=0.9 * usual.scatter)
    assert probabilities((usual, against), (usual, less)) == pytest.approx(_shares_of(2.0))
    assert probabilities((usual, filmic), (usual, filmic)) == pytest.approx(probabilities((usual, filmic)))


def _shares_of(over: float) -> list[float]:
    """Probabilities of two families, the second's evidence being greater by this logarithm."""
    return [1.0 / (1.0 + np.exp(over)), 1.0 / (1.0 + np.exp(-over))]


def test_a_family_s_probability_does_not_jump_where_it_comes_to_leave_less_scatter() -> None:
    """Round-off in the linear algebra would else choose the family, as it did of a real room."""
    usual, filmic = both(photographed(FILMIC))
    filmic = replace(filmic, log_evidence=usual.log_evidence + 50.0)
    gains = np.linspace(0.0, 0.01, 101)
    shares = np.array(
        [probabilities((usual, replace(filmic, scatter=(1.0 - gain) * usual.scatter)))[1] for gain in gains]
    )
    assert shares[0] == pytest.approx(0.5)
    assert shares[-1] == pytest.approx(1.0)
    assert np.abs(np.diff(shares)).max() < 0.02  # .5 where it jumps


def test_the_note_names_the_family_that_was_taken_wherever_its_curve_came_out() -> None:
    """The usual family's fit to a filmic picture is nearer to filmic curves than to its own middle."""
    for fit, kind in zip(both(photographed(FILMIC)), ("plain", "filmic"), strict=True):
        even = tone_note(replace(fit, family_probability=0.5))[0]
        assert f"both are about as probable, and a {kind} one was taken." in even
        assert "%" not in even


def test_the_filmic_fit_finds_the_power_that_the_usual_one_takes_for_less() -> None:
    usual, filmic = both(photographed(FILMIC))
    assert abs(np.log(filmic.tone.power / FILMIC.power)) < 0.1
    assert usual.tone.power < filmic.tone.power


def test_a_prior_that_is_needlessly_wide_is_less_probable_by_its_width() -> None:
    picture = photographed(LINEAR)
    narrow, wide = (
        fit_light(
            replace(picture, tone_prior=TonePrior(power_deviation=deviation)),
            flux_deviation=FLUX,
            observations_per_place=4.0,
        )
        for deviation in (0.5, 5.0)
    )
    assert narrow.log_evidence - wide.log_evidence == pytest.approx(np.log(10.0), abs=0.1)  # the data tell the power


def test_of_what_the_prior_alone_tells_the_width_makes_nothing_more_probable() -> None:
    picture = photographed(LINEAR)
    one, two = (
        fit_light(
            replace(picture, tone_prior=TonePrior(shoulder=0.0, shoulder_deviation=deviation)), flux_deviation=FLUX
        )
        for deviation in (0.001, 0.002)
    )
    assert one.log_evidence - two.log_evidence == pytest.approx(0.0, abs=0.1)  # log 2 where curvature does not count


def test_a_picture_that_cannot_tell_gets_the_families_difference_for_its_deviation() -> None:
    one, two = both(photographed(LINEAR))
    one = replace(one, reflectance=np.full((2, 3), 0.5), log_deviation=np.full((2, 3), 0.03))
    two = replace(two, reflectance=np.full((2, 3), 0.5 * np.exp(0.2)), log_deviation=np.full((2, 3), 0.05))
    found = with_others(one, (two,), np.array([0.75, 0.25]))
    logs = [np.log(each.reflectance) for each in (found, *found.others)]
    assert mean_log((found, *found.others), logs) == pytest.approx(np.log(0.5) + 0.25 * 0.2 * np.ones((2, 3)))
    variance = 0.75 * (0.03**2 + 0.05**2) + 0.25 * (0.05**2 + 0.15**2)
    assert found.log_deviation == pytest.approx(np.sqrt(variance) * np.ones((2, 3)))
    assert found.reflectance is one.reflectance
    assert "a plain one was taken, which is 75 % probable." in tone_note(found)[0]


def test_the_only_family_of_a_scan_whose_frames_tell_the_curve_stays_as_it_is() -> None:
    fit = fit_light(photographed(LINEAR), flux_deviation=FLUX)
    assert fit_other_families(photographed(LINEAR), fit, (), flux_deviation=FLUX) == ()
    found = with_others(fit, (), probabilities([fit]))
    assert found.log_deviation == pytest.approx(fit.log_deviation)
    assert found.family_probability == 1.0
    assert tone_note(found) == ()


def test_a_lamp_s_flux_is_as_unsure_as_the_families_differ_in_it() -> None:
    one = fit_light(photographed(LINEAR), flux_deviation=FLUX)
    one = replace(one, flux_factors=np.array([1.0, 1.0]), flux_deviations=np.array([0.1, 0.1]))
    two = replace(one, flux_factors=np.exp([0.3, -0.3]))
    found = with_others(one, (two,), np.array([0.8, 0.2]))
    assert found.flux_deviations == pytest.approx(np.sqrt(0.1**2 + 0.2 * 0.3**2) * np.ones(2))  # about the likelier's


@pytest.mark.parametrize("end", [-BOUND_EXPOSURE, BOUND_EXPOSURE])
def test_a_family_is_tried_also_where_the_exposure_is_at_the_end_of_its_range(end: float) -> None:
    picture = photographed(LINEAR)
    fit = fit_light(picture, flux_deviation=FLUX)
    fit = replace(fit, parameters=np.where(np.arange(fit.parameters.size) == 3, end, fit.parameters))
    (other,) = fit_other_families(picture, fit, (FILMIC_TONE,), flux_deviation=FLUX)
    assert np.isfinite(other.log_evidence)
    assert abs(other.parameters[3]) <= BOUND_EXPOSURE
