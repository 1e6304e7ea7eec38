"""Windows and other light that nobody named: found where the picture is cut, and told apart from the lamps'."""

from dataclasses import replace
from unittest.mock import patch

import numpy as np
import pytest
from scipy.sparse import csr_array

from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Panel
from lidarspectra.material.delighting import unknown_light
from lidarspectra.material.delighting.albedo import fit_light
from lidarspectra.material.delighting.light_evidence import LightEvidence
from lidarspectra.material.delighting.sharpened_cones import srgb_of_cones
from lidarspectra.material.delighting.unknown_light import (
    LOBES,
    UnknownSource,
    find_unknown_sources,
    opening_patterns,
    source_patterns,
    surely_shine,
)
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.workflow.materials.delighting_samples import seen_lit


def sheet(corner: tuple[float, ...], along: tuple[float, ...], up: tuple[float, ...], steps: int) -> np.ndarray:
    """(face, 3, 3) triangles of a parallelogram, facing along x up."""
    start, first, second = np.array(corner), np.array(along) / steps, np.array(up) / steps
    faces = []
    for i in range(steps):
        for j in range(steps):
            cell = start + i * first + j * second
            faces += [(cell, cell + first, cell + first + second), (cell, cell + first + second, cell + second)]
    return np.array(faces)


def room_with_window() -> tuple[Scan, np.ndarray]:
    """A floor of 4 m x 4 m, a window of 1 m x 1 m in a wall at x = 0, a screen of 4 cm; and which faces shine."""
    floor = sheet((0, -2, 0), (4, 0, 0), (0, 4, 0), 8)
    window = sheet((0, -0.5, 1), (0, 1, 0), (0, 0, 1), 10)
    led = sheet((3, 1, 1), (0, 0.2, 0), (0, 0, 0.2), 2)
    corners = np.concatenate([floor, window, led])
    shines = np.zeros(len(corners), dtype=np.bool_)
    shines[len(floor) :] = True
    return bare_scan(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3)), shines


def test_what_shines_is_one_source_a_window_and_a_highlight_is_none() -> None:
    scan, shines = room_with_window()
    (source,) = find_unknown_sources(scan, shines)
    assert source.area_m2 == pytest.approx(1.0)
    assert source.center == pytest.approx([0.0, 0.0, 1.5])
    assert source.normal == pytest.approx([1.0, 0.0, 0.0])
    assert source.is_pane
    assert find_unknown_sources(scan, np.zeros_like(shines)) == ()


