"""The AS7265x: its channels and dies, the orders they are sent in, gain, integration time, and what a count means.

Channels have letters. Three orders are met in the field, so a row of 18 numbers says nothing by itself: the module's
own AT firmware sends die by die, R S T U V W G H I J K L A B C D E F; the SparkFun examples print by wavelength,
A B C D E F G H R I S J T U V W K L; other sketches print by alphabet. A `ChannelOrder` therefore always carries who
said it: the protocol, or a header.

A count N at gain g and integration time t is, in basic counts, n = N / (g t) [1/ms].

Besides counts the module sends "calibrated" values, said to be in µW/cm². Two published logs show what they are: the
count times a factor per channel, between 0.3 and 1.2, the same at every integration time. By the data sheet's own 35
counts per µW/cm² they are some 30 times too large for that unit. Here they are called module values, counts that the
maker has evened out between the channels, and are taken to irradiance as counts are.

References
----------
AS7265x data sheet DS000612 v1-04 (ams, 2018), tables of optical characteristics and of AT commands.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from lidarspectra.arrays import ByteArray, FloatArray
from lidarspectra.errors import ReadingError
from lidarspectra.spectra.spectrum import AS7265X_CENTERS_NM, AS7265X_FWHM_NM

Die = Literal["AS72651", "AS72652", "AS72653"]

CHANNEL_COUNT = 18
DIES: tuple[Die, ...] = ("AS72651", "AS72652", "AS72653")
ASCENDING_LETTERS = tuple("ABCDEFGHRISJTUVWKL")  # by wavelength, 410 to 940 nm (data sheet)
UART_LETTERS = tuple("RSTUVWGHIJKLABCDEF")  # ATDATA and ATCDATA, and the dies' registers: master first
LETTERS_OF_DIE: dict[Die, str] = {"AS72651": "RSTUVW", "AS72652": "GHIJKL", "AS72653": "ABCDEF"}  # (data sheet)
DIE_INDEX = np.array(
    [next(i for i, die in enumerate(DIES) if letter in LETTERS_OF_DIE[die]) for letter in ASCENDING_LETTERS]
)
"""(channel,) which of `DIES` holds the channel, channels by wavelength."""
CHANNEL_LABELS = tuple(f"{center:.0f}" for center in AS7265X_CENTERS_NM)

GAIN_FACTORS = (1.0, 3.7, 16.0, 64.0)  # gain codes 0 to 3 (data sheet)
GAIN_ROUNDING = 0.01  # [1] of a gain that is written down
INTEGRATION_STEP_MS = 2.8  # [ms] one step of the integration time (data sheet)
SATURATED_COUNT = 65535  # [count] what a saturated channel reads (data sheet)
SATURATED_MODULE_VALUE = 2.0**32  # the module's own corrected value of a saturated channel (seen in logs)
FULL_SCALE_PER_STEP = (
    1000  # [count] about what one integration step can hold; this maker's family (TCS3772 sheet: 1025)
)
SETTLING_INTEGRATIONS = 2  # all six channels of a die take two integrations, one a bank (data sheet, mode 2)

RESPONSIVITY_COUNTS_CM2_UW = 35.0  # [count cm²/µW] at gain 16 and 166 ms (data sheet)
RESPONSIVITY_GAIN = 16.0  # gain at which the data sheet states it
RESPONSIVITY_TIME_MS = 166.0  # [ms] integration time at which the data sheet states it
RESPONSIVITY_LIMITS = 0.12  # ± limits of that figure (data sheet)
GAIN_LIMITS = 0.10  # ± limits of a gain's ratio to another (TCS3772 sheet; the AS7265x sheet gives none)
REPEATABILITY = 0.004  # noise of a reading, measured on 27 sensors in an office
GAUSSIAN_WIDTH_NM = AS7265X_FWHM_NM * float(np.sqrt(np.pi / (4.0 * np.log(2.0))))  # [nm] ∫ of a Gaussian of peak 1
WIDTH_LIMITS = GAUSSIAN_WIDTH_NM / AS7265X_FWHM_NM - 1.0  # the sheet does not state over which width its µW/cm² go
UW_CM2_TO_W_M2 = 0.01  # [W/m² per µW/cm²]

FLAG_SATURATED = 1  # more light than the channel can count
FLAG_MISSING = 2  # the device sent no number (NaN), or none for this channel
FLAG_DAMAGED = 4  # the number was damaged on the wire
FLAG_DISAGREES = 8  # count and module value contradict each other
FLAG_NAMES = {
    FLAG_SATURATED: "saturated",
    FLAG_MISSING: "missing",
    FLAG_DAMAGED: "damaged",
    FLAG_DISAGREES: "disagrees",
}

_LETTER_OF_LABEL = dict(zip(CHANNEL_LABELS, ASCENDING_LETTERS, strict=True))
_CHANNEL_NAME = re.compile(
    r"(?:channel|ch|cal|raw|wavelength|calibrated|module|flag|se|e|counts?)?[\s_:-]*"
    r"(?:(?P<letter>[A-LR-W])|(?:(?P<also>[A-LR-W])[\s_]*)?\(?(?P<label>[4-9]\d\d)(?:\s*nm)?\)?)",
    re.IGNORECASE,
)


@dataclass(frozen=True, kw_only=True)
class ChannelOrder:
    """Which channel each number of a row belongs to, and who said so.

    Parameters
    ----------
    letters : tuple of str
        Channel letters in the order of the row; each at most once.
    said_by : str
        The protocol or header that says so, for logs.
    """

    letters: tuple[str, ...]
    said_by: str

    def __post_init__(self) -> None:
        unknown = [letter for letter in self.letters if letter not in ASCENDING_LETTERS]
        if unknown or len(set(self.letters)) != len(self.letters) or not self.letters:
            raise ReadingError(
                expected=f"channel letters out of {' '.join(ASCENDING_LETTERS)}, each at most once",
                found=" ".join(self.letters) or "none",
                where=self.said_by,
                todo="Name the channels in the order in which the device prints them.",
            )

    def __len__(self) -> int:
        return len(self.letters)

    def ascending(self, values: ArrayLike) -> FloatArray:
        """Put a row, or rows, into the order of wavelengths.

        Parameters
        ----------
        values : (..., n) float
            In this order.

        Returns
        -------
        values : (..., 18) float
            By wavelength; NaN for channels that the row does not have.
        """
        given = np.asarray(values, dtype=np.float64)
        placed = np.full((*given.shape[:-1], CHANNEL_COUNT), np.nan)
        placed[..., [ASCENDING_LETTERS.index(letter) for letter in self.letters]] = given
        return placed


UART_ORDER = ChannelOrder(letters=UART_LETTERS, said_by="protocol: the module's AT firmware sends die by die")
ASCENDING_ORDER = ChannelOrder(letters=ASCENDING_LETTERS, said_by="protocol: by wavelength")


def channel_letter(name: str) -> str | None:
    """Letter of the channel that a column name means ('A', '410', '410nm', 'E_410', 'A (410 nm)'), or None."""
    match = _CHANNEL_NAME.fullmatch(name.strip().strip('"'))
    if match is None:
        return None
    if match["letter"]:
        return match["letter"].upper()
    letter = _LETTER_OF_LABEL.get(match["label"])
    contradicts = match["also"] is not None and match["also"].upper() != letter
    return None if contradicts else letter


def order_from_header(fields: Sequence[str], *, where: str) -> ChannelOrder | None:
    """Channel order that a header line states.

    Parameters
    ----------
    fields : sequence of str
        The names between its commas; empty ones at the end are left out.
    where : str
        Which header, for logs.

    Returns
    -------
    order : ChannelOrder or None
        None unless every field names a channel, no channel comes twice and there are six (one die) or more.
    """
    names = [field.strip() for field in fields]
    while names and not names[-1]:
        names.pop()
    letters = [channel_letter(name) for name in names]
    known = [letter for letter in letters if letter is not None]
    if len(known) < 6 or len(known) != len(letters) or len(set(known)) != len(known):
        return None
    return ChannelOrder(letters=tuple(known), said_by=f"header: {where}")


@dataclass(frozen=True, kw_only=True)
class SensorSettings:
    """Gain and integration time.

    Parameters
    ----------
    gain_code : int
        0 to 3, for gains of 1, 3.7, 16 and 64.
    integration_steps : int
        1 to 255, of 2.8 ms each.
    """

    gain_code: int
    integration_steps: int

    def __post_init__(self) -> None:
        if not (0 <= self.gain_code <= 3 and 1 <= self.integration_steps <= 255):
            raise ReadingError(
                expected="a gain code from 0 to 3 and 1 to 255 integration steps",
                found=f"gain code {self.gain_code}, {self.integration_steps} steps",
                where="sensor settings",
                todo="Gains are 1, 3.7, 16 and 64; the integration time runs from 2.8 to 714 ms.",
            )

    @property
    def gain(self) -> float:
        """Gain factor [1]."""
        return GAIN_FACTORS[self.gain_code]

    @property
    def integration_ms(self) -> float:
        """Integration time [ms]."""
        return self.integration_steps * INTEGRATION_STEP_MS

    @property
    def settling_s(self) -> float:
        """Time until all channels were measured wholly with these settings [s]."""
        return (SETTLING_INTEGRATIONS + 1) * self.integration_ms * 1e-3


DEFAULT_SETTINGS = SensorSettings(gain_code=2, integration_steps=59)  # gain 16, 165 ms: those of the sheet's figures


def settings_for(gain: float, integration_ms: float) -> SensorSettings:
    """Settings of a gain factor and an integration time; the nearest step of 2.8 ms.

    Raises
    ------
    ReadingError
        If the device has no such gain, or the time is outside 2.8 to 714 ms.
    """
    codes = [code for code, factor in enumerate(GAIN_FACTORS) if abs(factor - gain) < GAIN_ROUNDING]
    steps = round(integration_ms / INTEGRATION_STEP_MS)
    if not codes or not 1 <= steps <= 255:
        raise ReadingError(
            expected="a gain of 1, 3.7, 16 or 64 and an integration time from 2.8 to 714 ms",
            found=f"gain {gain:g} and {integration_ms:g} ms",
            where="sensor settings",
            todo="Choose one of these.",
        )
    return SensorSettings(gain_code=codes[0], integration_steps=steps)


def require_gains(gains: ArrayLike, *, where: str) -> None:
    """Refuse gains that the device does not have; NaN, where none is known, is none.

    Parameters
    ----------
    gains : (reading,) float
        [1]
    where : str
        For the error.

    Raises
    ------
    ReadingError
        If one is not 1, 3.7, 16 or 64: the device's codes 0 to 3, taken as gains, are wrong by factors of up to 21.
    """
    given = np.asarray(gains, dtype=np.float64)
    known = np.isclose(given[..., None], GAIN_FACTORS, atol=GAIN_ROUNDING).any(axis=-1) | np.isnan(given)
    if not known.all():
        found = np.unique(given[~known])
        raise ReadingError(
            expected="gains of 1, 3.7, 16 or 64",
            found=", ".join(f"{value:g}" for value in found[:4]),
            where=where,
            todo="If these are the device's codes, write 1 for 0, 3.7 for 1, 16 for 2 and 64 for 3.",
        )


def basic_counts(counts: ArrayLike, gain: ArrayLike, integration_ms: ArrayLike) -> FloatArray:
    """Counts per gain and time, n = N / (g t); what is left of a reading when its settings are taken out.

    Parameters
    ----------
    counts : (reading, channel) float
        N. [count]
    gain : (reading,) float
        g, NaN where unknown. [1]
    integration_ms : (reading,) float
        t, NaN where unknown. [ms]

    Returns
    -------
    basic : (reading, channel) float
        n; NaN where a part is unknown. [1/ms]
    """
    scale = np.asarray(gain, dtype=np.float64) * np.asarray(integration_ms, dtype=np.float64)
    return np.asarray(np.asarray(counts, dtype=np.float64) / scale[..., None], dtype=np.float64)


def count_uncertainty(counts: ArrayLike) -> FloatArray:
    """Standard uncertainty of a count: rounding to whole counts (1/√12) and the device's repeatability (0.4 %).

    Parameters
    ----------
    counts : (...,) float
        [count]

    Returns
    -------
    uncertainty : (...,) float
        [count]
    """
    return np.asarray(np.sqrt(1.0 / 12.0 + (REPEATABILITY * np.asarray(counts, dtype=np.float64)) ** 2))


def nominal_responsivity() -> tuple[float, float]:
    """Basic counts per spectral irradiance of any channel by the data sheet, and its relative standard uncertainty.

    35 counts per µW/cm² at gain 16 and 166 ms, over a Gaussian of 20 nm FWHM. The limits (12 % of the responsivity,
    6 % of the width that the sheet means) are taken as rectangular distributions.

    Returns
    -------
    responsivity : float
        [1/ms per W/m²/nm]
    relative_uncertainty : float
        [1]
    """
    per_uw_cm2 = RESPONSIVITY_COUNTS_CM2_UW / (RESPONSIVITY_GAIN * RESPONSIVITY_TIME_MS)
    responsivity = per_uw_cm2 * GAUSSIAN_WIDTH_NM / UW_CM2_TO_W_M2
    return responsivity, float(np.hypot(RESPONSIVITY_LIMITS, WIDTH_LIMITS) / np.sqrt(3.0))


def mask_counts(counts: ArrayLike) -> tuple[FloatArray, ByteArray]:
    """Mask saturated and missing counts.

    Parameters
    ----------
    counts : (..., channel) float
        As the device sent them; NaN where it sent none. [count]

    Returns
    -------
    counts : (..., channel) float
        NaN where masked. [count]
    flags : (..., channel) uint8
        `FLAG_SATURATED`, `FLAG_MISSING` or 0.
    """
    return _mask(np.asarray(counts, dtype=np.float64), SATURATED_COUNT)


def mask_module_values(module_values: ArrayLike) -> tuple[FloatArray, ByteArray]:
    """Mask saturated and missing values among the module's own corrected ones; see `mask_counts`."""
    return _mask(np.asarray(module_values, dtype=np.float64), SATURATED_MODULE_VALUE)


def _mask(values: FloatArray, limit: float) -> tuple[FloatArray, ByteArray]:
    missing = ~np.isfinite(values) | (values < 0)
    with np.errstate(invalid="ignore"):
        saturated = ~missing & (values >= limit)
    flags = np.where(missing, FLAG_MISSING, np.where(saturated, FLAG_SATURATED, 0)).astype(np.uint8)
    return np.where(missing | saturated, np.nan, values), flags
