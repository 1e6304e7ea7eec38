"""Rooms drawn by chance: sizes, paints, furniture, lamps, windows and cameras that nobody chose.

    python -m research.scenes.drawn_rooms FOLDER [--seed 1 2 ...] [--case night day]

    FOLDER/drawn-7-night/plan.toml, room.toml, scan.glb, truth/   as `research.scenes.by_day` writes them

A room written by hand has what its writer thought of. These have one or two boxes of air, a floor, ceiling and walls
out of the table of `research/scenes/rooms`, one wall in three rooms out of four of another paint, two to seven things
in them, one to four lamps of one or two spectra, a window or two, and a camera: all by a seed, by the distributions
below, which were written before a room of them was looked at.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from lidarspectra.io.toml_text import toml_value
from research.scenes.by_day import CASES, OTHER_CASES, OTHER_ROOMS, RoomByDay, build_room

CEILINGS = {
    "ceiling-white": 5, "paint-brilliant": 2, "ceiling-tile": 2, "ceiling-off-white": 2, "wall-cream": 1, "beech": 1,
    "grey-50": 1, "timber-dark": 1,
}  # fmt: skip
WALLS = {
    "ceiling-white": 4, "paint-brilliant": 2, "wall-cream": 2, "wall-beige": 2, "wall-grey": 2, "wall-greige": 2,
    "wall-sage": 1, "wall-pale-blue": 1, "wall-orange": 1, "tile-white": 1, "beech": 1,
}  # fmt: skip
ACCENTS = (
    "wall-orange", "wall-sage", "wall-red", "wall-grey", "wall-pale-blue", "wall-beige", "timber-dark", "beech",
    "velvet-blue", "paint-black", "tile-pale",
)  # fmt: skip
FLOORS = (
    "floor-lino", "floor-oak", "floor-tile", "carpet-blue", "carpet-charcoal", "carpet-green", "oak-dark",
    "floor-rubber", "tile-pale", "rug-beige",
)  # fmt: skip
THINGS = (
    "beech", "walnut", "laminate-white", "fabric-blue", "fabric-grey", "fabric-red", "steel-grey", "cabinet-green",
    "lacquer-yellow", "lacquer-white", "plastic-black", "leather-brown", "door-white", "oak-dark", "terracotta",
    "curtain-purple", "stone-black", "board-green", "poster-yellow", "paper-book",
)  # fmt: skip
RUGS = ("rug-beige", "carpet-blue", "carpet-charcoal", "carpet-green", "fabric-red")
SPECTRA = ("LED-B1", "LED-B2", "LED-B3", "LED-B4", "LED-B5", "FL3.12", "FL11", "A")
GRAIN = {"oak": 0.1, "beech": 0.08, "walnut": 0.1, "timber": 0.08, "carpet": 0.08, "rug": 0.1, "stone": 0.1}
SIZES_M = ((2.6, 6.0), (2.4, 4.5), (2.35, 3.0))  # x, y, z
DOUBLED = 0.3  # share of rooms that are two boxes of air, an L
ACCENTED = 0.75  # share of rooms with a wall of another paint
FILMIC = 0.2  # share of cameras with a filmic curve
GAP_M = 0.12  # between things
ROOM_AROUND_M = 0.35  # between a lamp and a wall
SIDES = ("west", "east", "south", "north")

Corners = tuple[tuple[float, ...], tuple[float, ...]]


@dataclass(kw_only=True)
class Drawing:
    """What has been drawn of a room so far.

    Parameters
    ----------
    generator : numpy.random.Generator
    size : (float, float, float)
        Of the first box of air, whose low corner is 0. [m]
    boxes : list of (low, high)
        All boxes of air. [m]
    taken : list of (low, high)
        Where things stand, seen from above, or on walls. [m]
    materials : set of str
        IDs in use.
    text : list of str
        TOML of parts and lamps.
    """

    generator: np.random.Generator
    size: tuple[float, float, float]
    boxes: list[Corners]
    taken: list[Corners] = field(default_factory=list)
    materials: set[str] = field(default_factory=set)
    text: list[str] = field(default_factory=list)

    def between(self, low: float, high: float) -> float:
        """A length [m], evenly between two."""
        return round(float(self.generator.uniform(low, high)), 2)

    def one_of(self, names: Sequence[str] | dict[str, int]) -> str:
        """A material's ID, which then counts as used."""
        weights = np.array(list(names.values()) if isinstance(names, dict) else [1] * len(names), dtype=float)
        name = str(self.generator.choice(list(names), p=weights / weights.sum()))
        self.materials.add(name)
        return name

    def free(self, low: Sequence[float], high: Sequence[float]) -> bool:
        """Whether nothing stands in a box yet; if so, it is taken."""
        for other_low, other_high in self.taken:
            if all(
                a < d + GAP_M and c < b + GAP_M for a, b, c, d in zip(low, high, other_low, other_high, strict=True)
            ):
                return False
        self.taken.append((tuple(low), tuple(high)))
        return True

    def add(self, table: str, **values: object) -> None:
        """Write a part or a lamp."""
        self.text += [f"\n[[{table}]]", *(f"{key} = {toml_value(value)}" for key, value in values.items())]


