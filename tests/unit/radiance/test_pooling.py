"""Paths that all sensors share: fair samples of where the sensors' rays arrive."""

import numpy as np
import pytest

from lidarspectra.errors import SceneError
from lidarspectra.radiance import pooling
from lidarspectra.radiance.pooling import PooledPaths, Surfaces, draw_pooled_paths, sort_into_cells
from lidarspectra.radiance.receptors import cosine_receptor
from lidarspectra.radiance.sensor_rays import Sensors

BATCHES = 3


class Box:
    """Answers rays in a box of 3 m, in place of an Embree scene."""

    def __init__(self, *, matt: bool = True) -> None:
        self.surfaces = Surfaces(
            caster=self,  # type: ignore[arg-type]
            face_material=np.zeros(6, dtype=np.int64),
            is_matt=np.array([matt]),
            cell_m=0.6,
        )
        self.normals = np.concatenate([np.eye(3), -np.eye(3)])

    def nearest(self, origins, directions):
        with np.errstate(divide="ignore"):
            walls = np.concatenate([-origins / directions, (3.0 - origins) / directions], axis=1)
        walls[walls <= 1e-9] = np.inf
        face = walls.argmin(axis=1)
        return type("Hits", (), {"face": face, "distance": walls.min(axis=1), "met": np.ones(len(face), dtype=bool)})


def sensors(count: int) -> Sensors:
    places = np.random.default_rng(2).uniform(0.5, 2.5, (count, 3))
    return Sensors(positions=places, normals=np.tile([0.0, 0.0, 1.0], (count, 1)), receptor=cosine_receptor())


def draw(count: int, paths: int, *, seed: int = 1, matt: bool = True) -> PooledPaths:
    return draw_pooled_paths(
        Box(matt=matt).surfaces, sensors(count), paths, batches=BATCHES, values=1, generator=np.random.default_rng(seed)
    )


def answer(pooled: PooledPaths, values: np.ndarray) -> np.ndarray:
    """(batch, sensor) estimates where a path is worth so much."""
    everything = slice(None)
    pooled.take(everything, 3.0 * values[:, None], whole=True)
    assert pooled.missing == len(values)
    pooled.take(everything, 2.0 * values[:, None], whole=False)
    assert pooled.missing == 0
    return pooled.estimates()[..., 0]


def test_light_that_is_the_same_everywhere_comes_out_as_it_is() -> None:
    pooled = draw(20, 89)
    assert answer(pooled, np.ones(len(pooled.rays))) == pytest.approx(1.0)


@pytest.mark.parametrize(("count", "paths"), [(1, 55), (4, 89), (60, 233)])
def test_about_as_many_paths_are_drawn_as_were_wanted(count: int, paths: int) -> None:
    assert 0.6 * paths < len(draw(count, paths).rays) / BATCHES < 2.0 * paths


def test_a_lone_sensor_is_sampled_by_paths_of_its_own() -> None:
    # All its rays are followed, so that its estimate is their plain mean and no light is moved.
    pooled = draw(1, 55)
    assert len(pooled.rays) == BATCHES * 55
    values = np.random.default_rng(3).random(len(pooled.rays))
    assert answer(pooled, values)[:, 0] == pytest.approx(values.reshape(BATCHES, 55).mean(axis=1))


def test_the_sum_over_sensors_is_unbiased_for_light_of_any_pattern() -> None:
    # A pattern far finer than a cell (stripes of 4 cm). 100 draws of about 3 x 89 paths of variance 1/4: the mean over
    # sensors is known to 0.5 / sqrt(27,000) = 0.3 %, the wanted one over 466,000 rays to 0.1 %; five of both.
    found, wanted = [], []
    for seed in range(100):
        pooled = draw(20, 89, seed=seed)
        arrived = stripes(pooled.rays)
        found.append(answer(pooled, arrived).mean())
        rays = sensors(20).draw_rays(np.arange(20), sets=1, count=233, generator=np.random.default_rng(1000 + seed))
        wanted.append(stripes(rays.reshape(-1, 6)).mean())
    assert np.mean(found) == pytest.approx(np.mean(wanted), abs=0.016)


def stripes(rays: np.ndarray) -> np.ndarray:
    hits = Box().nearest(rays[:, :3], rays[:, 3:])
    places = rays[:, :3] + hits.distance[:, None] * rays[:, 3:]
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


def test_points_in_one_place_share_a_cell_however_many() -> None:
    assert sort_into_cells(np.zeros((50, 3)), np.zeros(50, dtype=np.int64), most=4, longest_m=0.1).max() == 0


MATERIALS = """# as edited by hand
void spectrum a_slots
0
0
5 400 700 0.1 0.2 0.3
a_slots plastic a
0
0
5 1 1 1 0.02 0.1
void plastic b
0
0
5 1 1 1 0.4 0
void metal c
0
0
5 1 1 1 0.9 0
void glass d
0
0
3 1 1 1
"""


def test_materials_are_matt_unless_they_gleam_or_pass_light(tmp_path) -> None:
    (tmp_path / "m.rad").write_text(MATERIALS)
    assert pooling._are_matt(["a", "b", "c", "d"], tmp_path / "m.rad").tolist() == [True, False, False, False]


@pytest.mark.parametrize("text", [None, MATERIALS[:-4], MATERIALS.replace("glass d", "glass e"), "void plastic d 0 0"])
def test_materials_that_are_cut_or_missing_are_an_error_of_ours(tmp_path, text: str | None) -> None:
    if text is not None:
        (tmp_path / "m.rad").write_text(text)
    with pytest.raises(SceneError, match=r"m\.rad"):
        pooling._are_matt(["a", "d"], tmp_path / "m.rad")
