"""Writes the figures and tables of the report's sections as files, and gives them as HTML."""

from collections.abc import Callable, Sequence
from pathlib import Path

from matplotlib.figure import Figure

from lidarspectra.errors import MapError
from lidarspectra.io.files import write_whole, writing
from lidarspectra.mapping.figures.figure_style import FileType, page_svg, save_figure, svg_text
from lidarspectra.mapping.figures.tables import Table, save_table, table_html
from lidarspectra.mapping.report import report_page as html


class ReportWriter:
    """Writes figures and tables beside the page, and gives their HTML.

    A figure is drawn once, as SVG: for the page and as a file. Files of other kinds are drawn by `finish`, after it.

    Parameters
    ----------
    folder : Path
        The report's; made if absent, with `figures` and `tables` in it.
    kinds : sequence of str
        Of the figures' files: 'svg', 'png', 'pdf'.

    Raises
    ------
    MapError
        If it cannot be written.
    """

    def __init__(self, folder: Path, kinds: Sequence[FileType] = ("svg",)) -> None:
        self._kinds = kinds
        self._drawn_later: list[tuple[str, Callable[[], Figure]]] = []
        self._figures, self._tables = folder / "figures", folder / "tables"
        with writing(folder, error=MapError):
            self._figures.mkdir(parents=True, exist_ok=True)
            self._tables.mkdir(parents=True, exist_ok=True)

    @property
    def only_svg(self) -> bool:
        """Whether no figure is drawn after the page."""
        return not set(self._kinds) - {"svg"}

    def figure(self, name: str, figure: Figure, caption: str) -> str:
        """Draw a figure and give it as an element."""
        return self.drawn(name, svg_text(figure), lambda: figure, caption)

    def drawn(self, name: str, svg: str, draw: Callable[[], Figure], caption: str) -> str:
        """Give a figure that is drawn already as an element; it is drawn again for files of other kinds than SVG."""
        if "svg" in self._kinds:
            path = self._figures / f"{name}.svg"
            with writing(path, error=MapError):
                write_whole(path, svg)
        if not self.only_svg:
            self._drawn_later.append((name, draw))
        element = page_svg(svg, name=name, label=caption)
        return html.figure(element, caption=caption, name=name, kinds=self._kinds)

    def finish(self) -> None:
        """Draw the files that the page has links to, but does not show."""
        kinds = [kind for kind in self._kinds if kind != "svg"]
        for name, draw in self._drawn_later:
            save_figure(draw(), self._figures, name, kinds=kinds)

    def table(self, table: Table, *, max_rows: int | None = None) -> str:
        """Save a table and give it as an element."""
        save_table(table, self._tables)
        links = html.files(f"tables/{table.name}", ("csv", "md", "html"))
        return table_html(table, max_rows=max_rows) + f'<p class="files">{links}</p>'
