"""A rectangle that sends more than paint could, in a room whose light frames show, is a screen; what is lit is none."""

import re
from dataclasses import dataclass, replace

import numpy as np
import pytest
import trimesh

from lidarspectra.arrays import BoolArray, FloatArray
from lidarspectra.geometry.appearance import Appearance, LinearLight
from lidarspectra.geometry.rays import caster_of
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.material.delighting.light_exchange import exchange_matrix
from lidarspectra.material.frames.records import FrameRecords
from lidarspectra.material.frames.seen_screens import screens_of_frames
from lidarspectra.room.panes.pane import Pane

SIZE_M = (4.0, 3.0, 2.6)
LAMP, LAMP_SENDS = (1.5, 2.5, 1.0, 2.0), 60.0  # [m] its sides on the ceiling; [1] white in its light sends about 1
FRAMES = 16
PLACE = Pane(kind="screen", center=np.array([4.0, 1.5, 1.3]), size_m=(1.2, 0.8), normal=np.array([-1.0, 0.0, 0.0]))
FRAME_M = 0.1  # [m] width of a black frame within the place's rectangle
WALL, FRAME, WHITE = 0.45, 0.04, 0.85  # [1] reflectances


@dataclass(frozen=True)
class Room:
    """A room, the light that its faces send, and the irradiance on them."""

    scan: Scan
    sent: FloatArray
    light: FloatArray

    @property
    def lamp(self) -> BoolArray:
        return self.sent > 0.5 * LAMP_SENDS


@pytest.fixture(scope="module")
def room() -> Room:
    """A closed box with a lamp in its ceiling; light is followed until white paint would have all of it."""
    solid = trimesh.creation.box(bounds=[(0, 0, 0), SIZE_M])
    vertices, faces = trimesh.remesh.subdivide_to_size(solid.vertices, solid.faces, max_edge=0.16, max_iter=20)
    part = trimesh.Trimesh(vertices, faces, process=False)
    part.invert()
    scan = bare_scan(np.asarray(part.vertices), np.asarray(part.faces))
    center, up = scan.centers, scan.normals[:, 2]
    lamp = (up < -0.9) & (center[:, 0] > LAMP[0]) & (center[:, 0] < LAMP[1])
    lamp &= (center[:, 1] > LAMP[2]) & (center[:, 1] < LAMP[3])
    reflectance = np.where(up < -0.9, 0.8, np.where(up > 0.9, 0.2, WALL))
    exchange = exchange_matrix(
        caster_of(scan), len(scan.faces), center + 0.001 * scan.normals, scan.normals, rays=256,
        generator=np.random.default_rng(1),
    )[:, :-1]  # fmt: skip
    sent = np.where(lamp, LAMP_SENDS, 0.0)
    for _ in range(12):
        sent = np.where(lamp, LAMP_SENDS, reflectance * (exchange @ sent))
    return Room(scan=scan, sent=sent, light=np.asarray(exchange @ sent))


@dataclass(frozen=True, kw_only=True)
class There:
    """What is on the wall: radiance over the light there, in units of which a white paint has .85."""

    inner: float
    frame: float | None = FRAME
    fall: float = 0.0
    moves: float = 0.0
    sun: float = 0.0  # more light on it and half a metre around it, over the light there
    lamp_cut: float = 1.0  # by which the lamp sends more than all frames show


