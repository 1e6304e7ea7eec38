"""The target file of a design: which light is wanted where, and what may be changed about the lamps."""

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, Literal, Self, TypedDict

from pydantic import Field, model_validator

from lidarspectra.arguments import path_of
from lidarspectra.config import Fraction, Name, Positive, Vector
from lidarspectra.errors import RunFileError
from lidarspectra.io.toml_sections import Section, check_sections, parse_sections
from lidarspectra.mapping.photometry.quantities import light_quantities

MADE_IN_PYTHON = "target"  # what errors call targets that are no file


class TargetSection(Section):
    """`[[targets]]`: what the light shall be at some points."""

    name: Name
    quantity: str = "illuminance_lx"
    """Name of a quantity, as the columns of `lidarspectra photometry` have it."""
    at_least: Positive | None = None
    at_most: Positive | None = None
    about: Positive | None = None
    """To come close to, where it need not hold. [unit of the quantity]"""
    of: Literal["every point", "mean"] = "every point"
    """What must be at least, at most or about so much."""
    uniformity: Annotated[float, Field(gt=0, lt=1)] | None = None
    """U0 = least over mean, at least so much. [1]"""
    spectrum: str | None = None
    """Form of the light's spectrum to come close to: a lamp's database name, or a file."""
    channels: Annotated[tuple[Annotated[float, Field(ge=0)], ...], Field(min_length=2)] | None = None
    """The same as relative irradiance in each channel of the run."""
    polygon: Annotated[tuple[tuple[float, float], ...], Field(min_length=3)] | None = None
    """Corners on the plan [m]: the run's points within it."""
    points: Annotated[tuple[str | int, ...], Field(min_length=1)] | None = None
    """Names (column `name` of the run's points file) or numbers of the run's points, from 1 as in the report."""
    places: Annotated[tuple[Vector, ...], Field(min_length=1)] | None = None
    """Places of one's own [m]; light is traced there."""
    direction: Vector = (0.0, 0.0, 1.0)
    """In which the sensors at `places` look."""

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        levels = [name for name in ("at_least", "at_most", "about") if getattr(self, name) is not None]
        shapes = [name for name in ("spectrum", "channels") if getattr(self, name) is not None]
        where = [name for name in ("polygon", "points", "places") if getattr(self, name) is not None]
        if not levels and not shapes and self.uniformity is None:
            raise ValueError("give at_least, at_most, about, uniformity, spectrum or channels")
        if "about" in levels and len(levels) > 1:
            raise ValueError(f"give about or {levels[0]}, not both")
        if self.at_least is not None and self.at_most is not None and self.at_least > self.at_most:
            raise ValueError(f"at_least = {self.at_least:g} is above at_most = {self.at_most:g}")
        if len(shapes) > 1:
            raise ValueError("give spectrum or channels, not both")
        if shapes and self.at_least is None and self.about is None:
            raise ValueError(f"{shapes[0]} is a form without a height: give at_least or about too")
        if self.channels is not None and not any(self.channels):
            raise ValueError("channels that are all 0 are no form")
        if len(where) > 1:
            raise ValueError(f"give one of {' and '.join(where)}; leave all out for all points of the run")
        if self.places is None and "direction" in self.model_fields_set:
            raise ValueError("direction goes with places: the run's own points have theirs")
        if not any(self.direction):
            raise ValueError("direction = [0, 0, 0] is no direction")
        known = [quantity.name for quantity in light_quantities()]
        if self.quantity not in known:
            raise ValueError(f"quantity '{self.quantity}' is none of {', '.join(known)}")
        return self


class LampsToDesignSection(Section):
    """`[lamps]`: what may be changed about them."""

    fixed: tuple[Name, ...] = ()
    """Lamps that stay as they are; windows and the sun always do."""
    count: Annotated[int, Field(ge=1)] | None = None
    """At most so many are lit."""
    dimmable: bool = True
    min_dim: Fraction = 0.0
    """Least share of its flux that a lit lamp can be dimmed to."""
    least: Literal["watts", "lamps"] = "watts"
    """What is kept low."""
    power_W: dict[str, Positive] = Field(default_factory=dict)  # noqa: N815 - watts are W
    """Electrical power of lamps at their full flux, by name. [W]"""
    efficacy_lm_W: Positive | None = None  # noqa: N815
    """Lumens a watt of lamps whose power is not given. [lm/W]"""
    mix: Literal["each", "same", "mixed"] = "each"
    """With [[spectra]]: one for each lamp, one for all lamps, or any mixture in each lamp."""
    present_spectra: bool = True
    """With [[spectra]]: whether a lamp may keep the spectrum that it has."""


