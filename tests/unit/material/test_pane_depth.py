"""Panes by depth alone: LiDAR values behind a wall, at the distance of a mirror's image or not."""

from dataclasses import replace

import numpy as np
import pytest

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.material.frames.pane_depth import ThroughWall, through_wall
from lidarspectra.material.frames.wall_views import WallRows

SHAPE, FRAMES = (20, 30), 8
IMAGE_M = 2.0  # [m] behind the wall, at which a mirror there would have its image
PANE = (slice(5, 14), slice(8, 20))


def of_pane(box: tuple[slice, slice] = PANE) -> BoolArray:
    mask = np.zeros(SHAPE, dtype=np.bool_)
    mask[box] = True
    return mask


def rows_of(
    through: BoolArray, *, share: float = 0.4, behind_m: float | FloatArray = IMAGE_M, frames: int = FRAMES
) -> WallRows:
    """Eight values of each square, the share of those of some squares behind the wall by so much."""
    generator, squares = np.random.default_rng(2), SHAPE[0] * SHAPE[1]
    square, number = np.repeat(np.arange(squares), FRAMES), np.tile(np.arange(FRAMES), squares)
    deep = 0.02 * generator.normal(size=square.size)
    gone = through.ravel()[square] & (number < round(share * FRAMES))
    deep = np.where(gone, behind_m, deep)
    blank = np.full(square.size, np.nan)
    return WallRows(
        square=square, frame=(number + square) % frames, shown=blank, mirrored=blank, behind=blank, deep=deep,
        mirrored_deep=np.full(square.size, IMAGE_M), behind_deep=blank,
    )  # fmt: skip


def found(rows: WallRows, left: BoolArray | None = None) -> ThroughWall | None:
    return through_wall(rows, np.ones(SHAPE, dtype=np.bool_) if left is None else left)


def test_values_at_the_distance_of_the_image_are_a_mirrors() -> None:
    pane = found(rows_of(of_pane()))
    assert pane is not None
    assert (pane.kind, pane.image_share, pane.frames) == ("mirror", 1.0, FRAMES)
    assert (pane.mask >= of_pane()).all()
    assert not pane.mask[:4].any()  # a square wider at each side, at most
    assert not pane.mask[15:].any()
    assert not pane.mask[:, :7].any()
    assert not pane.mask[:, 21:].any()
    assert pane.share == pytest.approx(3 / 8 * of_pane().sum() / pane.mask.sum())


@pytest.mark.parametrize(
    ("behind_m", "kind"), [(2.25, "mirror"), (2.28, "glass"), (1.77, "mirror"), (1.75, "glass"), (3.0, "glass")]
)
def test_what_lies_beside_the_image_by_more_than_poses_err_is_seen_through_glass(behind_m: float, kind: str) -> None:
    pane = found(rows_of(of_pane(), behind_m=behind_m))  # .15 m and a twentieth of the way
    assert pane is not None
    assert pane.kind == kind
    assert pane.image_share == float(kind == "mirror")


def test_half_of_the_values_at_the_image_make_no_mirror() -> None:
    rows = rows_of(of_pane())
    deep = np.where((rows.deep > 1.0) & (rows.square % 2 == 0), 3.5, rows.deep)
    pane = found(replace(rows, deep=deep))
    assert pane is not None
    assert pane.kind == "glass"
    assert pane.image_share == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize(
    "rows",
    [
        rows_of(of_pane(), share=1 / 8),
        rows_of(of_pane(), behind_m=0.25),
        rows_of(of_pane(), frames=4),
        rows_of(of_pane((slice(5, 14), slice(8, 9)))),
        rows_of(of_pane((slice(0, 0), slice(0, 0)))),
    ],
    ids=["few values behind", "as rough as a wall is", "four frames", "an edge of a square's width", "a wall"],
)
def test_no_pane_is_told_by(rows: WallRows) -> None:
    assert found(rows) is None


def test_squares_of_three_values_tell_nothing_and_values_that_are_missing_do_not_count() -> None:
    rows = rows_of(of_pane(), share=1.0)
    number = np.tile(np.arange(FRAMES), SHAPE[0] * SHAPE[1])
    for values, is_told in ((3, False), (4, True)):
        few = replace(rows, deep=np.where(number < values, rows.deep, np.nan), frame=rows.square % FRAMES)
        pane = found(few)
        assert (pane is not None) == is_told
        if pane is not None:
            assert pane.share == pytest.approx(of_pane().sum() / pane.mask.sum())


def test_only_squares_that_are_left_are_looked_at() -> None:
    rows, left = rows_of(of_pane()), ~of_pane((slice(0, 20), slice(0, 14)))
    pane = found(rows, left)
    assert pane is not None
    assert not (pane.mask & ~left).any()
    assert pane.share == pytest.approx(3 / 8 * (of_pane() & pane.mask).sum() / pane.mask.sum())
    assert found(rows, ~of_pane((slice(3, 16), slice(6, 22)))) is None


def test_paint_that_the_lidar_met_beside_an_arm_of_what_it_went_through_is_not_covered() -> None:
    arm, post = (slice(2, 7), slice(2, 27)), (slice(2, 17), slice(2, 6))
    pane = found(rows_of(of_pane(arm) | of_pane(post)))
    assert pane is not None
    assert (pane.mask >= of_pane(arm)).all()
    assert not pane.mask[9:].any()


SMALL, LARGE = (slice(2, 8), slice(2, 8)), (slice(11, 18), slice(12, 26))


@pytest.mark.parametrize(
    ("small", "large"),
    [(SMALL, LARGE), ((slice(12, 18), SMALL[1]), (slice(2, 9), LARGE[1]))],
    ids=["the smaller is met first", "upside down"],
)
def test_the_larger_of_two_is_told_first(small: tuple[slice, slice], large: tuple[slice, slice]) -> None:
    pane = found(rows_of(of_pane(small) | of_pane(large)))
    assert pane is not None
    assert (pane.mask >= of_pane(large)).all()
    assert not (pane.mask & of_pane(small)).any()