def _found(room: Room, there: There) -> tuple[Pane, ...]:
    scan, generator = room.scan, np.random.default_rng(7)
    on = PLACE.members(scan.centers)
    inner = replace(PLACE, size_m=(PLACE.size_m[0] - 2 * FRAME_M, PLACE.size_m[1] - 2 * FRAME_M)).members(scan.centers)
    sent = room.sent.copy()
    sent[PLACE.covers(scan.centers, margin_m=0.5) & (scan.centers[:, 0] > 3.9)] *= 1.0 + there.sun
    if there.frame is not None:
        sent[on] = there.frame * (1.0 + there.sun) * room.light[on]
        on = inner
    sent[on] = there.inner * (1.0 + there.sun) * room.light[on]
    cut = room.lamp & (there.lamp_cut > 1.0)
    sent[cut] /= there.lamp_cut
    count, side = len(scan.faces), int(np.ceil(np.sqrt(len(scan.faces))))
    image = np.zeros((side * side, 3), dtype=np.float32)
    image[:count] = sent[:, None]
    row, column = np.divmod(np.arange(count), side)
    uv = np.stack([(column + 0.5) / side, 1.0 - (row + 0.5) / side], axis=1)
    colored = replace(
        scan,
        appearance=Appearance(
            images=(image.reshape(side, side, 3),), face_image=np.zeros(count, dtype=np.int64),
            corner_uv=np.repeat(uv[:, None], 3, axis=1), corner_color=np.zeros((count, 3, 3)),
            linear=LinearLight(
                power_deviation=0.0, shoulder_deviation=0.0, face_deviation=np.zeros(count),
                face_cut=cut.astype(np.float64),
            ),
        ),
    )  # fmt: skip
    turn = 2 * np.pi * np.arange(FRAMES) / FRAMES
    camera = np.stack([1.9 + 1.3 * np.cos(turn), 1.5 + np.sin(turn), 1.3 + 0.2 * np.sin(3 * turn)], axis=1)
    place, frame = (each.ravel() for each in np.meshgrid(np.arange(count), np.arange(FRAMES), indexing="ij"))
    way = camera[frame] - scan.centers[place]
    cosine = np.einsum("nc,nc->n", way, scan.normals[place]) / np.linalg.norm(way, axis=1)
    seen = cosine > 0.2
    place, frame, cosine = place[seen], frame[seen], cosine[seen]
    light = sent[place] * np.exp(0.02 * generator.normal(size=place.size))
    shows = on[place]
    light[shows] *= cosine[shows] ** there.fall * np.exp(there.moves * generator.normal(size=FRAMES))[frame[shows]]
    records = FrameRecords(
        points=scan.centers, normals=scan.normals, camera=camera, place=place, frame=frame,
        light=light.astype(np.float32), uneven=np.zeros(place.size, dtype=np.float32), clipped=cut[place],
    )  # fmt: skip
    return screens_of_frames(records, colored, caster_of(colored))


@pytest.mark.parametrize(
    ("there", "sign"),
    [
        (There(inner=2.0), "has a black frame"),
        (There(inner=2.0, lamp_cut=6.0), "has a black frame"),
        (There(inner=2.0, frame=None, fall=1.0), "cosine to the power 1.0"),
        (There(inner=0.7, moves=0.4), "from frame to frame"),
    ],
)
def test_a_screen_that_is_on_is_found_where_it_is_with_what_speaks_for_it(room: Room, there: There, sign: str) -> None:
    (pane,) = _found(room, there)
    assert pane.kind == "screen"
    assert sign in pane.why
    # Faces are 10 to 16 cm wide here, so that an edge is known by one of them.
    np.testing.assert_allclose(pane.center, PLACE.center, atol=0.12)
    np.testing.assert_allclose(pane.size_m, PLACE.size_m, atol=0.3)


@pytest.mark.parametrize(
    "there",
    [
        There(inner=WALL, frame=None),
        There(inner=WHITE),
        There(inner=WHITE, lamp_cut=6.0),
        There(inner=WHITE, sun=6.0),
        There(inner=WHITE, sun=1.0),
        There(inner=WHITE, frame=None, sun=6.0),
        There(inner=0.05, moves=0.5),
        There(inner=2.0, frame=None),
        There(inner=40.0),
    ],
    ids=[
        "bare wall", "white picture in a black frame", "the same under a lamp that is cut", "the same in the sun",
        "the same in weak sun", "paper in the sun", "dark gloss", "nothing but its light speaks for it", "a lamp",
    ],
)  # fmt: skip
def test_paint_however_it_is_lit_dark_gloss_and_lamps_are_no_screens(room: Room, there: There) -> None:
    assert _found(room, there) == ()


def test_how_bright_a_screen_is_comes_out_over_white_paint_in_the_same_light(room: Room) -> None:
    (dim,), (bright,) = _found(room, There(inner=2.0)), _found(room, There(inner=6.0))
    once, more = (float(re.findall(r"sends (\S+) times what white paint could", pane.why)[0]) for pane in (dim, bright))
    # Light is gathered by 256 rays a place, of which about ten meet the lamp; and words have one digit.
    assert more / once == pytest.approx(3.0, rel=0.15)


def test_frames_that_show_nothing_tell_no_screens(room: Room) -> None:
    nothing = np.zeros(0)
    records = FrameRecords(
        points=room.scan.centers[:9], normals=room.scan.normals[:9], camera=np.zeros((1, 3)),
        place=nothing.astype(np.int64), frame=nothing.astype(np.int64), light=nothing.astype(np.float32),
        uneven=nothing.astype(np.float32), clipped=nothing.astype(np.bool_),
    )  # fmt: skip
    assert screens_of_frames(records, room.scan, caster_of(room.scan)) == ()
