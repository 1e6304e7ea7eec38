"""Look at every wall of a room for glass, mirrors and screens."""

from collections.abc import Callable, Sequence

import numpy as np

from lidarspectra.geometry.rays import RayCaster, caster_of
from lidarspectra.geometry.scan import Scan
from lidarspectra.room.panes.glass import glass_of_wall, passages_of_wall
from lidarspectra.room.panes.mirrors import mirror_of_wall
from lidarspectra.room.panes.pane import Pane
from lidarspectra.room.panes.screens import screens_of_wall
from lidarspectra.room.panes.wall_view import WallView, wall_view
from lidarspectra.room.room import Room
from lidarspectra.room.room_planes import face_geometry

Seen = Callable[[Scan, Sequence[WallView], RayCaster], tuple[Pane, ...]]
"""From a scan, its room's walls and what rays meet in it to the mirrors and panes that frames show."""


def views_of_room(scan: Scan, room: Room) -> tuple[WallView, ...]:
    """Look at all walls of a room; at none in a model of a room, whose parts have names.

    Parameters
    ----------
    scan : Scan
        Repaired.
    room : Room
        In it.

    Returns
    -------
    views : tuple of WallView
    """
    if scan.appearance.is_drawn:
        return ()
    caster = caster_of(scan)
    return tuple(view for wall in room.walls if (view := wall_view(scan, room, wall, caster)).depth.size)


def propose_panes(scan: Scan, views: Sequence[WallView], *, seen: Seen | None = None) -> tuple[Pane, ...]:
    """Find what in a scan is probably glass, a mirror or a screen.

    Parameters
    ----------
    scan : Scan
    views : sequence of WallView
        Of its walls (`views_of_room`).
    seen : callable, optional
        What frames tell, where there are any.

    Returns
    -------
    panes : tuple of Pane
        Mirrors, then those that frames show, glass, and screens, none over another; none in a model of a room.
    """
    if scan.appearance.is_drawn:
        return ()
    faces = face_geometry(scan)
    found = [pane for view in views if (pane := mirror_of_wall(view, faces)) is not None]
    found += () if seen is None else seen(scan, views, caster_of(scan))
    found += [pane for view in views for pane in glass_of_wall(view)]
    if scan.appearance.known:
        found += [pane for view in views for pane in screens_of_wall(view)]
    kept: list[Pane] = []
    for pane in found:
        if not any(pane.overlaps(other) or _behind(pane, other) for other in kept):
            kept.append(pane)
    return tuple(kept)


def doubtful_openings(views: Sequence[WallView], known: Sequence[Pane]) -> tuple[Pane, ...]:
    """Openings in walls that may be clean panes of glass or passages.

    Parameters
    ----------
    views : sequence of WallView
    known : sequence of Pane
        Found or given; what they overlap is told.

    Returns
    -------
    openings : tuple of Pane
    """
    openings = [pane for view in views for pane in passages_of_wall(view)]
    return tuple(pane for pane in openings if not any(pane.overlaps(other) for other in known))


def _behind(pane: Pane, mirror: Pane) -> bool:
    """Whether a pane hangs in the image that a mirror shows."""
    return mirror.kind == "mirror" and bool(np.all(mirror.heights(pane.corners) < 0.0))
