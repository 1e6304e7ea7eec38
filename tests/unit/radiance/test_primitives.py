"""Scene text: nothing of the user's reaches it, and numbers are what they were."""

import numpy as np
import pytest

from lidarspectra.errors import ArrayError, SceneError
from lidarspectra.radiance.engine.bands import band_groups
from lidarspectra.radiance.scene import primitives
from lidarspectra.radiance.scene.primitives import Color

NATIVE = band_groups(3, "native")[0]
RGB = band_groups(3, "rgb")[0]


@pytest.mark.parametrize("name", ["!ls", "a b", "lamp;", "Lamp", "", "1m", "m\nvoid", "../m", "ä", "m" * 40])
def test_names_that_could_be_read_otherwise_are_refused(name: str) -> None:
    with pytest.raises(SceneError):
        primitives.black(name)
    with pytest.raises(SceneError):
        primitives.polygon(name, "p", np.zeros((3, 3)))


@pytest.mark.parametrize("file", ["/etc/passwd", "../room.rtm", "!cat.rtm", "a b.rtm", "room.rad", "room.rtm\n"])
def test_files_outside_the_scene_are_refused(file: str) -> None:
    with pytest.raises(SceneError):
        primitives.mesh("void", "room", file)


@pytest.mark.parametrize("word", ["!ls", "a b", "$(x)", "`x`", "a;b", "a\n", '"a"', "a|b", "#a"])
def test_words_that_a_shell_or_parser_could_take_apart_are_refused(word: str) -> None:
    with pytest.raises(SceneError):
        primitives.primitive("void", "brightfunc", "beam", words=[word])


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_none_are_refused(value: float) -> None:
    with pytest.raises(SceneError):
        primitives.number(value)


@pytest.mark.parametrize("value", [0.1, 1e-30, 123456.789, -2.5, 3e38, 1 / 3])
def test_numbers_keep_single_precision(value: float) -> None:
    assert np.float32(primitives.number(value)) == np.float32(value)


def test_whole_numbers_are_written_as_integers() -> None:
    assert [primitives.number(value) for value in (0.0, -0.0, 1.0, 1048576.0)] == ["0", "0", "1", "1048576"]


def test_negative_light_is_refused() -> None:
    with pytest.raises(SceneError):
        Color(group=NATIVE, slots=[0.1, -0.1, 0.1])
    with pytest.raises(ArrayError):
        Color(group=NATIVE, slots=[0.1, np.nan, 0.1])


def test_the_longest_slot_is_red() -> None:
    text = primitives.plastic("m0", Color(group=RGB, slots=[0.1, 0.2, 0.3]))
    assert text == "void plastic m0\n0\n0\n5 0.3 0.2 0.1 0 0\n"


def test_native_colours_are_a_spectrum_on_slot_centres_under_a_white_primitive() -> None:
    text = primitives.light("lamp0", Color(group=NATIVE, slots=[1, 2, 3]))
    assert text == ("void spectrum lamp0_slots\n0\n0\n5 447 715 1 2 3\nlamp0_slots light lamp0\n0\n0\n3 1 1 1\n")
