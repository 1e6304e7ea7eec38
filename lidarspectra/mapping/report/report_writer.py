"""Writes the figures and tables of the report's sections as files, and gives them as HTML."""

from pathlib import Path

from matplotlib.figure import Figure

from lidarspectra.errors import MapError
from lidarspectra.io.files import writing
from lidarspectra.mapping.figures.figure_style import inline_svg, save_figure
from lidarspectra.mapping.figures.tables import Table, save_table, table_html
from lidarspectra.mapping.report import report_page as html


class ReportWriter:
    """Numbers figures, writes figures and tables beside the page, and gives their HTML.

    Parameters
    ----------
    folder : Path
        The report's; made if absent, with `figures` and `tables` in it.

    Raises
    ------
    MapError
        If it cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        self._figures, self._tables = folder / "figures", folder / "tables"
        self._number = 0
        with writing(folder, error=MapError):
            self._figures.mkdir(parents=True, exist_ok=True)
            self._tables.mkdir(parents=True, exist_ok=True)

    def figure(self, name: str, figure: Figure, caption: str) -> str:
        """Save a figure and give it as an element."""
        self._number += 1
        save_figure(figure, self._figures, name)
        svg = inline_svg(figure, name=name, label=caption)
        return html.figure(svg, number=self._number, caption=caption, name=name)

    def save(self, name: str, figure: Figure) -> None:
        """Save a figure that the page itself does not contain."""
        save_figure(figure, self._figures, name)

    def table(self, table: Table, *, max_rows: int | None = None) -> str:
        """Save a table and give it as an element."""
        save_table(table, self._tables)
        links = html.files(f"tables/{table.name}", ("csv", "md", "html"))
        return table_html(table, max_rows=max_rows) + f'<p class="files">{links}</p>'
