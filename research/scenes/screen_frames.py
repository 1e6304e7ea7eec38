"""Make scans of a room with screens, and with what may be taken for one, and their frames.

    python -m research.scenes.screen_frames FOLDER [--seed 1 2 3] [--off] [--frames 140]

    FOLDER/screens-1/plan.toml, scan.glb, truth/     as `research.scenes.by_day` makes them
    FOLDER/screens-1/frames/                         an app's raw data of the walk

On: a television, a screen without a frame, and a monitor on a desk whose picture moves. Off: a polished screen. None at
all: a poster, a white picture in a black frame in a patch of sun that is wider than it, and a sheet of white paper in
the light of a desk lamp. `--off` makes `screens-1-off`, where all screens are off: nothing shines. Screens, sun and
desk lamp light nothing but what they are on or shine at: what is tested is what a surface sends.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.hardware.phone.texture_atlas import Atlas
from lidarspectra.room.panes.pane import Pane
from research.scenes.build import (
    Besides,
)
from research.scenes.frames import FRAMES
from research.scenes.pane_frames import build, set_lamps
from research.virtual_rooms.camera import DirectLight, SurfaceLight, seen_light
from research.virtual_rooms.day_light import relative_radiance
from research.virtual_rooms.frame_camera import FramePlan, Shining, upright_pose, write_frames
from research.virtual_rooms.pane_light import NONE
from research.virtual_rooms.phone import ScannedShape
from research.virtual_rooms.room_plan import RoomPlan
from research.virtual_rooms.screen_light import ShownScreen, ShownScreens
from research.virtual_rooms.true_room import TrueRoom

PLAN = Path(__file__).with_name("screens.toml")
OVER_WHITE = (2.5, 1.6, 5.0)  # [1] white of the screens over white paper there, by seed: 250 cd/m² at 350 lx, and so on
WALL_OVER_WHITE = 0.43 / 0.85  # [1] of the sage paint over white paper
FALL = (0.5, 1.0, 2.0)  # [1] power of the cosine, by seed
SUN_OVER_ROOM = (8.0, 3.0, 20.0)  # [1] of the light there, by seed: a bright sun would be 100, and cut in all frames
DESK_LAMP_OVER_ROOM = (6.0, 3.0, 10.0)  # [1] at the middle of its spot
DESK_LAMP_M = 0.35  # [m] before the wall
DESK_LAMP_AT = (4.4, 0.75, 1.35)  # [m] middle of its spot
SUN_LOW, SUN_SIDES, SUN_SLOPE = (0.0, 0.9, 0.8), (1.5, 1.2), 0.25  # [m] corner, width and height on the wall; its shear
LEVEL = np.array([0.0, -1.0, 0.0])
TELEVISION = Pane(kind="screen", center=np.array([1.4, 0.05, 1.34]), size_m=(1.14, 0.62), normal=-LEVEL)
BARE = Pane(kind="screen", center=np.array([3.2, 3.36, 1.4]), size_m=(0.6, 1.0), normal=LEVEL)
MONITOR = Pane(kind="screen", center=np.array([3.995, 2.31, 1.0]), size_m=(0.58, 0.36), normal=np.array([-1.0, 0, 0]))
DARK = Pane(kind="screen", center=np.array([1.4, 3.35, 1.34]), size_m=(1.2, 0.68), normal=LEVEL)
SCREENS = {"television": TELEVISION, "bare screen": BARE, "monitor": MONITOR, "dark screen": DARK}
NOT_SCREENS = {
    "poster": Pane(kind="screen", center=np.array([3.3, 0.03, 1.45]), size_m=(0.8, 0.9), normal=-LEVEL),
    "framed picture in the sun": Pane(
        kind="screen", center=np.array([0.035, 1.65, 1.45]), size_m=(0.9, 0.7), normal=np.array([1.0, 0.0, 0.0])
    ),
    "sheet under a desk lamp": Pane(
        kind="screen", center=np.array([4.385, 0.8, 1.3]), size_m=(0.6, 0.4), normal=np.array([-1.0, 0.0, 0.0])
    ),
}
LAPS, SWEEP, HEIGHT_M = 2, 12, 1.45  # around the room; frames from floor to ceiling and back; [m]


def walk(count: int, generator: np.random.Generator) -> list[FloatArray]:
    """(4, 4) poses around the room, looking across on one lap and at the near wall on the next."""
    poses = []
    for number in range(count):
        angle = 2 * np.pi * LAPS * number / count
        across = int(LAPS * number / count) % 2 == 0
        position = np.array([2.0 + 1.15 * np.cos(angle), 1.6 + 0.9 * np.sin(angle), HEIGHT_M])
        heading = angle + (np.pi if across else 0.0) + generator.normal(scale=0.1)
        phase = 0.5 - 0.5 * np.cos(2 * np.pi * number / SWEEP)
        poses.append(upright_pose(position, heading, float(np.radians(-50.0 + 112.0 * phase))))
    return poses


def in_sun(points: FloatArray) -> FloatArray:
    """(n,) 1 where the patch of sun falls on the west wall, a sheared window, and 0 elsewhere; soft over 2 cm."""
    across, up = points[:, 1] - SUN_LOW[1], points[:, 2] - SUN_LOW[2]
    up = up - SUN_SLOPE * across
    inside = np.minimum(
        np.minimum(across, SUN_SIDES[0] - across), np.minimum(up, SUN_SIDES[1] - up)
    )  # [m] from the nearest edge
    return np.where(points[:, 0] < 0.1, np.clip(inside / 0.02, 0.0, 1.0), 0.0)


def by_desk_lamp(points: FloatArray) -> FloatArray:
    """(n,) irradiance from a small lamp before the east wall, of that at the middle of its spot (inverse square)."""
    away2 = ((points - np.array(DESK_LAMP_AT))[:, 1:] ** 2).sum(axis=1)
    on_wall = points[:, 0] > DESK_LAMP_AT[0] - 0.05
    return np.where(on_wall, (1.0 + away2 / DESK_LAMP_M**2) ** -1.5, 0.0)


def frames_besides(folder: Path, *, seed: int, count: int, off: bool) -> Besides:
    """What makes the frames of a scan, from its shape and light."""

    def besides(
        plan: RoomPlan, room: TrueRoom, shape: ScannedShape, atlas: Atlas, light: SurfaceLight, direct: DirectLight
    ) -> None:
        generator, each = np.random.default_rng(seed + 4000), (seed - 1) % 3
        camera = plan.file.camera.model_copy(update={"exposure_spread": 0.0})
        texture, surface = seen_light(room, shape, atlas, light, direct, camera, generator)
        there = surface >= 0
        rows, columns = np.nonzero(there)
        corners = shape.vertices[shape.faces[atlas.texel_face[rows, columns]]]
        points = np.einsum("nk,nkc->nc", atlas.barycentric(rows, columns), corners)
        more = SUN_OVER_ROOM[each] * in_sun(points) + DESK_LAMP_OVER_ROOM[each] * by_desk_lamp(points)
        walls = np.isin(surface, [number for number, part in enumerate(room.surfaces) if part.part.endswith(" wall")])
        white = float(np.median(texture[walls].mean(axis=1))) / WALL_OVER_WHITE
        texture[there] *= 1.0 + more[:, None]
        set_lamps(texture, surface, plan, room, folder, light, camera)
        number_of_screen = np.full(surface.shape, NONE, dtype=np.int8)
        for number, part in enumerate(room.surfaces):
            if part.part in SCREENS:
                number_of_screen[surface == number] = list(SCREENS).index(part.part)
        shown = [
            ShownScreen(
                pane=pane, white=0.0 if off or name == "dark screen" else OVER_WHITE[each] * white, fall=FALL[each],
                moves=name == "monitor", is_polished=name == "dark screen",
            )
            for name, pane in SCREENS.items()
        ]  # fmt: skip
        write_frames(
            folder / FRAMES, room, shape, atlas,
            Shining(
                texture=texture.astype(np.float32), sky=np.zeros(surface.shape, dtype=np.bool_),
                panes=ShownScreens(panes=(), number=number_of_screen, screens=shown),
            ),
            FramePlan(count=count, tone=camera.tone), relative_radiance, generator,
            layout="3dscanner" if seed % 2 else "polycam", poses=walk(count, generator),
        )  # fmt: skip

    return besides


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", nargs="+", type=int, default=[1, 2, 3])
    parser.add_argument("--frames", type=int, default=140)
    parser.add_argument("--off", action="store_true", help="all screens off")
    given = parser.parse_args(arguments)
    for seed in given.seed:
        folder = given.folder / f"screens-{seed}{'-off' * given.off}"
        besides = frames_besides(folder, seed=seed, count=given.frames, off=given.off)
        print(f"{folder}: {build(folder, PLAN, seed=seed, besides=besides)}", flush=True)


if __name__ == "__main__":
    main()
