"""Screens that are on, by what frames show of them: they send more than paint could in the light that falls there.

`shining_places` gathers the irradiance E on a place from what frames show around it, and x/E of what it sends itself.
An upright rectangle with x > 1.15 E shines by itself, unless light falls there that is not gathered: the sun, or a desk
lamp that is cut or was not scanned. Such light does not end at the rectangle: what hangs beside it in its plane would
shine as well, or be brighter than the same wall farther away. And it must have a sign of its own: a black frame, a
radiance that falls away from the normal, or a picture that moves. A moving picture is enough alone, if it is not as
dark as gloss, whose reflections move too. What sends more than 20 times white is a lamp or a window rather than a
screen.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import IntArray, linked
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.frames.records import FrameRecords
from lidarspectra.material.frames.screen_rectangle import (
    BRIGHT,
    FRAMED,
    framed_share,
    is_lit_around,
    plane_view,
    shining_rectangle,
)
from lidarspectra.material.frames.screen_views import ALIKE, fall_from_normal, movement, rows_in
from lidarspectra.material.frames.shining_places import MOVES, SHINES, ShiningPlaces, shining_places
from lidarspectra.room.panes.pane import Pane

WHITEST = 0.9  # [1] reflectance of fresh paint
LAMP = 20.0  # [1] x over E from which it is a lamp or a window: screens have 100 to 1,000 cd/m², white paper 20 to 150
LINK_M = 0.25  # [m] between places of one screen; records are 5 to 10 cm apart
MIN_PLACES = 6
PEAK = 0.9  # [1] quantile of a screen's picture that is its white
MIN_LEVEL = 0.3  # [1] of a picture that moves: what is darker is gloss
MIN_FALL, MIN_RATIO = 0.25, 4.0  # [1] power of the cosine, and over its deviation: paints have less than .1
SEED = 20240911  # of rays and places; the same frames give the same screens


def screens_of_frames(records: FrameRecords, scan: Scan, caster: RayCaster) -> tuple[Pane, ...]:
    """Screens that are on.

    Parameters
    ----------
    records : FrameRecords
    scan : Scan
        With the frames' radiance as its colours.
    caster : RayCaster
        Of the scan.

    Returns
    -------
    screens : tuple of Pane
        Largest first.
    """
    generator = np.random.default_rng(SEED)
    shining = shining_places(records, scan, caster, generator)
    found = [
        pane
        for members in _clusters(records, shining)
        if (pane := _screen(members, records, shining, scan, caster)) is not None
    ]
    return tuple(sorted(found, key=lambda pane: -pane.area_m2))


def _clusters(records: FrameRecords, shining: ShiningPlaces) -> Iterator[IntArray]:
    """(n,) rows of `shining` that hang together, look one way, and shine or change."""
    rows = np.flatnonzero(shining.is_candidate)
    if not rows.size:
        return
    place = shining.place[rows]
    pairs = cKDTree(records.points[place]).query_pairs(LINK_M, output_type="ndarray")
    normals = records.normals[place]
    alike = np.einsum("pc,pc->p", normals[pairs[:, 0]], normals[pairs[:, 1]]) > ALIKE
    label = linked(pairs[alike], rows.size)
    for number in np.flatnonzero(np.bincount(label) >= MIN_PLACES):
        yield rows[label == number]


def _screen(
    members: IntArray, records: FrameRecords, shining: ShiningPlaces, scan: Scan, caster: RayCaster
) -> Pane | None:
    """The screen at some shining places (n,), if there is one."""
    place, light = shining.place[members], float(np.median(shining.light[members]))
    view = plane_view(place, records, shining, scan, caster)
    box = shining_rectangle(view.level, view.near(records.points[place[shining.moves[members] > MOVES]]))
    if box is None:
        return None
    inner = view.level[box]
    if not np.isfinite(inner).any():
        return None
    bright = inner > BRIGHT
    mean = float(np.nanmean(inner))
    peak = max(float(np.median(shining.level[members])), float(np.nanquantile(inner, PEAK)))
    if mean < MIN_LEVEL or peak > LAMP or is_lit_around(view.level, box):
        return None
    pane = view.pane(box, "")
    rows = rows_in(records, pane, least=min(BRIGHT, 0.7 * peak) * light)
    fall, deviation = fall_from_normal(records, pane, rows)
    moves = movement(records, pane, rows, fall)
    signs = []
    if framed_share(view.level, box, float(np.median(inner[bright])) if bright.any() else mean) >= FRAMED:
        signs.append("has a black frame")
    if fall > MIN_FALL and fall > MIN_RATIO * deviation:
        signs.append(f"falls away from the normal as the cosine to the power {fall:.1f} ± {deviation:.1f}")
    if moves > MOVES:
        signs.append(f"changes by {100 * moves:.0f} % from frame to frame")
    if not signs or (peak <= SHINES and moves <= MOVES):
        return None
    shines = f"it sends {peak / WHITEST:.1f} times what white paint could in the light that falls there"
    return replace(pane, why=" and ".join([shines, *signs]))
