"""IES TM-27 files (.spdx): the XML that lighting engineers hand spectra on in.

References
----------
IES TM-27-14 and TM-27-20, IES Standard Format for the Electronic Transfer of Spectral Data: `SpectralQuantity`, and a
`SpectralData` for each wavelength [nm].
"""

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from lidarspectra.errors import DatabaseError

UNIT_OF_FLUX = "W/nm"  # of the quantity 'flux' (TM-27); other quantities are not all of a lamp's light


def is_tm27(text: str) -> bool:
    """Whether a text is XML, as no table of a spectrum is."""
    return text.lstrip().startswith("<")


def read_tm27(text: str, path: Path) -> tuple[str, list[tuple[str, str]]]:
    """Heading and cells of a spectrum.

    Parameters
    ----------
    text : str
        Of the file.
    path : Path
        Where it is, for errors.

    Returns
    -------
    heading : str
        'W/nm' of a flux, else the quantity that the file names.
    cells : list of (str, str)
        Wavelength [nm] and value, as they stand in the file.

    Raises
    ------
    DatabaseError
        If it is no such file.
    """
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as cause:
        raise _no_tm27(path, f"XML that cannot be parsed ({cause})") from cause
    quantities = [(each.text or "").strip() for each in _named(root, "SpectralQuantity")]
    cells = [(each.get("wavelength", ""), (each.text or "").strip()) for each in _named(root, "SpectralData")]
    if len(quantities) > 1:
        raise _no_tm27(path, f"{len(quantities)} spectra in one file")
    if not cells:
        raise _no_tm27(path, f"other XML, <{root.tag.rpartition('}')[2][:40]}>")
    quantity = "".join(quantities)
    return UNIT_OF_FLUX if quantity.lower() == "flux" else quantity, cells


def _named(root: ElementTree.Element, name: str) -> Iterator[ElementTree.Element]:
    """Elements of a name in any name space."""
    return (each for each in root.iter() if str(each.tag).rpartition("}")[2] == name)


def _no_tm27(path: Path, found: str) -> DatabaseError:
    return DatabaseError(
        expected="an IES TM-27 file of one spectrum (.spdx), or a table of wavelength and value",
        found=found,
        where=str(path),
        todo="Export the spectrum as TM-27, or as a CSV of two columns.",
    )
