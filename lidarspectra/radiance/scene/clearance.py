"""Make way for the light of lamps that touch the scan: the rough surface around a lamp recedes, or the lamp moves.

A lamp flush with a ceiling lies behind all bumps of a scanned one, and what it sends there never reaches the room.
Light is lost where a ray from the lamp meets the back of a face close by. The surface that hides it is pressed back to
just behind the lamp where its triangles are small and its roughness alone lies before the lamp; otherwise the lamp
moves through it. No face is taken out, so the room stays as closed as it is, and materials keep their faces.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.rays import RayCaster, caster_of
from lidarspectra.geometry.scan import Scan
from lidarspectra.geometry.triangles import triangle_crosses
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.surfaces import Sphere, Surface
from lidarspectra.words import two_digits

RAYS = 2048  # from each lamp: a loss of 1 % is known within .2 %
NEAR_M = 0.5  # [m] distance within which the back of a face hides a lamp; farther ones are things in the room
LOSS_SHARE = 0.002  # [1] of a lamp's light, below which nothing is done
REACH_M = 0.1  # [m] how far a lamp may lie behind a surface to be counted as touching it
ROUGHNESS_M = 0.02  # [m] how far a surface's level may lie before a lamp for the surface to recede, and not the lamp
RECESS_M = 0.05  # [m] how far the surface recedes at most: three deviations of a phone's noise
GAP_M = 0.005  # [m] between a lamp and the surface behind it afterwards
FLUSH_M = 0.002  # [m] a surface no farther behind a lamp hides it in part: which of two such is met first is open
MARGIN_M = 0.05  # [m] around a lamp, in which the surface recedes
MAX_EDGE_M = 0.3  # [m] of triangles that recede; larger ones are no roughness
FACING = 0.2  # [1] cosine to the surface's normal, above which a face belongs to it
ROUGHLY = 0.5  # [1] the same for faces of which its normal is the mean: two walls of a corner stay apart
PEAKED = 8  # [1] exponent of the cosine by which faces count towards a normal like theirs
ENCLOSED = 0.5  # [1] length of the mean normal of what hides a lamp, below which it is all around it
ROUNDS = 5  # a corner has three surfaces, and what lies behind large triangles is found in a second try
MAX_NAMED = 6  # lamps named in one note
SEED = 20240607  # of the rays


@dataclass(frozen=True, kw_only=True, eq=False)
class Clearance:
    """Lamps and a scan of which neither hides the other's light.

    Parameters
    ----------
    lamps : tuple of Lamp
        Moved where that was needed.
    scan : Scan
        The same faces; some vertices may have moved.
    notes : tuple of str
        What was moved, a sentence for all lamps of one kind; empty if nothing was.
    """

    lamps: tuple[Lamp, ...]
    scan: Scan
    notes: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Hidden:
    """What of a lamp's light is lost behind surfaces that touch it.

    Parameters
    ----------
    share : float
        Of its light, if it is Lambertian. [0-1]
    faces : (face,) int
        What hides it.
    weights : (face,) float
        Share of its light that each hides. [0-1]
    """

    share: float
    faces: IntArray
    weights: FloatArray


def clear_lamps(lamps: Sequence[Lamp], scan: Scan) -> Clearance:
    """Let the scan recede around lamps that touch it, or move the lamps into the room.

    Parameters
    ----------
    lamps : sequence of Lamp
        The sun is left as it is.
    scan : Scan
        With normals towards the room.

    Returns
    -------
    clearance : Clearance
    """
    placed = list(lamps)
    first: dict[int, float] = {}
    receded: dict[int, float] = {}
    moved: dict[int, float] = {}
    waiting = [index for index, lamp in enumerate(placed) if lamp.is_in_room]
    for _ in range(ROUNDS):
        caster = caster_of(scan)
        vertices, touching = scan.vertices.copy(), []
        for index in waiting:
            hidden = hidden_light(placed[index], caster)
            if hidden.share <= LOSS_SHARE:
                continue
            first.setdefault(index, hidden.share)
            step = _step(placed[index], hidden, vertices, scan.faces, caster)
            if step is None:
                continue
            touching.append(index)
            if step.shift_m.any():
                placed[index] = replace(placed[index], center=placed[index].center + step.shift_m)
                moved[index] = moved.get(index, 0.0) + float(np.linalg.norm(step.shift_m))
            if step.vertices.size:
                depth = np.linalg.norm(step.places - vertices[step.vertices], axis=1)
                receded[index] = max(receded.get(index, 0.0), float(depth.max()))
                vertices[step.vertices] = step.places
        if not touching:
            break
        waiting, scan = touching, replace(scan, vertices=vertices)
    return Clearance(lamps=tuple(placed), scan=scan, notes=_notes(lamps, first, receded, moved))


def hidden_light(lamp: Lamp, caster: RayCaster) -> Hidden:
    """Share of a lamp's light that meets the back of a near face, as if all lamps were Lambertian.

    Parameters
    ----------
    lamp : Lamp
        In the room.
    caster : RayCaster
        Loaded with the scan.

    Returns
    -------
    hidden : Hidden
    """
    generator = np.random.default_rng(SEED)
    places, normals = lamp.sample(generator, RAYS)
    rays = _lambertian(normals, generator)
    flush = 0.0 if any(surface.normal is None for surface in lamp.surfaces) else FLUSH_M
    hits = caster.nearest(places - flush * normals, rays, max_distance=NEAR_M)
    behind = hits.met.copy()
    behind[hits.met] = np.einsum("ij,ij->i", caster.normals[hits.face[hits.met]], rays[hits.met]) > 0
    faces, counts = np.unique(hits.face[behind], return_counts=True)
    return Hidden(share=float(behind.mean()), faces=faces, weights=counts / RAYS)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Step:
    """What makes way: the lamp, by a shift [m], or vertices, which get new places [m]."""

    shift_m: FloatArray
    vertices: IntArray
    places: FloatArray


def _step(lamp: Lamp, hidden: Hidden, vertices: FloatArray, faces: IntArray, caster: RayCaster) -> _Step | None:
    """How to bring the light of one lamp past the surface that hides most of it; None where no way is known."""
    near = _Near.around(lamp, vertices, faces)
    unit = _fullest_normal(hidden, near, caster.normals)
    if unit is None:
        return None
    back = min(_lowest(surface, unit) for surface in lamp.surfaces)
    covering, heights = _surface_before(lamp, unit, back, caster)
    if not covering.size:
        return None
    level = float(np.median(heights))
    shift = level + GAP_M if level > ROUGHNESS_M else 0.0
    coarse = ~np.isin(covering, near.faces[near.small])
    if coarse.any() and heights[coarse].max() > shift - FLUSH_M:
        shift = float(heights[coarse].max()) + GAP_M
    hiding = np.concatenate([covering, hidden.faces[caster.normals[hidden.faces] @ unit > FACING]])
    chosen = near.vertices_of(hiding, unit, lamp, back, vertices, faces)
    before = vertices[chosen] @ unit - back - shift + GAP_M
    recede = (before > 0) & (before <= RECESS_M + GAP_M)
    if shift <= 0 and not recede.any():
        return None
    chosen, before = chosen[recede], before[recede]
    return _Step(shift_m=shift * unit, vertices=chosen, places=vertices[chosen] - before[:, None] * unit)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Near:
    """Faces near a lamp: (n,) which, their (n, 3) crosses, twice their area long [m²], and whether they are small."""

    faces: IntArray
    crosses: FloatArray
    small: BoolArray

    @classmethod
    def around(cls, lamp: Lamp, vertices: FloatArray, faces: IntArray) -> "_Near":
        """Those with a corner near, and those whose box reaches there."""
        surfaces = lamp.surfaces
        outlines = np.concatenate([surface.outline() for surface in surfaces])
        reach = REACH_M + MARGIN_M + max(s.radius if isinstance(s, Sphere) else 0.0 for s in surfaces)
        low, high = outlines.min(axis=0) - reach, outlines.max(axis=0) + reach
        above, below = vertices >= low, vertices <= high
        near = np.flatnonzero((above[faces].any(axis=1) & below[faces].any(axis=1)).all(axis=1))
        corners = vertices[faces[near]]
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        return cls(faces=near, crosses=triangle_crosses(corners), small=edges <= MAX_EDGE_M)

    def vertices_of(
        self, hiding: IntArray, unit: FloatArray, lamp: Lamp, back: float, vertices: FloatArray, faces: IntArray
    ) -> IntArray:
        """(n,) vertices of small faces that hide the lamp, or that look the same way and lie within the margin."""
        alike = self.small & (self.crosses @ unit > FACING * np.linalg.norm(self.crosses, axis=1))
        around = np.unique(faces[self.faces[alike]])
        in_plane = vertices[around] - (vertices[around] @ unit - back)[:, None] * unit
        around = around[lamp.distance(in_plane) <= MARGIN_M]
        small = self.faces[self.small & np.isin(self.faces, hiding)]
        return np.unique(np.concatenate([around, faces[small].ravel()]))


def _fullest_normal(hidden: Hidden, near: _Near, normals: FloatArray) -> FloatArray | None:
    """(3,) unit normal of the surface, among several in a corner, which hides most; None if the lamp is enclosed."""
    own = normals[hidden.faces]
    if np.linalg.norm(hidden.weights @ own) < ENCLOSED * hidden.weights.sum():
        return None  # a lampshade, or its own housing
    hiding = np.maximum(own @ own.T, 0.0) ** PEAKED @ hidden.weights
    sizes = np.linalg.norm(near.crosses, axis=1)
    facing = np.maximum(own @ (near.crosses / np.maximum(sizes, 1e-300)[:, None]).T, 0.0)
    area = facing**PEAKED @ sizes  # which a bump's steep side has little of
    fullest = own[int((hiding * area).argmax())]
    alike = near.crosses @ fullest > ROUGHLY * sizes
    mean = near.crosses[alike].sum(axis=0)
    length = float(np.linalg.norm(mean))
    return np.asarray(mean / length if length > 0 else fullest, dtype=np.float64)


def _lowest(surface: Surface, unit: FloatArray) -> float:
    """How far back along a unit vector a lamp's surface reaches [m]."""
    if isinstance(surface, Sphere):
        return float(surface.center @ unit) - surface.radius
    return float((surface.outline() @ unit).min())


