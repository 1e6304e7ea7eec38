"""Radiance on the surface from many frames: the best views of every texel, and a robust mean of them.

Each texel keeps its few best views, so that memory does not grow with the number of frames. What is cut at white in a
frame tells only that the radiance is not below that frame's white: where some frame was exposed for less, the lamp or
window has its radiance from there. Where none was, the frame that says most has it: of paint that is a little too
bright for all of them, the channels and pixels below white tell. And what a frame shows near black is noise, which is
cut at 0 and so never too low: each channel is weighted by what this noise amounts to in radiance, so that the blue of
an orange wall comes from the frames that were exposed for shadows. The spread between views is the texel's own
deviation: gloss, passers-by, poses. Views are few, so that their median absolute deviation is brought to the spread
that it stands for among so many, and the mean's deviation is that of its loss.

References
----------
Geman, McClure (1987) Statistical methods for tomographic image reconstruction, Bull. ISI 52, 5 (redescending loss).
Croux, Rousseeuw (1992) Time-efficient algorithms for two highly robust estimators of scale, COMPSTAT 1, 411 (median
absolute deviations of few values). Huber (1981) Robust statistics, Section 3.2 (variance of an M-estimate).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lidarspectra.arrays import BoolArray, ByteArray, FloatArray, IntArray, SmallFloatArray

VIEWS = 10  # that a texel keeps; more change its mean by less than their spread
ROUNDS = 4  # re-weightings about the median
ROBUST_SCALE = 2.0  # [1] of the redescending loss, in standard deviations: 79 % of a plain mean's efficiency
# [1] of its mean's deviation over s / sqrt(effective views) where errors are normal: sqrt(E psi² E² w / E w²) / E psi'
LOSS_DEVIATION = 1.07
# [1] of a spread over 1.4826 times the median absolute deviation of 2, 3, ... 9 values (Croux, Rousseeuw)
FEW_VIEWS = (1.196, 1.495, 1.363, 1.206, 1.200, 1.140, 1.129, 1.107)
MIN_SPREAD, SINGLE_SPREAD = 0.02, 0.15  # [1] of views of one texel; and where there is but one view
USUAL_SPREAD = 0.05  # [1] by which views count for the spread of a texel: what is noise in them tells nothing of it
DARKEST = 1e-4  # [1] of white, floor before logarithms
BLOCK_TEXELS = 50_000  # averaged at once, which bounds temporaries to some 50 MB


@dataclass(frozen=True, kw_only=True, eq=False)
class Fused:
    """Radiance of texels.

    Parameters
    ----------
    light : (texel, 3) float32
        Linear, over the white of a frame of mean gain; may be above 1. NaN where no frame saw it. [1]
    deviation : (texel,) float32
        Standard deviation of its logarithm, from the spread between views. [1]
    views : (texel,) uint8
        That agree on it.
    cut : (texel, 3) bool
        Which channels every frame shows cut at white, so that `light` is a lower bound in them.
    """

    light: SmallFloatArray
    deviation: SmallFloatArray
    views: ByteArray
    cut: BoolArray

    @staticmethod
    def joined(parts: "Sequence[Fused]") -> "Fused":
        """All texels of some tiles, in their order."""
        return Fused(
            light=np.concatenate([part.light for part in parts]),
            deviation=np.concatenate([part.deviation for part in parts]),
            views=np.concatenate([part.views for part in parts]),
            cut=np.concatenate([part.cut for part in parts]),
        )

    @property
    def at_least(self) -> BoolArray:
        """(texel,) whether `light` is a lower bound in some channel."""
        return np.asarray(self.cut.any(axis=1), dtype=np.bool_)

    @property
    def white(self) -> BoolArray:
        """(texel,) whether it is one in all of them, as of lamps; paint keeps channels that tell its radiance."""
        return np.asarray(self.cut.all(axis=1), dtype=np.bool_)


class BestViews:
    """The best views of each texel so far.

    Parameters
    ----------
    texels : int
        How many.
    """

    def __init__(self, texels: int) -> None:
        self._light = np.full((VIEWS, texels, 3), np.nan, dtype=np.float32)
        self._weight = np.zeros((VIEWS, texels), dtype=np.float32)
        self._frame = np.zeros((VIEWS, texels), dtype=np.uint16)
        self._noise: list[float] = []
        self._bound = np.zeros((texels, 3), dtype=np.float32)
        self._cut = np.zeros((texels, 3), dtype=np.bool_)

    def add(
        self,
        index: IntArray,
        light: FloatArray,
        weight: FloatArray,
        clipped: BoolArray,
        *,
        cut: BoolArray | None = None,
        noise: float = 0.0,
    ) -> None:
        """Add a frame.

        Parameters
        ----------
        index : (seen,) int
            Texels, each once.
        light : (seen, 3) float
            Radiance by this frame alone. [1]
        weight : (seen,) float
            How well it shows each. [1]
        clipped : (seen,) bool
            Where a part of the pixels is cut at white: `light`, their mean, is then a lower bound.
        cut : (seen, 3) bool
            Channels whose mean is at white; all of them where `clipped`, if left out.
        noise : float
            Standard deviation of `light` where the frame is dark. [1]
        """
        higher = clipped & (light.mean(axis=1) > self._bound[index].mean(axis=1))
        self._bound[index[higher]] = light[higher]
        self._cut[index[higher]] = True if cut is None else cut[higher]
        index, light, weight = index[~clipped], light[~clipped], weight[~clipped]
        worst = self._weight[:, index].argmin(axis=0)
        better = weight > self._weight[worst, index]
        slot, place = worst[better], index[better]
        self._light[slot, place] = light[better]
        self._weight[slot, place] = weight[better]
        self._frame[slot, place] = len(self._noise)
        self._noise.append(noise)

    def fused(self) -> Fused:
        """Robust means of all texels."""
        count = self._bound.shape[0]
        light = np.full((count, 3), np.nan, dtype=np.float32)
        deviation = np.full(count, SINGLE_SPREAD, dtype=np.float32)
        views = np.zeros(count, dtype=np.uint8)
        for start in range(0, count, BLOCK_TEXELS):
            part = slice(start, start + BLOCK_TEXELS)
            noise = np.array([*self._noise, 0.0], dtype=np.float32)[self._frame[:, part]]
            light[part], deviation[part], views[part] = _robust_mean(self._light[:, part], self._weight[:, part], noise)
        bounded = (views == 0) & (self._bound > 0).any(axis=1)
        light[bounded] = self._bound[bounded]
        return Fused(light=light, deviation=deviation, views=views, cut=bounded[:, None] & self._cut)


def _robust_mean(
    light: SmallFloatArray, weight: SmallFloatArray, noise: SmallFloatArray
) -> tuple[SmallFloatArray, SmallFloatArray, ByteArray]:
    """Mean, its relative deviation, and the number of views that agree, of (view, texel, 3) light.

    A channel's variance is that of the views' spread s and of the (view, texel) noise n over the light L there, so that
    its weight is as s² / (s² + (n / L)²).
    """
    seen = weight > 0
    values = np.log(np.maximum(np.where(seen[:, :, None], light, 1.0), DARKEST))
    # Most views may be too dark for a channel, and all of them too bright in it: the others tell where to begin.
    total = np.maximum(weight.sum(axis=0), 1e-20)[:, None]
    level = np.log(np.maximum(np.einsum("vt,vtc->tc", weight, np.where(seen[:, :, None], light, 0.0)) / total, DARKEST))
    told = weight[:, :, None] * _sure(np.full_like(level[:, 1:2], USUAL_SPREAD), noise, level)
    center, green = _weighted_median(values, told), told[:, :, 1]
    spread = 1.4826 * _weighted_median(np.abs(values[:, :, 1:2] - center[:, 1:2]), green[:, :, None])
    spread = np.maximum(spread * _of_few(_effective(green))[:, None], MIN_SPREAD)
    sure, share = np.ones_like(values), np.broadcast_to(weight[:, :, None], values.shape)
    for _ in range(ROUNDS):
        sure = _sure(spread, noise, center)
        apart = (np.abs(values - center) * np.sqrt(sure)).max(axis=2, keepdims=True) / (ROBUST_SCALE * spread)
        share = weight[:, :, None] * sure / (1.0 + apart**2) ** 2
        center = (share * values).sum(axis=0) / np.maximum(share.sum(axis=0), 1e-12)
    green = share[:, :, 1]
    agree = (green > np.where(seen, 0.25 * weight * sure[:, :, 1], np.inf)).sum(axis=0)
    deviation = np.where(agree > 1, LOSS_DEVIATION * spread[:, 0] / np.sqrt(_effective(green)), SINGLE_SPREAD)
    none = weight.max(axis=0) <= 0
    return (
        np.where(none[:, None], np.nan, np.exp(center)).astype(np.float32),
        deviation.astype(np.float32),
        agree.astype(np.uint8),
    )


def _sure(spread: SmallFloatArray, noise: SmallFloatArray, center: SmallFloatArray) -> SmallFloatArray:
    """(view, texel, 3) share of the views' spread in the variance of the logarithm of light about a centre [0-1]."""
    of_noise = noise[:, :, None] / np.exp(center)
    return np.asarray(spread**2 / (spread**2 + of_noise**2), dtype=np.float32)


