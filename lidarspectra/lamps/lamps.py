"""Lamps: what sends light, in which shape, with which spectrum."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

import numpy as np

from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.config import LampSection, LampsFromScanSection
from lidarspectra.errors import LampError
from lidarspectra.lamps.ies import CandelaTable, read_ies, read_ies_text
from lidarspectra.lamps.lamp_spectra import cct_spectrum, luminous_flux_lm
from lidarspectra.lamps.ldt import ies_text_of_ldt
from lidarspectra.spectra.databases import lamp_spectrum
from lidarspectra.spectra.spectrum import Spectrum

LampShape = Literal["panel", "disc", "strip", "bulb", "spot", "point", "ies", "window", "sun"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Opening:
    """A hole in the room's shell, for the sun.

    Parameters
    ----------
    corners : (4, 3) float
        Its rectangle. [m]
    inward : (3,) float
        Unit normal, into the room.
    transmittance : float
        Of its pane for the sun's direction. [0-1]
    """

    corners: FloatArray
    inward: FloatArray
    transmittance: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Lamp:
    """A light source with an absolute spectrum.

    Parameters
    ----------
    name : str
        The user's words; files get safe names.
    shape : str
        'panel' and 'strip' are Lambertian rectangles, 'disc' and 'spot' round, 'bulb' and 'point' spheres.
    center : (3,) float
        [m]
    normal : (3,) float
        Direction it shines in; made a unit vector. Unused by bulb and point.
    size : tuple of float
        Panel, strip, window: (length, width). Disc, spot, bulb, point: (diameter,). Ies: either. [m]
    rotation_deg : float
        Turn of the length (of a luminaire's 0 degree plane) about the normal, from the x axis (from y where the normal
        is along x). [deg]
    beam_angle_deg : float or None
        Spot: full angle at half the peak intensity. [deg]
    flux : Spectrum
        Spectral radiant flux. [W/nm]
    incoming : (azimuth, altitude, wavelength) float or None
        Window with daylight: radiance that its pane lets in, on `sky`'s grid; a plain Lambertian window without it.
        [W/m²/sr/nm]
    openings : tuple of Opening
        Sun: what it shines through. Its normal is the way its light goes; centre and size are a marker's, for plans.
    candela_file : str or None
        IES LM-63 text (the text itself) for 'ies'; its distribution is used, its flux replaced by `flux`.
    """

    name: str
    shape: LampShape
    center: FloatArray
    size: tuple[float, ...]
    flux: Spectrum
    normal: FloatArray
    rotation_deg: float = 0.0
    beam_angle_deg: float | None = None
    candela_file: str | None = None
    incoming: FloatArray | None = None
    openings: tuple[Opening, ...] = ()

    def __post_init__(self) -> None:
        center = float_array(self.center, name=f"lamp '{self.name}' center", shape=(3,))
        normal = float_array(self.normal, name=f"lamp '{self.name}' normal", shape=(3,))
        length = float(np.linalg.norm(normal))
        if length == 0:
            raise LampError(expected="a direction", found="a normal of length zero", where=f"lamp '{self.name}'")
        wanted = (2,) if self.shape in ("panel", "strip", "window") else (1, 2) if self.shape == "ies" else (1,)
        if len(self.size) not in wanted or min(self.size) <= 0:
            raise LampError(
                expected=f"{' or '.join(map(str, wanted))} positive size(s) in metres for a {self.shape}",
                found=f"{self.size}",
                where=f"lamp '{self.name}'",
            )
        if self.flux.values.min() < 0 or self.flux.values.max() <= 0:
            raise LampError(
                expected="a spectrum that is nowhere negative and somewhere positive",
                found=f"values from {self.flux.values.min():g} to {self.flux.values.max():g}",
                where=f"lamp '{self.name}'",
            )
        object.__setattr__(self, "center", center)
        object.__setattr__(self, "normal", float_array(normal / length, name="normal", shape=(3,)))


DEFAULT_DIAMETER_M = {"bulb": 0.06, "spot": 0.08, "point": 0.01}
"""[m] An A60 bulb, a common downlight, and next to nothing; other shapes must say their size."""


def resolve_lamps(sections: Sequence[LampSection], folder: Path) -> tuple[Lamp, ...]:
    """Turn the run file's lamps into lamps with absolute spectra.

    The spectrum comes from the databases, a file, or the colour temperature (`lamp_spectra.cct_spectrum`). It is
    scaled to the luminous flux, 683 lm/W ∫Φ V dλ, or to the radiant flux, ∫Φ dλ over the spectrum's whole range; an
    absolute spectrum [W/nm] needs neither, nor does a candela file, which has its own lumens. `dim` then scales it.

    Parameters
    ----------
    sections : sequence of LampSection
        `[[lamps]]` of the run file.
    folder : Path
        Where relative file names start; the run file's folder.

    Returns
    -------
    lamps : tuple of Lamp
        In their order; lamps dimmed to 0 are left out.

    Raises
    ------
    LampError
        If a lamp lacks size or flux, or a candela file cannot be read.
    DatabaseError
        If there is no such spectrum.
    """
    return tuple(_resolve(section, folder) for section in sections if section.dim > 0)


class LitShape(Protocol):
    """A lamp as the scan shows it: where its light comes from, not how much (`material.lit_lamps.LitLamp`)."""

    @property
    def shape(self) -> Literal["panel", "strip", "disc"]:
        """Outline."""

    @property
    def center(self) -> FloatArray:
        """(3,) middle [m]."""

    @property
    def size(self) -> tuple[float, ...]:
        """Length and width, or diameter [m]."""

    @property
    def normal(self) -> FloatArray:
        """(3,) direction it shines in."""

    @property
    def rotation_deg(self) -> float:
        """As `Lamp.rotation_deg` [deg]."""


def lamps_from_lit(lit_lamps: Sequence[LitShape], section: LampsFromScanSection, folder: Path) -> tuple[Lamp, ...]:
    """Turn lamps found lit in a scan into lamps with absolute spectra.

    A scan shows where light comes from, not how much: each lamp sends the exitance that the run file states [lm/m²]
    times its own area, with the spectrum that it names.

    Parameters
    ----------
    lit_lamps : sequence of LitLamp
    section : LampsFromScanSection
        `[lamps_from_scan]` of the run file.
    folder : Path
        Where relative file names start.

    Returns
    -------
    lamps : tuple of Lamp
        Named 'lit 1', 'lit 2', ...

    Raises
    ------
    LampError
        If no lamp was found, or the spectrum has no light that the eye sees.
    DatabaseError
        If there is no such spectrum.
    """
    if not lit_lamps:
        raise LampError(
            expected="lamps lit in the scan's texture",
            found="none",
            where="[lamps_from_scan]",
            todo="Give each lamp as [[lamps]] in its place: centre, size, spectrum and flux.",
        )
    spectrum = _relative_spectrum(section, folder)
    one_lumen = _scaled(spectrum, 1.0, luminous_flux_lm(spectrum), "[lamps_from_scan]", "lumens")
    return tuple(
        Lamp(
            name=f"lit {number}",
            shape=lit.shape,
            center=lit.center,
            normal=lit.normal,
            size=lit.size,
            rotation_deg=lit.rotation_deg,
            flux=one_lumen.scaled(section.luminous_exitance_lm_m2 * _outline_area_m2(lit)),
        )
        for number, lit in enumerate(lit_lamps, start=1)
    )


def _outline_area_m2(lit: LitShape) -> float:
    return 0.25 * np.pi * lit.size[0] ** 2 if lit.shape == "disc" else lit.size[0] * lit.size[1]


def _relative_spectrum(section: LampsFromScanSection, folder: Path) -> Spectrum:
    return cct_spectrum(section.cct_k) if section.cct_k else lamp_spectrum(section.spectrum or "", folder).spectrum


def _resolve(section: LampSection, folder: Path) -> Lamp:
    where = f"lamp '{section.name}'"
    candela_file = None if section.file is None else _candela_text(folder / section.file)
    table = None if candela_file is None else read_ies(candela_file, where=str(folder / str(section.file)))
    return Lamp(
        name=section.name,
        shape=section.shape,
        center=np.array(section.center),
        normal=np.array(section.normal),
        size=table.opening_m if table is not None and section.size is None else _size(section, where),
        rotation_deg=section.rotation_deg,
        beam_angle_deg=section.beam_angle_deg,
        flux=_flux(section, folder, where, table).scaled(section.dim),
        candela_file=candela_file,
    )


def _candela_text(path: Path) -> str:
    """LM-63 text of a luminaire's file, which may be an EULUMDAT one."""
    return ies_text_of_ldt(path) if path.suffix.lower() == ".ldt" else read_ies_text(path)