def _surface_before(lamp: Lamp, unit: FloatArray, back: float, caster: RayCaster) -> tuple[IntArray, FloatArray]:
    """(n,) faces that cover the lamp or its margin, and how far before its back [m]; by rays against their normal."""
    places, _ = lamp.sample(np.random.default_rng(SEED), RAYS // 4)
    away = places - lamp.center
    length = np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-12)
    places = np.concatenate([places, places + 0.5 * MARGIN_M * away / length])
    starts = places + (back + REACH_M - places @ unit)[:, None] * unit
    hits = caster.nearest(starts, -unit, max_distance=2.0 * REACH_M)
    front = hits.met.copy()
    front[hits.met] = caster.normals[hits.face[hits.met]] @ unit > FACING
    return hits.face[front], np.asarray(REACH_M - hits.distance[front], dtype=np.float64)


def _lambertian(normals: FloatArray, generator: np.random.Generator) -> FloatArray:
    """(n, 3) directions about (n, 3) normals, as often as the cosine: a point of the unit sphere added to each."""
    height, turn = generator.uniform(-1.0, 1.0, len(normals)), generator.uniform(0.0, 2.0 * np.pi, len(normals))
    wide = np.sqrt(1.0 - height**2)
    rays = normals + np.stack([wide * np.cos(turn), wide * np.sin(turn), height], axis=1)
    length = np.linalg.norm(rays, axis=1, keepdims=True)
    return np.where(length > 1e-9, rays / np.maximum(length, 1e-9), normals)


