"""Rooms rendered to learn from: rays meet what they should, tiles have their size, textures keep their light."""

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="torch, of the extra 'train', is not installed")

from research.training.pictures import CLASSES  # noqa: E402
from research.training.rendered.boxes import SHELL, Rooms, clear, nearest  # noqa: E402
from research.training.rendered.dressings import DRESSINGS, PALETTES, PATTERNS, PLACES  # noqa: E402
from research.training.rendered.patterns import lay  # noqa: E402
from research.training.rendered.phone_batch import _compressed, develop  # noqa: E402
from research.training.rendered.structures import STRUCTURES, UNIT, draw_structures, seamless_noise  # noqa: E402
from research.training.rendered.surfaces import Textures, Wardrobe, find_pools  # noqa: E402
from research.training.rendered.texture_bank import GAMMA, make_bank, resized, sample_bank  # noqa: E402
from research.training.rendered.views import NO_CLASS, collages, room_views  # noqa: E402

CPU = torch.device("cpu")


def room(size, *boxes):
    """One room of this size with these boxes, (low, high) each, and nothing that shines."""
    nothing = torch.zeros((1, 1, 3))
    return Rooms(
        size=torch.tensor([size]),
        low=torch.tensor([[low for low, _ in boxes]]),
        high=torch.tensor([[high for _, high in boxes]]),
        places=torch.zeros((1, SHELL + len(boxes)), dtype=torch.int64),
        emission=torch.zeros((1, SHELL + len(boxes), 3)),
        lamps=nothing,
        power=nothing,
        radius_m=torch.zeros((1, 1)),
        ambient=torch.ones((1, 3)),
    )


@pytest.mark.parametrize(
    ("direction", "distance", "surface", "axis"),
    [
        ((1.0, 0.0, 0.0), 1.0, SHELL, 0),  # the box
        ((-1.0, 0.0, 0.0), 1.0, 0, 0),
        ((0.0, 1.0, 0.0), 2.0, 3, 1),
        ((0.0, 0.0, -1.0), 1.0, 4, 2),  # the floor
        ((0.0, 0.0, 2.0), 1.0, 5, 2),  # the ceiling, 2 m away, in lengths of the direction
    ],
)
def test_rays_meet_the_nearest_side(direction, distance, surface, axis):
    one = room((5.0, 4.0, 3.0), ((2.0, 1.0, 0.0), (3.0, 3.0, 2.0)))
    found = nearest(one, torch.tensor([[[1.0, 2.0, 1.0]]]), torch.tensor([[direction]]))
    assert float(found.distance) == pytest.approx(distance)
    assert (int(found.surface), int(found.axis)) == (surface, axis)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_of_two_boxes_in_a_row_the_nearer_is_met_whichever_comes_first(order):
    boxes = (((2.0, 1.0, 0.0), (2.5, 3.0, 2.0)), ((3.0, 1.0, 0.0), (3.5, 3.0, 2.0)))
    one = room((5.0, 4.0, 3.0), *(boxes[number] for number in order))
    found = nearest(one, torch.tensor([[[1.0, 2.0, 1.0]]]), torch.tensor([[[1.0, 0.0, 0.0]]]))
    assert float(found.distance) == pytest.approx(1.0)
    assert int(found.surface) == SHELL + order.index(0)


def test_a_box_hides_what_is_behind_it_and_nothing_beside_it():
    one = room((5.0, 4.0, 3.0), ((2.0, 1.0, 0.0), (3.0, 3.0, 2.0)))
    start = torch.tensor([[[1.0, 2.0, 1.0], [1.0, 3.5, 1.0]]])
    sight = torch.tensor([[[3.0, 0.0, 0.0], [3.0, 0.0, 0.0]]])
    assert clear(one, start, sight).tolist() == [[False, True]]
    assert clear(one, start, sight, skip=(0,)).tolist() == [[True, True]]


@pytest.mark.parametrize("name", [name for name in PATTERNS if name not in ("none", "hexagon")])
def test_places_of_one_tile_lie_within_its_width_and_length_and_fill_them(name):
    width, aspect = 0.1, 3.0
    random = np.random.default_rng(0)
    x, y = (torch.from_numpy(random.uniform(-1.0, 1.0, 200_000)) for _ in range(2))
    even = torch.ones_like(x)
    cells = lay(torch.full(x.shape, PATTERNS.index(name)), x, y, width * even, aspect * even, 7.0 * even)
    assert float(cells.edge.min()) >= -1e-9
    assert float(cells.across.min()) >= 0.0
    assert float(cells.across.max()) <= width + 1e-9
    assert float(cells.down.min()) >= 0.0
    assert float(cells.down.max()) <= aspect * width + 1e-9
    _, number, count = np.unique(np.stack([cells.column, cells.row]), axis=1, return_inverse=True, return_counts=True)
    # Whole tiles have the places of width x length: 4 m² have 200,000, and the Poisson deviation of 1,500 is 39.
    expected = 200_000 / 4.0 * width * aspect * width
    assert np.abs(np.sort(count)[-40:] - expected).max() < 5.0 * np.sqrt(expected)
    one = number == np.argmax(count)
    assert np.ptp(x[one].numpy()) * np.ptp(y[one].numpy()) == pytest.approx(aspect * width**2, rel=0.05)


