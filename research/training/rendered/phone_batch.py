"""What a phone makes of light, for a batch of pictures on one device: as `phone.developed`, and with more of it."""

import torch
from torch import Tensor
from torch.nn.functional import conv2d, interpolate, pad

from research.training.rendered.surfaces import Wardrobe

BRIGHT, BRIGHT_SHARE = (0.4, 1.05), (0.6, 0.98)  # [1] what a quantile of the light becomes, and the quantile
TINT = 0.05  # [1] deviation of the logarithm of each colour after white balance
GAMMA = (1.7, 2.7)  # [1]
BLUR_PX, MOTION_PX, NOISE = 1.4, 3.0, 0.03  # [px], [px], [1] largest
REACH_PX = 6  # [px] of blurs
COARSE = (0.35, 0.9)  # [1] resolution of a poor picture
QUANTA = (
    16, 11, 10, 16, 24, 40, 51, 61, 12, 12, 14, 19, 26, 58, 60, 55, 14, 13, 16, 24, 40, 57, 69, 56, 14, 17, 22, 29, 51,
    87, 80, 62, 18, 22, 37, 56, 68, 109, 103, 77, 24, 35, 55, 64, 81, 104, 113, 92, 49, 64, 78, 87, 103, 121, 120, 101,
    72, 92, 95, 98, 112, 100, 103, 99,
)  # fmt: skip  # [1] of 255, of JPEG's luminance at half quality: ITU-T T.81, Table K.1


def develop(light: Tensor, wardrobe: Wardrobe) -> Tensor:
    """Exposure, white balance, vignetting, tone curve, blur, sharpening, noise, resolution and compression.

    Parameters
    ----------
    light : (picture, 3, row, column) float
        Linear, in any unit; sides multiples of 16.
    wardrobe : Wardrobe
        Whose generator draws.

    Returns
    -------
    pictures : (picture, 3, row, column) float
        Encoded. [0-1]
    """
    count, random = len(light), wardrobe.random
    device = light.device

    def of(*bounds: float, share: float = 1.0) -> Tensor:
        low, high = bounds
        drawn = low + random(count, 1, 1, 1) * (high - low)
        return torch.where(random(count, 1, 1, 1) < share, drawn, 0.0) if share < 1.0 else drawn

    levels = light[:, :, ::4, ::4].amax(dim=1).flatten(1).sort(dim=1).values
    place = (of(*BRIGHT_SHARE)[:, 0, 0] * (levels.shape[1] - 1)).to(torch.int64)
    light = light * (of(*BRIGHT) / levels.gather(1, place).clamp_min(1e-4)[:, :, None, None])
    light = light * torch.exp(TINT * wardrobe.normal(count, 3, 1, 1))
    row, column = (torch.linspace(-1, 1, side, device=device) for side in light.shape[2:])
    light = light / (1.0 + of(0.0, 0.35, share=0.4) * (row[:, None] ** 2 + column**2))
    contrast = of(0.0, 0.5, share=0.5)
    encoded = light.clamp(0, 1) ** (1.0 / of(*GAMMA))
    encoded = torch.lerp(encoded, encoded**2 * (3.0 - 2.0 * encoded), contrast)
    grey = encoded.mean(dim=1, keepdim=True)
    encoded = grey + (encoded - grey) * of(0.6, 1.3)
    encoded = _blurred(encoded, of(0.3, BLUR_PX, share=0.85).flatten())
    encoded = _blurred(encoded, of(0.5, MOTION_PX, share=0.2).flatten(), down=False)
    sharp = encoded - _blurred(encoded, torch.full((count,), 1.0, device=device))
    encoded = encoded + of(0.0, 0.8, share=0.3) * sharp
    grain = wardrobe.normal(*encoded.shape)
    soft = 1.8 * _blurred(grain, torch.full((count,), 0.8, device=device))
    grain = torch.where(random(count, 1, 1, 1) < 0.5, soft, grain)
    encoded = encoded + of(0.0, NOISE) * grain
    encoded = _coarse(encoded, wardrobe)
    return _compressed(encoded.clamp(0, 1), of(0.15, 2.5, share=0.5)).clamp(0, 1)


