"""One paint, one reflectance: what changes along a plane of one hue in a picture is light, until shown otherwise.

De-lighting leaves the errors of its light on large surfaces as slow changes of reflectance along them. Faces of one
plane and one hue whose lightness lies about a common one are therefore taken for one paint; what is clearly lighter or
darker there, as a grey door in a white wall, is another, and keeps its own. But no paint is brighter than fresh white:
what comes out so has more light than the model knows, and is of the paint of its plane and hue. And a picture tells no
hue in a channel that it shows near black, as blue of an orange wall between others, or of any wall in the light of
candles: what the noise alone sets apart there is of the paint of its plane that the other channels agree with.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Self

import numpy as np
from scipy.ndimage import gaussian_filter1d

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.delighting.light_objective import BRIGHTEST_REFLECTANCE, PICTURE_NOISE
from lidarspectra.material.delighting.surface_hues import HUE_FLOOR, surface_groups

ALIKE = 0.3  # [1] of the logarithm of reflectance, about the commonest, that light may have changed by
PIECES_ALIKE = 0.1  # [1] the same between pieces of a plane that a wall parts: their lights are known to some 5 % each
STEP, BLUR = 0.02, 0.06  # [1] of that logarithm: of the histogram, and by which it is smoothed
FINE_BLUR = 0.03  # [1] of that logarithm, by which the histogram is smoothed where a step is looked for
DIP = 0.6  # [1] of the lower of two peaks; a histogram lower than that between them is of two paints
PEAK_SHARE = 0.1  # [1] of the highest peak, from which another counts
LEAST_M2 = 0.5  # [m²] of a paint
PAINTS = 3  # of one hue in one plane
SAME_HUE = 0.06  # [1] largest difference of the logarithms' differences between channels, of one hue
UNKNOWN_LIGHT = 0.7  # [1] of that logarithm: twice the light, the most by which a place outshines the model of it
FACE_HUE = 0.2  # [1] the same of one face and a paint: in glare a picture tells hues badly
SAME_PLANE_M = 0.06  # [m]
FLAT = 0.95  # [1] cosine between planes
FLOOR = 0.005  # [1] of reflectances before their logarithm
CUT_WEIGHT = 1e-3  # [1] of a face that is cut in some channel, in the mean of a paint that others tell
GREEN = 1  # channel by which lightness is told: a picture's least noisy one


@dataclass(frozen=True, kw_only=True, eq=False)
class Paints:
    """Paints on the planes of a scan.

    Parameters
    ----------
    color : (face, 3) float
        Reflectance in linear sRGB, of each paint's faces the mean. [0-1]
    paint : (face,) int
        -1 for faces of none.
    spread : (paint,) float
        Standard deviation of the logarithm of reflectance over its faces, before. [1]
    area_m2 : (paint,) float
        [m²]
    doubt : (face,) float, optional
        Standard deviation of the logarithm of reflectance of faces of none, for what else they may be of
        (`beside_paints`), 0 of others; 0 if left out. [1]
    """

    color: FloatArray
    paint: IntArray
    spread: FloatArray
    area_m2: FloatArray
    doubt: FloatArray | None = None

    def deviation(self, place_m: float) -> FloatArray:
        """(face,) deviation of the mean's logarithm, if places of so many metres err independently [1]."""
        if not self.spread.size:
            return np.zeros(len(self.color))
        own = self.spread / np.sqrt(np.maximum(1.0, self.area_m2 / place_m**2))
        return np.where(self.paint >= 0, own[self.paint], 0.0)

    def place_deviation(self, usual: float) -> FloatArray:
        """(face,) deviation of the logarithm in one place [1]: the usual one and the doubt of what is of no paint.

        That of a paint is in the deviation of its mean.
        """
        doubt = np.zeros(len(self.color)) if self.doubt is None else self.doubt
        return np.where(self.paint >= 0, 0.0, np.hypot(usual, doubt))

    def with_more(self, face: IntArray, paint: IntArray, color: FloatArray) -> Self:
        """The same paints, with some (n,) more faces, of (n,) paints or none, and their (n, 3) reflectances [0-1]."""
        colors, paints = self.color.copy(), self.paint.copy()
        colors[face], paints[face] = color, paint
        return replace(self, color=colors, paint=paints)

    def in_words(self) -> str:
        """How many there are, and how much they were evened; empty if there is none."""
        if not self.spread.size:
            return ""
        mean = float(np.average(self.spread, weights=self.area_m2))
        return (
            f"{self.spread.size} paints on {self.area_m2.sum():.0f} m² of planes, each given one reflectance, which "
            f"varied by {100 * mean:.0f} % along them"
        )


