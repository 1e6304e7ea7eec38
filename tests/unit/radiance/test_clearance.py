"""Lamps that touch a rough scan keep their light: the scan recedes or they move, and the notes say which."""

from functools import cache

import numpy as np
import pytest
import trimesh

from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Bulb, Disc, Luminaire, Panel, Point, Shape, Spot, Strip, Window
from lidarspectra.radiance.scene.clearance import REACH_M, clear_lamps
from lidarspectra.radiance.scene.placement import placement_notes
from lidarspectra.spectra.spectrum import Spectrum

LENGTH_M, WIDTH_M, HEIGHT_M = 4.0, 3.0, 2.5
NOISE_M = 0.01
FLAT = Spectrum(wavelengths_nm=[400, 700], values=[1.0, 1.0])
BOTH_WAYS = "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 3 1 1 2 0.3 1.2 0\n1 1 0\n0 90 180\n0\n100 10 50\n"
SHAPES: list[Shape] = [
    Panel(0.6, 0.6),
    Strip(1.2, 0.05),
    Window(1.0, 1.2),
    Disc(0.3),
    Spot(0.1, beam_angle_deg=40.0),
    Bulb(),
    Point(0.02),
    Luminaire(BOTH_WAYS),
]


@cache
def rough_room(longest_edge_m: float = 0.12, noise_m: float = NOISE_M, seed: int = 1) -> Scan:
    """A box around the origin, seen from inside, its vertices off by a centimetre."""
    box = trimesh.creation.box(extents=(LENGTH_M, WIDTH_M, HEIGHT_M))
    box.invert()
    while box.edges_unique_length.max() > longest_edge_m:
        box = box.subdivide()
    noise = np.random.default_rng(seed).normal(0.0, noise_m, box.vertices.shape)
    return bare_scan(box.vertices + noise, box.faces)


def flush(shape: Shape, behind_m: float = 0.0, name: str = "lamp", x: float = 0.3) -> Lamp:
    """A lamp whose back lies in the ceiling, of a window in a wall, or so far behind it."""
    if isinstance(shape, Window):
        return Lamp(name=name, shape=shape, center=(-0.5 * LENGTH_M - behind_m, 0.1, 0.0), normal=(1, 0, 0), flux=FLAT)
    radius = 0.5 * shape.size[0] if isinstance(shape, Bulb | Point) else 0.0
    return Lamp(name=name, shape=shape, center=(x, 0.2, 0.5 * HEIGHT_M - radius + behind_m), flux=FLAT)


def arriving(lamp: Lamp, scan: Scan) -> float:
    """Share of a Lambertian lamp's rays that meet a surface of the room from the room's side."""
    generator = np.random.default_rng(7)
    places, normals = lamp.sample(generator, 20_000)
    across = np.cross(normals, np.roll(normals, 1, axis=1) + [0.1, 0.2, 0.3])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    turn, radius = 2 * np.pi * generator.random(len(places)), np.sqrt(generator.random(len(places)))
    beside = np.cos(turn)[:, None] * across + np.sin(turn)[:, None] * np.cross(normals, across)
    rays = radius[:, None] * beside + np.sqrt(1 - radius**2)[:, None] * normals
    hits = RayCaster(scan).nearest(places, rays)
    return float((hits.met & (np.einsum("ij,ij->i", scan.normals[hits.face], rays) < 0)).mean())


@pytest.mark.parametrize("longest_edge_m", [0.12, 0.5, 9.0])
@pytest.mark.parametrize("behind_m", [-0.01, 0.0, 0.04])
@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: shape.word)
def test_light_of_a_lamp_that_touches_a_rough_surface_arrives(
    shape: Shape, behind_m: float, longest_edge_m: float
) -> None:
    room = rough_room(longest_edge_m)
    given = flush(shape, behind_m)
    clear = clear_lamps([given], room)
    (lamp,) = clear.lamps
    assert (
        arriving(lamp, clear.scan) > 0.99
    )  # of 20,000 rays; before, half of a flush panel's and none of a buried one's
    assert placement_notes(clear.lamps, clear.scan) == ()
    assert np.linalg.norm(lamp.center - given.center) < max(behind_m, 0.0) + 4.0 * NOISE_M
    np.testing.assert_array_equal(clear.scan.faces, room.faces)


