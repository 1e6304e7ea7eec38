"""What a file says of faces: colours of several textures and of corners, and names that stay with their faces."""

import numpy as np
import pytest

from lidarspectra.errors import ArrayError
from lidarspectra.geometry.appearance import CLOSED_KINDS, DRAWN, NO_COLOR, PHOTOGRAPHED, Appearance
from lidarspectra.spectra.colorimetry import encode_srgb

RED, GREEN, BLUE = np.array([0.8, 0.1, 0.1]), np.array([0.1, 0.6, 0.1]), np.array([0.1, 0.1, 0.4])  # linear


def plain(color: np.ndarray, side: int = 4) -> np.ndarray:
    """A texture of one colour."""
    return np.full((side, side, 3), color, dtype=np.float32)


def named(kinds: tuple[str, ...], face_kind: list[int], source: list[int] | None = None) -> Appearance:
    """Faces of one colour that are parts of things."""
    count = len(face_kind)
    return Appearance(
        images=(), face_image=np.full(count, -1), corner_uv=np.zeros((count, 3, 2)),
        corner_color=np.full((count, 3, 3), 0.5), color_source=None if source is None else np.array(source),
        kinds=kinds, face_kind=np.array(face_kind),
    )  # fmt: skip


def names(appearance: Appearance) -> list[str | None]:
    """What each face is part of, in words."""
    return [None if kind < 0 else appearance.kinds[kind] for kind in appearance.face_kinds]


def test_points_on_faces_of_several_textures_and_of_none_have_each_the_colour_of_its_own_face() -> None:
    """As an OBJ with a material a wall has them; they are asked for in any order, many at once."""
    generator = np.random.default_rng(2)
    appearance = Appearance(
        images=(plain(RED), plain(GREEN)), face_image=np.array([1, -1, 0]),
        corner_uv=generator.uniform(0.2, 0.8, (3, 3, 2)), corner_color=np.full((3, 3, 3), encode_srgb(BLUE)),
    )  # fmt: skip
    faces = generator.integers(0, 3, size=50)
    barycentric = generator.dirichlet(np.ones(3), size=50)
    expected = np.stack([GREEN, BLUE, RED])[faces]
    np.testing.assert_allclose(appearance.sample(faces, barycentric), expected, atol=1e-6)  # single precision
    for face, color in enumerate((GREEN, BLUE, RED)):
        one = appearance.sample(np.array([face]), np.full((1, 3), 1 / 3))
        np.testing.assert_allclose(one[0], color, atol=1e-6)
    np.testing.assert_allclose(appearance.face_colors(), [GREEN, BLUE, RED], atol=1e-6)
    assert appearance.sample(faces[:0], barycentric[:0]).shape == (0, 3)


def test_all_pixels_of_all_textures_are_counted() -> None:
    textures = (plain(RED, 8), np.zeros((2, 16, 3), dtype=np.float32))
    appearance = Appearance(
        images=textures, face_image=np.array([0]), corner_uv=np.zeros((1, 3, 2)), corner_color=np.zeros((1, 3, 3))
    )
    assert appearance.pixels == 8 * 8 + 2 * 16


def test_faces_that_are_added_keep_their_names_and_those_of_none_get_none() -> None:
    room = named(("wall", "door", "table"), [0, 2, -1, 1])
    added = named(("closed ceiling", "door"), [0, -1, 1])
    assert names(room.with_more(added)) == ["wall", "table", None, "door", "closed ceiling", None, "door"]
    assert names(room.with_more(named((), [-1]))) == ["wall", "table", None, "door", None]


def test_only_named_walls_without_photographs_are_a_model_of_a_room() -> None:
    drawn, bare, photographed = [DRAWN] * 4, [NO_COLOR] * 4, [PHOTOGRAPHED] * 4
    assert named(("wall",), [0, 0, 0, -1], drawn).is_drawn
    assert not named(("wall",), [0, 0, 0, -1], photographed).is_drawn  # a scan whose app named its walls
    assert not named((), [-1] * 4, bare).is_drawn  # an STL
    assert not named(("table",), [0] * 4, drawn).is_drawn


def test_without_names_a_drawn_colour_is_a_surfaces_own_and_what_closes_the_room_is_still_known() -> None:
    closed = CLOSED_KINDS[0]
    plain_room = named(("wall", closed), [0, 1, -1], [DRAWN, NO_COLOR, PHOTOGRAPHED]).without_names()
    assert plain_room.sources.tolist() == [PHOTOGRAPHED, NO_COLOR, PHOTOGRAPHED]
    assert names(plain_room) == [None, closed, None]


@pytest.mark.parametrize("face_kind", [[0, 2], [-2, 0]])
def test_a_face_that_is_part_of_nothing_that_is_named_is_refused(face_kind: list[int]) -> None:
    with pytest.raises(ArrayError, match="kinds of parts from -1 to 1"):
        named(("wall", "door"), face_kind)