def one_paint(
    scan: Scan,
    color: FloatArray,
    usable: BoolArray,
    *,
    turn_deg: float,
    piece: IntArray | None = None,
    shown: FloatArray | None = None,
    clarity: FloatArray | None = None,
    cut: BoolArray | None = None,
) -> Paints:
    """Give each paint the mean of its faces' reflectances.

    Parameters
    ----------
    scan : Scan
    color : (face, 3) float
        Estimated reflectance in linear sRGB. [0-1]
    usable : (face,) bool
        Which show a surface; others are left as they are.
    turn_deg : float
        Turn of the room's walls from the x axis. [deg]
    piece : (face,) int, optional
        Of its plane (`plane_pieces`); planes are one piece if left out.
    shown : (face, 3) float, optional
        Linear sRGB that the picture shows, by which dark channels are told; none is dark if left out. [0-1]
    clarity : (face,) float, optional
        Weight of a face in the mean of its paint beside its area; 1 if left out. [1]
    cut : (face, 3) bool, optional
        Channels that the picture cuts at white, of which a reflectance is the least that it may be; none if left out.

    Returns
    -------
    paints : Paints
    """
    pieces = np.zeros(len(color), dtype=np.int64) if piece is None else piece
    group = surface_groups(color, scan.centers, scan.normals, usable, turn_deg=turn_deg, piece=pieces)
    logs = np.log(np.maximum(color, FLOOR))
    weights = scan.areas if clarity is None else scan.areas * clarity
    if cut is not None:
        weights = np.where(cut.any(axis=1), CUT_WEIGHT * weights, weights)
    evened, paint = color.copy(), np.full(len(color), -1, dtype=np.int64)
    spread: list[float] = []
    means: list[FloatArray] = []
    for member in _one_plane_one_hue(scan, logs, group, pieces):
        means.append(np.average(logs[member], axis=0, weights=weights[member]))
        paint[member] = len(means) - 1
    paint = _without_beyond_white(scan, logs, usable, paint, means)
    if shown is not None:
        paint = _without_dark_hues(scan, logs, usable, paint, means, shown, pieces)
    if cut is not None:
        paint = _without_cut_hues(scan, logs, usable, paint, means, cut, pieces)
    for number, mean in enumerate(means):
        member = paint == number
        evened[member] = np.exp(mean)
        spread.append(float(np.sqrt(np.average((logs[member, GREEN] - mean[GREEN]) ** 2, weights=scan.areas[member]))))
    area = np.bincount(paint[paint >= 0], weights=scan.areas[paint >= 0], minlength=len(spread))
    return Paints(color=evened, paint=paint, spread=np.array(spread), area_m2=area.astype(np.float64))


def _without_beyond_white(
    scan: Scan, logs: FloatArray, usable: BoolArray, paint: IntArray, means: list[FloatArray]
) -> IntArray:
    """(face,) paints, those of what is brighter than white exchanged for the largest of the same plane and hue.

    That is a small part of its plane, beside a lamp. A wall that is white as a whole, and too bright by the level of
    the fit, does not take the paint of a dark pane in it.
    """
    white = np.log(BRIGHTEST_REFLECTANCE)
    beyond = np.array([mean.max() > white for mean in means], dtype=np.bool_)
    left = usable & np.where(paint < 0, logs.max(axis=1) > white, beyond[paint] if beyond.size else False)
    area = np.bincount(paint[paint >= 0], weights=scan.areas[paint >= 0], minlength=len(means))
    changed = paint.copy()
    for number in np.argsort(-area, kind="stable"):
        if beyond[number]:
            continue
        faces = np.flatnonzero(left)
        patch = _Patch.of(scan, logs, np.flatnonzero(paint == number))
        away = np.abs((scan.centers[faces] - patch.center) @ patch.normal)
        apart = logs[faces] - means[number]
        same = (scan.normals[faces] @ patch.normal > FLAT) & (away < SAME_PLANE_M) & (np.ptp(apart, axis=1) < FACE_HUE)
        same &= apart[:, GREEN] < UNKNOWN_LIGHT
        if scan.areas[faces[same]].sum() < area[number]:
            changed[faces[same]] = number
            left[faces[same]] = False
    return _without_empty(changed, means)


