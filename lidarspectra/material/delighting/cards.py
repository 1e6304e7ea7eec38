"""Cards of known reflectance that lie or hang in a scan: a photographer's grey card, a sheet of white paper.

What the picture shows of a card, over the light that falls there, is its reflectance: one card fixes the level of all
others, and two of different grey the camera's tone curve as well.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.errors import MaterialError
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.delighting.clipped_light import CLIPPED, DARK
from lidarspectra.material.delighting.light_objective import CARD_DEVIATION, LOG_SCATTER
from lidarspectra.material.delighting.linear_evidence import MAX_CUT
from lidarspectra.material.delighting.sharpened_cones import cones_of_srgb
from lidarspectra.spectra.colorimetry import decode_srgb

REACH_M = 0.15  # [m] from a card's stated middle to the surface that it lies on: a tape measure, the scan's drift
LOOKS = 200  # directions in which the surface is sought
OFF_M = 0.05  # [m] from which the card is looked at, and as far behind its plane: cards bend, scans are uneven
ACROSS = 6  # points along each side that are looked at
MIDDLE = 0.6  # [1] of a card's size: its rim is blurred, and may be a few centimetres off
LEAST_POINTS = 9  # of a card that must be usable
BESIDE_M = 0.3  # [m] beyond a card, at most: what light and exposure err by changes along a metre
BESIDE = 24  # points there, the nearest; fewer would tell of the surface's grain
SAME_PLANE_M, FLAT = 0.06, 0.95  # [m], [1] cosine: of what a card lies on
# [1] standard deviations, rms over the cones, by which a card may differ from what the picture shows of it without any
# card. Right ones were within 2.3; a slip of the place shows the floor, one of the number paper for a grey card.
MAX_CONTRADICTION = 4.0
EVEN = 1.1  # [1] ratio of a triangle's lightest corner to its darkest, up to which it shows one surface
TOO_COARSE = (
    "the scan has colours at the corners of its triangles alone, which lie too far apart for so small a card. Use a "
    "larger one, or export the scan with its texture"
)
GOLDEN_TURN = np.pi * (3.0 - np.sqrt(5.0))  # [rad]


@dataclass(frozen=True, kw_only=True, eq=False)
class Card:
    """A matt grey or white card.

    Parameters
    ----------
    center : (3,) float
        Its middle. [m]
    size_m : float
        Its shorter side. [m]
    reflectance : float
        The same at all wavelengths. [0-1]
    """

    center: FloatArray
    size_m: float
    reflectance: float


@dataclass(frozen=True, kw_only=True, eq=False)
class SeenCards:
    """Points of cards, as a picture shows them.

    Parameters
    ----------
    card : (point,) int
        Which one each is of.
    face : (point,) int
        Of the scan.
    positions, normals : (point, 3) float
        On the surface. [m, 1]
    shown : (point, 3) float
        Linear sRGB; beyond 1 where frames tell it. [1]
    log_reflectance : (card, 3) float
        In sharpened cones.
    notes : tuple of str
        Cards that tell nothing, as full sentences.
    """

    card: IntArray
    face: IntArray
    positions: FloatArray
    normals: FloatArray
    shown: FloatArray
    log_reflectance: FloatArray
    notes: tuple[str, ...]


def look_at_cards(scan: Scan, caster: RayCaster, cards: Sequence[Card]) -> SeenCards:
    """Points of cards in a scan's texture.

    Parameters
    ----------
    scan : Scan
        With colours.
    caster : RayCaster
        Of it.
    cards : sequence of Card

    Returns
    -------
    seen : SeenCards
        Without points of cards that are cut at white, or too dark.

    Raises
    ------
    MaterialError
        If no surface is near a card's place.
    """
    found: list[tuple[int, IntArray, FloatArray, FloatArray, FloatArray]] = []
    notes = []
    for number, card in enumerate(cards):
        face, places = _points_of(scan, caster, card)
        shown = scan.appearance.sample(face, places[1])
        cut, dark = _is_cut(scan, face, shown), shown.max(axis=1) <= DARK
        seen, mixed = scan.appearance.photographed[face], _is_mixed(scan, face, places[0], card)
        usable = np.flatnonzero(seen & ~cut & ~dark & ~mixed)
        if usable.size < LEAST_POINTS:
            why = _why_not(seen & ~mixed, cut, dark) if (seen & ~mixed).any() or not seen.any() else TOO_COARSE
            notes.append(
                f"The card at ({_place(card)}) tells nothing: {why}, and scan again; or take it "
                "out of [[materials.cards]]."
            )
            continue
        found.append((number, face[usable], places[0][usable], scan.normals[face[usable]], shown[usable]))
    levels = np.array([card.reflectance for card in cards])
    empty = np.empty((0, 3))
    nothing: IntArray = np.empty(0, dtype=np.int64)
    return SeenCards(
        card=np.concatenate([np.full(each[1].size, each[0], dtype=np.int64) for each in found] or [nothing]),
        face=np.concatenate([each[1] for each in found] or [nothing]),
        positions=np.concatenate([each[2] for each in found] or [empty]),
        normals=np.concatenate([each[3] for each in found] or [empty]),
        shown=np.concatenate([each[4] for each in found] or [empty]),
        log_reflectance=np.log(cones_of_srgb(np.repeat(levels[:, None], 3, axis=1))) if levels.size else empty,
        notes=tuple(notes),
    )


def beside_cards(cards: Sequence[Card], seen: SeenCards, positions: FloatArray, normals: FloatArray) -> csr_array:
    """The nearest points of the surfaces that cards lie on, round about them.

    Parameters
    ----------
    cards : sequence of Card
    seen : SeenCards
        Of them.
    positions, normals : (point, 3) float
        [m, 1]

    Returns
    -------
    beside : (card, point) sparse bool
        None of cards that tell nothing.
    """
    found = np.zeros((len(cards), len(positions)), dtype=np.bool_)
    for number, card in enumerate(cards):
        own = seen.card == number
        if not own.any():
            continue
        middle, normal = seen.positions[own].mean(axis=0), seen.normals[own].mean(axis=0)
        away = positions - middle
        distance = np.linalg.norm(away, axis=1)
        there = np.flatnonzero(
            (distance > card.size_m)  # half its longer side is no more: of paper .71 of the shorter, and a blurred rim
            & (distance < card.size_m + BESIDE_M)
            & (np.abs(away @ normal) < SAME_PLANE_M)
            & (normals @ normal > FLAT)
        )
        found[number, there[np.argsort(distance[there], kind="stable")[:BESIDE]]] = True
    return csr_array(found)


@dataclass(frozen=True, kw_only=True)
class Contradiction:
    """What a picture shows where a card of another reflectance is said to be.

    Parameters
    ----------
    reflectance, deviation : float
        The mean over the cones, and its standard deviation. [1]
    is_colored : bool
        Whether it differs from the card by its hue more than by its level.
    """

    reflectance: float
    deviation: float
    is_colored: bool


def contradicted_cards(
    card: IntArray, said: FloatArray, found: FloatArray, deviation: FloatArray
) -> dict[int, Contradiction]:
    """Cards that the picture plainly contradicts: most likely they lie elsewhere, or are of another reflectance.

    Parameters
    ----------
    card : (point,) int
        Which card each point is of; -1 for none.
    said : (card, 3) float
        Log reflectance that they are said to have, in cones.
    found, deviation : (point, 3) float
        Log reflectance by a fit that knows no card, and its standard deviation by camera and light. [1]

    Returns
    -------
    contradicted : dict of int to Contradiction
        By the numbers of the cards.
    """
    contradicted = {}
    for number in np.unique(card[card >= 0]).tolist():
        own = card == number
        apart, light = found[own].mean(axis=0) - said[number], deviation[own].mean(axis=0)
        unsure = np.hypot(np.hypot(light, LOG_SCATTER), CARD_DEVIATION)
        if np.sqrt(np.mean((apart / unsure) ** 2)) > MAX_CONTRADICTION:
            level = float(apart.mean())
            shown = float(np.exp(said[number].mean() + level))
            contradicted[number] = Contradiction(
                reflectance=shown,
                deviation=shown * float(np.hypot(light.mean(), LOG_SCATTER)),
                is_colored=float(np.std(apart)) > abs(level),
            )
    return contradicted


def contradiction_notes(cards: Sequence[Card], contradicted: Mapping[int, Contradiction]) -> tuple[str, ...]:
    """Notes on cards that do not count, by what the picture shows of each."""
    return tuple(
        f"The card at ({_place(cards[number])}) does not count: it is said to be grey and to reflect "
        f"{cards[number].reflectance:.2f}, but by all else that is known what the picture shows there reflects "
        f"{shown.reflectance:.2f} ± {shown.deviation:.2f}{' and is coloured' if shown.is_colored else ''}. Check its "
        "center, and its reflectance: about 0.18 of a grey card, 0.85 of white paper."
        for number, shown in contradicted.items()
    )


def _is_cut(scan: Scan, face: IntArray, shown: FloatArray) -> BoolArray:
    """(point,) whether it is cut at white: in a picture by its level, in frames, which go beyond it, if all cut it."""
    linear = scan.appearance.linear
    return np.asarray(shown.max(axis=1) >= CLIPPED if linear is None else linear.face_cut[face] >= MAX_CUT)


def _is_mixed(scan: Scan, face: IntArray, points: FloatArray, card: Card) -> BoolArray:
    """(point,) whether its colour is that of corners some of which lie beside the card, however it is turned.

    A texture shows the card itself; colours at corners are mixed across the triangles at its rim.
    """
    by_corner = scan.appearance.face_image[face] < 0
    middle = points.mean(axis=0) if len(points) else card.center
    corners = scan.vertices[scan.faces[face]] - middle
    beside = np.linalg.norm(corners, axis=2).max(axis=1, initial=0.0) > card.size_m / 2.0
    level = decode_srgb(scan.appearance.corner_color[face]).mean(axis=2)
    differ = level.max(axis=1) > EVEN * level.min(axis=1)
    return np.asarray(by_corner & beside & differ, dtype=np.bool_)


def _why_not(seen: BoolArray, cut: BoolArray, dark: BoolArray) -> str:
    """Why the (point,) points of a card tell nothing, and what to do."""
    if seen.size < LEAST_POINTS:
        return "the surface there is smaller than the card, or full of holes. Check its center and size"
    if seen.sum() < LEAST_POINTS:
        return "no picture shows it. Show it to the phone from the front"
    if (seen & cut).sum() > (seen & dark).sum():
        return "in the picture it is cut at white. Put it where it is lit less strongly, or use a grey one"
    return "in the picture it is too dark. Put it where it is lit more strongly, or use a white one"


def nearest_surface(caster: RayCaster, card: Card) -> tuple[int, FloatArray]:
    """What a card lies on.

    Parameters
    ----------
    caster : RayCaster
        Of the scan.
    card : Card

    Returns
    -------
    face : int
        The nearest one.
    place : (3,) float
        On it. [m]

    Raises
    ------
    MaterialError
        If no surface is near the card's stated middle.
    """
    height = 1.0 - 2.0 * (np.arange(LOOKS) + 0.5) / LOOKS
    turn = GOLDEN_TURN * np.arange(LOOKS)
    level = np.sqrt(1.0 - height**2)
    ways = np.stack([level * np.cos(turn), level * np.sin(turn), height], axis=1)
    starts = np.broadcast_to(card.center, (LOOKS, 3)) - 1e-3 * ways
    hits = caster.nearest(starts, ways, max_distance=REACH_M)
    if not hits.met.any():
        raise MaterialError(
            expected=f"a surface within {100 * REACH_M:.0f} cm of a card's middle",
            found="none",
            where=f"card at ({_place(card)}) m, [[materials.cards]]",
            todo="Give the place in metres, in the scan's axes: 'lidarspectra scan' prints its extent, and the report "
            "shows it.",
        )
    nearest = int(np.argmin(hits.distance))
    return int(hits.face[nearest]), starts[nearest] + hits.distance[nearest] * ways[nearest]


def _points_of(scan: Scan, caster: RayCaster, card: Card) -> tuple[IntArray, tuple[FloatArray, FloatArray]]:
    """Faces, positions and barycentric coordinates of points in the middle of a card."""
    face, place = nearest_surface(caster, card)
    normal = scan.normals[face]
    foot = card.center + ((place - card.center) @ normal) * normal  # of the perpendicular from the stated middle
    aside = np.array([1.0, 0.0, 0.0]) if abs(normal[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    along = np.cross(normal, aside)
    along /= np.linalg.norm(along)
    steps = (np.arange(ACROSS) + 0.5) / ACROSS - 0.5
    u, v = (grid.reshape(-1, 1) * MIDDLE * card.size_m for grid in np.meshgrid(steps, steps))
    start = foot + u * along + v * np.cross(normal, along) + OFF_M * normal
    hits = caster.nearest(start, np.broadcast_to(-normal, start.shape), max_distance=2.0 * OFF_M)
    met = np.flatnonzero(hits.met)
    return hits.face[met], (start[met] - hits.distance[met, None] * normal, hits.barycentric[met])


def _place(card: Card) -> str:
    return ", ".join(f"{value:.2f}" for value in card.center)
