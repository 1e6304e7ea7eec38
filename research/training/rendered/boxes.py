"""Rooms of boxes, many at once, and what rays meet in them."""

from dataclasses import dataclass

import torch
from torch import Tensor

from research.training.rendered.dressings import PLACES
from research.training.rendered.surfaces import Wardrobe

LOW_M, HIGH_M = (2.2, 2.2, 2.2), (8.0, 6.5, 3.3)  # [m] sides of a room
HALLS, HALL = 0.15, 1.8  # [1] share of rooms that are halls, and how much wider they are
SHELL = 6  # walls at low and high x, then y; floor; ceiling
NEAR_M = 1e-3  # [m] from which a surface is met
ABSENT_M = -50.0  # [m] where boxes are that a room does not have


@dataclass(frozen=True, kw_only=True, eq=False)
class Rooms:
    """A batch of rooms.

    Parameters
    ----------
    size : (room, 3) float
        One corner is the origin. [m]
    low, high : (room, box, 3) float
        Corners of the boxes. [m]
    places : (room, surface) int64
        Of `PLACES`; the shell's six sides, then the boxes.
    emission : (room, surface, 3) float
        Light that surfaces give. [1]
    lamps : (room, lamp, 3) float
        [m]
    power : (room, lamp, 3) float
        Light that falls on what faces a lamp at 1 m. [1]
    radius_m : (room, lamp) float
        [m]
    ambient : (room, 3) float
        [1]
    """

    size: Tensor
    low: Tensor
    high: Tensor
    places: Tensor
    emission: Tensor
    lamps: Tensor
    power: Tensor
    radius_m: Tensor
    ambient: Tensor


@dataclass(frozen=True, kw_only=True)
class Piece:
    """Something in a room: the ranges of its sides, where it stands, how often it is there.

    Parameters
    ----------
    sides : (low, high) of (wide, deep, high)
        [m]
    bottom_m : (low, high)
        Of its lower side above the floor. [m]
    where : 'floor', 'along' a wall, 'wall' (on one), 'ceiling', or 'top' (on the piece before it)
    present : float
        [0-1]
    place : str
        Of `PLACES`.
    """

    sides: tuple[tuple[float, float, float], tuple[float, float, float]]
    bottom_m: tuple[float, float]
    where: str
    present: float
    place: str = "furniture"


WINDOWS, PANELS = (0, 1), (2, 3)
PIECES = (
    Piece(sides=((0.6, 0.02, 0.8), (2.4, 0.05, 1.9)), bottom_m=(0.0, 1.1), where="wall", present=0.6, place="window"),
    Piece(sides=((0.6, 0.02, 0.8), (1.6, 0.05, 1.6)), bottom_m=(0.6, 1.1), where="wall", present=0.35, place="window"),
    Piece(sides=((0.3, 0.15, 0.02), (1.3, 0.65, 0.05)), bottom_m=(0.0, 0.0), where="ceiling", present=0.6),
    Piece(sides=((0.3, 0.15, 0.02), (1.3, 0.65, 0.05)), bottom_m=(0.0, 0.0), where="ceiling", present=0.6),
    Piece(sides=((0.7, 0.02, 1.9), (1.2, 0.06, 2.15)), bottom_m=(0.0, 0.0), where="wall", present=0.6),
    Piece(sides=((0.3, 0.02, 0.3), (1.8, 0.05, 1.2)), bottom_m=(0.9, 1.3), where="wall", present=0.6),
    Piece(sides=((0.8, 0.6, 0.006), (3.0, 2.2, 0.02)), bottom_m=(0.0, 0.0), where="floor", present=0.25, place="rug"),
    Piece(sides=((0.4, 0.3, 0.4), (2.0, 0.65, 2.1)), bottom_m=(0.0, 0.0), where="along", present=0.65),
    Piece(sides=((0.4, 0.3, 0.4), (1.4, 0.65, 1.2)), bottom_m=(0.0, 0.15), where="along", present=0.5),
    Piece(sides=((0.1, 0.1, 0.03), (0.5, 0.4, 0.5)), bottom_m=(0.0, 0.0), where="top", present=0.6),
    Piece(sides=((0.7, 0.5, 0.02), (1.8, 0.9, 0.05)), bottom_m=(0.55, 0.76), where="floor", present=0.55),
    Piece(sides=((0.1, 0.1, 0.02), (0.4, 0.3, 0.3)), bottom_m=(0.0, 0.0), where="top", present=0.6),
    Piece(sides=((0.03, 0.03, 0.4), (0.08, 0.08, 0.75)), bottom_m=(0.0, 0.0), where="floor", present=0.6),
    Piece(sides=((0.4, 0.4, 0.03), (0.6, 0.6, 0.1)), bottom_m=(0.4, 0.45), where="floor", present=0.5),
    Piece(sides=((0.7, 0.5, 0.3), (2.0, 1.6, 0.6)), bottom_m=(0.0, 0.05), where="floor", present=0.4),
    Piece(sides=((0.1, 0.1, 0.05), (0.6, 0.6, 0.8)), bottom_m=(0.0, 0.0), where="floor", present=0.5),
    Piece(sides=((0.05, 0.02, 0.1), (0.3, 0.05, 0.4)), bottom_m=(0.1, 1.3), where="wall", present=0.4),
)
FURNISHED = (0.2, 1.0)  # [1] of the pieces, times their own share, from an empty to a full room