def _size(section: LampSection, where: str) -> tuple[float, ...]:
    if section.size is None:
        if section.shape not in DEFAULT_DIAMETER_M:
            raise LampError(
                expected=f"'size' in metres for a {section.shape}", found="none", where=where, todo="Measure the lamp."
            )
        return (DEFAULT_DIAMETER_M[section.shape],)
    size = section.size if isinstance(section.size, tuple) else (section.size,)
    if section.shape == "panel" and len(size) == 1:
        return (size[0], size[0])  # a square panel by its side
    return tuple(size)


def _flux(section: LampSection, folder: Path, where: str, table: CandelaTable | None) -> Spectrum:
    if section.cct_k is not None:
        spectrum, absolute = cct_spectrum(section.cct_k), False
    else:
        found = lamp_spectrum(section.spectrum or "", folder)
        spectrum, absolute = found.spectrum, found.absolute
    if section.luminous_flux_lm is not None:
        return _scaled(spectrum, section.luminous_flux_lm, luminous_flux_lm(spectrum), where, "lumens")
    if section.radiant_flux_W is not None:
        return _scaled(spectrum, section.radiant_flux_W, spectrum.integral(), where, "watts")
    if not absolute and table is not None:
        return _scaled(spectrum, table.luminous_flux_lm(), luminous_flux_lm(spectrum), where, "lumens")
    if not absolute:
        raise LampError(
            expected="luminous_flux_lm or radiant_flux_W, since the spectrum is relative",
            found="neither",
            where=where,
            todo="The lumens stand on the lamp's package; a spectrum in W/nm needs none.",
        )
    return spectrum


def _scaled(spectrum: Spectrum, wanted: float, present: float, where: str, unit: str) -> Spectrum:
    if present <= 0:
        raise LampError(
            expected=f"a spectrum that can be scaled to {wanted:g} {unit}",
            found=f"one without any {unit}",
            where=where,
            todo="Give radiant_flux_W for a lamp that the eye does not see.",
        )
    return spectrum.scaled(wanted / present)
