"""Which hues of a plane a picture tells apart: the integrated classification likelihood of Gaussian groups.

A room's hues are sorted into as many groups as it may have. White paint, tiles and a ceiling are nearly of one hue;
such groups then part a wall by its noise, or by what a wrong camera makes of bright and dark places. Points so parted
witness no light any more, and those left together confirm the camera that parted them. So groups of one plane are put
together while that makes their hues h more probable. With n_k of n points in group k and their covariance S_k, the
likelihood of Gaussian groups whose members are known, less what their parameters cost, is

    ICL = sum n_k [log(n_k / n) - log det(S_k + d² I) / 2] - 3 K log n,                                           (1)

d being what a picture tells of a hue, and six the parameters of a group: mean, covariance and share. What cutting a
group in two gains by the second term it loses by the first: two groups of equal size stay two if 3.5 of their
deviations lie between them.

References
----------
Biernacki, Celeux, Govaert (2000) Assessing a mixture model for clustering with the integrated completed likelihood,
IEEE Trans. Pattern Anal. Mach. Intell. 22, 719, Eq. 8.
"""

from dataclasses import dataclass
from itertools import combinations
from typing import Self

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray

HUE_DEVIATION = 0.004  # [1] of the log of a hue, that a picture of 8 bits tells at half of white
PARAMETERS = 6  # of a group
# Orthonormal axes across (1, 1, 1), which the mean of a hue's logarithms, 0, leaves free.
HUE_AXES = np.array([[1.0, 0.0, -1.0], [-1.0, 2.0, -1.0]]) / np.sqrt([[2.0], [6.0]])


@dataclass(frozen=True, kw_only=True, eq=False)
class _Hues:
    """Some hues: their number, their mean, and the sums of squares and products about it."""

    count: float
    mean: FloatArray
    squares: FloatArray

    @classmethod
    def of(cls, hues: FloatArray) -> Self:
        """Of (point, 2) hues."""
        apart = hues - hues.mean(axis=0)
        return cls(count=float(len(hues)), mean=hues.mean(axis=0), squares=apart.T @ apart)

    def with_more(self, other: "_Hues") -> "_Hues":
        """These and others together."""
        count, apart = self.count + other.count, other.mean - self.mean
        return _Hues(
            count=count,
            mean=self.mean + other.count / count * apart,
            squares=self.squares + other.squares + self.count * other.count / count * np.outer(apart, apart),
        )

    def likelihood(self, of_all: int) -> float:
        """Term of this group in Eq. 1, but for the cost of its parameters."""
        spread = self.squares / self.count + HUE_DEVIATION**2 * np.eye(2)
        return self.count * float(np.log(self.count / of_all) - 0.5 * np.linalg.slogdet(spread)[1])


def told_hues(hues: FloatArray, label: IntArray) -> IntArray:
    """Put groups of hues together while Eq. 1 grows by it, those first by which it grows most.

    Parameters
    ----------
    hues : (point, 3) float
        Logarithms of a plane's colours less their mean.
    label : (point,) int
        A sorting into groups, rather too many than too few.

    Returns
    -------
    label : (point,) int
        Of those put together, the least.
    """
    flat = hues @ HUE_AXES.T
    groups = {int(name): _Hues.of(flat[label == name]) for name in np.unique(label)}
    found = label.copy()
    cost = 0.5 * PARAMETERS * float(np.log(len(label)))

    def gain(pair: tuple[int, int]) -> float:
        first, second = groups[pair[0]], groups[pair[1]]
        apart = first.likelihood(len(label)) + second.likelihood(len(label))
        return first.with_more(second).likelihood(len(label)) + cost - apart

    while len(groups) > 1:
        pair = max(combinations(groups, 2), key=gain)
        if gain(pair) < 0:
            break
        kept, gone = pair
        groups[kept] = groups[kept].with_more(groups.pop(gone))
        found[found == gone] = kept
    return found