def _notes(
    lamps: Sequence[Lamp], first: dict[int, float], receded: dict[int, float], moved: dict[int, float]
) -> tuple[str, ...]:
    far = {index: shift for index, shift in moved.items() if shift > 2.0 * GAP_M}
    pressed = {index: depth for index, depth in receded.items() if index not in far and depth > GAP_M}
    notes = []
    if pressed:
        notes.append(
            f"The scan's rough surface hid up to {_percent(first, pressed)} of the light of {_named(lamps, pressed)}. "
            f"It was pressed back there by up to {100 * max(pressed.values()):.1f} cm, to just behind "
            f"{_pronoun(pressed)}, so that all of the light reaches the room; nothing needs to be done."
        )
    if far:
        notes.append(
            f"A surface of the scan hid up to {_percent(first, far)} of the light of {_named(lamps, far)}, so that the "
            f"center was moved by up to {100 * max(far.values()):.1f} cm, to just before that surface; all of the "
            "light reaches the room. Measure the center again, or scan that surface again, if this is too far."
        )
    return tuple(notes)


def _percent(shares: dict[int, float], chosen: dict[int, float]) -> str:
    return f"{two_digits(100 * max(shares[index] for index in chosen))} %"


def _pronoun(chosen: dict[int, float]) -> str:
    return "the lamp" if len(chosen) == 1 else "the lamps"


def _named(lamps: Sequence[Lamp], chosen: dict[int, float]) -> str:
    names = [f"'{lamps[index].name}'" for index in sorted(chosen)]
    more = len(names) - MAX_NAMED
    listed = ", ".join(names[:MAX_NAMED]) + (f" and {more} more" if more > 0 else "")
    return f"{'lamp' if len(names) == 1 else 'lamps'} {listed}"
