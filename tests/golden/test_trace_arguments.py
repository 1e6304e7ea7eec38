"""The exact arguments that the engine is run with: a change of any is a change of method."""

import pytest

from lidarspectra.radiance.engine.bands import band_groups
from lidarspectra.radiance.engine.options import BOUNCES, PassOptions, first_round_sizes, plain_arguments

NATIVE = PassOptions(
    group=band_groups(14, "native")[0],
    lamp_modifiers=("lamp0", "lamp1"),
    octree="pass0.oct",
    bounces=BOUNCES["ultra"],
    lamp_count=2,
)
RGB = PassOptions(
    group=band_groups(3, "rgb")[0], lamp_modifiers=("lamp0",), octree="pass0.oct", bounces=2, lamp_count=1
)


def test_direct_light_is_asked_for_by_these_arguments() -> None:
    assert " ".join(NATIVE.direct_arguments(4)) == (
        "-h- -fdf -V+ -c 4 -u+ -bv+ -dt 0 -dc 1 -dr 2 -dp 0 -ss 1 -st 0.01 -aa 0 -as 0 -av 0 0 0 "
        "-I+ -ab 0 -dj 1 -ds 0.05 -dv+ -cs 14 -cw 380 800 -m lamp0 -m lamp1 pass0.oct"
    )


def test_reflected_light_is_asked_for_by_these_arguments() -> None:
    assert " ".join(NATIVE.gather_arguments(233, bounces=20, lamps_visible=False)) == (
        "-h- -fdf -V+ -c 233 -u+ -bv+ -dt 0 -dc 1 -dr 2 -dp 0 -ss 1 -st 0.01 -aa 0 -as 0 -av 0 0 0 "
        "-I- -dv- -dj 1 -ds 0.3 -ab 19 -ad 1 -lw 0.4 -lr -40 -cs 14 -cw 380 800 -m lamp0 -m lamp1 pass0.oct"
    )


def test_light_reflected_once_ends_where_its_rays_arrive() -> None:
    once = NATIVE.gather_arguments(34, bounces=1, lamps_visible=False)
    assert once[once.index("-ab") + 1] == "0"


def test_light_in_a_narrow_view_includes_the_lamps() -> None:
    assert "-dv+" in NATIVE.gather_arguments(233, bounces=20, lamps_visible=True)


def test_classic_rgb_names_no_slots() -> None:
    assert " ".join(RGB.gather_arguments(8, bounces=2, lamps_visible=False)) == (
        "-h- -fdf -V+ -c 8 -u+ -bv+ -dt 0 -dc 1 -dr 2 -dp 0 -ss 1 -st 0.01 -aa 0 -as 0 -av 0 0 0 "
        "-I- -dv- -dj 1 -ds 0.3 -ab 1 -ad 1 -lw 0.4 -lr -22 -m lamp0 pass0.oct"
    )


def test_a_plain_run_for_stock_radiance() -> None:
    assert " ".join(plain_arguments("low", "standard", lamp_count=12)) == (
        "-I+ -u+ -bv+ -dt 0 -dc 1 -dr 2 -dp 0 -ss 1 -st 0.01 -aa 0 -as 0 -av 0 0 0 -dj 1 -ds 0.1 "
        "-ab 2 -ad 1024 -lw 0.000390625 -lr -22"
    )


def test_accuracies_are_the_papers_reflections() -> None:
    assert BOUNCES == {"low": 2, "medium": 8, "high": 14, "ultra": 20}


@pytest.mark.parametrize(
    ("target", "sizes"),
    [(0.2, (5, 34)), (0.05, (5, 34)), (0.03, (13, 89)), (0.02, (13, 89)), (0.01, (34, 233)), (0.001, (34, 233))],
)
def test_a_finer_target_starts_with_no_fewer_paths(target: float, sizes: tuple[int, int]) -> None:
    assert first_round_sizes(target) == sizes