def draw_room(seed: int) -> RoomByDay:
    """A room by chance.

    Parameters
    ----------
    seed : int

    Returns
    -------
    room : RoomByDay
    """
    generator = np.random.default_rng(seed)
    wide, deep, tall = (round(float(generator.uniform(*range_m)), 2) for range_m in SIZES_M)
    size = (wide, deep, tall)
    drawing = Drawing(generator=generator, size=size, boxes=[((0.0, 0.0, 0.0), size)])
    if generator.random() < DOUBLED:  # a wing behind the north wall, as high
        start, width = drawing.between(0.0, 0.4 * wide), drawing.between(1.4, 0.55 * wide + 0.2)
        drawing.boxes.append(
            ((start, deep, 0.0), (min(start + width, wide), deep + drawing.between(1.5, 2.5), size[2]))
        )
    windows = _windows(drawing)
    _furnish(drawing)
    _light(drawing)
    filmic = generator.random() < FILMIC
    return RoomByDay(
        name=f"drawn-{seed}",
        plan=_plan(drawing, seed),
        reflectances=OTHER_ROOMS / "reflectances.csv",
        points=None,
        windows=windows,
        flux_ratio=float(generator.uniform(0.5, 2.0)),
        tone="filmic" if filmic else round(float(generator.uniform(0.0, 1.2)), 2),
        bright_level=round(float(generator.uniform(0.4, 0.85)), 2),
        white_balance=round(float(generator.uniform(0.6, 1.0)), 2),
    )


def _windows(drawing: Drawing) -> list[Corners]:
    """One or two, in the south and the west wall, which the wing does not touch."""
    wide, deep, _ = drawing.size
    found: list[Corners] = []
    for side in SIDES[2::-2][: 1 + int(drawing.generator.random() < 0.4)]:
        along = wide if side == "south" else deep
        width, sill = drawing.between(0.9, min(2.0, along - 0.8)), drawing.between(0.7, 1.0)
        start, top = drawing.between(0.3, along - width - 0.3), round(sill + drawing.between(0.9, 1.2), 2)
        low, high = (start, -0.04, sill), (round(start + width, 2), 0.01, top)
        if side == "west":
            low, high = (low[1], low[0], low[2]), (high[1], high[0], high[2])
        found.append((low, high))
        drawing.taken.append((low, high))
    return found


def _furnish(drawing: Drawing) -> None:
    """Cupboards along walls, tables with chairs, a rug or a box, a board or poster on a wall."""
    makers = (_cupboard, _cupboard, _table, _board, _pillar, _rug)
    for number in range(int(drawing.generator.integers(2, 8))):
        makers[int(drawing.generator.integers(len(makers)))](drawing, f"thing {number + 1}")


def _cupboard(drawing: Drawing, name: str) -> None:
    wide, deep, tall = drawing.size
    along, depth = drawing.between(0.5, 1.8), drawing.between(0.3, 0.65)
    height = min(drawing.between(0.4, 2.2), tall - 0.2)
    north = drawing.generator.random() < 0.5 and len(drawing.boxes) == 1
    length = wide if north else deep
    start = drawing.between(0.0, max(length - along, 0.01))
    low, high = (start, deep - depth, -0.05), (start + along, deep + 0.05, height)
    if not north:
        low, high = (wide - depth, start, -0.05), (wide + 0.05, start + along, height)
    if drawing.free(low, high):
        drawing.add(
            "parts", name=name, shape="box", low=_rounded(low), high=_rounded(high), material=drawing.one_of(THINGS)
        )