def test_lamps_before_one_another_are_named_and_the_colours_of_one_luminaire_are_not() -> None:
    room = rough_room(9.0, noise_m=0.0)

    def hung(name: str, shape: Shape, x: float = 0.0, z: float = 1.0) -> Lamp:
        return Lamp(name=name, shape=shape, center=(x, 0.0, z), flux=FLAT)

    warm, cold = hung("warm", Panel(0.6, 0.6)), hung("cold", Panel(0.6, 0.6))
    assert placement_notes([warm, cold], room) == ()
    above, beside = hung("above", Panel(0.6, 0.6), z=1.005), hung("beside", Panel(0.6, 0.6), x=0.7)
    (note,) = placement_notes([above, cold, beside], room)
    assert "'above' (7" in note
    assert "hidden by another lamp" in note
    assert "'cold'" not in note
    assert "'beside'" not in note
    (note,) = placement_notes([warm, hung("disc in its plane", Disc(0.5))], room)
    assert "'warm' (" in note
    assert placement_notes([warm, hung("pendant", Bulb(0.1), z=0.9), hung("spot", Disc(0.05), z=0.8)], room) == ()


def test_a_lamp_on_a_fine_rough_ceiling_stays_and_the_ceiling_recedes_around_it_alone() -> None:
    room = rough_room()
    given = flush(Panel(0.6, 0.6))
    assert arriving(given, room) < 0.7
    clear = clear_lamps([given], room)
    np.testing.assert_array_equal(clear.lamps[0].center, given.center)
    change = clear.scan.vertices - room.vertices
    moved = np.abs(change).max(axis=1) > 0
    assert np.linalg.norm(change, axis=1).max() < 5.0 * NOISE_M
    assert given.distance(room.vertices[moved]).max() < 0.2  # its margin, and the triangles that reach into it
    (note,) = clear.notes
    assert "pressed back" in note
    assert "'lamp'" in note


def test_a_lamp_behind_large_triangles_moves_and_the_scan_stays() -> None:
    room = rough_room(9.0, noise_m=0.0)
    clear = clear_lamps([flush(Panel(0.6, 0.6), 0.04)], room)
    np.testing.assert_allclose(clear.lamps[0].center, (0.3, 0.2, 0.5 * HEIGHT_M - 0.005))
    np.testing.assert_array_equal(clear.scan.vertices, room.vertices)
    (note,) = clear.notes
    assert "moved by up to 4.5 cm" in note


def test_a_lamp_in_the_very_plane_of_a_smooth_ceiling_comes_before_it_without_a_note() -> None:
    room = rough_room(9.0, noise_m=0.0)
    clear = clear_lamps([flush(Disc(0.3))], room)
    assert clear.lamps[0].center[2] == pytest.approx(0.5 * HEIGHT_M - 0.005)
    assert clear.notes == ()


def test_a_lamp_whose_rim_lies_in_a_wall_comes_out_of_it() -> None:
    room = rough_room()
    center = (0.5 * LENGTH_M - 0.24, 0.5 * WIDTH_M - 0.27, 0.5 * HEIGHT_M)  # .3 is right: in ceiling and both walls
    given = Lamp(name="corner", shape=Panel(0.6, 0.6), center=center, flux=FLAT)
    clear = clear_lamps([given], room)
    assert arriving(given, room) < 0.7
    assert arriving(clear.lamps[0], clear.scan) > 0.99


def test_lamps_in_the_air_and_lamps_far_behind_a_wall_are_left_alone() -> None:
    room = rough_room()
    lamps = [flush(Panel(0.6, 0.6), -0.06), flush(Disc(0.2), REACH_M + 0.06, name="far")]
    clear = clear_lamps(lamps, room)
    for before, after in zip(lamps, clear.lamps, strict=True):
        np.testing.assert_array_equal(before.center, after.center)
    np.testing.assert_array_equal(clear.scan.vertices, room.vertices)
    assert clear.notes == ()
    assert "'far'" in " ".join(placement_notes(clear.lamps, clear.scan))


def test_a_bulb_within_a_scanned_globe_leaves_the_globe_as_it_is() -> None:
    box = trimesh.creation.box(extents=(LENGTH_M, WIDTH_M, HEIGHT_M))
    box.invert()
    globe = trimesh.creation.icosphere(radius=0.08)
    room = bare_scan(np.vstack([box.vertices, globe.vertices]), np.vstack([box.faces, globe.faces + len(box.vertices)]))
    clear = clear_lamps([Lamp(name="bulb", shape=Bulb(), center=(0, 0, 0), flux=FLAT)], room)
    np.testing.assert_array_equal(clear.scan.vertices, room.vertices)
    told = " ".join(placement_notes(clear.lamps, clear.scan))
    assert "behind a surface" in told
    assert "turn its normal" in told  # a window that looks out


def test_sixteen_lamps_share_one_note() -> None:
    lamps = [flush(Disc(0.2), name=f"lamp {number}", x=-1.6 + 0.2 * number) for number in range(16)]
    (note,) = clear_lamps(lamps, rough_room()).notes
    assert "and 10 more" in note
