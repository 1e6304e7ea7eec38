"""Paths that all sensors share: fair samples of where the sensors' rays arrive."""

import numpy as np
import pytest

from lidarspectra.radiance.sampling import pooling
from lidarspectra.radiance.sampling.arrivals import LampBodies, Scattering, Surfaces
from lidarspectra.radiance.sampling.pooling import PooledPaths, Sharing, draw_pooled_paths, sort_into_cells
from lidarspectra.radiance.sampling.receptors import cosine_receptor
from lidarspectra.radiance.sampling.rough_light import RoughLight
from lidarspectra.radiance.sampling.sensor_rays import Sensors

BATCHES = 3
REFLECTANCES = (0.8, 0.1)  # of the box's walls in turn


class Box:
    """Answers rays in a box of 3 m, in place of an Embree scene."""

    def __init__(self, *, matt: bool = True, diffuse: bool = False) -> None:
        self.surfaces = Surfaces(
            caster=self,
            face_material=np.arange(6) % 2,
            scattering=Scattering(  # the last stands for lamps, of which there are none
                is_matt=np.array([matt, matt, True]),
                is_diffuse=np.array([diffuse, diffuse, False]),
                reflectance=np.array([*REFLECTANCES, 0.0])[:, None] * diffuse,
                diffuse_part=np.array([*REFLECTANCES, 0.0])[:, None],
                transmissivity=np.zeros(3),
            ),
            cell_m=0.6,
            diffuse_share=1.0,
            bounds=np.array([[0.0] * 3, [3.0] * 3]),
            shading_normals=np.zeros((6, 3, 3), dtype=np.float32),
            face_body=np.empty(0, dtype=np.int64),
            bodies=LampBodies.of([], []),
        )
        self.normals = np.concatenate([np.eye(3), -np.eye(3)])

    def nearest(self, origins, directions):
        with np.errstate(divide="ignore"):
            walls = np.concatenate([-origins / directions, (3.0 - origins) / directions], axis=1)
        walls[walls <= 1e-9] = np.inf
        face = walls.argmin(axis=1)
        weights = np.full((len(face), 3), 1.0 / 3.0)
        met = np.ones(len(face), dtype=bool)
        return type("Hits", (), {"face": face, "distance": walls.min(axis=1), "met": met, "barycentric": weights})


def sensors(count: int) -> Sensors:
    places = np.random.default_rng(2).uniform(0.5, 2.5, (count, 3))
    return Sensors(positions=places, normals=np.tile([0.0, 0.0, 1.0], (count, 1)), receptor=cosine_receptor())


def draw(
    count: int, paths: int, *, seed: int = 1, matt: bool = True, diffuse: bool = False, sharers: int = 1
) -> PooledPaths:
    surfaces, generator = Box(matt=matt, diffuse=diffuse).surfaces, np.random.default_rng(seed)
    return draw_pooled_paths(
        surfaces, sensors(count), paths, batches=BATCHES, values=1, sharers=sharers, generator=generator
    )


def answer(pooled: PooledPaths, light) -> np.ndarray:
    """(batch, sensor) estimates where a leg's ray finds so much light: `light` (ray, 6) -> (ray,)."""
    for leg in pooled.legs:
        half = len(leg.rays) // 2
        found = {"rest": 1.0, "whole": 3.0, "first": 2.0}[leg.reach] * light(leg.rays)[:, None]
        for part in (slice(half, None), slice(half)):
            assert pooled.missing > 0
            pooled.take(leg, part, found[part])
    assert pooled.missing == 0
    return pooled.estimates()[..., 0]


def everywhere(rays: np.ndarray) -> np.ndarray:
    return np.ones(len(rays))


def test_light_that_is_the_same_everywhere_comes_out_as_it_is() -> None:
    assert answer(draw(20, 89), everywhere) == pytest.approx(1.0)