def test_a_desk_cut_at_white_below_a_window_is_a_source_of_its_own_and_a_rough_pane_is_one() -> None:
    scan, _ = room_with_window()
    # It touches the window's lower edge, and looks up.
    desk = sheet((0, -0.5, 1), (1, 0, 0), (0, 1, 0), 10)
    corners = np.concatenate([scan.vertices[scan.faces], desk])
    joined = bare_scan(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    shines = np.concatenate([room_with_window()[1], np.ones(len(desk), dtype=np.bool_)])
    first, second = find_unknown_sources(joined, shines)
    assert (first.area_m2, second.area_m2) == pytest.approx((1.0, 1.0))
    assert sorted((first.is_upright, second.is_upright)) == [False, True]
    assert [first.is_beside, second.is_beside] == [False, False]  # alike, as a window round a corner
    small = find_unknown_sources(joined, shines & (joined.centers[:, 0] < 0.45))
    assert [(each.is_pane, each.is_beside) for each in small] == [(True, False), (False, True)]
    pane = first if first.is_upright else second
    assert pane.normal == pytest.approx([1.0, 0.0, 0.0])
    # Normals that a phone turned by 15 degrees (standard deviation) leave a pane in one piece.
    rough = scan.vertices.copy()
    shining = np.unique(scan.faces[room_with_window()[1]])
    places, same = np.unique(rough[shining].round(6), axis=0, return_inverse=True)
    rough[shining, 0] += np.random.default_rng(2).normal(scale=0.02, size=len(places))[same.reshape(-1)]
    (source,) = find_unknown_sources(bare_scan(rough, scan.faces), room_with_window()[1])
    assert source.area_m2 == pytest.approx(1.0, rel=0.15)


def test_the_panes_of_a_window_round_a_corner_are_two_sources() -> None:
    panes = [sheet((0, 0, 1), (0, 1, 0), (0, 0, 1), 10), sheet((0, 0, 1), (0, 0, 1), (1, 0, 0), 10)]
    corners = np.concatenate(panes)
    scan = bare_scan(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    found = find_unknown_sources(scan, np.ones(len(scan.faces), dtype=np.bool_))
    assert sorted(each.normal.round(6).tolist() for each in found) == [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]
    assert all(each.is_pane for each in found)


def test_a_lamps_shade_is_one_source_whose_sides_look_all_ways() -> None:
    x, y, z = 0.3 * np.eye(3)
    zero = np.zeros(3)
    sides = [
        sheet(tuple(corner), tuple(along), tuple(up), 6)
        for corner, along, up in (
            (zero, x, z), (x, y, z), (x + y, -x, z), (y, -y, z), (zero, y, x), (z, x, y),
        )
    ]  # fmt: skip
    corners = np.concatenate(sides)
    scan = bare_scan(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    assert ((scan.centers - 0.15) * scan.normals).sum(axis=1).min() > 0.0  # all look outwards
    (source,) = find_unknown_sources(scan, np.ones(len(scan.faces), dtype=np.bool_))
    assert source.area_m2 == pytest.approx(6 * 0.3**2)
    assert not source.is_pane, "a window looks one way"


@pytest.mark.parametrize(("zenith", "horizon"), [(1.0, 1.0), (1.0, 1.0 / 3.0)])
def test_even_and_overcast_skies_are_in_the_span_of_a_windows_lobes(zenith: float, horizon: float) -> None:
    # A large window before a point of the opposite wall is all that the point sees: half of it is sky.
    scan = bare_scan(sheet((0, -20, -20), (0, 40, 0), (0, 0, 40), 80).reshape(-1, 3), np.arange(38400).reshape(-1, 3))
    every = np.arange(len(scan.faces))
    source = UnknownSource(faces=every, center=np.zeros(3), normal=np.array([1.0, 0.0, 0.0]), area_m2=1600.0)
    away, facing = np.array([[1.5, 0.0, 0.0]]), np.array([[-1.0, 0.0, 0.0]])
    with patch.object(unknown_light, "PLACES", 20_000):
        patterns = source_patterns(scan, RayCaster(scan), source, away, facing, np.random.default_rng(5))[:, 0]
    found = zenith * patterns[0] + horizon * patterns[1]
    # Irradiance of an upright surface from half a sky of radiance horizon + (zenith - horizon) sin h, over pi.
    assert found == pytest.approx(0.5 * (horizon + (zenith - horizon) * 4.0 / (3.0 * np.pi)), rel=0.04)


def test_light_of_a_window_is_that_of_its_solid_angle_and_falls_or_rises() -> None:
    scan, shines = room_with_window()
    (source,) = find_unknown_sources(scan, shines)
    positions = np.array([[3.0, 0.0, 1.5], [2.0, 0.0, 0.02], [2.0, 0.0, 2.6], [2.0, 0.0, -0.5]])
    normals = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.0, 0.0, 1.0]])
    patterns = source_patterns(scan, RayCaster(scan), source, positions, normals, np.random.default_rng(1))
    assert patterns.shape == (LOBES, 4)
    # Form factor from a point to a parallel rectangle before it, four quarters (Howell's catalogue, B-3).
    a = 0.5 / 3.0
    quarter = a / np.hypot(1, a) * np.arctan(a / np.hypot(1, a)) / np.pi
    assert patterns[:, 0].sum() == pytest.approx(4 * quarter, rel=0.02)
    on_floor, on_ceiling, below = patterns[:, 1], patterns[:, 2], patterns[:, 3]
    assert on_floor[2] == 0
    assert on_floor[0] > 0
    assert on_floor[0] + on_floor[1] == pytest.approx(on_floor.sum())
    assert on_ceiling[:2].sum() == 0
    assert on_ceiling[2] > 0
    assert below.sum() == 0  # the floor is between


def test_what_lies_beyond_the_scan_shines_in_from_where_nothing_is_met() -> None:
    scan, _ = room_with_window()
    positions, normals = np.array([[2.0, 1.0, 0.02], [2.0, 0.0, -1.0]]), np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    patterns = opening_patterns(RayCaster(scan), positions, normals, np.random.default_rng(1))
    assert patterns[:, 0] == pytest.approx([2 / 3, 1 / 3, 0.0], abs=0.02)  # nearly all is open above
    assert patterns[:, 1] == pytest.approx([0.0, 0.0, 1.0])


def test_a_lamp_that_looks_dark_beside_a_bright_window_was_off() -> None:
    scan, shines = room_with_window()
    lamps = [
        Lamp(
            name=name,
            shape=Panel(0.4, 0.4),
            center=np.array([x, 0.0, 0.05]),
            normal=np.array([0.0, 0.0, 1.0]),
            flux=Spectrum(wavelengths_nm=[400, 700], values=[1.0, 1.0]),
        )
        for name, x in (("dark", 1.0), ("lit", 3.0))
    ]
    shown = np.full((len(scan.faces), 3), 0.2)
    known = ~shines
    known[np.linalg.norm(scan.centers - [3.0, 0.0, 0.0], axis=1) < 0.4] = False
    sources = find_unknown_sources(scan, shines)
    lit, off = seen_lit(scan, shown, known, lamps, sources)
    assert ([lamp.name for lamp in lit], off) == (["lit"], ("dark",))
    nothing = np.ones_like(known)  # a picture that shows no light at all tells nothing of lamps
    assert seen_lit(scan, shown, nothing, lamps, ()) == (tuple(lamps), ())
    bright = seen_lit(scan, np.full_like(shown, 0.8), known, lamps, sources)
    assert bright == (tuple(lamps), ())