def _blurred(pictures: Tensor, sigma_px: Tensor, *, down: bool = True) -> Tensor:
    """Gaussian blur, each picture by its own deviation, across and down or across alone; 0 leaves one as it is."""
    count, channels = pictures.shape[:2]
    reach = REACH_PX
    step = torch.arange(-reach, reach + 1, device=pictures.device).float()
    kernel = torch.exp(-0.5 * (step / sigma_px[:, None].clamp_min(0.05)) ** 2)
    kernel = (kernel / kernel.sum(dim=1, keepdim=True)).repeat_interleave(channels, dim=0)
    one = pictures.reshape(1, count * channels, *pictures.shape[2:])
    one = conv2d(pad(one, (reach, reach, 0, 0), mode="replicate"), kernel[:, None, None], groups=count * channels)
    if down:
        one = conv2d(
            pad(one, (0, 0, reach, reach), mode="replicate"), kernel[:, None, :, None], groups=count * channels
        )
    return one.reshape(pictures.shape)


def _coarse(pictures: Tensor, wardrobe: Wardrobe) -> Tensor:
    """A fifth of the batch at one lower resolution, and another at a second."""
    size, some = pictures.shape[2:], len(pictures) // 5
    order = torch.randperm(len(pictures), generator=wardrobe.generator, device=pictures.device)
    for part in (order[:some], order[some : 2 * some]):
        share = COARSE[0] + float(wardrobe.random(1)) * (COARSE[1] - COARSE[0])
        small = [max(16, round(side * share)) for side in size]
        if len(part):
            coarse = interpolate(pictures[part], size=small, mode="bilinear", antialias=True, align_corners=False)
            fine = interpolate(coarse, size=size, mode="bilinear", align_corners=False)
            pictures = pictures.index_copy(0, part, fine)
    return pictures


def _compressed(pictures: Tensor, quantum: Tensor) -> Tensor:
    """JPEG's rounding of the cosine transform of blocks, colours at half resolution; 0 leaves a picture as it is."""
    device = pictures.device
    to_ycc = torch.tensor([[0.299, 0.587, 0.114], [-0.1687, -0.3313, 0.5], [0.5, -0.4187, -0.0813]], device=device)
    k, n = torch.meshgrid(torch.arange(8.0, device=device), torch.arange(8.0, device=device), indexing="ij")
    cosines = torch.cos(torch.pi * (2 * n + 1) * k / 16) * torch.where(k == 0, 0.125**0.5, 0.5)
    table = torch.tensor(QUANTA, device=device).reshape(8, 8) / 255.0
    ycc = torch.einsum("oc,nchw->nohw", to_ycc, pictures)
    color = interpolate(ycc[:, 1:], scale_factor=0.5, mode="area")

    def rounded(values: Tensor, steps: Tensor) -> Tensor:
        count, channels, height, width = values.shape
        blocks = values.reshape(count, channels, height // 8, 8, width // 8, 8)
        waves = torch.einsum("ki,nchiwj,lj->nchkwl", cosines, blocks, cosines)
        step = (steps[:, :, :, :, None, None] * table[None, None, None, :, None, :]).clamp_min(1e-4)
        waves = (waves / step).round() * step
        return torch.einsum("ki,nchkwl,lj->nchiwj", cosines, waves, cosines).reshape(values.shape)

    bright, color = rounded(ycc[:, :1], quantum), rounded(color, 1.5 * quantum)
    color = interpolate(color, size=pictures.shape[2:], mode="bilinear", align_corners=False)
    back = torch.einsum("oc,nchw->nohw", torch.linalg.inv(to_ycc), torch.cat([bright, color], dim=1))
    return torch.where(quantum > 0, back, pictures)
