"""How tiles, planks and bricks are laid: which one a place of a surface is on, and how far from its edge."""

from dataclasses import dataclass

import torch
from torch import Tensor

from research.training.rendered.dressings import PATTERNS

BOND = 0.5  # [1] of a tile's length, by which every other row is shifted


@dataclass(frozen=True, kw_only=True, eq=False)
class Cells:
    """Where places of surfaces lie on their tiles or planks.

    Parameters
    ----------
    column, row : (place,) float
        Numbers of the tile. [1]
    across, down : (place,) float
        On the tile, along its width and its length. [m]
    edge : (place,) float
        To the nearest edge of the tile; infinite on surfaces that are not laid in tiles. [m]
    odd : (place,) bool
        Whether column and row add up to an odd number.
    """

    column: Tensor
    row: Tensor
    across: Tensor
    down: Tensor
    edge: Tensor
    odd: Tensor


def hashed(column: Tensor, row: Tensor, seed: Tensor, number: int) -> Tensor:
    """Numbers between 0 and 1 that look random, the same for the same tile."""
    angle = column * 12.9898 + row * 78.233 + seed * 3.7 + 17.31 * number
    return (torch.sin(angle) * 4375.85).remainder(1.0)


def lay(pattern: Tensor, x: Tensor, y: Tensor, width: Tensor, aspect: Tensor, seed: Tensor) -> Cells:
    """Find the tiles on which places lie.

    Parameters
    ----------
    pattern : (place,) int64
        Of `PATTERNS`, of the place's surface; so are all others.
    x, y : (place,) float
        On the surface. [m]
    width : (place,) float
        Of a tile. [m]
    aspect : (place,) float
        Its length to its width. [1]
    seed : (place,) float

    Returns
    -------
    cells : Cells
    """
    whole = aspect.round().clamp_min(2.0)
    ways = {
        "none": (torch.zeros_like(x), torch.zeros_like(x), x, y, torch.full_like(x, torch.inf)),
        "grid": _grid(x, y, width, aspect * width, torch.zeros_like(x)),
        "herringbone": _herringbone(x, y, width, whole),
        "basket": _basket(x, y, width, whole),
        "hexagon": _hexagon(x, y, width),
    }
    column = (x / width).floor()
    ways["bond"] = _grid(x, y, width, aspect * width, BOND * column.remainder(2.0))
    ways["planks"] = _grid(x, y, width, aspect * width, hashed(column, torch.zeros_like(x), seed, 0))
    ways["checker"] = ways["grid"]
    values = []
    for parts in zip(*(ways[name] for name in PATTERNS), strict=True):
        chosen = parts[0]
        for number, part in enumerate(parts[1:], start=1):
            chosen = torch.where(pattern == number, part, chosen)
        values.append(chosen)
    column, row, across, down, edge = values
    return Cells(column=column, row=row, across=across, down=down, edge=edge, odd=(column + row).remainder(2.0) > 0.5)


Way = tuple[Tensor, Tensor, Tensor, Tensor, Tensor]  # column, row, across, down, edge


def _to_edge(across: Tensor, down: Tensor, width: Tensor, length: Tensor) -> Tensor:
    return torch.minimum(torch.minimum(across, width - across), torch.minimum(down, length - down))


def _grid(x: Tensor, y: Tensor, width: Tensor, length: Tensor, shift: Tensor) -> Way:
    """Columns side by side, each shifted by a share of the length."""
    column, along = (x / width).floor(), y / length + shift
    row = along.floor()
    across, down = x - column * width, (along - row) * length
    return column, row, across, down, _to_edge(across, down, width, length)


def _herringbone(x: Tensor, y: Tensor, width: Tensor, whole: Tensor) -> Way:
    """Blocks of whole x 1 squares, alternately along both axes, each row shifted by one square."""
    i, j = (x / width).floor(), (y / width).floor()
    step = (i - j).remainder(2.0 * whole)
    lying = step < whole
    back = torch.where(lying, step, 2.0 * whole - 1.0 - step)
    column, row = torch.where(lying, i - back, i), torch.where(lying, j, j - back)
    left, top = x - column * width, y - row * width
    across, down = torch.where(lying, top, left), torch.where(lying, left, top)
    return column, row, across, down, _to_edge(across, down, width, whole * width)


def _basket(x: Tensor, y: Tensor, width: Tensor, whole: Tensor) -> Way:
    """Squares of parallel strips, every other one turned."""
    side = whole * width
    i, j = (x / side).floor(), (y / side).floor()
    turned = (i + j).remainder(2.0) > 0.5
    left, top = x - i * side, y - j * side
    left, top = torch.where(turned, top, left), torch.where(turned, left, top)
    strip = (left / width).floor().clamp_max(whole - 1.0)
    across = left - strip * width
    return i * whole + strip, j, across, top, _to_edge(across, top, width, side)


def _hexagon(x: Tensor, y: Tensor, width: Tensor) -> Way:
    """Hexagons, of this width between two parallel sides: the nearer of two lattices' middles is the hexagon's own."""
    high = 3.0**0.5 * width
    first, second = (_lattice(x, y, width, high, half) for half in (0.0, 0.5))
    nearer = second[4] > first[4]
    column, row, across, down, edge = (torch.where(nearer, b, a) for a, b in zip(first, second, strict=True))
    return column, row, across, down, edge


def _lattice(x: Tensor, y: Tensor, width: Tensor, high: Tensor, half: float) -> Way:
    """Hexagons about the nearest middle of one lattice of rectangles, shifted by half an edge or not."""
    column, row = (x / width - half).round(), (y / high - half).round()
    across, down = x - (column + half) * width, y - (row + half) * high
    corner = torch.maximum(across.abs(), 0.5 * across.abs() + 0.5 * 3.0**0.5 * down.abs())
    return 2.0 * (column + half), 2.0 * (row + half), across, down, 0.5 * width - corner
