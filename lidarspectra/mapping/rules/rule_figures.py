"""Tables and figures of a check against rules."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from lidarspectra.arrays import ByteArray
from lidarspectra.mapping.figures.figure_style import (
    BLUE,
    INK,
    MUTED,
    PAGE_WIDTH_IN,
    VERMILION,
    new_figure,
    place,
    plain,
    styled,
)
from lidarspectra.mapping.figures.tables import Table
from lidarspectra.mapping.rules.rule_record import LookRow, RuleRecord, RuleRow
from lidarspectra.words import digits

ROW_IN = 0.27  # [in]
WORDS_IN, NUMBERS_IN = 4.6, 1.5  # [in] of the columns left and right
MAX_WORDS = 70  # letters of a requirement, which fill the left column
WIDEST = 4.0  # the scale's least end, as a factor on either side
LIKELY, UNLIKELY = 0.95, 0.05
ACROSS = 4  # pictures in a row
NEAR_ONE = 0.995


def chance_words(probability: float) -> str:
    """A probability in per cent that is never said to be certain."""
    if probability > NEAR_ONE:
        return "> 99 %"
    return "< 1 %" if probability < 1.0 - NEAR_ONE else f"{100.0 * probability:.0f} %"


def rules_table(record: RuleRecord) -> Table:
    """Every requirement, and the probability that it is kept."""
    frame = pd.DataFrame(
        {
            "rule": [row.rule for row in record.rows],
            "requirement": [row.what for row in record.rows],
            "where": [row.where for row in record.rows],
            "limit": [f"{row.sense} {row.limit:g} {row.unit}".rstrip() for row in record.rows],
            "as traced": [digits(row.traced, ".3g") for row in record.rows],
            "best estimate": [digits(row.value, ".3g") for row in record.rows],
            "5 to 95 %": [f"{digits(row.low, '.3g')} to {digits(row.high, '.3g')}" for row in record.rows],
            "probability": [chance_words(row.probability) for row in record.rows],
        }
    )
    caption = (
        "Requirements; what was traced, times the maintenance factor where it counts; the median and the range in "
        "which the run's uncertainty lets the truth be, light that the trace left out among it; and the probability "
        "that the requirement is kept."
    )
    return Table(name="rules", caption=caption, frame=frame)


def whole_table(record: RuleRecord) -> Table:
    """Each rule as a whole."""
    frame = pd.DataFrame(
        {
            "rule": list(record.whole),
            "requirements judged": [sum(row.rule == rule for row in record.rows) for rule in record.whole],
            "probability that they are kept": [chance_words(each) for each in record.whole.values()],
            "not judged": ["; ".join(record.absent.get(rule, ())) for rule in record.whole],
        }
    )
    caption = (
        "Each rule as a whole: all its requirements that were judged at once, in the same states of the room. What was "
        "not judged may still fail."
    )
    return Table(name="rules-whole", caption=caption, frame=frame)


def looks_table(record: RuleRecord) -> Table:
    """Glare in every look."""
    frame = pd.DataFrame(
        {
            "area": [look.area for look in record.looks],
            "look [deg]": [look.angle_deg for look in record.looks],
            "eye [m]": [", ".join(f"{value:.2f}" for value in look.eye) for look in record.looks],
            "UGR of the luminaires": [_ugr_words(look.ugr) for look in record.looks],
            "UGR by evalglare": [_ugr_words(look.evalglare_ugr) for look in record.looks],
            "DGP by evalglare": [look.dgp for look in record.looks],
        }
    )
    caption = (
        "Glare as people see it who look one way, counter-clockwise from the x axis. DGP is made for daylight: above "
        "0.35 glare is perceptible, above 0.45 intolerable; it says little in light as dim as most electric light."
    )
    return Table(name="glare", caption=caption, frame=frame, formats={"look [deg]": ".0f", "DGP by evalglare": ".2f"})


def _ugr_words(ugr: float) -> str:
    return f"{ugr:.1f}" if np.isfinite(ugr) and ugr > 0 else "none seen"


@styled
def rules_figure(rows: Sequence[RuleRow]) -> Figure:
    """Every requirement as the range of value over limit: right of the line it is kept."""
    height = ROW_IN * len(rows)
    figure = new_figure(PAGE_WIDTH_IN, height + 1.0)
    width = PAGE_WIDTH_IN - WORDS_IN - NUMBERS_IN
    axes = place(figure, WORDS_IN, 0.55, width, height)
    beside = axes.get_yaxis_transform()
    ends = [_margin(row, end) for row in rows for end in (row.low, row.high)]
    reach = min(max(WIDEST, *(max(end, 1.0 / end) for end in ends)), 20.0)
    for number, row in enumerate(rows):
        at = len(rows) - number - 0.5
        low, high = sorted((_margin(row, row.low), _margin(row, row.high)))
        color = BLUE if row.probability >= LIKELY else VERMILION if row.probability <= UNLIKELY else MUTED
        axes.plot(
            np.clip([low, high], 1.0 / reach, reach), [at, at], color=color, lw=6.0, solid_capstyle="butt", alpha=0.5
        )
        axes.plot(np.clip(_margin(row, row.value), 1.0 / reach, reach), at, "o", color=color)
        words = f"{row.rule}: {row.what}"
        axes.text(-0.02, at, plain(words, longest=MAX_WORDS), transform=beside, ha="right", va="center", size=8.0)
        axes.text(
            1.02, at, f"{chance_words(row.probability)}  {plain(row.where, longest=16)}",
            transform=beside, va="center", size=8.0,
        )  # fmt: skip
    axes.axvline(1.0, color=INK, lw=0.8)
    axes.set_xscale("log")
    axes.set(xlim=(1.0 / reach, reach), ylim=(0, len(rows)), yticks=[])
    ticks = [tick for tick in (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0) if 1.0 / reach <= tick <= reach]
    axes.set_xticks(ticks, minor=False)
    axes.set_xticks([], minor=True)
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_xlabel("found over limit (limit over found where it is a highest value)")
    axes.spines["left"].set_visible(False)
    top = height + 0.68
    for words, left, side in (
        ("requirement", WORDS_IN - 0.1, "right"),
        ("kept  where", PAGE_WIDTH_IN - NUMBERS_IN + 0.1, "left"),
    ):
        figure.text(left / PAGE_WIDTH_IN, top / (height + 1.0), words, ha=side, weight="bold", size=8.5)
    return figure


def _margin(row: RuleRow, value: float) -> float:
    """Value over limit, or limit over value where it is a highest one; above 1 it is kept."""
    if row.sense == "at most":
        return row.limit / value if value > 0 else np.inf
    return max(value, 1e-9) / row.limit


@styled
def looks_figure(looks: Sequence[LookRow], pictures: Sequence[ByteArray]) -> Figure:
    """What people see, with its glare.

    Parameters
    ----------
    looks : sequence of LookRow
        Of one picture each, with UGR and DGP. [1]
    pictures : sequence of (height, width, 3) uint8
        sRGB, in the same order.

    Returns
    -------
    figure : matplotlib.figure.Figure
    """
    columns = min(ACROSS, len(looks))
    rows = -(-len(looks) // columns)
    side = (PAGE_WIDTH_IN - 0.2) / ACROSS
    figure = new_figure(side * columns + 0.2, rows * (side + 0.45))
    for number, (look, picture) in enumerate(zip(looks, pictures, strict=True)):
        row, column = divmod(number, columns)
        bottom = (rows - row - 1) * (side + 0.45) + 0.05
        axes = place(figure, 0.1 + column * side + 0.05, bottom, side - 0.1, side - 0.1)
        axes.imshow(picture)
        axes.set_axis_off()
        words = f"{plain(look.area, longest=22)}, {look.angle_deg:.0f}°\nUGR {_ugr_words(look.ugr)}, DGP {look.dgp:.2f}"
        axes.set_title(words, size=8.0)
    return figure
