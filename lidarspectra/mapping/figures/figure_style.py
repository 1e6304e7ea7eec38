"""The house style of all figures: one type size, colours for every eye, units on every axis, no pyplot state.

Colour maps are of even lightness steps, so that they read in black and white and for the colour-blind; lines differ
by marker and dash as well as by colour. What is drawn in `INK` and `MUTED` takes the page's own text colours where a
figure stands in the report.
"""

import base64
import io
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal, ParamSpec
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont, get_font
from numpy.typing import ArrayLike

from lidarspectra.errors import MapError
from lidarspectra.io.files import writing
from lidarspectra.mapping.figures.printable import printable

INK = "#1d2126"
MUTED = "#6a7178"
BLUE, VERMILION = "#0072b2", "#d55e00"
OKABE_ITO = (BLUE, VERMILION, "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7f6a00", INK)
"""Colours that the colour-blind tell apart (Okabe and Ito 2008), the yellow darkened to stand on white."""
PAGE_COLORS = {INK: "currentColor", MUTED: "var(--muted, #6a7178)", BLUE: "var(--blue, #0072b2)"}
"""What a figure's colours are called in a page, which has others in the dark."""
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "*")
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (3, 1)), (0, (1, 1)), "-")
LIGHT_MAP = "inferno"  # dark where it is dark; even steps of lightness
DIFFERENCE_MAP = "RdBu_r"  # white in the middle
ERROR_MAP = "cividis"  # another quantity, another map
POINTS_PER_IN = 72.0
DPI = 200  # [1/in] of the PNG files
PAGE_DPI = 144  # [1/in] of pictures within SVG: three pixels for two of a page that shows the figure at its own width
PAGE_WIDTH_IN = 10.0  # [in] a figure over the whole width of the page
LONGEST_LABEL = 40  # characters of a user's name in a figure
FileType = Literal["png", "svg", "pdf"]
FILE_TYPES: tuple[FileType, ...] = ("png", "svg")
PNG_LEVEL = 1  # of zlib; more halves the file and takes ten times as long

STYLE: dict[Any, Any] = {
    "axes.edgecolor": MUTED,
    "axes.facecolor": "none",
    "axes.formatter.use_mathtext": False,
    "axes.labelcolor": INK,
    "axes.labelsize": 9.0,
    "axes.linewidth": 0.7,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlecolor": INK,
    "axes.unicode_minus": True,
    "figure.facecolor": "white",
    "font.family": ["DejaVu Sans"],  # comes with matplotlib: the same letters on every machine
    "font.size": 9.0,
    "grid.color": MUTED,
    "grid.alpha": 0.25,
    "grid.linewidth": 0.5,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "legend.labelcolor": INK,
    "lines.linewidth": 1.6,
    "lines.markersize": 4.5,
    "pdf.fonttype": 42,
    "savefig.dpi": DPI,
    "svg.fonttype": "path",
    "svg.hashsalt": "lidarspectra",
    "text.color": INK,
    "text.parse_math": False,  # a '$' in a lamp's name is a dollar
    "xtick.color": MUTED,
    "xtick.labelcolor": INK,
    "xtick.labelsize": 8.0,
    "ytick.color": MUTED,
    "ytick.labelcolor": INK,
    "ytick.labelsize": 8.0,
}

# No file tells when and by which version it was made: the same numbers give the same bytes.
_MARKS: dict[FileType, dict[str, None]] = {
    "png": {"Software": None},
    "svg": {"Date": None, "Creator": None},
    "pdf": {"CreationDate": None, "Producer": None, "Creator": None},
}
_OPTIONS: dict[FileType, dict[str, Any]] = {"png": {"pil_kwargs": {"compress_level": PNG_LEVEL}}}
_SVG = "http://www.w3.org/2000/svg"
_XLINK = "http://www.w3.org/1999/xlink"
_LINKS = (f"{{{_XLINK}}}href", "href")
_SHAPES = ("svg", "g", "defs", "clipPath", "pattern", "path", "rect", "use", "image")  # all that figures are made of
_OUTSIDE = re.compile(r"url\((?!#)|\\", re.IGNORECASE)  # a backslash could spell the same
Parameters = ParamSpec("Parameters")