def _table(drawing: Drawing, name: str) -> None:
    wide, deep, _ = drawing.size
    size, height = (drawing.between(0.6, 1.6), drawing.between(0.5, 0.9)), drawing.between(0.4, 0.78)
    reach = 0.5 * float(np.hypot(*size))
    if min(wide, deep) < 2 * reach + 0.2:
        return
    center = (drawing.between(reach, wide - reach), drawing.between(reach, deep - reach))
    if not drawing.free((center[0] - reach, center[1] - reach, 0.0), (center[0] + reach, center[1] + reach, 1.0)):
        return
    top, legs = drawing.one_of(THINGS), drawing.one_of(THINGS)
    yaw = round(float(drawing.generator.normal(0.0, 4.0)), 1)
    drawing.add("parts", name=name, shape="table", center=list(center), size=list(size), height=height, leg=0.05,
                material=top, leg_material=legs, yaw_deg=yaw)  # fmt: skip
    beside = (center[0], round(center[1] - reach - 0.3, 2))
    if beside[1] > 0.35 and drawing.free(
        (beside[0] - 0.3, beside[1] - 0.3, 0.0), (beside[0] + 0.3, beside[1] + 0.3, 1.0)
    ):
        drawing.add("parts", name=f"{name} chair", shape="chair", center=list(beside), leg=0.045,
                    material=drawing.one_of(THINGS), leg_material=legs,
                    yaw_deg=round(float(drawing.generator.normal(0.0, 15.0)), 1))  # fmt: skip


def _board(drawing: Drawing, name: str) -> None:
    """On the east wall: a board, a poster, a curtain."""
    wide, deep, tall = drawing.size
    width, low_z = drawing.between(0.5, 1.6), drawing.between(0.1, 1.2)
    start, top = (
        drawing.between(0.1, max(deep - width - 0.1, 0.11)),
        min(low_z + drawing.between(0.5, 1.2), tall - 0.15),
    )
    low, high = (wide - 0.02, start, low_z), (wide + 0.05, start + width, top)
    if drawing.free(low, high):
        drawing.add(
            "parts", name=name, shape="box", low=_rounded(low), high=_rounded(high), material=drawing.one_of(THINGS)
        )


def _pillar(drawing: Drawing, name: str) -> None:
    """A bin, a stool, a pot: an upright cylinder."""
    wide, deep, _ = drawing.size
    radius, height = drawing.between(0.12, 0.3), drawing.between(0.25, 0.9)
    at = (drawing.between(radius + 0.1, wide - radius - 0.1), drawing.between(radius + 0.1, deep - radius - 0.1))
    if drawing.free((at[0] - radius, at[1] - radius, 0.0), (at[0] + radius, at[1] + radius, height)):
        drawing.add("parts", name=name, shape="cylinder", foot=[*at, -0.02], radius=radius, height=height,
                    material=drawing.one_of(THINGS))  # fmt: skip


def _rug(drawing: Drawing, name: str) -> None:
    wide, deep, _ = drawing.size
    size = (drawing.between(0.8, 0.6 * wide), drawing.between(0.8, 0.6 * deep))
    at = (drawing.between(0.1, wide - size[0] - 0.1), drawing.between(0.1, deep - size[1] - 0.1))
    low, high = (*at, -0.05), (at[0] + size[0], at[1] + size[1], 0.012)
    things, drawing.text = drawing.text, []
    material = drawing.one_of(RUGS)
    drawing.add("parts", name=name, shape="box", low=_rounded(low), high=_rounded(high), material=material)
    drawing.text += things  # after it, so that what stands on it is seen


