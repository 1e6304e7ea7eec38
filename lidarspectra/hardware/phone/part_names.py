"""What a part of a room model is, read from its name in the file: a wall, a door, a table.

Apple's RoomPlan and the room modes of scanning apps write one named part for each surface and piece of furniture
('Wall0', 'Door2', 'Storage_3', 'window_1').

References
----------
Apple, RoomPlan: CapturedRoom.Surface.Category and CapturedRoom.Object.Category.
"""

import re
from collections.abc import Iterable

KIND_WORDS: dict[str, tuple[str, ...]] = {
    "wall": ("wall", "walls"),
    "floor": ("floor", "floors"),
    "ceiling": ("ceiling", "ceilings", "roof"),
    "door": ("door", "doors"),
    "window": ("window", "windows"),
    "opening": ("opening", "openings"),
    "table": ("table", "tables", "desk", "counter", "countertop"),
    "chair": ("chair", "chairs", "stool", "bench"),
    "sofa": ("sofa", "couch", "armchair"),
    "bed": ("bed", "beds", "mattress"),
    "storage": ("storage", "cabinet", "cupboard", "shelf", "shelves", "wardrobe", "drawer", "bookcase"),
    "screen": ("television", "tv", "screen", "monitor"),
    "appliance": ("refrigerator", "fridge", "stove", "oven", "dishwasher", "washer", "dryer", "washerdryer"),
    "sanitary": ("toilet", "sink", "bathtub", "washbasin"),
    "stairs": ("stairs", "stair", "staircase"),
    "fireplace": ("fireplace",),
    "furniture": ("object", "furniture"),
}  # words of names; the kinds are RoomPlan's categories, those that scatter light alike together
AIR = "opening"  # kind of a part that is no surface
ROOM_KIND = "wall"  # names count only in a file that names walls: 'Object_2' alone says nothing
GLASS_WORDS = ("glass", "glazing", "glazed")  # a wall or door of it reflects as a window does
GLASS_NAMES = ("curtain wall",)  # of facades
LAMP_WORDS = ("lamp", "lamps", "light", "lights", "lighting", "luminaire", "chandelier", "pendant")
_KIND_OF_WORD = {word: kind for kind, words in KIND_WORDS.items() for word in words}
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")


def part_kind(names: Iterable[str | None]) -> str:
    """Kind of a part, from its name and those of the groups around it.

    Parameters
    ----------
    names : iterable of str or None
        The part's own name first. The last word of a name that names a kind counts: 'Wall_0_grp' is a wall's group,
        'WallCabinet' a cabinet. A 'FloorLamp' is no floor, and of no kind; a 'GlassWall' is as a window.

    Returns
    -------
    kind : str
        One of `KIND_WORDS`; empty where no name has such a word.
    """
    for name in names:
        words = _words(name or "")
        kinds = [number for number, word in enumerate(words) if word in _KIND_OF_WORD]
        if not kinds:
            continue
        if any(word in LAMP_WORDS for word in words[kinds[-1] + 1 :]):
            return ""
        kind = _KIND_OF_WORD[words[kinds[-1]]]
        of_glass = any(word in GLASS_WORDS for word in words) or any(each in " ".join(words) for each in GLASS_NAMES)
        return "window" if of_glass and kind in ("wall", "door") else kind
    return ""


def _words(name: str) -> list[str]:
    return [word.lower() for word in _WORD.findall(name)]


def counted_kinds(kinds: Iterable[str]) -> str:
    """Parts in words, the most frequent kind first: '12 walls, 3 doors, 1 table'."""
    names = list(kinds)
    counts = sorted({name: names.count(name) for name in names}.items(), key=lambda item: (-item[1], item[0]))
    return ", ".join(f"{count} {_plural(name) if count > 1 else name}" for name, count in counts)


def _plural(name: str) -> str:
    return {"furniture": "pieces of furniture", "stairs": "stairs", "storage": "storages", "sanitary": "sanitary"}.get(
        name, f"{name}es" if name.endswith("ch") else f"{name}s"
    )
