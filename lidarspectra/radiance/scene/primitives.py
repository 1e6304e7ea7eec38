"""The text of Radiance primitives: safe names, finite numbers, integers as integers.

A colour is given as slot values (see `bands`). Natively it becomes a `spectrum` pattern, and the primitive itself is
white: `1 1 1` times the pattern, where any other red, green and blue would be split over the samples at 480 and 588 nm.
In rgb mode the slots are the primitive's own three numbers, the last slot as red, which Radiance writes first.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.errors import SceneError
from lidarspectra.radiance.engine.bands import BandGroup

SAFE_NAME = re.compile(r"[a-z][a-z0-9_]{0,31}")
SAFE_FILE = re.compile(r"[a-z][a-z0-9_]{0,31}\.(cal|dat|rtm)")
SAFE_WORD = re.compile(r"[A-Za-z0-9_.+\-*/^(),:]{1,200}")


@dataclass(frozen=True, kw_only=True, eq=False)
class Color:
    """What a primitive reflects, passes or sends in each slot of a pass.

    Parameters
    ----------
    group : BandGroup
        The pass's bands.
    slots : (slot,) float
        Ascending, >= 0.
    """

    group: BandGroup
    slots: FloatArray

    def __post_init__(self) -> None:
        slots = float_array(self.slots, name="Color.slots", shape=(self.group.slot_count,))
        if slots.min() < 0:
            raise SceneError(expected="slot values of 0 or more", found=f"{slots.min():g}", where="color")
        object.__setattr__(self, "slots", slots)


def number(value: float) -> str:
    """A finite number in nine digits, which single precision needs; whole numbers below 1e9 come out as integers."""
    value = float(value)
    if not np.isfinite(value):
        raise SceneError(expected="a finite number", found=f"{value}", where="scene text")
    return f"{value:.9g}" if value else "0"  # no minus zero


def primitive(
    modifier: str, kind: str, name: str, *, words: Sequence[str] = (), numbers: ArrayLike = (), per_line: int = 12
) -> str:
    """One primitive.

    Parameters
    ----------
    modifier, name : str
        Safe names; the modifier may be 'void'.
    kind : str
        Radiance's word for it.
    words : sequence of str
        String arguments.
    numbers : array-like of float
        Real arguments, in reading order.
    per_line : int
        Numbers on a line.

    Returns
    -------
    text : str
        Ending in a newline.

    Raises
    ------
    SceneError
        If a name or word could be read as anything else, or a number is not finite.
    """
    for safe in (modifier, name):
        if not SAFE_NAME.fullmatch(safe):
            raise SceneError(expected="a name of a-z, 0-9 and '_'", found=repr(safe), where=f"{kind} primitive")
    for word in words:
        if not SAFE_WORD.fullmatch(word):
            raise SceneError(expected="a plain word", found=repr(word), where=f"{kind} {name}")
    texts = [number(value) for value in np.asarray(numbers, dtype=np.float64).ravel()]
    lines = [" ".join(texts[start : start + per_line]) for start in range(0, len(texts), per_line)]
    string_line = " ".join([str(len(words)), *words])
    return "\n".join([f"{modifier} {kind} {name}", string_line, "0", " ".join([str(len(texts)), *lines[:1]])]) + (
        "\n" + "".join(f"{line}\n" for line in lines[1:])
    )


@dataclass(frozen=True, kw_only=True)
class Primitive:
    """A primitive as read back: its modifier, type and name, its words and its numbers."""

    modifier: str
    kind: str
    name: str
    words: tuple[str, ...]
    numbers: tuple[float, ...]


def read_primitives(path: Path) -> list[Primitive]:
    """Read back a file of what `primitive` writes, comments or not.

    Parameters
    ----------
    path : Path

    Returns
    -------
    primitives : list of Primitive

    Raises
    ------
    SceneError
        If the file is missing, cut or another one.
    """
    try:
        words = iter(re.sub("#.*", "", path.read_text(encoding="utf-8")).split())
        found = []
        for modifier in words:
            kind, name = next(words), next(words)
            texts, _, numbers = [[next(words) for _ in range(int(next(words)))] for _ in range(3)]
            values = tuple(float(value) for value in numbers)
            found.append(Primitive(modifier=modifier, kind=kind, name=name, words=tuple(texts), numbers=values))
    except (OSError, ValueError, StopIteration, RuntimeError) as cause:
        raise SceneError(
            expected="primitives that write_scene made, each with its three lists",
            found=f"{type(cause).__name__}: {cause}",
            where=str(path),
            todo="Make the scene stage again.",
        ) from cause
    return found


def _colored(
    kind: str, name: str, color: Color, others: Sequence[float], modifier: str, *, words: Sequence[str] = ()
) -> str:
    """A material whose first three arguments are its colour, followed by others."""
    if color.group.mode == "rgb":
        return primitive(modifier, kind, name, words=words, numbers=[*color.slots[::-1], *others])
    spectrum_name = f"{name}_slots"
    return spectrum(spectrum_name, color, modifier=modifier) + primitive(
        spectrum_name, kind, name, words=words, numbers=[1.0, 1.0, 1.0, *others]
    )


def spectrum(name: str, color: Color, *, modifier: str = "void") -> str:
    """Pattern that multiplies what it modifies by the slot values, for native mode; named at slot centres."""
    first, last = color.group.slot_ends_nm
    return primitive(modifier, "spectrum", name, numbers=[first, last, *color.slots], per_line=14)


def plastic(name: str, color: Color, *, specularity: float = 0.0, roughness: float = 0.0) -> str:
    """Diffuse color x (1 - specularity), and an uncoloured specular part."""
    return _colored("plastic", name, color, [specularity, roughness], "void")


def metal(name: str, color: Color, *, specularity: float, roughness: float) -> str:
    """Diffuse color x (1 - specularity), specular color x specularity."""
    return _colored("metal", name, color, [specularity, roughness], "void")


def trans(
    name: str, color: Color, *, specularity: float, roughness: float, transmitted: float, directly: float = 0.0
) -> str:
    """Translucent sheet: of color x (1 - specularity), `transmitted` goes through, `directly` of that unscattered."""
    return _colored("trans", name, color, [specularity, roughness, transmitted, directly], "void")


def glass(name: str, transmissivity: Color) -> str:
    """Clear thin pane of refractive index 1.52; transmissivity is per passage and without the surfaces' reflections."""
    return _colored("glass", name, transmissivity, [], "void")