@pytest.mark.parametrize("diffuse", [False, True])
@pytest.mark.parametrize(("count", "paths"), [(1, 55), (4, 89), (60, 233)])
def test_about_as_many_paths_are_drawn_as_were_wanted(count: int, paths: int, diffuse: bool) -> None:
    assert 0.6 * paths < len(draw(count, paths, diffuse=diffuse).cell) / BATCHES < 2.0 * paths


def test_a_lone_sensor_is_sampled_by_paths_of_its_own() -> None:
    # All its rays are followed, so that its estimate is their plain mean and no light is moved.
    pooled = draw(1, 55)
    whole, first = pooled.legs
    assert (whole.reach, first.reach, len(whole.rays)) == ("whole", "first", BATCHES * 55)
    np.testing.assert_array_equal(whole.rays, first.rays)
    values = stripes(whole.rays).reshape(BATCHES, 55)
    assert answer(pooled, stripes)[:, 0] == pytest.approx(values.mean(axis=1))


@pytest.mark.parametrize("sharers", [1, 16])
def test_the_sum_over_sensors_is_unbiased_for_light_of_any_pattern(sharers: int) -> None:
    # A pattern far finer than a cell (stripes of 4 cm). 100 draws of about 3 x 89 paths of variance 1/4: the mean over
    # sensors is known to 0.5 / sqrt(27,000) = 0.3 %, the wanted one over 466,000 rays to 0.1 %; five of both. Where
    # passes share a band a sensor sends 5 rays a batch rather than 8; seeds are fixed.
    found = [answer(draw(20, 89, seed=seed, sharers=sharers), stripes).mean() for seed in range(100)]
    wanted = [stripes(rays_of(20, 1000 + seed)).mean() for seed in range(100)]
    assert np.mean(found) == pytest.approx(np.mean(wanted), abs=0.016)


def test_it_is_unbiased_too_where_paths_go_on_from_bright_walls_more_often_than_from_dark_ones() -> None:
    # As above, the light that reaches a wall being striped and the walls' reflectances 0.8 and 0.1: at most 0.4 of
    # standard deviation a path.
    found = [answer(draw(20, 89, seed=seed, diffuse=True), stripes_here).mean() for seed in range(100)]
    wanted = []
    for seed in range(100):
        rays = rays_of(20, 1000 + seed)
        reflectance = np.array(REFLECTANCES)[Box().nearest(rays[:, :3], rays[:, 3:]).face % 2]
        wanted.append((reflectance * stripes(rays)).mean())
    assert np.mean(found) == pytest.approx(np.mean(wanted), abs=0.013)


def test_rays_that_go_on_leave_a_wall_in_proportion_to_the_cosine() -> None:
    (rest,) = draw(20, 610, diffuse=True).legs
    starts, directions = rest.rays[:, :3], rest.rays[:, 3:]
    off = np.abs(np.minimum(starts, 3.0 - starts) - 1e-4)  # from the walls, less what rays start off them
    assert off.min(axis=1).max() < 1e-9
    wall = off.argmin(axis=1)
    inward = np.where(starts[np.arange(len(wall)), wall] < 1.5, 1.0, -1.0)
    cosine = inward * directions[np.arange(len(wall)), wall]
    assert np.linalg.norm(directions, axis=1) == pytest.approx(1.0)
    assert cosine.min() > 0
    # cos² is uniform. 1,800 random numbers would be within 0.03 of it but for six in a million draws; these lie evenly.
    assert np.abs(np.sort(cosine**2) - (np.arange(len(wall)) + 0.5) / len(wall)).max() < 0.03


class Walls:
    """The box's six walls as patches, each its own group."""

    def __len__(self) -> int:
        return 6

    def place_of(self, arrivals) -> np.ndarray:
        walls = np.concatenate([np.abs(arrivals.places), np.abs(3.0 - arrivals.places)], axis=1)
        return walls.argmin(axis=1)


def slope(rays: np.ndarray) -> np.ndarray:
    """Light that grows along the box, where rays start."""
    return rays[:, 0] - 0.2 * rays[:, 2]