def make_rooms(wardrobe: Wardrobe, count: int) -> Rooms:
    """Draw rooms.

    Parameters
    ----------
    wardrobe : Wardrobe
        Whose generator draws.
    count : int
    """
    random, device = wardrobe.random, wardrobe.device

    def between(low: object, high: object, *shape: int) -> Tensor:
        first, last = (torch.as_tensor(each, dtype=torch.float32, device=device) for each in (low, high))
        return first + random(*shape) * (last - first)

    size = between(LOW_M, HIGH_M, count, 3)
    size[:, :2] *= torch.where(random(count, 1) < HALLS, HALL, 1.0)
    full = between(*FURNISHED, count)
    lows: list[Tensor] = []
    highs: list[Tensor] = []
    for piece in PIECES:
        low, high = _placed(piece, size, between(*piece.sides, count, 3), between(*piece.bottom_m, count), wardrobe)
        if piece.where == "top":
            low, high = _on_top(low, high, lows[-1], highs[-1])
        always = piece.place == "window" or piece.where == "ceiling"
        there = random(count) < piece.present * torch.where(torch.full_like(full, float(always)) > 0, 1.0, full)
        lows.append(torch.where(there[:, None], low, ABSENT_M))
        highs.append(torch.where(there[:, None], high, ABSENT_M))
    shell = ["wall"] * 4 + ["floor", "ceiling"]
    names = shell + [piece.place for piece in PIECES]
    places = torch.tensor([PLACES.index(name) for name in names], device=device).repeat(count, 1)
    low, high = torch.stack(lows, dim=1), torch.stack(highs, dim=1)
    return Rooms(size=size, low=low, high=high, places=places, **_lights(wardrobe, size, low, high))


def _placed(piece: Piece, size: Tensor, sides: Tensor, bottom: Tensor, wardrobe: Wardrobe) -> tuple[Tensor, Tensor]:
    """(room, 3) lower and upper corners of a piece in every room."""
    count = len(size)
    turned = wardrobe.random(count) < 0.5
    sides = torch.where(turned[:, None], sides[:, [1, 0, 2]], sides)
    sides = torch.minimum(sides, 0.95 * size)
    low = wardrobe.random(count, 3) * (size - sides)
    low[:, 2] = torch.minimum(bottom, size[:, 2] - sides[:, 2])
    if piece.where in ("along", "wall"):
        far = (wardrobe.random(count) < 0.5).float()
        axis = torch.where(turned, 0, 1)  # across which it is thin
        room, own = size.gather(1, axis[:, None])[:, 0], sides.gather(1, axis[:, None])[:, 0]
        low = low.scatter(1, axis[:, None], (far * (room - own))[:, None])
    if piece.where == "ceiling":
        low[:, 2] = size[:, 2] - sides[:, 2]
    return low, low + sides


def _on_top(low: Tensor, high: Tensor, under_low: Tensor, under_high: Tensor) -> tuple[Tensor, Tensor]:
    sides = high - low
    middle = 0.5 * (under_low + under_high)
    low = middle - 0.5 * sides
    low[:, 2] = under_high[:, 2]
    return low, low + sides