def _without_dark_hues(
    scan: Scan,
    logs: FloatArray,
    usable: BoolArray,
    paint: IntArray,
    means: list[FloatArray],
    shown: FloatArray,
    piece: IntArray,
) -> IntArray:
    """(face,) paints, those of what is too dark in a channel for a hue exchanged for the best told that it may be of.

    Of a paint is what lies in its piece of a plane, is about as light, and has its hue up to what the picture tells: a
    face that shows x has the hue of a paint if in each channel either it has in its logarithm, or x would be another by
    less than the noise. So white in the dark is not taken for yellow, which would show clearly less blue.
    """
    dark = shown.min(axis=1) < HUE_FLOOR
    told = (paint >= 0) & ~dark
    told_m2 = np.append(np.bincount(paint[told], weights=scan.areas[told], minlength=len(means)), 0.0)  # of no paint, 0
    left = usable & dark
    changed = paint.copy()
    for number in np.argsort(-told_m2[:-1], kind="stable"):
        faces = np.flatnonzero(left & (told_m2[paint] < told_m2[number]))
        members = np.flatnonzero(paint == number)
        patch = _Patch.of(scan, logs, members)
        away = np.abs((scan.centers[faces] - patch.center) @ patch.normal)
        apart = logs[faces] - means[number]
        hue = apart - apart[:, [GREEN]]
        other = shown[faces] * np.abs(np.expm1(-hue))  # that the paint's hue would show more or less
        same = ((np.abs(hue) < FACE_HUE) | (other < PICTURE_NOISE)).all(axis=1) & (np.abs(apart[:, GREEN]) < ALIKE)
        same &= (scan.normals[faces] @ patch.normal > FLAT) & (away < SAME_PLANE_M)
        same &= np.isin(piece[faces], piece[members])
        changed[faces[same]] = number
        left[faces[same]] = False
    return _without_empty(changed, means)


def _without_cut_hues(
    scan: Scan,
    logs: FloatArray,
    usable: BoolArray,
    paint: IntArray,
    means: list[FloatArray],
    cut: BoolArray,
    piece: IntArray,
) -> IntArray:
    """(face,) paints, those of what is cut at white in some channels exchanged for the best told that it may be of.

    In warm light a picture cuts red first, so that a white wall turns blue towards its lamp. Of a paint is what lies in
    its piece of a plane, and is as light and of its hue by the channels that are not cut; in the others the paint
    reflects no less than what is cut there shows.
    """
    told = (paint >= 0) & ~cut.any(axis=1)
    told_m2 = np.append(np.bincount(paint[told], weights=scan.areas[told], minlength=len(means)), 0.0)  # of no paint, 0
    left = usable & cut.any(axis=1) & ~cut.all(axis=1)
    changed = paint.copy()
    for number in np.argsort(-told_m2[:-1], kind="stable"):
        faces = np.flatnonzero(left & (told_m2[paint] < told_m2[number]))
        members = np.flatnonzero(told & (paint == number))
        if not (faces.size and members.size):
            continue
        patch = _Patch.of(scan, logs, members)
        away = np.abs((scan.centers[faces] - patch.center) @ patch.normal)
        apart = logs[faces] - means[number]
        least, most = (np.where(cut[faces], fill, apart) for fill in (np.inf, -np.inf))
        same = (np.abs(np.where(cut[faces], 0.0, apart)) < ALIKE).all(axis=1)
        same &= most.max(axis=1) - least.min(axis=1) < FACE_HUE
        same &= (apart < least.min(axis=1, keepdims=True) + FACE_HUE).all(axis=1)  # light that errs, errs alike
        same &= (scan.normals[faces] @ patch.normal > FLAT) & (away < SAME_PLANE_M)
        same &= np.isin(piece[faces], piece[members])
        changed[faces[same]] = number
        left[faces[same]] = False
    return _without_empty(changed, means)


def _without_empty(paint: IntArray, means: list[FloatArray]) -> IntArray:
    """(face,) paints in a row, without the numbers and means of those that have no face left."""
    kept = np.flatnonzero(np.bincount(paint[paint >= 0], minlength=len(means)))
    renamed = np.full(len(means) + 1, -1, dtype=np.int64)
    renamed[kept] = np.arange(kept.size)
    means[:] = [means[number] for number in kept]
    return np.asarray(renamed[paint], dtype=np.int64)


