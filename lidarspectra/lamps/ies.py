"""Luminaires as their makers measure them: IES LM-63 candela files, type C.

The table I(θ, φ) [cd] has θ from straight down and φ counter-clockwise seen from above. Only its shape is used with a
lamp's spectrum: I(θ, φ)/Φ_v [1/sr], where Φ_v = ∫I dω is the table's own flux,

    ∫∫ I sinθ dθ dφ = Σ_cells Δφ ∫ (a + bθ) sinθ dθ,

exact for the bilinear interpolant that Radiance uses as well.
"""

import math
import re
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.errors import LampError

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,2})?")  # finite, and nothing that only Python reads
# Of files that say how they were made where earlier ones have the ballast-lamp photometric factor.
GENERATION_TYPE = re.compile(r"^\s*IES(NA)?\s*:\s*LM-63-(20)?19\s*$", flags=re.MULTILINE | re.IGNORECASE)
LARGEST_NUMBER = 1e12  # [1] of a file: four are multiplied for a candela value
METRES_PER_FOOT = 0.3048  # [m/ft] international foot
MAX_BYTES = 20_000_000  # [B] a table of 720 x 360 directions has 2 MB
MAX_ANGLES = 1000  # of either kind; goniometers step by half a degree at the finest
POINT_DIAMETER_M = 0.1  # [m] of a luminaire whose file gives no opening
LINE_WIDTH_M = 0.026  # [m] of one whose file gives a length alone: a T8 tube's
ELLIPSE = math.sqrt(math.pi) / 2.0  # [1] sides of a rectangle over the axes of an ellipse of its area


@dataclass(frozen=True, kw_only=True, eq=False)
class CandelaTable:
    """Luminous intensity of a luminaire by direction.

    Parameters
    ----------
    vertical_deg : (vertical,) float
        θ from straight down, ascending from 0 to 180. [deg]
    horizontal_deg : (horizontal,) float
        φ from the luminaire's length, ascending from 0 to 360; a single 0 for axial symmetry. [deg]
    candela : (horizontal, vertical) float
        [cd]
    opening_m : tuple of float
        Luminous opening: (length, width), or (diameter,). [m]
    name : str
        What the file calls it.
    lamps_lm : float or None
        Luminous flux of the lamps in it, as the file states it; None of absolute photometry, which states none. [lm]
    """

    vertical_deg: FloatArray
    horizontal_deg: FloatArray
    candela: FloatArray
    opening_m: tuple[float, ...]
    name: str = ""
    lamps_lm: float | None = None

    def __post_init__(self) -> None:
        vertical = float_array(self.vertical_deg, name="CandelaTable.vertical_deg", shape=(None,))
        horizontal = float_array(self.horizontal_deg, name="CandelaTable.horizontal_deg", shape=(None,))
        shape = (horizontal.size, vertical.size)
        object.__setattr__(self, "vertical_deg", vertical)
        object.__setattr__(self, "horizontal_deg", horizontal)
        object.__setattr__(self, "candela", float_array(self.candela, name="CandelaTable.candela", shape=shape))

    @property
    def is_axial(self) -> bool:
        """Whether φ makes no difference."""
        return self.horizontal_deg.size == 1

    def luminous_flux_lm(self, *, upward: bool | None = None) -> float:
        """Flux ∫I dω of the interpolated table [lm]; of its upper (θ > 90°) or lower half where `upward` says so."""
        theta, values = self.vertical_deg, self.candela
        if upward is not None:
            theta = np.union1d(theta, [90.0])
            theta = theta[theta >= 90.0] if upward else theta[theta <= 90.0]
            values = np.stack([np.interp(theta, self.vertical_deg, row) for row in self.candela])
        turns = np.radians(self.horizontal_deg)
        around = values[0] * 2 * np.pi if self.is_axial else np.trapezoid(values, turns, axis=0)
        return float(_ring_flux(np.radians(theta), np.asarray(around)))

    def at(self, vertical_deg: ArrayLike, horizontal_deg: ArrayLike) -> FloatArray:
        """Intensity in some directions, bilinear between the table's angles.

        Parameters
        ----------
        vertical_deg, horizontal_deg : (n,) float
            θ and φ. [deg]

        Returns
        -------
        candela : (n,) float
            [cd]
        """
        theta = np.asarray(vertical_deg, dtype=np.float64)
        if self.is_axial:
            return np.asarray(np.interp(theta, self.vertical_deg, self.candela[0]))
        phi = np.mod(np.asarray(horizontal_deg, dtype=np.float64), 360.0)
        from scipy.interpolate import RegularGridInterpolator  # loads slowly, and few lamps need it

        between = RegularGridInterpolator((self.horizontal_deg, self.vertical_deg), self.candela)
        inside = np.clip(theta, self.vertical_deg[0], self.vertical_deg[-1])
        return np.asarray(between(np.stack(np.broadcast_arrays(phi, inside), axis=-1)), dtype=np.float64)