def _effective(weight: SmallFloatArray) -> SmallFloatArray:
    """(texel,) how many equal views as much as (view, texel) unequal ones; at least 1."""
    effective = weight.sum(axis=0) ** 2 / np.maximum((weight**2).sum(axis=0), 1e-20)
    return np.asarray(np.maximum(effective, 1.0), dtype=np.float32)


def _of_few(views: SmallFloatArray) -> SmallFloatArray:
    """(texel,) spread over 1.4826 times the median absolute deviation of so many views."""
    few = np.interp(views, np.arange(2, 2 + len(FEW_VIEWS)), FEW_VIEWS)
    return np.asarray(np.where(views > 1 + len(FEW_VIEWS), views / (views - 0.8), few), dtype=np.float32)


def _weighted_median(values: SmallFloatArray, weight: SmallFloatArray) -> SmallFloatArray:
    """(texel, channel) weighted median over the first axis of (view, texel, channel) values.

    Between the two views whose middles of weight are next to half of it, so that of two alike it is their mean.
    """
    order = np.argsort(np.where(weight > 0, values, np.inf), axis=0)
    own = np.take_along_axis(weight, order, axis=0)
    mass = own.cumsum(axis=0)
    middle, half = mass - 0.5 * own, 0.5 * mass[-1]
    above = np.clip((middle < half).sum(axis=0), 0, np.maximum((own > 0).sum(axis=0) - 1, 0))
    rows = np.stack([np.maximum(above - 1, 0), above])
    (low, high), (mass_low, mass_high) = (
        np.take_along_axis(each, rows, axis=0) for each in (np.take_along_axis(values, order, axis=0), middle)
    )
    share = np.clip((half - mass_low) / np.maximum(mass_high - mass_low, 1e-12), 0.0, 1.0)
    return np.asarray(low + share * (high - low), dtype=np.float32)
