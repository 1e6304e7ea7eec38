"""A lamp from what a person knows of it: its place and size, a spectrum by name, the lumens on its label."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Literal, Protocol, get_args

import numpy as np
from numpy.typing import ArrayLike

from lidarspectra.arguments import number_of, one_of, path_of
from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.errors import ArgumentError, LampError
from lidarspectra.lamps.ies import CandelaTable, read_ies, read_ies_text
from lidarspectra.lamps.lamp_spectra import cct_spectrum, luminous_flux_lm
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.ldt import ies_text_of_ldt
from lidarspectra.lamps.shapes import Shape, shape_of
from lidarspectra.spectra.databases import lamp_spectrum
from lidarspectra.spectra.spectrum import Spectrum

GivenShape = Literal["panel", "disc", "strip", "bulb", "spot", "point", "ies", "window"]
EXITANCE_LM_M2 = 10_000.0  # [lm/m²] a common panel of 0.6 m x 0.6 m and 3600 lm


def make_lamp(
    shape: GivenShape,
    center: ArrayLike,
    *,
    name: str = "lamp",
    size: float | Sequence[float] | None = None,
    normal: ArrayLike = (0.0, 0.0, -1.0),
    rotation_deg: float = 0.0,
    beam_angle_deg: float | None = None,
    spectrum: Spectrum | str | PathLike[str] | None = None,
    cct_k: float | None = None,
    luminous_flux_lm: float | None = None,
    radiant_flux_W: float | None = None,
    file: str | PathLike[str] | None = None,
    folder: str | PathLike[str] = Path(),
) -> Lamp:
    """Make a lamp with an absolute spectrum.

    The spectrum is scaled to the luminous flux, 683 lm/W ∫Φ V dλ, or to the radiant flux, ∫Φ dλ over the spectrum's
    whole range. A spectrum in W/nm needs neither, nor does a candela file, which has its own lumens.

    Parameters
    ----------
    shape : str
        'panel' and 'strip' are Lambertian rectangles, 'disc' and 'spot' round, 'bulb' and 'point' spheres, 'ies' a
        luminaire with a candela file, 'window' a rectangle that lets light in.
    center : (3,) float
        [m]
    name : str
        Tells lamps apart, in relighting too: two lamps of a room have two names.
    size : float or sequence of float, optional
        Length and width of a rectangle (one number is a square panel), diameter of the others. Bulb, spot and point
        have a common one. [m]
    normal : (3,) float
        Direction that it shines in; down by default.
    rotation_deg : float
        Turn of the length about the normal, see `Lamp`. [deg]
    beam_angle_deg : float, optional
        Of a spot: full angle at half the peak intensity. [deg]
    spectrum : Spectrum, str or path, optional
        A spectrum, a name of the databases ('LED-B3', 'FL11', 'A', ...), or a file. Give it or `cct_k`.
    cct_k : float, optional
        Correlated colour temperature, for a black body or daylight (`lamp_spectra.cct_spectrum`). [K]
    luminous_flux_lm, radiant_flux_W : float, optional
        One of them, or neither where the spectrum is in W/nm: a Spectrum always is unless one is given. [lm], [W]
    file : str or path, optional
        IES LM-63 or EULUMDAT (.ldt) file, for shape 'ies'.
    folder : str or path
        Where relative file names start.

    Returns
    -------
    lamp : Lamp

    Raises
    ------
    ArgumentError
        If the shape is none, or the spectrum something else.
    LampError
        If the lamp lacks size or flux, was given two fluxes or two spectra, or its candela file cannot be read.
    DatabaseError
        If there is no such spectrum.
    """
    one_of(shape, get_args(GivenShape), name="shape of a lamp")
    where = f"lamp '{name}'"
    if (shape == "ies") != (file is not None):
        raise LampError(
            expected="'file' with shape 'ies', and only with it", found=f"shape '{shape}', file {file}", where=where
        )
    if (shape == "spot") != (beam_angle_deg is not None):
        raise LampError(
            expected="'beam_angle_deg' with shape 'spot', and only with it",
            found=f"shape '{shape}', beam_angle_deg {beam_angle_deg}",
            where=where,
        )
    path = None if file is None else path_of(folder, name="folder") / path_of(file, name="file")
    candela_text = None if path is None else _candela_text(path)
    table = None if candela_text is None else read_ies(candela_text, where=str(path))
    sizes = None if size is None else float_array(np.atleast_1d(size), name=f"{where} size", shape=(None,)).tolist()
    angle = None if beam_angle_deg is None else number_of(beam_angle_deg, name=f"{where} beam_angle_deg", unit="deg")
    options = {"beam_angle_deg": angle, "candela_text": candela_text}
    return Lamp(
        name=name,
        shape=shape_of(shape, None if sizes is None else tuple(sizes), where=where, **options),
        center=float_array(center, name=f"{where} center", shape=(3,)),
        normal=float_array(normal, name=f"{where} normal", shape=(3,)),
        rotation_deg=number_of(rotation_deg, name=f"{where} rotation_deg", unit="deg"),
        flux=_flux(_source(spectrum, cct_k, folder, where), luminous_flux_lm, radiant_flux_W, where, table),
    )


class LitShape(Protocol):
    """A lamp as the scan shows it: where its light comes from, not how much (`material.lit_lamps.LitLamp`)."""

    @property
    def shape(self) -> Shape:
        """Outline."""

    @property
    def center(self) -> FloatArray:
        """(3,) middle [m]."""

    @property
    def normal(self) -> FloatArray:
        """(3,) direction it shines in."""

    @property
    def rotation_deg(self) -> float:
        """As `Lamp.rotation_deg` [deg]."""


def lamps_from_lit(
    lit_lamps: Sequence[LitShape], spectrum: Spectrum, *, luminous_exitance_lm_m2: float = EXITANCE_LM_M2
) -> tuple[Lamp, ...]:
    """Turn lamps found lit in a scan into lamps with absolute spectra.

    A scan shows where light comes from, not how much: each lamp sends the exitance that is stated times its own area.

    Parameters
    ----------
    lit_lamps : sequence of LitLamp
    spectrum : Spectrum
        Of all of them, relative. [any unit]
    luminous_exitance_lm_m2 : float
        Luminous flux that each square metre of lamp sends. [lm/m²]

    Returns
    -------
    lamps : tuple of Lamp
        Named 'lit 1', 'lit 2', ...

    Raises
    ------
    LampError
        If no lamp was found, or the spectrum has no light that the eye sees.
    """
    if not lit_lamps:
        raise LampError(
            expected="lamps lit in the scan's texture",
            found="none",
            where="[lamps_from_scan]",
            todo="Give each lamp as [[lamps]] in its place: centre, size, spectrum and flux.",
        )
    one_lumen = _scaled(spectrum, 1.0, luminous_flux_lm(spectrum), "[lamps_from_scan]", "lumens")
    return tuple(
        Lamp(
            name=f"lit {number}",
            shape=lit.shape,
            center=lit.center,
            normal=lit.normal,
            rotation_deg=lit.rotation_deg,
            flux=one_lumen.scaled(luminous_exitance_lm_m2 * lit.shape.area),
        )
        for number, lit in enumerate(lit_lamps, start=1)
    )


def _candela_text(path: Path) -> str:
    """LM-63 text of a luminaire's file, which may be an EULUMDAT one."""
    return ies_text_of_ldt(path) if path.suffix.lower() == ".ldt" else read_ies_text(path)


