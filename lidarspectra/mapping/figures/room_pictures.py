"""Pictures of a room for the eye: tone-mapped colour, and luminance in false colour.

Colour is adapted to the lamps' white as an eye in the room is (Bradford's cone responses, CIE 159), luminance brought
into a display's range by Reinhard's global operator, L' = L (1 + L/L_white²) / (1 + L), with L the luminance over that
of a middle grey, which the picture's log-mean luminance becomes.

References
----------
Reinhard, Stark, Shirley, Ferwerda 2002, ACM Trans. Graphics 21, 267: Eq. 1, 2 and 4.
"""

import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator

from lidarspectra.arrays import ByteArray, FloatArray
from lidarspectra.mapping.figures.figure_style import LIGHT_MAP, MUTED, PAGE_WIDTH_IN, new_figure, place, styled
from lidarspectra.spectra.colorimetry import BRADFORD, SRGB_WHITE_XYZ, encode_srgb, xyz_to_linear_srgb

MIDDLE_GREY = 0.22  # [1] of white, that the log-mean luminance becomes
WHITE_PERCENTILE = 99.0  # of luminance: what is brighter is white
DARKEST_SHARE = 0.01  # percentile of luminance at which the scale of false colour starts
SCALE_DECADES = 3.0  # that it spans at most


def tone_mapped(xyz: FloatArray, white_xyz: FloatArray) -> ByteArray:
    """A picture for a display.

    Parameters
    ----------
    xyz : (row, column, 3) float
        Y is luminance; 0 where the picture shows nothing. [cd/m²]
    white_xyz : (3,) float
        Of the lamps' light, in any unit: what the eye takes for white.

    Returns
    -------
    pixels : (row, column, 3) uint8
        sRGB.
    """
    cones = (BRADFORD @ SRGB_WHITE_XYZ) / (BRADFORD @ (white_xyz / white_xyz[1]))
    adapted = xyz @ (np.linalg.inv(BRADFORD) @ np.diag(cones) @ BRADFORD).T
    luminance = np.maximum(xyz[..., 1], 0.0)
    lit = luminance[luminance > 0]
    if not lit.size:
        return np.zeros(xyz.shape, dtype=np.uint8)
    middle = float(np.exp(np.log(lit).mean()))
    scaled = MIDDLE_GREY * luminance / middle
    white = max(float(np.percentile(scaled[luminance > 0], WHITE_PERCENTILE)), 1.0)
    shown = scaled * (1.0 + scaled / white**2) / (1.0 + scaled)
    factor = np.where(luminance > 0, shown / np.where(luminance > 0, luminance, 1.0), 0.0)
    linear = xyz_to_linear_srgb(adapted * factor[..., None])
    return np.rint(255.0 * encode_srgb(_in_gamut(linear, np.minimum(shown, 1.0)))).astype(np.uint8)


def _in_gamut(linear: FloatArray, grey: FloatArray) -> FloatArray:
    """Colours mixed with grey of their luminance until no part is below 0 or above 1."""
    middle = grey[..., None]
    chroma = linear - middle
    with np.errstate(divide="ignore", invalid="ignore"):
        room = np.where(chroma > 0, (1.0 - middle) / chroma, np.where(chroma < 0, -middle / chroma, np.inf))
    share = np.clip(room.min(axis=-1, keepdims=True), 0.0, 1.0)
    return np.asarray(middle + share * chroma, dtype=np.float64)


@styled
def luminance_figure(luminance: FloatArray, *, title: str = "") -> Figure:
    """Luminance in false colour with a logarithmic legend.

    Parameters
    ----------
    luminance : (row, column) float
        0 where the picture shows nothing. [cd/m²]
    title : str
        Above it.
    """
    lit = luminance[luminance > 0]
    highest = float(lit.max()) if lit.size else 1.0
    lowest = float(np.percentile(lit, 100.0 * DARKEST_SHARE)) if lit.size else 0.1
    lowest = min(max(lowest, highest / 10.0**SCALE_DECADES), 0.5 * highest)
    rows, columns = luminance.shape
    width = PAGE_WIDTH_IN - 1.5
    height = min(width * rows / columns, 7.0)
    width = height * columns / rows
    top = 0.35 if title else 0.1
    figure = new_figure(width + 1.5, height + 0.1 + top)
    axes = place(figure, 0.1, 0.1, width, height)
    shown = np.ma.masked_less_equal(luminance, 0.0)
    image = axes.imshow(shown, cmap=LIGHT_MAP, norm=LogNorm(lowest, highest), interpolation="nearest")
    axes.set_axis_off()
    if title:
        figure.text(0.1 / (width + 1.5), 1.0 - 0.22 / (height + 0.1 + top), title, weight="bold", size=9.5)
    bar = figure.colorbar(image, cax=place(figure, width + 0.25, 0.1 + 0.1 * height, 0.16, 0.8 * height), extend="min")
    bar.ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    bar.ax.yaxis.set_minor_locator(LogLocator(subs=()))
    bar.set_label("luminance [cd/m²]")
    bar.outline.set_edgecolor(MUTED)
    return figure