def lit_by_both(generator: np.random.Generator) -> tuple[LightEvidence, np.ndarray]:
    """Four surfaces under a lamp and a window of another colour; and their reflectance in cones."""
    count, groups = 100, 4
    group = np.repeat(np.arange(groups), count)
    reflectance = np.array([[0.7, 0.7, 0.66], [0.3, 0.25, 0.2], [0.12, 0.16, 0.2], [0.5, 0.5, 0.45]])[group]
    lamp, steep, flat, rising = generator.uniform(0.2, 1.8, (4, group.size))
    light = 0.4 * lamp[:, None] * np.array([1.0, 0.9, 0.7])
    light = light + (0.5 * steep + 0.3 * flat + 0.1 * rising)[:, None] * np.array([0.8, 1.0, 1.3])
    shown = srgb_of_cones(0.5 * reflectance * light)
    evidence = LightEvidence(
        shown=shown,
        direct=np.repeat(lamp[None, :, None], 3, axis=2),
        emission=np.ones((1, group.size)),
        exchange=csr_array((group.size, group.size + 1)),
        face_shown=shown,
        face_area=np.ones(group.size),
        face_lamp=np.zeros(group.size, dtype=np.bool_),
        group=group,
        cell=np.arange(group.size),
        ceiling=group == 0,
        white=np.zeros(group.size, dtype=np.bool_),
        unsure=np.zeros((group.size, 3)),
        other=np.stack([steep, flat, rising])[None],
        other_upright=np.array([True]),
    )
    return evidence, reflectance


def apart(evidence: LightEvidence, reflectance: np.ndarray) -> tuple[float, float]:
    """Deviation of log reflectances within surfaces, and the share of the light that is the lamp's."""
    fit = fit_light(evidence, flux_deviation=np.array([0.15]))
    error = np.log(fit.reflectance / reflectance)
    within = max(float(np.std(error[evidence.group == number])) for number in range(4))
    other = 0.0 if fit.other is None else float(fit.other.mean())
    return within, 1.0 - other / float(fit.straight.mean())


def test_lamp_and_window_are_told_apart_by_their_patterns() -> None:
    evidence, reflectance = lit_by_both(np.random.default_rng(3))
    within, share = apart(evidence, reflectance)
    assert within < 0.08  # the tone curve's priors bend dark surfaces
    assert share == pytest.approx(0.4 * 0.87 / (0.4 * 0.87 + 0.9 * 1.03), abs=0.04)
    within_without, _ = apart(replace(evidence, other=None, other_upright=None), reflectance)
    assert within_without > 0.2


def test_a_room_lit_by_its_window_alone_needs_no_lamp() -> None:
    evidence, _ = lit_by_both(np.random.default_rng(3))
    dark = replace(
        evidence, direct=np.zeros((0, *evidence.direct.shape[1:])), emission=np.zeros((0, len(evidence.group)))
    )
    fit = fit_light(dark, flux_deviation=np.zeros(0))
    assert fit.flux_factors.shape == (0,)
    assert fit.other is not None
    assert fit.other == pytest.approx(fit.straight)
    assert (fit.radiosity > 0).all()


def test_how_well_a_sources_strength_is_known_is_stated() -> None:
    found = [fit_light(lit_by_both(np.random.default_rng(seed))[0], flux_deviation=np.array([0.15])) for seed in (3, 4)]
    for fit in found:
        assert fit.radiosity_deviation.shape == fit.radiosity.shape
        assert (fit.radiosity_deviation < 0.5).all()
    apart = np.abs(np.log(found[0].radiosity / found[1].radiosity))
    assert (apart < 3.0 * np.hypot(*(fit.radiosity_deviation for fit in found))).all()


def test_paint_that_is_cut_at_white_is_no_source_while_its_strength_is_hardly_known() -> None:
    falls = np.ones((1, 3))
    known, hardly = np.full((1, 3), 0.15), np.full((1, 3), 0.5)
    assert surely_shine(8.0 * falls, known, falls).all()
    assert not surely_shine(3.6 * falls, hardly, falls).any()
    assert not surely_shine(1.9 * falls, 0.0 * known, falls).any()  # fits err by as much
    assert surely_shine(falls * (1.0, 1.0, 8.0), known, falls).all()  # a blue lamp sends much in one cone alone
