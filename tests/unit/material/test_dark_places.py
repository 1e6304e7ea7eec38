"""What a picture shows too dark to tell."""

import numpy as np
import pytest

from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.material.delighting.dark_places import BLACK_DEVIATION, black_error, clarity, dark_places
from lidarspectra.material.delighting.light_objective import BRIGHTEST_REFLECTANCE
from lidarspectra.material.delighting.one_paint import Paints, one_paint
from lidarspectra.material.delighting.tone_curve import ToneCurve

LINEAR = ToneCurve()


def row_of_faces(count: int) -> Scan:
    """Triangles of half a square metre side by side, in one plane."""
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    shift = np.arange(count)[:, None, None] * [1.0, 0.0, 0.0]
    return bare_scan((corners + shift).reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


def single(color: np.ndarray) -> Paints:
    """Faces of no paint."""
    return Paints(
        color=np.repeat(color[:, None], 3, axis=1), paint=np.full(len(color), -1), spread=np.zeros(0),
        area_m2=np.zeros(0),
    )  # fmt: skip


def test_errors_of_the_black_are_stated_in_any_light_and_smaller_than_without() -> None:
    generator = np.random.default_rng(3)
    count = 4000
    truth = generator.uniform(0.02, BRIGHTEST_REFLECTANCE, count)
    light = np.exp(generator.uniform(np.log(0.004), 0.0, count))
    shown = np.maximum(truth * light + BLACK_DEVIATION * generator.standard_normal(count), 0.0)
    estimate = shown / light
    error = black_error(np.repeat(shown[:, None], 3, axis=1), LINEAR)
    found = dark_places(row_of_faces(count), single(estimate), np.ones(count, np.bool_), error)
    color, deviation = found.color[:, 0], found.color[:, 0] * found.deviation[:, 0]
    apart = np.abs(color - truth)
    for dim in (light < 0.02, (light > 0.02) & (light < 0.1), light > 0.1):
        assert (apart < 2.0 * deviation)[dim].mean() > 0.9
    dim = light < 0.02
    assert (apart[dim] ** 2).mean() < 0.6 * ((estimate - truth)[dim] ** 2).mean()
    assert apart[light > 0.3].max() < 0.04  # what is told stays: the black over this light is .007


def test_what_shows_nothing_is_like_the_rest_and_what_is_dark_in_good_light_stays() -> None:
    shown = np.array([0.4, 0.4, 0.004, 0.0005])
    color = np.array([0.5, 0.5, 0.02, 0.8])  # in light of .8, .8, .2 and .0006
    error = black_error(np.repeat(shown[:, None], 3, axis=1), LINEAR)
    found = dark_places(row_of_faces(4), single(color), np.array([True, True, True, True]), error)
    assert found.color[:3, 0] == pytest.approx(color[:3], abs=0.003)
    assert found.deviation[2, 0] * found.color[2, 0] == pytest.approx(BLACK_DEVIATION / 0.2, rel=0.01)
    assert found.color[3, 0] == pytest.approx(np.average(color[:3]), abs=0.02)
    assert found.deviation[3, 0] * found.color[3, 0] == pytest.approx(BRIGHTEST_REFLECTANCE / np.sqrt(12.0), rel=0.01)
    assert found.told[3] < 0.01
    aside = dark_places(row_of_faces(4), single(color), np.array([True, True, True, False]), error)
    assert aside.color[3, 0] == 0.8
    assert aside.told[3] == 1.0


def test_a_dark_ceiling_is_like_the_ceiling_and_not_like_the_floor() -> None:
    """Three faces each of ceiling (.8), floor (.2) and walls (.5); one more of each, dark, shows nothing."""
    corners = {"down": "0 0 0  0 2 0  2 0 0", "up": "0 0 0  2 0 0  0 2 0", "aside": "0 0 0  2 0 0  0 0 2"}
    one_way = {way: np.array(places.split(), np.float64).reshape(3, 3) for way, places in corners.items()}
    of_way = {"down": 0.8, "up": 0.2, "aside": 0.5}
    points = np.concatenate([one_way[way] for way in of_way for _ in range(4)])
    room = bare_scan(points, np.arange(len(points)).reshape(-1, 3))
    assert room.normals[:, 2] == pytest.approx(np.repeat([-1.0, 1.0, 0.0], 4))
    dark = np.arange(12) % 4 == 3
    color = np.where(dark, 0.9, np.repeat(list(of_way.values()), 4))
    error = black_error(np.repeat(np.where(dark, 0.0, 0.4)[:, None], 3, axis=1), LINEAR)
    found = dark_places(room, single(color), np.ones(12, np.bool_), error)
    assert found.color[dark, 0] == pytest.approx([0.8, 0.2, 0.5], abs=0.05)  # .5 is the mean of all


def test_a_curve_that_is_steep_in_shadows_makes_the_black_err_more() -> None:
    shown = np.full((1, 3), 0.01)
    steep = ToneCurve(power=0.5)  # shadows are lifted: twice the contrast of light for one of the picture
    assert steep.slope(shown)[0, 0] == pytest.approx(2.0, rel=0.05)
    assert black_error(shown, steep) == pytest.approx(2.0 * black_error(shown, LINEAR), rel=0.05)


def test_a_paint_is_told_by_its_bright_faces() -> None:
    x, y = np.meshgrid(np.arange(40) * 0.1, np.arange(40) * 0.1)
    corners = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0], [0, 1, 0]]]) * 0.1
    places = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    points = (places[:, None, None] + corners).reshape(-1, 3)
    floor = bare_scan(points, np.arange(len(points)).reshape(-1, 3))
    asked = np.ones(len(floor.faces), np.bool_)
    dark = floor.centers[:, 0] < 2.0
    shown = np.repeat(np.where(dark, 0.01, 0.3)[:, None], 3, axis=1)
    scatter = np.exp(0.06 * np.random.default_rng(2).standard_normal((len(asked), 1)))  # else there are two peaks
    color = np.repeat(np.where(dark, 0.55, 0.5)[:, None] * scatter, 3, axis=1)  # the black makes dark ones too bright
    error = black_error(shown, LINEAR)
    paints = one_paint(floor, color, asked, turn_deg=0.0, shown=shown, clarity=clarity(error))
    assert np.unique(paints.paint).tolist() == [0]
    assert paints.color[:, 0] == pytest.approx(0.5, abs=0.004)  # .524 by areas alone
    found = dark_places(floor, paints, asked, error)
    assert found.deviation.max() < 0.03  # of dark faces alone .2
