"""Figures of materials: the views before and after segmentation (paper, Figure 3), and their colours de-lighted."""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from lidarspectra.arrays import ByteArray, FloatArray, IntArray
from lidarspectra.errors import MapError
from lidarspectra.mapping.figures.channel_figures import ReportView
from lidarspectra.mapping.figures.figure_style import INK, MUTED, PAGE_WIDTH_IN, new_figure, place, plain, styled
from lidarspectra.spectra.colorimetry import LUMINANCE_FROM_SRGB, encode_srgb

CODE_COLORS = (
    (31, 119, 180), (255, 127, 14), (44, 160, 44), (214, 39, 40), (148, 103, 189), (140, 86, 75), (227, 119, 194),
    (188, 189, 34), (23, 190, 207), (174, 199, 232), (255, 187, 120), (152, 223, 138), (255, 152, 150), (197, 176, 213),
)  # fmt: skip  # sRGB of the largest kinds, easy to distinguish
CLASSES = (
    "painted", "wood", "foliage", "brick", "fabric", "leather", "plastic", "paper", "glass", "metal", "tile", "carpet",
    "ceramic", "stone",
)  # fmt: skip  # each has its own of these colours in every room
OTHER_COLOR = (127, 127, 127)  # sRGB of all smaller ones
NOTHING_COLOR = (0, 0, 0)  # sRGB where a ray left the scan
UNKNOWN_CLASSES = ("unknown", "")
GAP_IN, ROW_TITLE_IN, LEGEND_LINE_IN = 0.08, 0.24, 0.2  # [in] of the figure of views
TITLE_GAP_IN = 0.045  # [in] from a picture to the words over it
TITLE_SIZE = 9.5  # [pt] of these
LEGEND_COLUMNS = 5
MAX_COMPARED = 10  # materials in the figure of light


@dataclass(frozen=True, kw_only=True, eq=False)
class MaterialCode:
    """The colour code of the kinds of surface.

    Parameters
    ----------
    kind : str
        What the kinds are: 'class' where surfaces were classified, else 'material'.
    names : tuple of str
        The kinds that have a colour of their own, largest first.
    of_material : (material,) int
        Which kind each material is; -1 for the small ones.
    colors : tuple of (int, int, int)
        sRGB of each kind.
    """

    kind: str
    names: tuple[str, ...]
    of_material: IntArray
    colors: tuple[tuple[int, int, int], ...]

    def image(self, face: IntArray, face_material: IntArray) -> ByteArray:
        """Colour-code a view.

        Parameters
        ----------
        face : (row, column) int
            Face behind each pixel; -1 for none.
        face_material : (face,) int

        Returns
        -------
        image : (row, column, 3) uint8
            sRGB.
        """
        palette = np.array([*self.colors, OTHER_COLOR, NOTHING_COLOR], dtype=np.uint8)
        kind = np.append(np.where(self.of_material < 0, len(self.names), self.of_material), len(self.names) + 1)
        of_face = np.append(kind[face_material], len(self.names) + 1)
        return np.asarray(palette[of_face[face]], dtype=np.uint8)


@dataclass(frozen=True, kw_only=True, eq=False)
class MaterialPictures:
    """Pictures for the report of how materials were found.

    Parameters
    ----------
    views, segmented, lit_evenly : tuple of ReportView
        The first views; the same by kind of surface; and the same as even daylight would show them.
    code : MaterialCode
        The colours of `segmented`.
    shown, found : (material, 3) float
        Mean linear sRGB in the scan, and of the reflectance in even daylight. [0-1]
    """

    views: tuple[ReportView, ...]
    segmented: tuple[ReportView, ...]
    lit_evenly: tuple[ReportView, ...]
    code: MaterialCode
    shown: FloatArray
    found: FloatArray


def material_code(names: tuple[str, ...], classes: tuple[str, ...], areas_m2: FloatArray) -> MaterialCode:
    """Give the largest classes colours, or the largest materials where no classes are known.

    A class of `CLASSES` has the same colour in every room.

    Parameters
    ----------
    names, classes : tuple of str
        Of the materials.
    areas_m2 : (material,) float
        [m²]
    """
    classified = len({each for each in classes if each not in UNKNOWN_CLASSES}) > 1
    kinds = classes if classified else tuple(f"{number} {name}" for number, name in enumerate(names))
    total: dict[str, float] = {}
    for kind, area in zip(kinds, areas_m2.tolist(), strict=True):
        total[kind] = total.get(kind, 0.0) + area
    largest = sorted(total, key=lambda kind: -total[kind])[: len(CODE_COLORS)]
    number = {kind: index for index, kind in enumerate(largest)}
    return MaterialCode(
        kind="class" if classified else "material",
        names=tuple(largest),
        of_material=np.array([number.get(kind, -1) for kind in kinds], dtype=np.int64),
        colors=_colors(largest),
    )


def _colors(names: list[str]) -> tuple[tuple[int, int, int], ...]:
    """Colours (sRGB) of the kinds: a class's own, and for others those that are left, in order."""
    own = dict(zip(CLASSES, CODE_COLORS, strict=True))
    taken = [own[name] for name in names if name in own]
    left = iter(color for color in CODE_COLORS if color not in taken)
    return tuple(own[name] if name in own else next(left) for name in names)