def mirror(name: str, color: Color) -> str:
    """Perfectly smooth mirror, flat as its polygon, in which shadow rays find lamps' images."""
    return _colored("mirror", name, color, [], "void")


def light(name: str, radiance: Color, *, modifier: str = "void") -> str:
    """Material of a lamp's surface; `radiance` in [W/m²/sr/nm]."""
    return _colored("light", name, radiance, [], modifier)


def illum(name: str, radiance: Color, *, alternative: str, modifier: str = "void") -> str:
    """Light for shadow rays alone; other rays meet the material `alternative`."""
    return _colored("illum", name, radiance, [], modifier, words=[alternative])


def black(name: str) -> str:
    """Material that neither reflects nor sends."""
    return primitive("void", "plastic", name, numbers=[0, 0, 0, 0, 0])


def polygon(modifier: str, name: str, corners: FloatArray) -> str:
    """(corner, 3) polygon [m]; its front is where the corners run counter-clockwise."""
    return primitive(modifier, "polygon", name, numbers=corners, per_line=3)


def ring(modifier: str, name: str, center: FloatArray, normal: FloatArray, radius_m: float) -> str:
    """Disc [m]."""
    return primitive(modifier, "ring", name, numbers=[*center, *normal, 0.0, radius_m])


def sphere(modifier: str, name: str, center: FloatArray, radius_m: float) -> str:
    """Sphere [m]; a light there sends from its outside."""
    return primitive(modifier, "sphere", name, numbers=[*center, radius_m])


def mesh(modifier: str, name: str, file: str) -> str:
    """Compiled mesh (`.rtm`) with its own materials, in the folder where the program runs."""
    return primitive(modifier, "mesh", name, words=[file_word(file)])


def file_word(file: str) -> str:
    """A file beside the scene, named so that Radiance looks for it there and not along RAYPATH."""
    if not SAFE_FILE.fullmatch(file):
        raise SceneError(expected="a safe file name", found=repr(file), where="scene text")
    return f"./{file}"
