"""Furniture seen from above: outlines for plans and maps."""

import cv2
import numpy as np

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.geometry.rays import caster_of
from lidarspectra.geometry.scan import Scan
from lidarspectra.room.room import Room

PIXEL_M = 0.02  # [m] of the plan picture
LOWEST_M = 0.15  # [m] above the floor; lower surfaces are carpet edges, cables or noise
HIGHEST_M = 1.6  # [m] above the floor; higher tops are not drawn
MIN_UP = 0.8  # cosine of a surface that counts as a top
MIN_AREA_M2 = 0.03  # [m²] smaller patches are dropped; a stool is larger
CORNER_TOLERANCE_M = 0.04  # [m] largest deviation of a simplified outline
GAP_M = 0.06  # [m] narrower gaps between the tops of one piece are closed


def furniture_outlines(scan: Scan, room: Room) -> tuple[FloatArray, ...]:
    """Outlines of table tops, seats, cabinets and the like, seen from above.

    Level faces between `LOWEST_M` and `HIGHEST_M` above the floor and inside the room's plan are drawn from above;
    the outlines of the patches that they form are simplified.

    Parameters
    ----------
    scan : Scan
    room : Room

    Returns
    -------
    outlines : tuple of (corner, 2) float
        Largest first. [m]
    """
    centers = scan.centers
    above_floor = centers[:, 2] - room.floor_at(centers)
    top = (scan.normals[:, 2] > MIN_UP) & (above_floor > LOWEST_M) & (above_floor < HIGHEST_M)
    top &= room.in_plan(centers)
    if not top.any():
        return ()
    corners = scan.corners[top][:, :, :2]
    low = corners.reshape(-1, 2).min(axis=0) - 2 * GAP_M
    high = corners.reshape(-1, 2).max(axis=0) + 2 * GAP_M
    width, height = np.ceil((high - low) / PIXEL_M).astype(int)
    picture = np.zeros((height, width), dtype=np.uint8)
    for triangle in np.rint((corners - low) / PIXEL_M).astype(np.int32):
        cv2.fillConvexPoly(picture, triangle, 255)
    reach = 2 * round(GAP_M / PIXEL_M / 2) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (reach, reach))
    picture = cv2.morphologyEx(picture, cv2.MORPH_CLOSE, kernel)
    picture = cv2.morphologyEx(picture, cv2.MORPH_OPEN, kernel)
    contours, _ = cv2.findContours(picture, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    large = [c for c in contours if cv2.contourArea(c) * PIXEL_M**2 >= MIN_AREA_M2]
    large.sort(key=cv2.contourArea, reverse=True)
    simple = [cv2.approxPolyDP(contour, CORNER_TOLERANCE_M / PIXEL_M, True)[:, 0, :] for contour in large]
    return tuple(low + PIXEL_M * outline.astype(np.float64) for outline in simple if len(outline) >= 3)


def under_furniture(scan: Scan, room: Room, places: FloatArray) -> BoolArray:
    """(place,) whether something lower than `HIGHEST_M` above the floor is over each of (place, 3) positions [m]."""
    air_m = room.floor_at(places) + HIGHEST_M - places[:, 2]
    up = np.broadcast_to([0.0, 0.0, 1.0], places.shape)
    hits = caster_of(scan).nearest(places, up)
    return np.asarray(hits.met & (hits.distance < air_m), dtype=np.bool_)