@styled
def segmentation_figure(pictures: MaterialPictures) -> Figure:
    """Views in the scan's colours, their surfaces by kind (paper, Figure 3), and their estimated reflectances.

    Parameters
    ----------
    pictures : MaterialPictures
        With at least one view.
    """
    rows = (pictures.views, pictures.segmented, pictures.lit_evenly)
    if not pictures.views or len({len(row) for row in rows}) != 1:
        raise MapError(
            expected="the same number of pictures in each row, at least one",
            found=", ".join(str(len(row)) for row in rows),
            where="figure of the segmentation",
        )
    words = ("as scanned", f"by {pictures.code.kind}", "estimated reflectance, in even daylight")
    count = len(pictures.views)
    across = (PAGE_WIDTH_IN - GAP_IN * (count + 1)) / count
    down = across * pictures.views[0].image.shape[0] / pictures.views[0].image.shape[1]
    handles = _legend_handles(pictures.code)
    legend = LEGEND_LINE_IN * -(-len(handles) // LEGEND_COLUMNS) + 0.15
    height = len(rows) * (down + ROW_TITLE_IN) + legend + GAP_IN
    figure = new_figure(PAGE_WIDTH_IN, height)
    axes = place(figure, 0.0, 0.0, PAGE_WIDTH_IN, height)  # one for all: axes for each picture take five times as long
    axes.set_axis_off()
    figure.suppressComposite = True  # each picture stays one of its own in an SVG
    for row, (shown, said) in enumerate(zip(rows, words, strict=True)):
        bottom = legend + (len(rows) - 1 - row) * (down + ROW_TITLE_IN)
        for column, view in enumerate(shown):
            left = GAP_IN + column * (across + GAP_IN)
            axes.imshow(
                view.image,
                interpolation="nearest" if row == 1 else "antialiased",
                extent=(left, left + across, bottom, bottom + down),
                aspect="auto",
            )
            if row == 0 or column == 0:
                words_there = plain(view.name) if row == 0 else said
                axes.text(left, bottom + down + TITLE_GAP_IN, words_there, fontsize=TITLE_SIZE, fontweight="bold")
    axes.set_xlim(0.0, PAGE_WIDTH_IN)
    axes.set_ylim(0.0, height)
    figure.legend(handles=handles, loc="lower left", ncols=LEGEND_COLUMNS, frameon=False, fontsize=8.0)
    return figure


def _legend_handles(code: MaterialCode) -> list[Patch]:
    entries = [*zip(code.names, code.colors, strict=True)]
    if (code.of_material < 0).any():
        entries.append(("smaller ones", OTHER_COLOR))
    return [Patch(facecolor=_unit(color), label=plain(name, longest=24)) for name, color in entries]


@styled
def light_figure(names: tuple[str, ...], areas_m2: FloatArray, shown: FloatArray, found: FloatArray) -> Figure:
    """The main materials as the scan shows them and in even daylight, with the luminance of both.

    Parameters
    ----------
    names : tuple of str
        Of the materials.
    areas_m2 : (material,) float
        [m²]
    shown, found : (material, 3) float
        Mean linear sRGB in the scan, and of the reflectance in daylight. [0-1]
    """
    order = np.argsort(-areas_m2, kind="stable")[:MAX_COMPARED]
    order = order[areas_m2[order] > 0]
    row, top, left = 0.34, 0.4, 3.4
    figure = new_figure(PAGE_WIDTH_IN, top + row * len(order) + 0.1)
    axes = place(figure, 0.1, 0.1, PAGE_WIDTH_IN - 0.2, row * len(order) + top - 0.1)
    axes.set_xlim(0, PAGE_WIDTH_IN - 0.2)
    axes.set_ylim(0, row * len(order) + top - 0.1)
    axes.set_axis_off()
    high = row * len(order)
    for x, words in (
        (0.0, "material"),
        (left, "as the scan shows it"),
        (left + 3.2, "estimated reflectance, in even daylight"),
    ):
        axes.text(x, high + 0.08, words, color=MUTED, va="bottom")
    for place_down, number in enumerate(order.tolist()):
        y = high - (place_down + 1) * row
        axes.text(0.0, y + row / 2, f"{plain(names[number])}, {areas_m2[number]:.1f} m²", va="center", color=INK)
        for x, color in ((left, shown[number]), (left + 3.2, found[number])):
            axes.add_patch(Rectangle((x, y + 0.03), 2.2, row - 0.06, facecolor=encode_srgb(color), edgecolor=MUTED))
            axes.text(x + 2.3, y + row / 2, f"{float(LUMINANCE_FROM_SRGB @ color):.2f}", va="center", color=INK)
    return figure


def mean_shown_colors(
    face_color: FloatArray, face_material: IntArray, face_areas: FloatArray, count: int
) -> FloatArray:
    """(material, 3) area-weighted mean of what the scan shows of each material.

    Parameters
    ----------
    face_color : (face, 3) float
        Linear sRGB. [0-1]
    face_material : (face,) int
    face_areas : (face,) float
        [m²]
    count : int
        Of materials.
    """
    total = np.bincount(face_material, weights=face_areas, minlength=count)
    sums = [np.bincount(face_material, weights=face_areas * channel, minlength=count) for channel in face_color.T]
    return np.asarray(np.stack(sums, axis=1) / np.maximum(total, 1e-12)[:, None], dtype=np.float64)


def painted(face: IntArray, face_color: FloatArray) -> ByteArray:
    """(row, column, 3) uint8 sRGB of a view whose faces have linear sRGB colours of their own; black where none is."""
    colors = np.vstack([face_color, np.zeros((1, 3))])  # -1, for no face, is the last
    return np.asarray(np.rint(255.0 * encode_srgb(colors))[face], dtype=np.uint8)


def _unit(color: tuple[int, int, int]) -> tuple[float, float, float]:
    return (color[0] / 255.0, color[1] / 255.0, color[2] / 255.0)
