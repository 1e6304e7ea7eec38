"""Which Mitsuba runs here: the fast one that compiles its kernels through LLVM, or the plain one.

Band slots must come out as they go in. The `rgb` variants carry three numbers along a path and never take them for a
spectrum, so three slots at a time ride as red, green and blue; the `spectral` ones would turn colours into spectra.
"""

import importlib
import logging
import os
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from lidarspectra.errors import EngineError

logger = logging.getLogger(__name__)

FAST, PLAIN = "llvm_ad_rgb", "scalar_rgb"
SLOTS = 3  # that an rgb variant carries
MIN_LLVM = 17  # 14 to 16 end the process on Mitsuba 3.9's kernels ("Cannot select: fmaximum"); 19 was tried
GET_LLVM = (
    f"Install LLVM's shared library, version {MIN_LLVM} or later (Debian: apt-get install libllvm19; macOS: brew "
    "install llvm; Windows: the LLVM installer), or name it in the environment variable DRJIT_LIBLLVM_PATH."
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Mitsuba:
    """Mitsuba's modules with a variant chosen.

    Parameters
    ----------
    mi, dr : module
        `mitsuba` and `drjit`.
    variant : str
        'llvm_ad_rgb' or 'scalar_rgb'.
    note : str
        Why it is the plain one, and what to do; empty for the fast one.
    """

    mi: Any
    dr: Any
    variant: str
    note: str = ""

    @property
    def is_fast(self) -> bool:
        """Whether many rays are traced at once."""
        return self.variant == FAST


def find_mitsuba(*, plain: bool = False) -> Mitsuba:
    """Load Mitsuba and choose its variant, for the whole process.

    Parameters
    ----------
    plain : bool
        Take the plain variant even where LLVM is there.

    Returns
    -------
    mitsuba : Mitsuba
        The plain one where LLVM's library is missing or too old; `note` then says so, and a warning is logged.

    Raises
    ------
    EngineError
        If Mitsuba is not installed, or cannot be loaded.
    """
    dr, mi = _load("drjit"), _load("mitsuba")
    note = "asked for" if plain else _fault_of_llvm(dr)
    variant = PLAIN if note else FAST
    try:
        mi.set_variant(variant)
    except ImportError as cause:
        raise EngineError(
            expected=f"Mitsuba's variant {variant}", found=str(cause), where="mitsuba", todo=GET_LLVM
        ) from cause
    if note and not plain:
        logger.warning("Mitsuba runs its plain variant, about a hundred times slower: %s", note)
    return Mitsuba(mi=mi, dr=dr, variant=variant, note=note)


def _load(name: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except ImportError as cause:
        raise EngineError(
            expected="Mitsuba 3, which gives the second opinion",
            found=str(cause),
            where=name,
            todo="Install the extra: pip install lidarspectra[validate].",
        ) from cause


def _fault_of_llvm(dr: Any) -> str:
    """What keeps the fast variant from running; empty if nothing does."""
    if not dr.has_backend(dr.JitBackend.LLVM):
        named = os.environ.get("DRJIT_LIBLLVM_PATH")
        return f"LLVM's shared library is not {'at ' + named if named else 'there'}. {GET_LLVM}"
    major = int(dr.detail.llvm_version()[0])
    return "" if major >= MIN_LLVM else f"LLVM {major} is too old. {GET_LLVM}"