def _ring_flux(theta: FloatArray, around: FloatArray) -> float:
    """∫ J(θ) sinθ dθ for J linear between samples [rad]: ∫(a + bθ) sinθ = [-(a + bθ) cosθ + b sinθ]."""
    slope = np.diff(around) / np.diff(theta)
    lower, upper = theta[:-1], theta[1:]
    parts = around[:-1] * np.cos(lower) - around[1:] * np.cos(upper) + slope * (np.sin(upper) - np.sin(lower))
    return float(parts.sum())


def read_ies_text(path: Path) -> str:
    """Text of a candela file; makers write it in ASCII, with umlauts of any encoding in its keywords.

    Raises
    ------
    LampError
        If it cannot be read, or is too big to be one.
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise _unreadable(str(path), f"a file of {path.stat().st_size // 1_000_000} MB")
        content = path.read_bytes()
    except OSError as cause:
        raise _unreadable(str(path), str(cause.strerror or cause), todo="Mend 'file' of this lamp.") from cause
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = content.decode("utf-16", errors="replace")  # as some editors of Windows save it
    else:
        try:
            text = content.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = content.decode("latin-1")  # every byte is a letter there
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_ies(text: str, *, where: str) -> CandelaTable:
    """Read an IES LM-63 file (1986, 1991, 1995, 2002 or 2019).

    Symmetric tables are unfolded: 0-90° and 0-180° by mirroring, 90-270° likewise. TILT=INCLUDE is read over: its
    factors are for lamps that are mounted tilted. Candela are multiplied by the file's multiplier and ballast factors;
    the second of these says since 2019 how the file was made (1.1 by an accredited laboratory), and is no factor there.

    Parameters
    ----------
    text : str
        The file's text.
    where : str
        Its name, for errors.

    Returns
    -------
    table : CandelaTable

    Raises
    ------
    LampError
        If it is no LM-63 file, is cut short, has numbers left over, is of photometric type A or B, or sends no light.
    """
    tilt = re.search(r"^\s*TILT\s*=\s*(.*?)\s*$", text, flags=re.MULTILINE | re.IGNORECASE)
    if tilt is None:
        raise _unreadable(where, "no line TILT=...")
    if tilt[1].upper() not in ("NONE", "INCLUDE"):
        raise _unreadable(
            where, f"TILT={tilt[1][:40]}, another file", todo="Set TILT=NONE: it stands as it was measured."
        )
    numbers = _Numbers(text[tilt.end() :], where)
    if tilt[1].upper() == "INCLUDE":
        numbers.take(1)
        numbers.take(2 * numbers.count("tilt angles"))
    lamps, lumens, multiplier = numbers.take(3)
    verticals, horizontals = numbers.count("vertical angles"), numbers.count("horizontal angles")
    photometric_type, unit = numbers.take(2)
    width, length, height = numbers.take(3) * (METRES_PER_FOOT if unit == 1 else 1.0)
    ballast, photometric = numbers.take(3)[:2]
    # LM-63-2002 keeps the second for future use: a 0 there is no factor.
    factor = ballast * (1.0 if photometric == 0 or GENERATION_TYPE.search(text[: tilt.start()]) else photometric)
    vertical, horizontal = numbers.take(verticals), numbers.take(horizontals)
    candela = numbers.take(verticals * horizontals).reshape(horizontals, verticals)
    if (rest := numbers.numbers_left()) > 0:
        raise _unreadable(
            where,
            f"{rest} more numbers than {horizontals} x {verticals} candela",
            todo="Write decimals with points: to LM-63 a comma ends a number. Else correct the numbers of angles.",
        )
    if photometric_type != 1:
        raise _unreadable(where, f"photometric type {'CBA'[int(photometric_type) - 1:][:1] or photometric_type}",
                          todo="Convert it to type C, as all interior luminaires have it.")  # fmt: skip
    if unit not in (1, 2) or lamps < 0:
        raise _unreadable(where, f"unit {unit:g} (1 is feet, 2 is metres)")
    horizontal, candela = _unfolded(horizontal, candela * multiplier * factor, where)
    vertical, candela = _whole_circle(vertical, candela, where)
    table = CandelaTable(
        vertical_deg=vertical,
        horizontal_deg=horizontal,
        candela=candela,
        opening_m=_opening(width, length, height),
        name=_keyword(text, "LUMCAT") or _keyword(text, "LUMINAIRE"),
        lamps_lm=float(lamps * lumens * factor) if lamps > 0 and lumens > 0 else None,
    )
    if candela.min() < 0 or table.luminous_flux_lm() <= 0:
        raise _unreadable(where, "negative candela, or none at all")
    return table


class _Numbers:
    """The numbers after TILT, taken in order; commas and line ends are spaces."""

    def __init__(self, text: str, where: str) -> None:
        self._words = iter(text.replace(",", " ").split())
        self._where = where

    def take(self, count: int) -> FloatArray:
        values = []
        for _ in range(count):
            word = next(self._words, None)
            if word is None:
                raise _unreadable(self._where, "an end before the last candela value")
            if not NUMBER.fullmatch(word):
                raise _unreadable(self._where, f"'{word[:40]}' where a number should be")
            values.append(float(word))
            if abs(values[-1]) > LARGEST_NUMBER:
                raise _unreadable(self._where, f"the number {word[:40]}")
        return np.array(values)

    def numbers_left(self) -> int:
        """How many numbers follow, up to the first word that is none."""
        return sum(1 for _ in takewhile(NUMBER.fullmatch, self._words))

    def count(self, of: str) -> int:
        value = float(self.take(1)[0])
        if not (value == int(value) and 1 <= value <= MAX_ANGLES):
            raise _unreadable(self._where, f"{value:g} {of}")
        return int(value)


def _unfolded(horizontal: FloatArray, candela: FloatArray, where: str) -> tuple[FloatArray, FloatArray]:
    """Table over all of 0 to 360 degrees, by the symmetry that LM-63 reads from the last angle."""
    if np.any(np.diff(horizontal) <= 0):
        raise _unreadable(where, "horizontal angles that do not ascend")
    first, last = float(horizontal[0]), float(horizontal[-1])
    if horizontal.size == 1:
        return np.zeros(1), candela
    if (first, last) == (0.0, 90.0):
        horizontal = np.concatenate([horizontal, 180.0 - horizontal[-2::-1]])
        candela = np.concatenate([candela, candela[-2::-1]])
        first, last = 0.0, 180.0
    if (first, last) == (90.0, 270.0):  # mirrored at the 90-270 plane: φ and 180 - φ are alike
        inner = (horizontal > 90.0) & (horizontal <= 180.0)
        outer = (horizontal > 180.0) & (horizontal < 270.0)
        angles = np.concatenate([180.0 - horizontal[inner], horizontal, 540.0 - horizontal[outer], [360.0]])
        rows = np.concatenate([candela[inner], candela, candela[outer], candela[horizontal == 180.0]])
        if not np.any(horizontal == 180.0):
            raise _unreadable(where, "no plane at 180 degrees between 90 and 270")
        order = np.argsort(angles, kind="stable")
        return angles[order], rows[order]
    if (first, last) == (0.0, 180.0):
        return (
            np.concatenate([horizontal, 360.0 - horizontal[-2::-1]]),
            np.concatenate([candela, candela[-2::-1]]),
        )
    if first == 0.0 and 180.0 < last < 360.0:  # some files leave out the closing plane
        return np.append(horizontal, 360.0), np.concatenate([candela, candela[:1]])
    if (first, last) != (0.0, 360.0):
        raise _unreadable(where, f"horizontal angles from {first:g} to {last:g}", todo="Type C starts at 0, or at 90.")
    return horizontal, candela


def _whole_circle(vertical: FloatArray, candela: FloatArray, where: str) -> tuple[FloatArray, FloatArray]:
    """Table over all of 0 to 180 degrees; dark where the file has no angles."""
    if np.any(np.diff(vertical) <= 0) or vertical[0] < 0 or vertical[-1] > 180 or vertical.size < 2:
        raise _unreadable(
            where, f"vertical angles from {vertical[0]:g} to {vertical[-1]:g} that do not ascend in 0 to 180"
        )
    step = 1e-3  # [deg] over which a table that stops short falls to zero
    if vertical[0] > 0:
        vertical = np.concatenate([[0.0, vertical[0] - step], vertical])
        candela = np.pad(candela, ((0, 0), (2, 0)))
    if vertical[-1] < 180:
        vertical = np.concatenate([vertical, [vertical[-1] + step, 180.0]])
        candela = np.pad(candela, ((0, 0), (0, 2)))
    return vertical, candela


def _opening(width: float, length: float, height: float) -> tuple[float, ...]:
    """Luminous opening [m], flat: (length, width) or (diameter,).

    Negative sizes are round (LM-63-1995 and -2002, Table 1): two are a disc or an ellipse, which becomes the rectangle
    of its area and proportions; a width alone is a disc, a sphere or an upright cylinder; one of two is the diameter of
    a tube that lies along the other. Where only one size is above 0 it is a tube, or an upright rectangle's, whose
    other side is the height.
    """
    across, along, tall = float(abs(width)), float(abs(length)), float(abs(height))
    if across > 0 and along > 0:
        if width > 0 or length > 0:
            return (along, across)
        return (across,) if across == along else (ELLIPSE * along, ELLIPSE * across)
    if width < 0 or (length < 0 and tall == 0):
        return (max(across, along),)
    if along > 0:
        return (along, tall or LINE_WIDTH_M)
    return (tall or LINE_WIDTH_M, across) if across > 0 else (POINT_DIAMETER_M,)


def _keyword(text: str, name: str) -> str:
    found = re.search(rf"^\s*\[{name}\]\s*(.*?)\s*$", text, flags=re.MULTILINE)
    return found[1] if found else ""


def _unreadable(where: str, found: str, todo: str = "Ask the maker for the LM-63 file again.") -> LampError:
    return LampError(expected="an IES LM-63 candela file of type C", found=found, where=where, todo=todo)