def along_the_box(*strengths: float) -> RoughLight:
    """For each value so much of what `slope` says, times the walls' reflectances."""
    middles = 1.5 + 1.5 * np.concatenate([-np.eye(3), np.eye(3)])
    there = np.column_stack([slope(middles), np.tile([1.0, 0.0, -0.2], (6, 1))])
    whole = (np.array(REFLECTANCES)[np.arange(6) % 2][:, None] * there).ravel()
    return RoughLight(places=middles, functions=np.outer(whole, strengths).astype(np.float32), length_m=1.0)


def moved_light(seed: int, *strengths: float) -> np.ndarray:
    """(batch, sensor, value) by how much 20 sensors' estimates differ from the light along their own rays."""
    sharing = Sharing(patches=Walls(), group=np.arange(6), rough=along_the_box(*strengths))
    pooled = draw_pooled_paths(
        Box(diffuse=True).surfaces,
        sensors(20),
        89,
        batches=BATCHES,
        values=len(strengths),
        sharing=sharing,
        generator=np.random.default_rng(seed),
    )
    own = np.stack([share @ along_the_box(1.0).functions for share in pooled.rough_shares])
    answer(pooled, slope)
    return pooled.estimates() - own


def test_cells_move_only_the_light_that_was_not_known_roughly(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pooling, "VALUES_AT_ONCE", 2)
    nothing_known, half, all_of_it = np.moveaxis(moved_light(1, 0.0, 0.5, 1.0), -1, 0)
    assert np.sqrt(np.mean(nothing_known**2)) > 0.005
    # But for the 0.1 mm that rays start off their wall.
    assert half == pytest.approx(0.5 * nothing_known, abs=1e-4)
    assert all_of_it == pytest.approx(0.0, abs=1e-4)
    # The mean over all sensors is 0 whatever is known.
    assert np.mean([moved_light(seed, 0.5).mean() for seed in range(100)]) == pytest.approx(0.0, abs=2e-3)


def rays_of(count: int, seed: int) -> np.ndarray:
    generator = np.random.default_rng(seed)
    return sensors(count).draw_rays(np.arange(count), sets=1, count=233, generator=generator).reshape(-1, 6)


def stripes(rays: np.ndarray) -> np.ndarray:
    """Where rays arrive."""
    hits = Box().nearest(rays[:, :3], rays[:, 3:])
    return pattern(rays[:, :3] + hits.distance[:, None] * rays[:, 3:])


def stripes_here(rays: np.ndarray) -> np.ndarray:
    """Where rays start."""
    return pattern(rays[:, :3])


def pattern(places: np.ndarray) -> np.ndarray:
    return (np.floor(places.sum(axis=1) / 0.04) % 2).astype(float)


def test_glossy_surfaces_are_seen_by_each_sensor_for_itself() -> None:
    pooled = draw(5, 89, matt=False)
    for share in pooled.shares:
        used = (share > 0).sum(axis=0)
        assert np.max(used) == 1


def test_cells_keep_kinds_apart_and_stay_small() -> None:
    generator = np.random.default_rng(4)
    places, kind = generator.random((2000, 3)), generator.integers(0, 3, 2000)
    cell = sort_into_cells(places, kind, most=40, longest_m=0.3)
    sizes = np.bincount(cell)
    assert sizes.min() > 0
    assert sizes.max() <= 40
    for number in range(len(sizes)):
        inside = cell == number
        assert len(set(kind[inside])) == 1
        assert np.ptp(places[inside], axis=0).max() <= 0.3


def test_neighbours_share_a_cell() -> None:
    # 4,000 points in a box of 1 m, 40 a cell: a hundredth of its volume has sides of 0.22 m. Points that were put
    # together at random would be 0.66 m apart.
    places = np.random.default_rng(5).random((4000, 3))
    cell = sort_into_cells(places, np.zeros(4000, dtype=np.int64), most=40, longest_m=2.0)
    centers = np.stack([np.bincount(cell, weights=column) / np.bincount(cell) for column in places.T], axis=1)
    assert np.linalg.norm(places - centers[cell], axis=1).mean() < 0.2
