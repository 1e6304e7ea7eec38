"""Applications in the report beyond the maps: one record each, with figures and tables."""

from dataclasses import dataclass

from matplotlib.figure import Figure

from lidarspectra.mapping.figures.tables import Table


@dataclass(frozen=True, kw_only=True, eq=False)
class ApplicationFigure:
    """A figure with its file name and caption."""

    name: str
    figure: Figure
    caption: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Application:
    """A section of the report.

    Parameters
    ----------
    title : str
        Of the section.
    words : tuple of str
        Paragraphs before its figures.
    figures : tuple of ApplicationFigure
    tables : tuple of Table
    """

    title: str
    words: tuple[str, ...] = ()
    figures: tuple[ApplicationFigure, ...] = ()
    tables: tuple[Table, ...] = ()
