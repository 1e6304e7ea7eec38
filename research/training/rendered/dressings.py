"""What surfaces of rooms are made of and how they are laid: tiles with joints, planks, parquet, carpet squares, paint.

The table is a judgement of ours, of what is sold and seen; nothing in it was measured. Lengths are those of the goods:
a plank is 5 to 25 cm wide, a joint 1 to 6 mm.
"""

from dataclasses import dataclass, field

PLACES = ("floor", "ceiling", "wall", "furniture", "rug", "window", "collage")
PATTERNS = ("none", "grid", "bond", "planks", "herringbone", "basket", "hexagon", "checker")
PALETTES = ("native", "any", "pale", "wood", "mineral", "cloth", "clay", "glaze", "metal")
Range = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Structure:
    """Fine structure on a surface: one of these, at a size and a strength.

    Parameters
    ----------
    names : tuple of str
        Of `structures.STRUCTURES`.
    repeat_m : (low, high)
        Edge of its picture. [m]
    strength : (low, high)
        Times the structure's own spread. [1]
    """

    names: tuple[str, ...]
    repeat_m: Range
    strength: Range


NO_STRUCTURE = Structure(names=("clouds",), repeat_m=(1.0, 3.0), strength=(0.0, 0.15))


@dataclass(frozen=True, kw_only=True)
class Dressing:
    """One way in which a surface of a class is made; what is a range is drawn anew for each surface.

    Parameters
    ----------
    label : str
        Class.
    places : dict of str to float
        How often it is used in each of `PLACES`. [1]
    textures : tuple of str
        Folders of tiles, 'drawn CLASS' or 'photo CLASS'.
    plain : float
        Share without the texture's structure. [0-1]
    contrast : (low, high)
        Of the texture's structure, 1 as it is. [1]
    repeat_m : (low, high)
        Edge of the texture. [m]
    stretch : (low, high)
        How much longer it is down than across. [1]
    palettes : dict of str to float
        How often its colour is of each of `PALETTES`. [1]
    patterns : dict of str to float
        How often it is laid in each of `PATTERNS`. [1]
    cell_m : (low, high)
        Width of a tile or plank. [m]
    aspect : (low, high)
        Its length to its width. [1]
    joint_m : (low, high)
        Width of the joints. [m]
    joint_light : (low, high)
        Light of the joints to that of the surface. [1]
    uneven : (low, high)
        Deviation of the logarithm of the light from tile to tile. [1]
    fine, coarse : Structure
    glossy : float
        Share that reflects its surroundings. [0-1]
    mirroring : (low, high)
        Reflectance of these at normal incidence. [0-1]
    rough : (low, high)
        Blur of what they reflect, 0 for a mirror. [0-1]
    """

    label: str
    places: dict[str, float]
    textures: tuple[str, ...]
    plain: float = 0.0
    contrast: Range = (0.6, 1.2)
    repeat_m: Range = (0.3, 1.2)
    stretch: Range = (1.0, 1.0)
    palettes: dict[str, float] = field(default_factory=lambda: {"native": 1.0})
    patterns: dict[str, float] = field(default_factory=lambda: {"none": 1.0})
    cell_m: Range = (0.3, 0.6)
    aspect: Range = (1.0, 1.0)
    joint_m: Range = (0.002, 0.006)
    joint_light: Range = (0.2, 0.95)
    uneven: Range = (0.0, 0.05)
    fine: Structure = NO_STRUCTURE
    coarse: Structure = NO_STRUCTURE
    glossy: float = 0.0
    mirroring: Range = (0.03, 0.06)
    rough: Range = (0.05, 0.6)