def _light(drawing: Drawing) -> None:
    """Lamps below the ceiling: panels, strips, downlights; 60 to 250 lm for each square metre of floor."""
    generator = drawing.generator
    area = sum((high[0] - low[0]) * (high[1] - low[1]) for low, high in drawing.boxes)
    count = int(generator.integers(1, 5))
    shares = generator.dirichlet(np.full(count, 4.0)) * area * generator.uniform(60.0, 250.0)
    spectra = generator.choice(SPECTRA, size=1 + int(generator.random() < 0.3), replace=False)
    drawing.materials.add("diffuser")
    placed: list[Corners] = []
    for number in range(count):
        low, high = drawing.boxes[0 if number == 0 else int(generator.integers(len(drawing.boxes)))]
        half = {"panel": (0.3, 0.3), "strip": (0.6, 0.08), "spot": (0.09, 0.09)}
        shape = str(generator.choice(list(half)))
        reach = [ROOM_AROUND_M + each for each in half[shape]]
        if any(high[axis] - low[axis] < 2 * reach[axis] + 0.1 for axis in (0, 1)):
            shape, reach = "spot", [ROOM_AROUND_M + 0.09] * 2
        at = [drawing.between(low[axis] + reach[axis], high[axis] - reach[axis]) for axis in (0, 1)]
        wide = half[shape]
        corners = ((at[0] - wide[0], at[1] - wide[1]), (at[0] + wide[0], at[1] + wide[1]))
        if any(all(corners[0][k] < b[k] + 0.2 and a[k] < corners[1][k] + 0.2 for k in (0, 1)) for a, b in placed):
            continue
        placed.append(corners)
        name, top = f"lamp {number + 1}", high[2]
        if shape == "spot":
            foot = _rounded((*at, top - 0.015))
            drawing.add("parts", name=f"rim {number + 1}", shape="cylinder", foot=foot, radius=0.09, height=0.05,
                        material="diffuser", lamp=name)  # fmt: skip
            sizes: dict[str, object] = {"size": 0.16, "beam_angle_deg": float(generator.choice([60.0, 90.0, 110.0]))}
        else:
            drawing.add("parts", name=f"plate {number + 1}", shape="box", low=_rounded((*corners[0], top - 0.025)),
                        high=_rounded((*corners[1], top + 0.02)), material="diffuser", lamp=name)  # fmt: skip
            sizes = {"size": _rounded([2 * each for each in wide])}
        drawing.add("lamps", name=name, shape=shape, center=_rounded((*at, top - (0.075 if shape == "spot" else 0.09))),
                    **sizes, spectrum=str(generator.choice(spectra)),
                    luminous_flux_lm=max(round(float(shares[number]), -1), 50.0))  # fmt: skip


def _plan(drawing: Drawing, seed: int) -> str:
    """The plan's text."""
    floor, ceiling, walls = drawing.one_of(FLOORS), drawing.one_of(CEILINGS), drawing.one_of(WALLS)
    accents = ""
    if drawing.generator.random() < ACCENTED:
        side = str(drawing.generator.choice(SIDES[:3]))
        accents = f'accents = {{ {side} = "{drawing.one_of(ACCENTS)}" }}\n'
    lines = [f'name = "drawn-{seed}"\nreflectances = "reflectances.csv"\n\n[camera]\ntexture_px = 1536\n']
    for number, (low, high) in enumerate(drawing.boxes):
        lines.append(
            f'\n[[rooms]]\nname = "room {number + 1}"\nlow = {_rounded(low)}\nhigh = {_rounded(high)}\n'
            f'floor = "{floor}"\nceiling = "{ceiling}"\nwalls = "{walls}"\n{accents if number == 0 else ""}'
        )
    for name in sorted(drawing.materials):
        grain = next((value for word, value in GRAIN.items() if word in name), 0.01)
        lines.append(f'\n[[materials]]\nname = "{name}"\nreflectance = "{name}"\ngrain = {grain}\n')
        lines.append("grain_size = [0.4, 0.04, 0.04]\n" if grain >= 0.08 else "")
    points = "\n[sensors.grid]\nheight = 0.8\ncount = 40\n"
    return "".join(lines) + "\n".join(drawing.text) + f'\n\n[sensors]\ndevice = "as7265x-14"\nlift = 0.0\n{points}'


def _rounded(values: Sequence[float]) -> list[float]:
    return [round(float(value), 3) for value in values]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", nargs="+", type=int, default=list(range(1, 13)))
    parser.add_argument("--case", nargs="+", choices=OTHER_CASES, default=list(OTHER_CASES))
    given = parser.parse_args(arguments)
    for seed in given.seed:
        for name in given.case:
            built = build_room(draw_room(seed), CASES[name], given.folder / f"drawn-{seed}-{name}", seed=seed)
            print(f"{built.file}: {built.words}", flush=True)


if __name__ == "__main__":
    main()
