"""Luminaires as European makers publish them: EULUMDAT files (.ldt), turned into LM-63 text.

pyldt reads the file and unfolds its symmetry. Its planes C count like LM-63's φ, counter-clockwise seen from above, but
start across the luminaire where LM-63 starts along it, and its intensities are per 1,000 lm of the lamps inside:

    φ = C - 90°,    I [cd] = I [cd/klm] · Φ_lamps/1000 · conversion factor

Several sets of lamps are alternatives; the first counts. A tilt during the measurement is read over, as in LM-63: the
table stands as it was measured.
"""

from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import LampError

if TYPE_CHECKING:
    from pyldt import Ldt

MAX_BYTES = 5_000_000  # [B] 721 planes of 361 angles have 2 MB
MAX_PLANES, MAX_ANGLES = 721, 361  # half a degree each way, the finest that the format foresees
MAX_CANDELA = 1e12  # [cd] a lighthouse has 1e7
LINE_OF_PLANES, LINE_OF_ANGLES = 3, 5  # counted from 0
FIRST_SIZE, SIZES_BEFORE_SETS = 12, 13  # line of the first size, counted from 0; sizes and factors up to the sets
HEAD_LINES = 200  # that are looked at
MAX_SETS = 20  # the format's own limit
LM_PER_KLM = 1000.0  # [1]
MM_PER_M = 1000.0  # [1]
AXIAL = 1  # symmetry indicator: the same in all planes


def ies_text_of_ldt(path: Path) -> str:
    """LM-63 text of the luminaire in an EULUMDAT file.

    Parameters
    ----------
    path : Path

    Returns
    -------
    text : str
        IES LM-63-2002, type C, in metres and candela, for `ies.read_ies`.

    Raises
    ------
    LampError
        If the file is missing, no EULUMDAT file, cut short, or states no lumens.
    """
    from pyldt import LdtReader  # here, since few lamps are of such files

    _check_size(path)
    try:
        luminaire = LdtReader.read(path)
        return _ies_text(luminaire, str(path))
    except (OSError, ValueError, IndexError, OverflowError) as cause:
        raise _unreadable(str(path), f"{type(cause).__name__}: {str(cause)[:100]}") from cause


def _check_size(path: Path) -> None:
    """Refuse what is too big to be a luminaire before a table of that size is made."""
    try:
        if path.stat().st_size > MAX_BYTES:
            raise _unreadable(str(path), f"a file of {path.stat().st_size // 1_000_000} MB")
        with path.open(encoding="latin-1") as file:
            lines = list(islice(file, HEAD_LINES))
    except OSError as cause:
        raise _unreadable(str(path), str(cause.strerror or cause), todo="Mend 'file' of this lamp.") from cause
    if len(lines) <= LINE_OF_ANGLES:
        raise _unreadable(str(path), f"{len(lines)} lines")
    for line, most, of in ((LINE_OF_PLANES, MAX_PLANES, "C-planes"), (LINE_OF_ANGLES, MAX_ANGLES, "angles a plane")):
        words = lines[line].strip()
        if not (words.isascii() and words.isdecimal() and 1 <= len(words) <= 4 and 1 <= int(words) <= most):
            raise _unreadable(str(path), f"'{words[:40]}' for the number of {of} in line {line + 1}")
    # The reader passes over empty lines from here on, and would take as many lamp sets as are said.
    sets = [line.strip() for line in lines[FIRST_SIZE:] if line.strip()][SIZES_BEFORE_SETS:][:1]
    if sets and not (sets[0].isascii() and sets[0].isdecimal() and len(sets[0]) <= 4 and int(sets[0]) <= MAX_SETS):
        raise _unreadable(str(path), f"'{sets[0][:40]}' for the number of lamp sets")


def _ies_text(luminaire: "Ldt", where: str) -> str:
    header = luminaire.header
    lumens = header.lamp_flux[0]
    if not (np.isfinite(lumens) and lumens > 0 and header.conv_factor > 0):
        raise _unreadable(where, f"lamps of {lumens:g} lm, conversion factor {header.conv_factor:g}")
    with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is refused below
        candela = np.array(luminaire.intensities, dtype=np.float64) * lumens / LM_PER_KLM * header.conv_factor
    planes = np.array(header.c_angles, dtype=np.float64)
    if candela.shape != (planes.size, len(header.g_angles)) or not np.all(np.abs(candela) <= MAX_CANDELA):
        raise _unreadable(where, f"{planes.size} planes and a table of {' x '.join(map(str, candela.shape))}")
    if not np.isfinite(planes).all():
        raise _unreadable(where, "a C-plane at no angle")
    horizontal, candela = (np.zeros(1), candela[:1]) if header.isym == AXIAL else _along(planes, candela)
    length, width = header.length_lum_area / MM_PER_M, header.width_lum_area / MM_PER_M
    if width == 0:  # a round opening, which LM-63 marks by negative sizes
        length = width = -length
    return "\n".join(
        (
            "IESNA:LM-63-2002",
            f"[LUMCAT] {_one_line(header.luminaire_name)}",
            "TILT=NONE",
            f"1 {lumens:.7g} 1 {len(header.g_angles)} {horizontal.size} 1 2 {width:.6g} {length:.6g} 0",
            "1 1 0",
            _row(np.array(header.g_angles)),
            _row(horizontal),
            *map(_row, candela),
            "",
        )
    )


def _along(planes: FloatArray, candela: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Planes from across the luminaire to along it, ascending, with the first again at 360 degrees."""
    turned = np.mod(planes - 90.0, 360.0)
    order = np.argsort(turned)
    turned, candela = turned[order], candela[order]
    if turned[0] > 0:  # no plane along the luminaire: interpolate it, since LM-63 starts there
        share = (360.0 - turned[-1]) / (turned[0] + 360.0 - turned[-1])
        first = (1.0 - share) * candela[-1] + share * candela[0]
        turned, candela = np.concatenate([[0.0], turned]), np.concatenate([first[None], candela])
    return np.append(turned, 360.0), np.concatenate([candela, candela[:1]])


def _row(values: FloatArray) -> str:
    return " ".join(f"{value:.7g}" for value in values)


def _one_line(name: str) -> str:
    return " ".join("".join(letter if letter.isprintable() else " " for letter in name).split())[:200]


def _unreadable(where: str, found: str, todo: str = "Ask the maker for the LDT or the IES file again.") -> LampError:
    return LampError(expected="an EULUMDAT photometric file (.ldt)", found=found, where=where, todo=todo)
