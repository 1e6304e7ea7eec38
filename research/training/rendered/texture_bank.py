"""Textures of one size as a stack with mipmaps, sampled for millions of pixels at once.

A pixel's level is drawn at random between the two that its footprint lies between (stochastic trilinear filtering), so
that one level is read for it and not two.

References
----------
Williams (1983) Pyramidal parametrics, SIGGRAPH. Ernst, Stamminger, Greiner (2006) Filter importance sampling, IEEE
Symposium on Interactive Ray Tracing (one tap in place of many, drawn at random).
"""

from dataclasses import dataclass

import cv2
import numpy as np
import torch
from torch import Tensor

from lidarspectra.arrays import BoolArray, ByteArray

GAMMA = 2.2  # [1] between stored values and light, as in `phone`
MIN_LEVEL_PX = 4  # [px] edge of the coarsest level


@dataclass(frozen=True, kw_only=True, eq=False)
class TextureBank:
    """Textures with their mipmaps on one device.

    Parameters
    ----------
    texels : (texel,) int32
        All levels of all textures, finest first, rows by rows; red in the lowest byte, then green and blue.
    starts : (level,) int64
        Where each level begins.
    size_px : int
        Edge of the finest level, a power of 2. [px]
    mean : (texture, 3) float
        Mean light, decoded. [0-1]
    mirrored : (texture,) bool
        Whether it is continued by its mirror image, because it has a seam at its edge.
    """

    texels: Tensor
    starts: Tensor
    size_px: int
    mean: Tensor
    mirrored: Tensor

    @property
    def levels(self) -> int:
        """How many levels there are."""
        return len(self.starts)


def resized(image: ByteArray, size_px: int) -> ByteArray:
    """The largest square in the middle of a picture, at another size."""
    edge = min(image.shape[:2])
    top, left = ((length - edge) // 2 for length in image.shape[:2])
    square = image[top : top + edge, left : left + edge]
    method = cv2.INTER_AREA if edge > size_px else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(square, (size_px, size_px), interpolation=method), dtype=np.uint8)


def make_bank(textures: ByteArray, mirrored: BoolArray, device: torch.device) -> TextureBank:
    """Build the mipmaps.

    Parameters
    ----------
    textures : (texture, size, size, 3) uint8
        sRGB encoded; the size a power of 2.
    mirrored : (texture,) bool
    device : torch.device

    Returns
    -------
    bank : TextureBank
    """
    light = (torch.from_numpy(textures).to(device).float() / 255.0) ** GAMMA
    light = light.permute(0, 3, 1, 2)
    mean = light.mean(dim=(2, 3))
    parts, starts, first = [], [], 0
    size = int(textures.shape[1])
    for _ in range(int(np.log2(size // MIN_LEVEL_PX)) + 1):
        stored = (255.0 * light ** (1.0 / GAMMA)).round().clamp(0, 255).to(torch.int32)
        packed = stored[:, 0] | (stored[:, 1] << 8) | (stored[:, 2] << 16)
        parts.append(packed.reshape(-1))
        starts.append(first)
        first += parts[-1].numel()
        light = torch.nn.functional.avg_pool2d(light, 2)
    return TextureBank(
        texels=torch.cat(parts),
        starts=torch.tensor(starts, device=device),
        size_px=size,
        mean=mean.clamp_min(1e-3),
        mirrored=torch.from_numpy(mirrored).to(device),
    )


def sample_bank(bank: TextureBank, which: Tensor, u: Tensor, v: Tensor, footprint: Tensor) -> Tensor:
    """Light of textures at places.

    Parameters
    ----------
    bank : TextureBank
    which : (...,) int64
        Texture of each place.
    u, v : (...,) float
        Across and down, in edges of the texture. [1]
    footprint : (...,) float
        What a pixel covers, in edges of the texture. [1]

    Returns
    -------
    light : (..., 3) float
        Decoded. [0-1]
    """
    mirrored = bank.mirrored[which]
    across, down = (
        torch.where(mirrored, 1.0 - (1.0 - each.remainder(2.0)).abs(), each.remainder(1.0)) for each in (u, v)
    )
    level = torch.log2((footprint * bank.size_px).clamp_min(1e-6)) + torch.rand_like(footprint)
    level = level.floor().clamp(0, bank.levels - 1).to(torch.int64)
    size = torch.bitwise_right_shift(torch.full_like(level, bank.size_px), level)
    x, y = across * size - 0.5, down * size - 0.5
    left, top = x.floor(), y.floor()
    share_x, share_y = (x - left)[..., None], (y - top)[..., None]
    base = bank.starts[level] + which * size * size
    last = size - 1

    def at(row: Tensor, column: Tensor) -> Tensor:
        row, column = (
            torch.where(mirrored, torch.minimum(place.clamp_min(0), last), place.remainder(size))
            for place in (row.to(torch.int64), column.to(torch.int64))
        )
        texel = bank.texels[base + row * size + column]
        return torch.stack([texel & 255, (texel >> 8) & 255, (texel >> 16) & 255], dim=-1).float()

    upper = at(top, left) * (1.0 - share_x) + at(top, left + 1) * share_x
    lower = at(top + 1, left) * (1.0 - share_x) + at(top + 1, left + 1) * share_x
    return ((upper * (1.0 - share_y) + lower * share_y) / 255.0) ** GAMMA
