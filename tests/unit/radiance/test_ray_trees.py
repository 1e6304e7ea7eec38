"""Ray trees: what rtrace tells of every ray, read back whole."""

import numpy as np
import pytest

from lidarspectra.errors import EngineError
from lidarspectra.radiance.engine.engine import EngineRun
from lidarspectra.radiance.engine.ray_trees import covered_by_ancestor, read_ray_trees

SLOTS = 3
Ray = tuple[int, float, float, np.ndarray, np.ndarray]  # ancestors, weight, length, coefficient, contribution


def record(ray: Ray) -> bytes:
    depth, weight, length, coefficient, contribution = ray
    numbers = [weight, length, *(0.5, 1.0, 1.5), *(0.0, 0.0, 1.0), *coefficient, *contribution]
    return b"\t" * depth + b"~\t" + np.array(numbers, dtype=np.float32).tobytes()


def run_of(*rays: Ray, more: bytes = b"") -> EngineRun:
    output = b"".join(map(record, rays)) + more
    return EngineRun(argv=("rtrace",), status=0, stderr="", seconds=0.0, output=output)


def grey(value: float) -> np.ndarray:
    return np.full(SLOTS, value)


# One walk: it reflects twice (0.5 each), and at each corner looks at a lamp of radiance 10 in 1 % of the half space.
WALK: tuple[Ray, ...] = (
    (3, 0.25, 2.0, grey(0.25 * 0.005), grey(0.25 * 0.05)),  # looks at the lamp from the last corner
    (2, 0.25, 3.0, grey(0.25), grey(0.25 * 0.05)),
    (2, 0.5, 1.0, grey(0.5 * 0.005), grey(0.0)),  # a look that something blocks
    (1, 0.5, 4.0, grey(0.5), grey(0.25 * 0.05)),
    (1, 1.0, 2.0, grey(0.005), grey(0.05)),  # looks from the first corner
    (0, 1.0, 5.0, grey(1.0), grey(0.05 + 0.25 * 0.05)),
)


def test_a_walk_comes_back_with_its_parents_and_its_looks_at_lamps() -> None:
    rays = read_ray_trees(run_of(*WALK), trees=1, slots=SLOTS)
    np.testing.assert_allclose(rays.length, [2.0, 3.0, 4.0, 2.0, 5.0])  # without the blocked look
    np.testing.assert_array_equal(rays.parent, [1, 2, 4, 4, -1])
    np.testing.assert_array_equal(rays.shadow, [True, False, False, True, False])
    np.testing.assert_array_equal(rays.reflection[~rays.shadow], [2, 1, 0])
    np.testing.assert_allclose(rays.contribution[-1], 0.0625)
    np.testing.assert_allclose(rays.coefficient[1], 0.25)
    np.testing.assert_allclose(rays.origin[0], [0.5, 1.0, 1.5])


def test_rays_know_which_tree_they_belong_to() -> None:
    single: Ray = (0, 1.0, 1.0, grey(1.0), grey(0.0))
    rays = read_ray_trees(run_of(single, *WALK, single), trees=3, slots=SLOTS)
    np.testing.assert_array_equal(rays.tree, [0, 1, 1, 1, 1, 1, 2])


def test_a_followed_ray_that_brings_nothing_is_kept_for_something_may_stand_before_it() -> None:
    dark: tuple[Ray, ...] = ((1, 0.5, 4.0, grey(0.5), grey(0.0)), (0, 1.0, 5.0, grey(1.0), grey(0.0)))
    rays = read_ray_trees(run_of(*dark), trees=1, slots=SLOTS)
    assert len(rays) == 2
    assert not rays.shadow.any()


@pytest.mark.parametrize("field", [1, 2, 3, 4, 5, 6, 7])  # length, origin, direction
@pytest.mark.parametrize("offset", [0, 1, 2])
def test_numbers_that_look_like_a_mark_mislead_nobody(field: int, offset: int) -> None:
    output = bytearray(run_of(*WALK, WALK[-1]).output)
    size = 2 + 4 * (8 + 2 * SLOTS)
    marks = [index for index in range(len(output) - size + 1) if output[index : index + 2] == b"~\t"]
    for mark in marks:
        place = mark + 2 + 4 * field + offset
        output[place : place + 2] = b"~\t"
    spoilt = EngineRun(argv=("rtrace",), status=0, stderr="", seconds=0.0, output=bytes(output))
    rays = read_ray_trees(spoilt, trees=2, slots=SLOTS)
    assert len(marks) == len(WALK) + 1
    np.testing.assert_array_equal(rays.tree, [0, 0, 0, 0, 0, 1])
    np.testing.assert_array_equal(rays.parent, [1, 2, 4, 4, -1, -1])


@pytest.mark.parametrize("radiance", [10.0, 0.0])
def test_a_look_at_a_lamp_through_glass_is_one_behind_it_too(radiance: float) -> None:
    look, pane = 0.005, 0.9
    rays = read_ray_trees(
        run_of(
            (2, 0.9, 2.0, grey(look * pane), grey(look * pane * radiance)),
            (1, 1.0, 1.0, grey(look), grey(look * pane * radiance)),
            (1, 0.5, 3.0, grey(0.5), grey(0.0)),
            (0, 1.0, 5.0, grey(1.0), grey(look * pane * radiance)),
        ),
        trees=1,
        slots=SLOTS,
    )
    lit = [True, True] if radiance else []  # a look that ends behind the pane on something dark is left out as a whole
    np.testing.assert_array_equal(rays.shadow, [*lit, False, False])
    np.testing.assert_array_equal(rays.parent, [1, 3, 3, -1] if radiance else [1, -1])


@pytest.mark.parametrize(
    ("run", "trees", "words"),
    [
        (run_of(*WALK), 2, "2 whole trees, found 1"),
        (run_of(*WALK[:-1]), 1, "1 whole trees, found 0"),
        (run_of(*WALK, more=b"\t\t"), 1, "records of"),
        (run_of(*WALK, more=b"what?"), 1, "records of"),
        (run_of((0, 1.0, 1.0, grey(1.0), grey(np.nan))), 1, "finite numbers"),
        (run_of((0, 1.0, 1.0, grey(np.inf), grey(1.0))), 1, "finite numbers"),
    ],
)
def test_an_answer_that_is_none_is_refused(run: EngineRun, trees: int, words: str) -> None:
    with pytest.raises(EngineError, match=words):
        read_ray_trees(run, trees=trees, slots=SLOTS)


def test_what_stands_behind_a_chosen_ray_is_covered_however_far() -> None:
    rays = read_ray_trees(run_of(*WALK), trees=1, slots=SLOTS)
    #                  look, second, first, look, walk
    chosen = np.array([True, False, True, True, False])
    np.testing.assert_array_equal(covered_by_ancestor(rays, chosen), [True, False, False, False, False])
    np.testing.assert_array_equal(covered_by_ancestor(rays, np.ones(5, dtype=bool)), [True, True, True, True, False])
    assert not covered_by_ancestor(rays, np.zeros(5, dtype=bool)).any()