class LibrarySection(Section):
    """`[[spectra]]`: a spectrum that lamps may have."""

    spectrum: str
    """Database name or file."""
    luminous_flux_lm: Positive | None = None
    """Of each lamp with it; that of the lamp as it is by default. [lm]"""
    efficacy_lm_W: Positive | None = None  # noqa: N815
    """[lm/W]"""


class CandidatesSection(Section):
    """`[candidates]`: places where lamps might hang."""

    like: Name | None = None
    """The run's lamp whose kind they are; its first by default."""
    centers: Annotated[tuple[Vector, ...], Field(min_length=1, max_length=200)] | None = None
    """[m]"""
    spacing: Positive | None = None
    """Of a grid under the ceiling, along the walls, at the height of that lamp. [m]"""
    margin: Annotated[float, Field(ge=0)] = 0.5
    """Least distance of the grid from walls. [m]"""
    keep_lamps: bool = False
    """Whether the run's own lamps may be used as well."""

    @model_validator(mode="after")
    def _places(self) -> Self:
        if (self.centers is None) == (self.spacing is None):
            raise ValueError("give either centers or spacing")
        return self


class Target(Section):
    """A target file.

    Parameters
    ----------
    targets, lamps, spectra, candidates
        Its tables; docs/howto-design.md lists every key.
    """

    targets: tuple[TargetSection, ...]
    lamps: LampsToDesignSection = LampsToDesignSection()
    spectra: tuple[LibrarySection, ...] = ()
    candidates: CandidatesSection | None = None

    @model_validator(mode="after")
    def _names(self) -> Self:
        if not self.targets:
            raise ValueError("give one or more [[targets]]")
        names = [target.name for target in self.targets]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"two targets have the name {twice[0]!r}; give each its own")
        spectra = [entry.spectrum for entry in self.spectra]
        if len(set(spectra)) < len(spectra):
            raise ValueError("a spectrum is given twice in [[spectra]]")
        if not self.lamps.present_spectra and not self.spectra:
            raise ValueError("present_spectra = false needs [[spectra]] to choose from")
        return self


class _Named(TypedDict):
    kind: str
    error: type[RunFileError]
    page: str


_NAMED: _Named = {"kind": "target file", "error": RunFileError, "page": "docs/howto-design.md"}


def read_target(target: str | PathLike[str] | Mapping[str, Any]) -> tuple[Target, str, Path]:
    """Read a target file, or take its tables as they are given in Python.

    Parameters
    ----------
    target : str, path or mapping
        A TOML text in UTF-8, or its tables: `{"targets": [{"name": "desks", "at_least": 500}]}`.

    Returns
    -------
    target : Target
    where : str
        What errors call it.
    base : Path
        Where relative file names in it start.

    Raises
    ------
    RunFileError
        If the file is missing, no TOML, or has unknown keys or values that do not fit; all faults are named at once.
    """
    if isinstance(target, Mapping):
        return check_sections(Target, dict(target), **_NAMED, where=MADE_IN_PYTHON), MADE_IN_PYTHON, Path()
    path = path_of(target, name="target", meaning="the name of a target file, or its tables as a dict")
    try:
        text = path.read_text(encoding="utf-8-sig")  # editors of Windows may begin a text with a mark
    except (OSError, UnicodeDecodeError) as cause:
        raise RunFileError(
            expected="a readable target file (TOML, UTF-8)",
            found=str(cause) if isinstance(cause, OSError) else f"no text in UTF-8 ({cause.reason})",
            where=str(path),
            todo="docs/howto-design.md shows one.",
        ) from cause
    return parse_sections(Target, text, **_NAMED, where=str(path)), str(path), path.resolve().parent