def _source(
    spectrum: Spectrum | str | PathLike[str] | None, cct_k: float | None, folder: str | PathLike[str], where: str
) -> tuple[Spectrum, bool]:
    """The spectrum that is meant, and whether it is in W/nm."""
    if (spectrum is None) == (cct_k is None):
        raise LampError(
            expected="either spectrum or cct_k", found="neither" if spectrum is None else "both", where=where
        )
    if cct_k is not None:
        return cct_spectrum(number_of(cct_k, name=f"{where} cct_k", unit="K")), False
    if isinstance(spectrum, Spectrum):
        return spectrum, True
    if not isinstance(spectrum, str | PathLike):
        raise ArgumentError(
            expected="a Spectrum, a name of the databases, or a file of a spectrum",
            found=f"a value of type {type(spectrum).__name__}",
            where=f"spectrum of {where}",
        )
    found = lamp_spectrum(str(spectrum), folder)
    return found.spectrum, found.absolute


def _flux(
    source: tuple[Spectrum, bool], lumens: float | None, watts: float | None, where: str, table: CandelaTable | None
) -> Spectrum:
    spectrum, absolute = source
    if lumens is not None and watts is not None:
        raise LampError(expected="luminous_flux_lm or radiant_flux_W", found="both", where=where)
    for name, value in (("luminous_flux_lm", lumens), ("radiant_flux_W", watts)):
        if value is not None and number_of(value, name=f"{where} {name}", unit=name.rpartition("_")[2]) <= 0:
            raise LampError(expected=f"a {name} above 0", found=f"{value}", where=where)
    if lumens is not None:
        return _scaled(spectrum, lumens, luminous_flux_lm(spectrum), where, "lumens")
    if watts is not None:
        return _scaled(spectrum, watts, spectrum.integral(), where, "watts")
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