def test_hexagons_have_the_width_between_their_sides_and_meet_without_gaps():
    random = np.random.default_rng(0)
    x, y = (torch.from_numpy(random.uniform(-1.0, 1.0, 100_000)) for _ in range(2))
    even = torch.ones_like(x)
    cells = lay(torch.full(x.shape, PATTERNS.index("hexagon")), x, y, 0.2 * even, even, even)
    assert float(cells.edge.min()) >= -1e-9  # no place is outside of its hexagon
    assert float(cells.edge.max()) == pytest.approx(0.1, abs=2e-3)
    _, count = np.unique(np.stack([cells.column, cells.row]), axis=1, return_counts=True)
    expected = 100_000 / 4.0 * 0.5 * 3.0**0.5 * 0.2**2
    assert np.median(np.sort(count)[-60:]) == pytest.approx(expected, rel=0.1)


@pytest.fixture(scope="module")
def bank():
    random = np.random.default_rng(1)
    textures = random.integers(0, 256, (2, 32, 32, 3)).astype(np.uint8)
    return textures, make_bank(textures, np.array([False, True]), CPU)


def test_the_finest_level_gives_texels_and_the_coarsest_the_mean(bank):
    textures, made = bank
    place = (torch.arange(32) + 0.5) / 32
    rows, columns = torch.meshgrid(place, place, indexing="ij")
    which = torch.zeros(rows.shape, dtype=torch.int64)
    fine = sample_bank(made, which, columns, rows, torch.full(rows.shape, 1e-9))
    assert np.allclose(fine.numpy(), (textures[0] / 255.0) ** GAMMA, atol=1e-5)
    coarse = sample_bank(made, which, columns, rows, torch.full(rows.shape, 9.0))
    # The coarsest level has 4 x 4 texels, each of 64 random ones: within 5 deviations of their mean.
    assert float((coarse - made.mean[0]).abs().max()) < 5.0 * 0.31 / 8.0


def test_a_texture_with_a_seam_is_continued_by_its_mirror_image_and_others_as_they_are(bank):
    _, made = bank
    u = torch.linspace(0.01, 0.99, 50)
    for which, same in ((0, u + 1.0), (1, 2.0 - u)):
        number = torch.full(u.shape, which)
        first, again = (sample_bank(made, number, each, u, torch.full(u.shape, 1e-9)) for each in (u, same))
        assert torch.allclose(first, again, atol=1e-4)


def test_noise_goes_on_across_its_edge():
    noise = seamless_noise(np.random.default_rng(0), 4.0, 4.0)
    inside = np.abs(np.diff(noise, axis=1)).max()
    assert np.abs(noise[:, 0] - noise[:, -1]).max() <= inside


def test_structures_change_no_light_in_the_mean():
    pictures, names = draw_structures(np.random.default_rng(0))
    assert set(names) == set(STRUCTURES)
    light = (pictures / 255.0) ** GAMMA
    assert np.abs(light.mean(axis=(1, 2, 3)) / UNIT - 1.0).max() < 0.02  # what is cut off at 0 and 2


def test_pictures_are_cut_to_their_middle():
    image = np.zeros((10, 30, 3), np.uint8)
    image[:, 10:20] = 200
    assert (resized(image, 8) == 200).all()


@pytest.fixture(scope="module")
def wardrobe():
    random = np.random.default_rng(2)
    names = sorted({name for each in DRESSINGS for name in each.textures})
    textures = random.integers(60, 200, (len(names), 32, 32, 3)).astype(np.uint8)
    structures, kinds = draw_structures(random)
    made = Textures(
        materials=make_bank(textures, np.zeros(len(names), np.bool_), CPU),
        structures=make_bank(structures, np.zeros(len(structures), np.bool_), CPU),
        **find_pools(names, kinds, CPU),
    )
    generator = torch.Generator(CPU)
    generator.manual_seed(3)
    return Wardrobe(made, generator)


def test_the_table_of_dressings_names_what_there_is():
    for each in DRESSINGS:
        assert set(each.places) <= set(PLACES)
        assert set(each.patterns) <= set(PATTERNS)
        assert set(each.palettes) <= set(PALETTES)
        assert set(each.fine.names) | set(each.coarse.names) <= set(STRUCTURES)


def test_surfaces_are_of_dressings_that_their_place_may_have(wardrobe):
    for place in ("ceiling", "window"):
        drawn = wardrobe.surfaces(torch.full((300,), PLACES.index(place)))
        allowed = {each.label for each in DRESSINGS if each.places.get(place, 0.0) > 0}
        assert {CLASSES[n] for n in drawn["label"].tolist()} <= allowed


@pytest.mark.parametrize("make", [room_views, collages])
def test_views_have_finite_light_and_a_class_almost_everywhere(wardrobe, make):
    batch = make(wardrobe, 4, 48)
    assert batch.light.shape == (4, 3, 48, 48)
    assert batch.label.shape == (4, 48, 48)
    assert torch.isfinite(batch.light).all()
    assert (batch.light >= 0).all()
    assert (batch.label != NO_CLASS).float().mean() > 0.5
    pictures = develop(batch.light, wardrobe)
    assert pictures.shape == batch.light.shape
    assert float(pictures.min()) >= 0.0
    assert float(pictures.max()) <= 1.0


def test_a_quantum_of_nothing_leaves_a_picture_as_it_is_and_a_coarse_one_keeps_what_is_even():
    picture = torch.rand((2, 3, 32, 32), generator=torch.Generator().manual_seed(0))
    quantum = torch.tensor([0.0, 2.0]).reshape(2, 1, 1, 1)
    found = _compressed(picture, quantum)
    assert torch.equal(found[0], picture[0])
    assert float((found[1] - picture[1]).abs().mean()) > 0.02
    even = torch.full((1, 3, 32, 32), 0.5)
    assert (
        float((_compressed(even, quantum[1:]) - even).abs().max()) < 0.02
    )  # half a step of the mean's quantum, 16/8/255