def _lights(wardrobe: Wardrobe, size: Tensor, low: Tensor, high: Tensor) -> dict[str, Tensor]:
    """Lamps under the panels and inside of the windows, one hanging free, and light from everywhere."""
    count, boxes = low.shape[:2]
    device = wardrobe.device
    emission = torch.zeros((count, SHELL + boxes, 3), device=device)
    lamps, power, radius = [], [], []
    tint = torch.exp(0.07 * wardrobe.normal(count, 1) * torch.tensor([1.0, 0.1, -1.2], device=device))
    for number in WINDOWS + PANELS:
        there = (low[:, number, 0] > 0.5 * ABSENT_M).float()[:, None]
        level = torch.exp(0.7 * wardrobe.normal(count, 1))
        color = torch.exp(0.05 * wardrobe.normal(count, 3)) * (tint if number in PANELS else 1.0)
        middle = 0.5 * (low[:, number] + high[:, number])
        inwards = (0.5 * size - middle) / (0.5 * size - middle).norm(dim=1, keepdim=True).clamp_min(1e-3)
        lamps.append(middle + torch.where(torch.tensor(number in WINDOWS, device=device), 0.15, 0.1) * inwards)
        power.append(there * level * color * (1.6 if number in WINDOWS else 1.1))
        radius.append(0.15 + 0.35 * wardrobe.random(count))
        emission[:, SHELL + number] = there * level * color * (4.0 if number in WINDOWS else 6.0)
    free = wardrobe.random(count, 3) * size
    free[:, 2] = (0.6 + 0.38 * wardrobe.random(count)) * size[:, 2]
    lamps.append(free)
    power.append((wardrobe.random(count, 1) < 0.6) * torch.exp(0.6 * wardrobe.normal(count, 1)) * tint)
    radius.append(0.02 + 0.2 * wardrobe.random(count))
    return {
        "emission": emission,
        "lamps": torch.stack(lamps, dim=1),
        "power": torch.stack(power, dim=1),
        "radius_m": torch.stack(radius, dim=1),
        "ambient": (0.1 + 0.5 * wardrobe.random(count, 1)) * torch.exp(0.03 * wardrobe.normal(count, 3)),
    }


@dataclass(frozen=True, kw_only=True, eq=False)
class Hits:
    """What rays meet.

    Parameters
    ----------
    distance : (room, ray) float
        In lengths of the ray's direction. [1]
    surface : (room, ray) int64
        The shell's six sides, then the boxes.
    axis : (room, ray) int64
        Along which the surface's normal is.
    """

    distance: Tensor
    surface: Tensor
    axis: Tensor


def nearest(rooms: Rooms, origin: Tensor, direction: Tensor) -> Hits:
    """Cast (room, ray, 3) rays from inside of the rooms."""
    inverse = 1.0 / torch.where(direction.abs() < 1e-7, torch.full_like(direction, 1e-7), direction)
    end = torch.where(inverse > 0, rooms.size[:, None], 0.0)
    distance, axis = ((end - origin) * inverse).min(dim=2)
    surface = 2 * axis + (inverse.gather(2, axis[:, :, None])[:, :, 0] > 0)
    for number in range(rooms.low.shape[1]):
        entry, exit_, along = _slab(rooms, number, origin, inverse)
        met = (entry < exit_) & (entry > NEAR_M) & (entry < distance)
        distance = torch.where(met, entry, distance)
        axis = torch.where(met, along, axis)
        surface = torch.where(met, SHELL + number, surface)
    return Hits(distance=distance, surface=surface, axis=axis)


def clear(rooms: Rooms, origin: Tensor, direction: Tensor, *, skip: tuple[int, ...] = ()) -> Tensor:
    """(room, ray) whether no box stands within one length of the rays; of the boxes some may be left out."""
    inverse = 1.0 / torch.where(direction.abs() < 1e-7, torch.full_like(direction, 1e-7), direction)
    free = torch.ones(origin.shape[:2], dtype=torch.bool, device=origin.device)
    for number in range(rooms.low.shape[1]):
        if number not in skip:
            entry, exit_, _ = _slab(rooms, number, origin, inverse)
            free &= ~((entry < exit_) & (entry > NEAR_M) & (entry < 1.0))
    return free


def _slab(rooms: Rooms, number: int, origin: Tensor, inverse: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """(room, ray) where rays enter and leave a box, and the axis of the side where they enter."""
    first = (rooms.low[:, number, None] - origin) * inverse
    last = (rooms.high[:, number, None] - origin) * inverse
    entry, along = torch.minimum(first, last).max(dim=2)
    return entry, torch.maximum(first, last).min(dim=2).values, along
