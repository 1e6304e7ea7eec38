"""Receptors and the directions drawn for them."""

from pathlib import Path

import numpy as np
import pytest

from lidarspectra.errors import SensorError
from lidarspectra.radiance.sampling.receptors import (
    FIBONACCI,
    Receptor,
    cone_receptor,
    cosine_receptor,
    draw_directions,
    read_receptor,
)

AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, -0.6, 0.8]])


def test_cosine_receptor_has_measure_pi() -> None:
    assert cosine_receptor().measure_sr == pytest.approx(np.pi)


def test_cone_receptor_has_the_measure_of_its_cone() -> None:
    # ∫ cosθ dω up to θ is π sin²θ; 1e-6 is the error of the trapezoids.
    assert cone_receptor(20.5).measure_sr == pytest.approx(np.pi * np.sin(np.radians(20.5)) ** 2, rel=1e-6)


def test_a_cone_of_ninety_degrees_is_the_cosine_receptor() -> None:
    assert cone_receptor(90.0).is_cosine


@pytest.mark.parametrize("receptor", [cosine_receptor(), cone_receptor(20.5)])
def test_directions_are_unit_vectors_within_the_view(receptor: Receptor) -> None:
    directions = draw_directions(receptor, AXES, sets=3, count=55, generator=np.random.default_rng(1))
    cosines = np.einsum("pkmc,pc->pkm", directions, AXES)
    assert directions.shape == (3, 3, 55, 3)
    assert np.linalg.norm(directions, axis=-1) == pytest.approx(1.0, abs=1e-12)
    assert cosines.min() >= np.cos(np.radians(receptor.angles_deg[-1])) - 1e-9


def test_directions_of_the_cosine_receptor_integrate_cosines_exactly_enough() -> None:
    # Mean of cosθ under density cosθ/π is 2/3, of a horizontal component 0; a lattice of 987 errs by some 1/987.
    directions = draw_directions(cosine_receptor(), AXES, sets=4, count=987, generator=np.random.default_rng(1))
    mean = directions.mean(axis=2)
    assert np.abs(mean - 2.0 / 3.0 * AXES[:, None]).max() < 2e-3


def test_a_tabulated_receptor_draws_in_proportion_to_its_table() -> None:
    # R = 1 up to 30 degrees, then linearly to 0 at 60: the drawn mean of cosθ is ∫R cosθ sinθ dθ / ∫R sinθ dθ.
    receptor = Receptor(angles_deg=np.array([0.0, 30.0, 60.0]), response=np.array([1.0, 1.0, 0.0]))
    angle = np.linspace(0.0, np.pi / 3.0, 100_001)
    weight = np.interp(np.degrees(angle), receptor.angles_deg, receptor.response) * np.sin(angle)
    expected = np.sum(weight * np.cos(angle)) / np.sum(weight)
    directions = draw_directions(receptor, AXES[:1], sets=8, count=987, generator=np.random.default_rng(2))
    assert directions[..., 2].mean() == pytest.approx(expected, abs=2e-4)  # 1/987/sqrt(8), with a margin


def test_every_set_has_a_shift_of_its_own() -> None:
    directions = draw_directions(cosine_receptor(), AXES[:1], sets=2, count=8, generator=np.random.default_rng(3))
    assert np.abs(directions[0, 0] - directions[0, 1]).max() > 0.1


def test_a_lattice_beats_independent_directions() -> None:
    # A half-lit sky seen sideways: the lattice's variance is less than a third of that of independent directions.
    count = 233
    directions = draw_directions(cosine_receptor(), AXES[:1], sets=400, count=count, generator=np.random.default_rng(4))
    estimates = (directions[0, ..., 0] > 0.3).mean(axis=1)
    share = estimates.mean()
    assert estimates.var() < share * (1 - share) / count / 3.0


def test_the_same_seed_draws_the_same_directions() -> None:
    first, second = (
        draw_directions(cosine_receptor(), AXES, sets=2, count=13, generator=np.random.default_rng(7)) for _ in range(2)
    )
    assert np.array_equal(first, second)


def test_sizes_of_sets_are_fibonacci_numbers() -> None:
    triples = zip(FIBONACCI[:-2], FIBONACCI[1:-1], FIBONACCI[2:], strict=True)
    assert all(third == first + second for first, second, third in triples)


@pytest.mark.parametrize(
    ("angles", "response"),
    [([0.0, 91.0], [1.0, 1.0]), ([5.0, 60.0], [1.0, 1.0]), ([0.0, 60.0], [1.0, -0.1]), ([0.0, 60.0], [0.0, 0.0])],
)
def test_an_impossible_receptor_is_refused(angles: list[float], response: list[float]) -> None:
    with pytest.raises(SensorError, match="receptor"):
        Receptor(angles_deg=np.array(angles), response=np.array(response))


@pytest.mark.parametrize("angle", [0.0, -1.0, 91.0])
def test_an_impossible_view_is_refused(angle: float) -> None:
    with pytest.raises(SensorError, match="half angle"):
        cone_receptor(angle)


def test_a_table_of_the_cosine_is_the_cosine_receptor(tmp_path: Path) -> None:
    rows = "\n".join(f"{angle},{max(np.cos(np.radians(angle)), 0.0)}" for angle in range(0, 91))
    (tmp_path / "head.csv").write_text("# a diffuser\nangle_deg,response\n" + rows + "\n", encoding="utf-8")
    # Linear between whole degrees: the mean error of a cosine there is 2.5e-5.
    assert read_receptor(tmp_path / "head.csv").measure_sr == pytest.approx(np.pi, rel=1e-4)


@pytest.mark.parametrize(
    "text", ["", "angle,response\n0,1\n", "angle_deg,response\n0,1\n10\n", "angle_deg,response\n5,1\n9,1\n"]
)
def test_other_tables_are_refused_in_words(tmp_path: Path, text: str) -> None:
    (tmp_path / "head.csv").write_text(text, encoding="utf-8")
    with pytest.raises(SensorError, match="head"):
        read_receptor(tmp_path / "head.csv")
