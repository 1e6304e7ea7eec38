"""What the user gives `init` in place of a guess."""

import math
from dataclasses import dataclass
from typing import get_args

from lidarspectra.arguments import one_of
from lidarspectra.errors import ArgumentError
from lidarspectra.hardware.phone.readers import UnitChoice, UpChoice

SENSOR_HEIGHT_M = 0.3  # [m] about the height of the sensor on the paper's robot


@dataclass(frozen=True, kw_only=True)
class InitChoices:
    """What the user gives in place of a guess.

    Parameters
    ----------
    unit, up : str
        Of the scan's coordinates; 'auto' detects them.
    level : bool
        Set a scan upright that leans.
    height : float
        Of the sensors above the floor. [m]
    floor, ceiling : float or None
        Heights z in the scan's axes; None finds them. [m]
    spectrum : str or None
        Of every lamp: a database name or a file; None assumes a common LED.
    luminous_flux_lm : float or None
        Of each lamp; None assumes it. [lm]
    """

    unit: UnitChoice = "auto"
    up: UpChoice = "auto"
    level: bool = True
    height: float = SENSOR_HEIGHT_M
    floor: float | None = None
    ceiling: float | None = None
    spectrum: str | None = None
    luminous_flux_lm: float | None = None

    def __post_init__(self) -> None:
        one_of(self.unit, get_args(UnitChoice), name="unit")
        one_of(self.up, get_args(UpChoice), name="up")
        if not isinstance(self.height, float | int) or not 0 <= self.height < float("inf"):
            raise ArgumentError(expected="a height above the floor in metres", found=f"{self.height}", where="height")
        for name in ("floor", "ceiling"):
            z = getattr(self, name)
            if z is not None and not (isinstance(z, float | int) and math.isfinite(z)):
                raise ArgumentError(expected="a height z in the scan's axes, in metres", found=f"{z}", where=name)
        if self.floor is not None and self.ceiling is not None and self.ceiling <= self.floor:
            raise ArgumentError(
                expected=f"a ceiling above the floor, which is given at z = {self.floor:g} m",
                found=f"one at z = {self.ceiling:g} m",
                where="ceiling",
                todo="Give both as heights z in the scan's axes, in metres.",
            )

        if self.spectrum is not None and not (isinstance(self.spectrum, str) and self.spectrum.strip()):
            raise ArgumentError(
                expected="a lamp's spectrum, as a database name or a file", found=f"{self.spectrum!r}", where="spectrum"
            )
        flux = self.luminous_flux_lm
        if flux is not None and not (isinstance(flux, float | int) and 0 < flux < float("inf")):
            raise ArgumentError(expected="a flux above 0 lm", found=f"{flux}", where="luminous_flux_lm")

    @property
    def given(self) -> tuple[str, ...]:
        """Of 'unit', 'up', 'floor' and 'ceiling' those that were given."""
        return tuple(name for name in ("unit", "up", "floor", "ceiling") if getattr(self, name) not in ("auto", None))
