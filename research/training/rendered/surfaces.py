"""Surfaces drawn from the table of dressings, a whole batch of rooms at once."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from research.training.pictures import CLASSES
from research.training.rendered.dressings import DRESSINGS, PALETTES, PATTERNS, PLACES, Dressing, Range
from research.training.rendered.texture_bank import GAMMA, TextureBank

RANGES = (
    "contrast", "repeat_m", "stretch", "cell_m", "aspect", "joint_m", "joint_light", "uneven", "mirroring", "rough",
    "fine_repeat_m", "fine_strength", "coarse_repeat_m", "coarse_strength",
)  # fmt: skip
RATIOS = (
    "repeat_m",
    "stretch",
    "cell_m",
    "aspect",
    "fine_repeat_m",
    "coarse_repeat_m",
)  # drawn evenly in the logarithm
ALIGNED = 0.6  # [1] share of surfaces laid along the walls
SQUARE = 0.6  # [1] share of tiles that are square
ANY_STRONG = 0.3  # [1] share of colours that are strong
CHECKER_SPREAD = 0.7  # [1] of the logarithm of the second colour's light


@dataclass(frozen=True, kw_only=True, eq=False)
class Textures:
    """What surfaces may wear: textures of materials, structures, and which dressing may take which.

    Parameters
    ----------
    materials, structures : TextureBank
    pools, fine_pools, coarse_pools : list of (texture,) int64
        Of each dressing; those without textures are never drawn.
    """

    materials: TextureBank
    structures: TextureBank
    pools: list[Tensor]
    fine_pools: list[Tensor]
    coarse_pools: list[Tensor]


def find_pools(names: list[str], structures: tuple[str, ...], device: torch.device) -> dict[str, list[Tensor]]:
    """Textures of each dressing, by the folder or class that they came from."""

    def numbers(have: list[str], wanted: tuple[str, ...]) -> Tensor:
        return torch.tensor([n for n, name in enumerate(have) if name in wanted], dtype=torch.int64, device=device)

    known = list(structures)
    return {
        "pools": [numbers(names, each.textures) for each in DRESSINGS],
        "fine_pools": [numbers(known, each.fine.names) for each in DRESSINGS],
        "coarse_pools": [numbers(known, each.coarse.names) for each in DRESSINGS],
    }


class Wardrobe:
    """The table of dressings as tensors, to draw surfaces from.

    Parameters
    ----------
    textures : Textures
    generator : torch.Generator
        On the same device.
    """

    def __init__(self, textures: Textures, generator: torch.Generator) -> None:
        self.textures, self.generator = textures, generator
        self.device = generator.device
        have = torch.tensor([float(len(pool) > 0) for pool in textures.pools])
        weights = torch.tensor([[each.places.get(place, 0.0) for each in DRESSINGS] for place in PLACES])
        self._weights = (weights * have).to(self.device)
        bounds = torch.tensor([[_range(each, name) for name in RANGES] for each in DRESSINGS])
        ratios = torch.tensor([name in RATIOS for name in RANGES])
        bounds[:, ratios] = bounds[:, ratios].log()
        self._bounds, self._ratios = bounds.to(self.device), ratios.to(self.device)
        self._palettes = self._table([[each.palettes.get(name, 0.0) for name in PALETTES] for each in DRESSINGS])
        self._patterns = self._table([[each.patterns.get(name, 0.0) for name in PATTERNS] for each in DRESSINGS])
        self._plain = self._table([each.plain for each in DRESSINGS])
        self._glossy = self._table([each.glossy for each in DRESSINGS])
        self._label = self._table([CLASSES.index(each.label) for each in DRESSINGS]).to(torch.int64)
        self._pools = [_padded(pools) for pools in (textures.pools, textures.fine_pools, textures.coarse_pools)]

    def _table(self, values: object) -> Tensor:
        return torch.tensor(values, dtype=torch.float32, device=self.device)

    def random(self, *shape: int) -> Tensor:
        """Uniform numbers between 0 and 1."""
        return torch.rand(shape, generator=self.generator, device=self.device)

    def normal(self, *shape: int) -> Tensor:
        """Standard normal numbers."""
        return torch.randn(shape, generator=self.generator, device=self.device)

    def choose(self, weights: Tensor) -> Tensor:
        """(n,) a column of each row of (n, column) weights."""
        return torch.multinomial(weights, 1, generator=self.generator)[:, 0]

    def surfaces(self, places: Tensor) -> dict[str, Tensor]:
        """Draw a surface for each place.

        Parameters
        ----------
        places : (surface,) int64
            Of `PLACES`.

        Returns
        -------
        surfaces : dict of str to (surface,) or (surface, 3) tensor
            What `shading.albedo` needs of each, by name.
        """
        count = len(places)
        dressing = self.choose(self._weights[places])
        low, high = self._bounds[dressing].unbind(dim=2)
        drawn = low + self.random(count, len(RANGES)) * (high - low)
        drawn = torch.where(self._ratios, drawn.exp(), drawn)
        found = {name: drawn[:, number] for number, name in enumerate(RANGES)}
        texture, fine, coarse = (self._one_of(pool, dressing) for pool in self._pools)
        palette = self.choose(self._palettes[dressing])
        native = self.textures.materials.mean[texture]
        color = torch.where((palette == PALETTES.index("native"))[:, None], native, self._color(palette))
        square = self.random(count) < SQUARE
        angle = 0.5 * torch.pi * torch.randint(4, (count,), generator=self.generator, device=self.device)
        turned = torch.where(self.random(count) < ALIGNED, 0.0, torch.pi * (self.random(count) * 2.0 - 1.0))
        aspect = torch.where(square & (found["aspect"] < 3.0), torch.ones_like(found["aspect"]), found["aspect"])
        glossy = self.random(count) < self._glossy[dressing]
        joint = found["joint_light"][:, None] * color * (1.0 + 0.08 * self.normal(count, 3))
        grey = self._color(torch.full_like(palette, PALETTES.index("mineral")))
        return found | {
            "label": self._label[dressing],
            "texture": texture,
            "fine": fine,
            "coarse": coarse,
            "color": color,
            "second": color * torch.exp(CHECKER_SPREAD * self.normal(count, 1) + 0.15 * self.normal(count, 3)),
            "joint_color": torch.where(self.random(count, 1) < 0.4, grey, joint).clamp(0.01, 0.95),
            "contrast": torch.where(self.random(count) < self._plain[dressing], 0.0, found["contrast"]),
            "pattern": self.choose(self._patterns[dressing]),
            "aspect": aspect,
            "angle": angle + turned,
            "shift": 5.0 * self.random(count, 2),
            "seed": 100.0 * self.random(count),
            "mirroring": torch.where(glossy, found["mirroring"], 0.0),
        }

    def _one_of(self, pool: tuple[Tensor, Tensor], dressing: Tensor) -> Tensor:
        numbers, length = pool
        place = (self.random(len(dressing)) * length[dressing]).to(torch.int64)
        return numbers[dressing, place]

    def _color(self, palette: Tensor) -> Tensor:
        """(surface, 3) light of colours drawn from palettes."""
        count = len(palette)
        share, spread = self.random(count, 1), self.normal(count, 3)
        strong = self.random(count, 1) < ANY_STRONG
        free = torch.where(strong, 0.15 + 0.7 * share + 0.2 * spread, 0.4 + 0.55 * share + 0.05 * spread)
        warm = self.normal(count, 1).abs() * torch.tensor([0.02, 0.0, -0.04], device=self.device)
        colors = {
            "native": free,
            "any": free,
            "pale": 0.72 + 0.26 * share.sqrt() + 0.02 * spread + 0.7 * warm,
            "wood": self._between(share, (0.2, 0.12, 0.07), (0.88, 0.72, 0.52)) + 0.035 * spread,
            "mineral": 0.2 + 0.72 * share + 0.015 * spread + warm,
            "cloth": (0.2 + 0.5 * share) * (1.0 + torch.where(strong, 0.3, 0.08) * spread) + 2.0 * warm * share,
            "clay": self._between(share, (0.4, 0.19, 0.13), (0.8, 0.52, 0.38)) + 0.03 * spread,
            "glaze": 0.2 + 0.76 * share.sqrt() + 0.02 * spread + 1.5 * warm,
            "metal": 0.25 + 0.6 * share + 0.015 * spread,
        }
        stored = torch.stack([colors[name] for name in PALETTES])[palette, torch.arange(count, device=self.device)]
        return stored.clamp(0.03, 0.97) ** GAMMA

    def _between(self, share: Tensor, low: tuple[float, ...], high: tuple[float, ...]) -> Tensor:
        first, last = (torch.tensor(each, device=self.device) for each in (low, high))
        return first + share * (last - first)


def _range(dressing: Dressing, name: str) -> Range:
    for part in ("fine", "coarse"):
        if name.startswith(part):
            value: Range = getattr(getattr(dressing, part), name.removeprefix(f"{part}_"))
            return value
    own: Range = getattr(dressing, name)
    return own


def _padded(pools: list[Tensor]) -> tuple[Tensor, Tensor]:
    """(pool, most) numbers and (pool,) lengths."""
    lengths = torch.tensor([len(pool) for pool in pools])
    numbers = torch.zeros((len(pools), max(1, int(np.max(lengths.numpy())))), dtype=torch.int64)
    for row, pool in enumerate(pools):
        numbers[row, : len(pool)] = pool.cpu()
    device = pools[0].device
    return numbers.to(device), lengths.to(device)