def _one_plane_one_hue(scan: Scan, logs: FloatArray, group: IntArray, piece: IntArray) -> list[IntArray]:
    """Faces of each paint; groups that differ neither in plane nor in hue nor much in lightness are joined."""
    found: list[IntArray] = []
    for number in range(int(group.max(initial=-1)) + 1):
        left = np.flatnonzero(group == number)
        for _ in range(PAINTS):
            lightness = logs[left, GREEN]
            low, high = _about_commonest(lightness, scan.areas[left])
            member = left[(lightness > low) & (lightness < high)]
            if scan.areas[member].sum() < LEAST_M2:
                break
            found.append(member)
            left = np.setdiff1d(left, member, assume_unique=True)
    found.sort(key=lambda member: -float(scan.areas[member].sum()))
    seen = [_Patch.of(scan, logs, member) for member in found]
    joined: dict[int, list[IntArray]] = {}  # by the largest of each
    for number, member in enumerate(found):

        def is_of(other: int, members: list[IntArray], number: int = number, member: IntArray = member) -> bool:
            one_piece = any(piece[each[0]] == piece[member[0]] for each in members)
            return seen[number].is_like(seen[other], ALIKE if one_piece else PIECES_ALIKE) and not _has_step(
                scan, logs, np.concatenate([*members, member])
            )

        alike = next((other for other, members in joined.items() if is_of(other, members)), number)
        joined.setdefault(alike, []).append(member)
    return [np.concatenate(members) for members in joined.values()]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Patch:
    """Means over some faces."""

    normal: FloatArray
    center: FloatArray
    logs: FloatArray

    @classmethod
    def of(cls, scan: Scan, logs: FloatArray, faces: IntArray) -> Self:
        normal, center, color = (
            np.average(values[faces], axis=0, weights=scan.areas[faces])
            for values in (scan.normals, scan.centers, logs)
        )
        return cls(normal=normal, center=center, logs=color)

    def is_like(self, other: Self, alike: float) -> bool:
        """Whether both lie in one plane, and differ in lightness by less than `alike`, and hardly in hue."""
        away = abs(float((self.center - other.center) @ other.normal))
        apart = self.logs - other.logs
        return bool(
            self.normal @ other.normal > FLAT
            and away < SAME_PLANE_M
            and abs(apart[GREEN]) < alike
            and np.ptp(apart) < SAME_HUE
        )


def _about_commonest(values: FloatArray, weights: FloatArray) -> tuple[float, float]:
    """Least and largest value of a paint: within `ALIKE` of where most of the weight lies, up to a step to another."""
    if not values.size:
        return 0.0, 0.0
    middle = _mode(*_histogram(values, weights, BLUR))
    low, high = middle - ALIKE, middle + ALIKE
    near = np.abs(values - middle) < ALIKE
    dips = _dips(*_histogram(values[near], weights[near], FINE_BLUR))
    return max([low, *dips[dips < middle]]), min([high, *dips[dips > middle]])


def _has_step(scan: Scan, logs: FloatArray, faces: IntArray) -> bool:
    """Whether the lightness of some faces has two peaks, apart."""
    return bool(_dips(*_histogram(logs[faces, GREEN], scan.areas[faces], FINE_BLUR)).size)


def _histogram(values: FloatArray, weights: FloatArray, blur: float) -> tuple[FloatArray, FloatArray]:
    """Middles of bins, and the smoothed weight in them."""
    edges = np.arange(values.min() - 3 * blur, values.max() + 3 * blur + STEP, STEP)
    count = np.histogram(values, bins=edges, weights=weights)[0]
    return 0.5 * (edges[:-1] + edges[1:]), gaussian_filter1d(count, blur / STEP, mode="constant")


def _mode(at: FloatArray, smooth: FloatArray) -> float:
    return float(at[np.argmax(smooth)])


def _dips(at: FloatArray, smooth: FloatArray) -> FloatArray:
    """(dip,) where a smoothed histogram falls below `DIP` of the peaks on either side."""
    from scipy.signal import find_peaks  # heavy: `relight` and `init` look for none

    peaks, _ = find_peaks(smooth, height=PEAK_SHARE * smooth.max())
    found = []
    for first, second in pairwise(peaks):
        lowest = first + int(np.argmin(smooth[first : second + 1]))
        if smooth[lowest] < DIP * min(smooth[first], smooth[second]):
            found.append(float(at[lowest]))
    return np.array(found)