@dataclass(frozen=True, kw_only=True)
class Prefix:
    """A decimal prefix that brings values near one.

    Parameters
    ----------
    symbol : str
        '', 'm', 'µ', 'n'.
    factor : float
        What values in the plain unit are multiplied by. [1]
    """

    symbol: str
    factor: float


def styled(draw: Callable[Parameters, Figure]) -> Callable[Parameters, Figure]:
    """Let a function draw its figure in the house style, whatever the user's own matplotlib settings are."""

    def draw_styled(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Figure:
        with house_style():
            return draw(*args, **kwargs)

    draw_styled.__doc__ = draw.__doc__
    draw_styled.__name__ = draw.__name__
    return draw_styled


@contextmanager
def house_style() -> Iterator[None]:
    """The settings of all figures, while drawing and while saving."""
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(STYLE)
        yield


def new_figure(width_in: float, height_in: float) -> Figure:
    """An empty figure that knows no window."""
    figure = Figure(figsize=(width_in, height_in))
    FigureCanvasAgg(figure)
    return figure


def place(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    """Axes at a place in the figure, all in inches from its lower left corner."""
    full_width, full_height = (float(size) for size in figure.get_size_inches())
    box = (left / full_width, bottom / full_height, width / full_width, height / full_height)
    return figure.add_axes(box)


def save_figure(figure: Figure, folder: Path, name: str, *, kinds: Sequence[FileType] = FILE_TYPES) -> tuple[Path, ...]:
    """Write a figure as NAME.png and NAME.svg, or as files of other kinds.

    Parameters
    ----------
    figure : Figure
        In house style.
    folder : Path
        Exists.
    name : str
        File name without its ending, of our own choosing.
    kinds : sequence of str
        'png', 'svg' (its letters as shapes), 'pdf' (its letters as text, which takes three times as long).

    Returns
    -------
    paths : tuple of Path

    Raises
    ------
    MapError
        If a file cannot be written.
    """
    paths = tuple(folder / f"{name}.{kind}" for kind in kinds)
    with writing(folder, error=MapError), house_style():
        for path, kind in zip(paths, kinds, strict=True):
            figure.savefig(path, metadata=_MARKS[kind], **_OPTIONS.get(kind, {}))
    return paths


def save_picture(figure: Figure, path: Path) -> Path:
    """Write a figure as one PNG file; raises MapError if its name has another ending or it cannot be written."""
    if path.suffix.lower() != ".png":
        raise MapError(
            expected="a file name that ends in .png",
            found=f"'{path.name}'",
            where=str(path),
            todo="Pictures are drawn as PNG: give such a name.",
        )
    with writing(path, error=MapError), house_style():
        figure.savefig(path, metadata=_MARKS["png"], **_OPTIONS["png"])
    return path


def svg_text(figure: Figure) -> str:
    """A figure in house style as a file of SVG, without a background."""
    stream = io.BytesIO()
    with house_style():
        figure.savefig(stream, format="svg", transparent=True, dpi=PAGE_DPI, metadata=_MARKS["svg"])
    return stream.getvalue().decode("utf-8")


def page_svg(svg: str, *, name: str, label: str) -> str:
    """A file of SVG as an element for an HTML page: text in the page's colours, no names that clash.

    Parameters
    ----------
    svg : str
        Of `svg_text`.
    name : str
        Set before every id in it.
    label : str
        What a screen reader says.

    Returns
    -------
    svg : str
        Shapes alone, without comments, scripts or references to anything outside itself.

    Raises
    ------
    ValueError
        If it is no such file: see `svg_width_in`.
    """
    for prefix, space in (("", _SVG), ("xlink", _XLINK)):
        ElementTree.register_namespace(prefix, space)
    root = ElementTree.fromstring(svg.encode("utf-8"))
    width_in = svg_width_in(root)
    _keep_shapes(root)
    names: set[str] = set()
    for element in root.iter():
        if element.get("id") in names:  # the same marker, defined again under the hash of its shape
            del element.attrib["id"]
        names.add(element.get("id", ""))
        for key, value in list(element.attrib.items()):
            if _acts(element.tag, key, value):
                del element.attrib[key]  # matplotlib writes none; of a file that was kept nobody knows
            else:
                element.set(key, _page_value(key, value, name))
    root.attrib.pop("height", None)
    root.set("width", "100%")
    root.set("style", f"max-width: {width_in * 100:.0f}px; stroke-linejoin: round; stroke-linecap: butt")
    root.set("role", "img")
    root.set("aria-label", printable(label))
    return ElementTree.tostring(root, encoding="unicode")


def svg_width_in(root: ElementTree.Element) -> float:
    """Width of a file of `svg_text` [in].

    Raises
    ------
    ValueError
        If it is another file: no SVG, or one that another program has saved, which measures in other units.
    """
    width = root.get("width", "")
    if root.tag != f"{{{_SVG}}}svg" or not width.endswith("pt"):
        raise ValueError(f"expected an SVG whose width is in pt, found '{root.tag}' of width '{width}'")
    return float(width.removesuffix("pt")) / POINTS_PER_IN


def _keep_shapes(root: ElementTree.Element) -> None:
    """Drop all that is no shape: styles would hold for the whole page, scripts and animations would act."""
    shapes = {f"{{{_SVG}}}{tag}" for tag in _SHAPES}
    for parent in list(root.iter()):
        for child in [each for each in parent if each.tag not in shapes]:
            parent.remove(child)


def _acts(tag: str, key: str, value: str) -> bool:
    """Whether an attribute runs something, or asks for what is outside of the figure; HTML takes ONLOAD for onload."""
    if key in _LINKS:
        is_picture = tag == f"{{{_SVG}}}image" and value.startswith("data:image/")
        return not (is_picture or value.startswith("#"))
    return key.lower().startswith("on") or _OUTSIDE.search(value) is not None


def _page_value(key: str, value: str, name: str) -> str:
    if key == "id":
        return f"{name}-{value}"
    if key in _LINKS:
        return f"#{name}-{value[1:]}" if value.startswith("#") else value
    for color, page_color in PAGE_COLORS.items():
        value = value.replace(color, page_color)
    return value.replace("url(#", f"url(#{name}-")


def prefix_of(values: ArrayLike) -> Prefix:
    """The decimal prefix that brings the largest of the values [any unit] between 1 and 1000, down to nano."""
    sizes = np.abs(np.asarray(values, dtype=np.float64))
    largest = float(np.nanmax(sizes)) if sizes.size else 0.0
    for symbol, factor in (("", 1.0), ("m", 1e3), ("µ", 1e6)):
        if largest * factor >= 1.0 or largest == 0.0:
            return Prefix(symbol=symbol, factor=factor)
    return Prefix(symbol="n", factor=1e9)


def irradiance_unit(prefix: Prefix) -> str:
    """Unit of spectral irradiance with a prefix, for axes."""
    return f"{prefix.symbol}W m⁻² nm⁻¹"


def plain(text: str, *, longest: int = LONGEST_LABEL) -> str:
    """A user's words as a figure can draw them: one line, no control characters, letters that the font has.

    The full words stand in the report's tables.
    """
    words = " ".join(text.split())
    known = _letters()
    drawn = "".join(letter if ord(letter) in known else "□" for letter in words)
    return drawn if len(drawn) <= longest else drawn[: longest - 1] + "…"


@cache
def _letters() -> frozenset[int]:
    return frozenset(get_font(findfont("DejaVu Sans")).get_charmap())


def data_uri(content: bytes, kind: str) -> str:
    """Bytes as an address that holds them, `data:image/jpeg;base64,...`."""
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"
