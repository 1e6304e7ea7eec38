"""Sun patches: found by the one direction that explains them, and painted as what lies around them."""

import numpy as np
import pytest

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.material.delighting.sun_patches import Openings, SunPatches, find_sun_patches
from lidarspectra.room.light_samples import samples_of

from .conftest import box_scan

CELLS = 24
FLOOR, SUN = 0.2, 0.5  # [1] of white: what the picture shows, and what the sun adds
SUN_DEG = (200.0, 35.0)  # azimuth and height


def toward(azimuth_deg: float, height_deg: float) -> FloatArray:
    """(3,) direction."""
    azimuth, height = np.radians([azimuth_deg, height_deg])
    return np.array([np.cos(height) * np.cos(azimuth), np.cos(height) * np.sin(azimuth), np.sin(height)])


@pytest.fixture(scope="module")
def room() -> Scan:
    """A box with nothing in it."""
    return box_scan(CELLS)[0]


@pytest.fixture(scope="module")
def window(room: Scan) -> BoolArray:
    """(face,) in the wall of least x, in the upper half."""
    low, high = room.bounds
    share = (room.centers - low) / (high - low)
    on_wall = share[:, 0] < 1e-6
    inside = (share[:, 1] > 0.3) & (share[:, 1] < 0.7) & (share[:, 2] > 0.4) & (share[:, 2] < 0.8)
    return np.asarray(on_wall & inside, dtype=np.bool_)


def sunlit(scan: Scan, window: BoolArray, way: FloatArray) -> BoolArray:
    """(face,) whose way to the sun crosses the window's rectangle, by plane geometry."""
    corners = scan.corners[window].reshape(-1, 3)
    low, high = corners.min(axis=0), corners.max(axis=0)
    distance = (low[0] - scan.centers[:, 0]) / way[0]
    at = scan.centers + distance[:, None] * way
    through = ((at[:, 1:] > low[1:]) & (at[:, 1:] < high[1:])).all(axis=1)
    return np.asarray((distance > 1e-3) & through & (scan.normals @ way > 0), dtype=np.bool_)


def found(scan: Scan, brightness: FloatArray, panes: BoolArray, *, holes: bool = False) -> SunPatches:
    """What is found in a scan."""
    caster = RayCaster(scan)
    samples = samples_of(scan, caster, np.random.default_rng(1), count=3000)
    return find_sun_patches(scan, caster, samples, brightness, Openings.of(scan, panes, holes=holes))


def uneven(scan: Scan) -> FloatArray:
    """(face,) brightness without a sun: by a factor of three along the room, as from a window."""
    low, high = scan.bounds
    return np.asarray(FLOOR * 3.0 ** -((scan.centers - low) / (high - low))[:, 0], dtype=np.float64)


@pytest.mark.parametrize("strength", [SUN, 10.0])
@pytest.mark.parametrize("azimuth_deg", [180.0, 205.0])
def test_the_suns_direction_is_found_and_its_patch_gets_the_surface_around_it(
    room: Scan, window: BoolArray, strength: float, azimuth_deg: float
) -> None:
    way = toward(azimuth_deg, SUN_DEG[1])
    truth = sunlit(room, window, way)
    shown = np.minimum(uneven(room) + strength * truth, 1.0)
    patches = found(room, shown, window)
    assert np.degrees(np.arccos(patches.toward @ way)) < 3.0
    got = patches.member(room)
    assert room.areas[got & truth].sum() > 0.85 * room.areas[truth].sum()
    assert room.areas[got & ~truth].sum() < 0.05 * room.areas[truth].sum()
    reflectance = np.where(truth, 0.9, 0.3)[:, None] * np.ones(3)
    assert patches.filled(reflectance)[got] == pytest.approx(0.3)


def test_what_shows_no_surface_beside_the_sun_makes_its_patch_no_lighter(room: Scan, window: BoolArray) -> None:
    """It is marked by a reflectance of 1, which counted in the mean of what lies around."""
    way = toward(*SUN_DEG)
    truth = sunlit(room, window, way)
    patches = found(room, np.minimum(uneven(room) + SUN * truth, 1.0), window)
    reflectance = np.where(np.arange(len(truth)) % 5 == 0, 1.0, 0.3)[:, None] * np.ones(3)
    assert patches.faces.size
    assert patches.filled(reflectance)[patches.faces] == pytest.approx(0.3)


def test_a_hole_where_the_window_was_serves_as_well(room: Scan, window: BoolArray) -> None:
    way = toward(*SUN_DEG)
    truth = sunlit(room, window, way)[~window]
    without = bare_scan(room.vertices, room.faces[~window])
    patches = found(without, np.minimum(uneven(without) + SUN * truth, 1.0), np.zeros(len(truth), bool), holes=True)
    assert np.degrees(np.arccos(patches.toward @ way)) < 3.0


def test_daylight_without_a_sun_is_none(room: Scan, window: BoolArray) -> None:
    assert found(room, uneven(room), window).faces.size == 0


def test_a_bright_rug_is_no_sun(room: Scan, window: BoolArray) -> None:
    """Longer than any picture of the window on the floor, and not in line with it."""
    low, high = room.bounds
    share = (room.centers - low) / (high - low)
    rug = (share[:, 2] < 1e-6) & (share[:, 1] > 0.05) & (share[:, 1] < 0.3) & (share[:, 0] > 0.05)
    assert found(room, uneven(room) + SUN * rug, window).faces.size == 0


def test_without_windows_nothing_is_looked_for(room: Scan, window: BoolArray) -> None:
    truth = sunlit(room, window, toward(*SUN_DEG))
    assert found(room, uneven(room) + SUN * truth, np.zeros_like(window)).faces.size == 0