_POLISHED = ("Marble", "Granite", "Terrazzo", "Onyx", "Travertine")
_GRAIN = Structure(names=("grain",), repeat_m=(0.08, 0.35), strength=(0.2, 1.3))
_STREAKS = Structure(names=("grain", "brushed"), repeat_m=(0.3, 2.0), strength=(0.0, 0.8))
_PILE = Structure(names=("pile", "ribs"), repeat_m=(0.07, 0.3), strength=(0.3, 1.6))
_SOILED = Structure(names=("clouds",), repeat_m=(0.8, 4.0), strength=(0.0, 0.35))
_STONY = Structure(names=("veins", "chips", "clouds", "flecks"), repeat_m=(0.2, 1.2), strength=(0.0, 0.9))
_CARPET_COLORS = {"cloth": 0.75, "any": 0.25}
_TILING = {"grid": 0.66, "bond": 0.16, "hexagon": 0.06, "checker": 0.12}

DRESSINGS: tuple[Dressing, ...] = (
    # Tile: joints tell it, whatever lies between them.
    Dressing(
        label="tile", places={"floor": 5, "wall": 1.2, "furniture": 0.3, "collage": 0.5},
        textures=("Porcelain", "drawn ceramic", "Concrete"), plain=0.6, contrast=(0.1, 0.7), repeat_m=(0.3, 1.5),
        palettes={"glaze": 0.8, "clay": 0.12, "any": 0.08}, patterns=_TILING, cell_m=(0.1, 0.65), aspect=(1.0, 2.0),
        joint_m=(0.002, 0.008), uneven=(0.0, 0.08), fine=_STONY, coarse=_SOILED, glossy=0.8, rough=(0.02, 0.7),
    ),
    Dressing(
        label="tile", places={"floor": 5, "wall": 0.8, "collage": 0.5}, textures=_POLISHED,
        contrast=(0.3, 1.2), repeat_m=(0.4, 2.0), palettes={"native": 0.6, "glaze": 0.4}, patterns=_TILING,
        cell_m=(0.15, 0.8), aspect=(1.0, 2.0), joint_m=(0.0015, 0.006), uneven=(0.0, 0.1), fine=_STONY,
        coarse=_SOILED, glossy=0.85, rough=(0.02, 0.6),
    ),
    Dressing(
        label="tile", places={"wall": 1.2, "floor": 0.8, "furniture": 0.3, "collage": 0.5},
        textures=("Porcelain", "drawn ceramic"), plain=0.7, contrast=(0.1, 0.5),
        palettes={"glaze": 0.5, "pale": 0.25, "any": 0.25}, patterns={"grid": 0.5, "bond": 0.3, "hexagon": 0.12,
        "checker": 0.08}, cell_m=(0.02, 0.15), aspect=(1.0, 2.5), joint_m=(0.001, 0.005), joint_light=(0.3, 1.6),
        uneven=(0.0, 0.25), glossy=0.7, rough=(0.02, 0.5),
    ),
    Dressing(
        label="tile", places={"floor": 3, "wall": 1.0, "furniture": 0.3, "collage": 3.5}, textures=("Tiles",),
        contrast=(0.7, 1.2), repeat_m=(0.4, 2.5), palettes={"native": 0.75, "glaze": 0.15, "any": 0.1},
        fine=_STONY, coarse=_SOILED, glossy=0.5, rough=(0.05, 0.7),
    ),
    Dressing(label="tile", places={"collage": 1.0, "wall": 0.2}, textures=("photo tile",), repeat_m=(0.2, 0.8)),
    # Wood
    Dressing(
        label="wood", places={"floor": 5, "wall": 0.5, "ceiling": 0.4, "furniture": 0.3, "collage": 0.5},
        textures=("Wood", "Bamboo"), contrast=(0.5, 1.3), repeat_m=(0.12, 0.5), stretch=(2.0, 7.0),
        palettes={"native": 0.35, "wood": 0.6, "mineral": 0.05}, patterns={"planks": 0.86, "bond": 0.14},
        cell_m=(0.05, 0.24), aspect=(5.0, 16.0), joint_m=(0.0004, 0.003), joint_light=(0.1, 0.7), uneven=(0.02, 0.2),
        fine=_GRAIN, coarse=_SOILED, glossy=0.6, rough=(0.1, 0.7),
    ),
    Dressing(
        label="wood", places={"floor": 3, "wall": 0.2, "collage": 0.4}, textures=("Wood",),
        contrast=(0.4, 1.2), repeat_m=(0.1, 0.4), stretch=(1.5, 5.0), palettes={"native": 0.3, "wood": 0.7},
        patterns={"planks": 0.4, "herringbone": 0.35, "basket": 0.25}, cell_m=(0.03, 0.09), aspect=(3.0, 8.0),
        joint_m=(0.0003, 0.0015), joint_light=(0.2, 0.8), uneven=(0.04, 0.25), fine=_GRAIN, coarse=_SOILED,
        glossy=0.7, rough=(0.1, 0.6),
    ),
    Dressing(
        label="wood", places={"floor": 3, "wall": 0.5, "furniture": 0.6, "collage": 1.5},
        textures=("WoodFloor", "Planks"), contrast=(0.7, 1.2), repeat_m=(0.5, 2.5),
        palettes={"native": 0.8, "wood": 0.2}, fine=_GRAIN, coarse=_SOILED, glossy=0.5, rough=(0.1, 0.7),
    ),
    Dressing(
        label="wood", places={"furniture": 6, "wall": 0.6, "ceiling": 0.3, "floor": 1.2, "collage": 1.5},
        textures=("Wood", "Bamboo"), plain=0.25, contrast=(0.3, 1.3), repeat_m=(0.25, 1.2), stretch=(1.0, 4.0),
        palettes={"native": 0.45, "wood": 0.55}, fine=_GRAIN, coarse=_STREAKS, glossy=0.5, rough=(0.1, 0.7),
    ),
    Dressing(
        label="wood", places={"collage": 1.0, "wall": 0.4, "furniture": 0.4, "ceiling": 0.2},
        textures=("WoodSiding", "Bark", "Chipboard", "photo wood"), repeat_m=(0.3, 2.0),
    ),
    # Carpet
    Dressing(
        label="carpet", places={"floor": 5, "rug": 2, "furniture": 0.4, "collage": 2.5},
        textures=("drawn carpet",), plain=0.8,
        contrast=(0.1, 0.8), palettes=_CARPET_COLORS, fine=_PILE, coarse=_SOILED,
    ),
    Dressing(
        label="carpet", places={"floor": 4, "rug": 2, "collage": 2}, textures=("drawn carpet",), plain=0.7,
        contrast=(0.1, 0.8), palettes=_CARPET_COLORS, fine=_PILE,
        coarse=Structure(names=("flecks", "clouds", "pile"), repeat_m=(0.2, 2.0), strength=(0.1, 1.2)),
    ),
    Dressing(
        label="carpet", places={"floor": 3, "collage": 0.6}, textures=("drawn carpet",), plain=0.7,
        contrast=(0.1, 0.8), palettes=_CARPET_COLORS, patterns={"grid": 0.5, "checker": 0.3, "planks": 0.2},
        cell_m=(0.3, 0.6), aspect=(1.0, 2.0), joint_m=(0.0, 0.0015), joint_light=(0.5, 1.1), uneven=(0.0, 0.12),
        fine=_PILE, coarse=Structure(names=("flecks", "brushed", "clouds"), repeat_m=(0.3, 2.0), strength=(0.0, 1.0)),
    ),
    Dressing(
        label="carpet", places={"floor": 2, "rug": 2, "furniture": 0.3, "collage": 2.5},
        textures=("Carpet", "drawn carpet"),
        contrast=(0.6, 1.3), repeat_m=(0.15, 1.0), palettes={"native": 0.6, "cloth": 0.4}, fine=_PILE,
    ),
    Dressing(
        label="carpet", places={"floor": 1.2, "rug": 4, "collage": 0.5},
        textures=("drawn wallpaper", "Fabric", "Tiles"),
        contrast=(0.2, 0.8), repeat_m=(0.4, 2.0), palettes={"native": 0.3, "cloth": 0.7}, fine=_PILE, coarse=_SOILED,
    ),
    # Stone
    Dressing(
        label="stone", places={"floor": 1.0, "furniture": 0.8, "wall": 0.4, "collage": 2.5}, textures=_POLISHED,
        contrast=(0.5, 1.2), repeat_m=(0.4, 2.0), palettes={"native": 0.8, "mineral": 0.2}, fine=_STONY,
        glossy=0.6, rough=(0.02, 0.6),
    ),
    Dressing(
        label="stone", places={"floor": 1.2, "wall": 0.8, "ceiling": 0.4, "furniture": 0.2, "collage": 2.5},
        textures=("Concrete", "Rock"), plain=0.1, contrast=(0.3, 1.3), repeat_m=(0.8, 3.5),
        palettes={"native": 0.6, "mineral": 0.4}, fine=_STONY, coarse=_SOILED, glossy=0.3, rough=(0.2, 0.8),
    ),
    Dressing(
        label="stone", places={"wall": 0.4, "floor": 0.4, "collage": 3, "furniture": 0.1},
        textures=("Rocks", "Rock", "Concrete", "photo stone"), repeat_m=(0.6, 3.0),
    ),
    Dressing(
        label="stone", places={"wall": 0.1, "collage": 2.5}, textures=("PavingStones",), repeat_m=(0.6, 3.0),
    ),
    # Brick
    Dressing(
        label="brick", places={"wall": 1.2, "floor": 0.3, "collage": 4, "furniture": 0.1},
        textures=("Bricks", "photo brick"), contrast=(0.6, 1.2), repeat_m=(0.6, 2.0),
        palettes={"native": 0.85, "pale": 0.15},
    ),
    Dressing(
        label="brick", places={"wall": 0.8, "collage": 1}, textures=("Concrete", "Rock"), contrast=(0.3, 1.0),
        palettes={"clay": 0.75, "mineral": 0.15, "pale": 0.1}, patterns={"bond": 1.0}, cell_m=(0.05, 0.09),
        aspect=(3.0, 4.2), joint_m=(0.006, 0.014), joint_light=(0.6, 2.0), uneven=(0.05, 0.3), fine=_STONY,
    ),
    # Painted
    Dressing(
        label="painted", places={"wall": 7, "ceiling": 5, "furniture": 1, "collage": 1.5}, textures=("drawn painted",),
        plain=0.6, contrast=(0.2, 1.0), palettes={"pale": 0.7, "any": 0.3},
        fine=Structure(names=("roller",), repeat_m=(0.15, 0.6), strength=(0.0, 0.25)),
        coarse=Structure(names=("clouds",), repeat_m=(0.8, 4.0), strength=(0.0, 0.2)), glossy=0.15, rough=(0.4, 0.9),
    ),
    Dressing(
        label="painted", places={"wall": 5, "ceiling": 4, "furniture": 1, "collage": 1.5}, textures=("drawn painted",),
        plain=1.0, palettes={"pale": 0.65, "any": 0.35},
        fine=Structure(names=("roller",), repeat_m=(0.15, 0.6), strength=(0.0, 0.08)),
        coarse=Structure(names=("clouds",), repeat_m=(0.8, 4.0), strength=(0.0, 0.05)),
    ),
    Dressing(
        label="painted", places={"furniture": 2.5, "collage": 0.5}, textures=("drawn painted",), plain=1.0,
        palettes={"pale": 0.5, "any": 0.5}, glossy=0.5, rough=(0.2, 0.8),
    ),
    Dressing(
        label="painted", places={"wall": 2, "ceiling": 1.5, "collage": 2}, textures=("Paint", "Plaster"),
        contrast=(0.3, 1.1), repeat_m=(0.5, 2.0), palettes={"native": 0.4, "pale": 0.4, "any": 0.2},
    ),
    Dressing(
        label="painted", places={"ceiling": 4, "collage": 0.6}, textures=("OfficeCeiling", "drawn painted"),
        plain=0.4, contrast=(0.3, 1.0), repeat_m=(0.6, 1.2), palettes={"pale": 0.9, "any": 0.1},
        patterns={"grid": 0.9, "none": 0.1}, cell_m=(0.58, 0.63), aspect=(1.0, 2.0), joint_m=(0.008, 0.028),
        joint_light=(0.5, 1.15), uneven=(0.0, 0.03),
        fine=Structure(names=("flecks", "roller"), repeat_m=(0.1, 0.5), strength=(0.0, 0.8)),
    ),
    # Wallpaper
    Dressing(
        label="wallpaper", places={"wall": 2, "collage": 4}, textures=("Wallpaper", "drawn wallpaper"),
        contrast=(0.3, 1.1), repeat_m=(0.3, 1.2), palettes={"native": 0.7, "pale": 0.3},
        fine=Structure(names=("weave", "roller", "brushed"), repeat_m=(0.1, 0.4), strength=(0.0, 0.4)),
    ),
    # Fabric
    Dressing(
        label="fabric", places={"furniture": 3, "wall": 0.4, "floor": 0.3, "collage": 3},
        textures=("Fabric", "drawn fabric"), contrast=(0.4, 1.2), repeat_m=(0.1, 0.8),
        palettes={"native": 0.6, "cloth": 0.2, "any": 0.2},
        coarse=Structure(names=("clouds",), repeat_m=(0.5, 3.0), strength=(0.0, 0.5)),
    ),
    Dressing(
        label="fabric", places={"furniture": 2, "wall": 0.4, "collage": 1.5}, textures=("drawn fabric",), plain=0.9,
        palettes={"cloth": 0.5, "any": 0.5},
        fine=Structure(names=("weave",), repeat_m=(0.05, 0.25), strength=(0.1, 0.9)),
        coarse=Structure(names=("folds", "clouds"), repeat_m=(0.5, 3.0), strength=(0.0, 0.8)),
    ),
    # Plastic
    Dressing(
        label="plastic", places={"furniture": 2, "floor": 0.4, "collage": 2}, textures=("Plastic", "Rubber"),
        contrast=(0.4, 1.1), repeat_m=(0.2, 1.0), palettes={"native": 0.7, "any": 0.3}, glossy=0.5, rough=(0.1, 0.7),
    ),
    Dressing(
        label="plastic", places={"furniture": 2, "collage": 1}, textures=("Plastic",), plain=1.0,
        palettes={"any": 0.6, "pale": 0.2, "mineral": 0.2}, glossy=0.8, rough=(0.1, 0.7),
    ),
    Dressing(
        label="plastic", places={"floor": 1.8, "collage": 0.6}, textures=("Rubber", "Plastic"), plain=0.7,
        contrast=(0.2, 0.8), palettes={"glaze": 0.5, "any": 0.3, "clay": 0.2},
        fine=Structure(names=("flecks", "clouds", "brushed"), repeat_m=(0.1, 0.6), strength=(0.1, 1.0)),
        coarse=_SOILED, glossy=0.7, rough=(0.2, 0.7),
    ),
    Dressing(
        label="plastic", places={"collage": 6, "furniture": 0.1}, textures=("photo plastic",), repeat_m=(0.06, 0.3),
    ),
    # Metal
    Dressing(
        label="metal", places={"furniture": 2, "wall": 0.2, "floor": 0.2, "collage": 3},
        textures=("Metal", "DiamondPlate", "CorrugatedSteel", "Rust", "Chainmail", "Foil"), repeat_m=(0.2, 1.2),
        palettes={"native": 0.8, "metal": 0.2}, glossy=0.5, mirroring=(0.1, 0.6), rough=(0.2, 0.8),
    ),
    Dressing(
        label="metal", places={"furniture": 1.5, "ceiling": 0.1, "collage": 1}, textures=("Metal",), plain=0.8,
        contrast=(0.2, 0.8), palettes={"metal": 0.9, "any": 0.1},
        fine=Structure(names=("brushed",), repeat_m=(0.05, 0.3), strength=(0.0, 0.6)), glossy=0.9,
        mirroring=(0.2, 0.7), rough=(0.1, 0.8),
    ),
    Dressing(label="metal", places={"collage": 6, "furniture": 0.1}, textures=("photo metal",), repeat_m=(0.06, 0.3)),
    # Paper
    Dressing(
        label="paper", places={"furniture": 0.8, "collage": 1.5}, textures=("Paper", "Cardboard"), repeat_m=(0.1, 0.6),
        palettes={"native": 0.7, "pale": 0.2, "any": 0.1},
    ),
    Dressing(
        label="paper", places={"furniture": 0.6, "collage": 0.7}, textures=("Paper",), plain=0.8,
        contrast=(0.1, 0.6), palettes={"pale": 0.8, "any": 0.2},
    ),
    Dressing(label="paper", places={"collage": 4, "furniture": 0.15}, textures=("photo paper",), repeat_m=(0.06, 0.4)),
    # The rest
    Dressing(label="glass", places={"collage": 8, "furniture": 0.1}, textures=("photo glass",), repeat_m=(0.06, 0.3)),
    Dressing(
        label="glass", places={"furniture": 0.6, "wall": 0.3, "window": 1},
        textures=("drawn sky", "Grass", "drawn mirror"), contrast=(0.1, 0.9), repeat_m=(1.0, 5.0),
        palettes={"native": 0.5, "mineral": 0.5}, glossy=1.0, mirroring=(0.08, 0.4), rough=(0.0, 0.05),
    ),
    Dressing(
        label="glass", places={"furniture": 0.3, "wall": 0.3, "window": 0.8}, textures=("drawn sky", "drawn mirror"),
        contrast=(0.1, 0.9), repeat_m=(1.0, 5.0), palettes={"native": 0.5, "mineral": 0.5},
        patterns={"grid": 1.0}, cell_m=(0.04, 0.6), aspect=(1.0, 30.0), joint_m=(0.008, 0.05), joint_light=(0.1, 3.0),
        glossy=1.0, mirroring=(0.08, 0.4), rough=(0.0, 0.05),
    ),
    Dressing(
        label="mirror", places={"furniture": 0.9, "wall": 0.2}, textures=("drawn mirror",), plain=1.0,
        palettes={"mineral": 1.0}, glossy=1.0, mirroring=(0.85, 0.95), rough=(0.0, 0.01),
    ),
    Dressing(label="mirror", places={"collage": 1}, textures=("drawn mirror",), repeat_m=(0.2, 0.8)),
    Dressing(
        label="leather", places={"furniture": 1.5, "collage": 4}, textures=("drawn leather",), contrast=(0.4, 1.2),
        repeat_m=(0.05, 0.3), palettes={"native": 0.6, "cloth": 0.2, "any": 0.2}, glossy=0.5, rough=(0.4, 0.8),
    ),
    Dressing(
        label="ceramic", places={"furniture": 1.5, "collage": 4},
        textures=("drawn ceramic", "Porcelain", "GlazedTerracotta"),
        plain=0.3, contrast=(0.3, 1.0), repeat_m=(0.1, 0.6), palettes={"native": 0.5, "pale": 0.3, "any": 0.2},
        glossy=0.9, rough=(0.02, 0.3),
    ),
    Dressing(
        label="foliage", places={"furniture": 0.8, "floor": 0.2, "collage": 4},
        textures=("Grass", "Moss", "ScatteredLeaves", "PineNeedles", "photo foliage"), repeat_m=(0.3, 1.5),
    ),
    Dressing(label="hair", places={"collage": 4}, textures=("drawn hair",), repeat_m=(0.1, 0.4)),
    Dressing(label="skin", places={"collage": 4}, textures=("drawn skin",), repeat_m=(0.1, 0.4)),
    Dressing(label="sky", places={"collage": 4}, textures=("drawn sky",), repeat_m=(0.2, 0.8)),
    Dressing(label="water", places={"collage": 4}, textures=("drawn water",), repeat_m=(0.2, 0.8)),
)  # fmt: skip
