"""Make scans of a study with a mirror, a glass partition and a lit screen, all flat in the mesh, and their frames.

    python -m research.scenes.pane_frames FOLDER [--seed 1 2 3] [--matt] [--frames 140]

    FOLDER/study-1/plan.toml, scan.glb, truth/     as `research.scenes.by_day` makes them
    FOLDER/study-1/frames/                         an app's raw data of the walk: through the study, then the corridor

`--matt` makes `study-1-matt`, where the same three places are black paint: nothing is to be found. The mirror reflects
.83 to .9, the glass as Fresnel's equations have it; the LiDAR measures both in their plane here and there, by dust, and
else what is seen in them or through them. How often a phone's does is not known: with seeds 1, 2 and 3 it is .3, .6 and
1 of its values, so that with the third nothing is told by depth. Light does not go through the glass to light the other
room, and the screen lights nothing: what is tested are colours along rays.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.hardware.phone.texture_atlas import Atlas
from lidarspectra.room.panes.pane import Pane
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps
from research.scenes.build import (
    SCENES,
    VISIBLE_NM,
    WAVELENGTH_STEP_NM,
    Besides,
    direct_light,
    phone_scan,
    spectral_flux,
    write_run_file,
    write_truth,
)
from research.scenes.by_day import CAMERAS
from research.scenes.frames import FRAMES
from research.virtual_rooms.camera import DirectLight, SurfaceLight, light_colors, seen_light
from research.virtual_rooms.day_light import reflected_light, relative_radiance
from research.virtual_rooms.frame_camera import FramePlan, Shining, upright_pose, write_frames
from research.virtual_rooms.pane_light import NONE, ShownPane, ShownPanes
from research.virtual_rooms.phone import ScannedShape
from research.virtual_rooms.room_plan import CameraSection, RoomPlan, read_plan
from research.virtual_rooms.true_room import TrueRoom, true_room

PLAN = Path(__file__).with_name("study.toml")
GAP_M = 0.1  # [m] between study and corridor
DUST = 0.25  # [1] of the black paint that mirror and glass would be, that dust scatters
SCREEN_OVER_WHITE = 2.5  # [1] white of the screen over white paper there: 250 cd/m² at 350 lx
MIRROR_REFLECTANCE = (0.83, 0.88, 0.9)  # by seed
SURFACE_SHARE = (0.3, 0.6, 1.0)  # of the LiDAR's values, by seed
MIRROR = Pane(kind="mirror", center=np.array([0.005, 1.5, 1.3]), size_m=(1.2, 1.6), normal=np.array([1.0, 0.0, 0.0]))
GLASS = Pane(kind="glass", center=np.array([1.5, 3.395, 1.2]), size_m=(2.2, 2.2), normal=np.array([0.0, -1.0, 0.0]))
GLASS_BEHIND = Pane(
    kind="glass", center=np.array([1.5, 3.505, 1.2]), size_m=(2.2, 2.2), normal=np.array([0.0, 1.0, 0.0])
)
SCREEN = Pane(kind="screen", center=np.array([2.1, 0.05, 1.34]), size_m=(1.12, 0.6), normal=np.array([0.0, 1.0, 0.0]))
TRUE_PANES = (MIRROR, GLASS, SCREEN)
PANE_PARTS = {"mirror": 0, "glass study": 1, "glass corridor": 2}
CORRIDOR_SHARE = 0.25  # of the frames that are taken in the corridor
LAPS, SWEEP = 2, 12  # around the study; frames from floor to ceiling and back
HEIGHT_M = 1.45


def walk(count: int, generator: np.random.Generator) -> list[FloatArray]:
    """(4, 4) poses: around the study, looking across on one lap and at the near wall on the next; then the corridor."""
    beyond = round(CORRIDOR_SHARE * count)
    poses = []
    for number in range(count - beyond):
        angle = 2 * np.pi * LAPS * number / (count - beyond)
        across = int(LAPS * number / (count - beyond)) % 2 == 0
        position = np.array([2.1 + 1.25 * np.cos(angle), 1.8 + 0.95 * np.sin(angle), HEIGHT_M])
        heading = angle + (np.pi if across else 0.0) + generator.normal(scale=0.1)
        poses.append(upright_pose(position, heading, _pitch(number)))
    for number in range(beyond):
        share = number / max(beyond - 1, 1)
        position = np.array([3.9 - 3.1 * share, 4.2, HEIGHT_M])
        heading = np.pi * (0.5 + 0.5 * np.sin(9.0 * share)) + generator.normal(scale=0.1)
        poses.append(upright_pose(position, heading, _pitch(number)))
    return poses


def _pitch(number: int) -> float:
    phase = 0.5 - 0.5 * np.cos(2 * np.pi * number / SWEEP)
    return float(np.radians(-50.0 + 112.0 * phase))


def set_lamps(
    texture: FloatArray,
    surface: "np.ndarray[tuple[int, ...], np.dtype[np.int64]]",
    plan: RoomPlan,
    room: TrueRoom,
    folder: Path,
    light: SurfaceLight,
    camera: CameraSection,
) -> None:
    """Set a (row, column, 3) texture to what lamps send, where the (row, column) surface is a lamp's."""
    lamps = resolve_lamps(plan.file.lamps, folder)
    sent = {
        lamp.name: row / lamp.shape.area
        for lamp, row in zip(lamps, spectral_flux(lamps, light.wavelengths_nm), strict=True)
    }
    for number, part in enumerate(room.surfaces):
        if part.lamp is not None:
            shines = sent[part.lamp]
            texture[surface == number] = light_colors(np.ones((1, shines.size)), light, shines[None], camera)[0, 0]


def frames_besides(folder: Path, *, seed: int, count: int, matt: bool) -> Besides:
    """What makes the frames of a scan, from its shape and light."""

    def besides(
        plan: RoomPlan, room: TrueRoom, shape: ScannedShape, atlas: Atlas, light: SurfaceLight, direct: DirectLight
    ) -> None:
        generator = np.random.default_rng(seed + 3000)
        camera = plan.file.camera.model_copy(update={"exposure_spread": 0.0})
        texture, surface = seen_light(room, shape, atlas, light, direct, camera, generator)
        number_of_pane = np.full(surface.shape, NONE, dtype=np.int8)
        for number, part in enumerate(room.surfaces):
            there = surface == number
            if not matt and part.part in PANE_PARTS:
                texture[there] *= DUST
                number_of_pane[there] = PANE_PARTS[part.part]
            if not matt and part.part == "screen":
                white = float(np.quantile(texture[surface >= 0].mean(axis=1), 0.9))
                texture[there] += SCREEN_OVER_WHITE * white * _pictured(shape, atlas, there)[:, None]
        set_lamps(texture, surface, plan, room, folder, light, camera)
        write_frames(
            folder / FRAMES, room, shape, atlas,
            Shining(
                texture=texture.astype(np.float32), sky=np.zeros(surface.shape, dtype=np.bool_),
                panes=None if matt else _panes(number_of_pane, seed),
            ),
            FramePlan(count=count, tone=camera.tone), relative_radiance, generator,
            layout="3dscanner" if seed % 2 else "polycam", poses=walk(count, generator),
        )  # fmt: skip

    return besides


def _panes(number: "np.ndarray[tuple[int, ...], np.dtype[np.int8]]", seed: int) -> ShownPanes:
    surface_share = SURFACE_SHARE[(seed - 1) % 3]
    reflectance = MIRROR_REFLECTANCE[(seed - 1) % 3]
    panes = [ShownPane(pane=MIRROR, mirror_reflectance=reflectance, surface_share=surface_share)]
    panes += [
        ShownPane(pane=each, thickness_m=GAP_M + 0.01, surface_share=surface_share) for each in (GLASS, GLASS_BEHIND)
    ]
    return ShownPanes(panes=panes, number=number)


def _pictured(
    shape: ScannedShape, atlas: Atlas, there: "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]"
) -> FloatArray:
    """(texel,) what a screen shows, of its white: a page with lines of text beside a dark window [0-1]."""
    rows, columns = np.nonzero(there)
    corners = shape.vertices[shape.faces[atlas.texel_face[rows, columns]]]
    points = np.einsum("nk,nkc->nc", atlas.barycentric(rows, columns), corners)
    away = points - SCREEN.center
    page = (away @ SCREEN.along > -0.1) & ~((np.sin(90.0 * points[:, 2]) > 0.3) & (away @ SCREEN.along > 0.05))
    return np.where(page, 1.0, 0.15)


def build(folder: Path, plan_file: Path, *, seed: int, besides: Besides) -> str:
    """Make a scan of a plan, its truth, and what is made besides; what to say of it."""
    (folder / "truth").mkdir(parents=True, exist_ok=True)
    (folder / "reflectances.csv").write_bytes((SCENES / "reflectances.csv").read_bytes())
    (folder / "plan.toml").write_bytes(plan_file.read_bytes())
    plan = read_plan(folder / "plan.toml")
    tone, level, balance = CAMERAS[(seed - 1) % len(CAMERAS)]
    camera = plan.file.camera.model_copy(update={"tone": tone, "bright_level": level, "white_balance": balance})
    plan = RoomPlan(file=plan.file.model_copy(update={"camera": camera}), materials=plan.materials)
    room = true_room(plan)
    wavelengths = np.arange(VISIBLE_NM[0], VISIBLE_NM[1] + WAVELENGTH_STEP_NM / 2, WAVELENGTH_STEP_NM)
    direct = direct_light(plan, room, folder, wavelengths)
    generator = np.random.default_rng(seed + 1000)
    positions, faces = room.sample(plan.file.camera.light_spacing_m, generator)
    normals, straight = room.normals[faces], direct(positions, room.normals[faces])
    reflectance = np.stack([each.reflectance.at(wavelengths, outside="nearest") for each in room.materials])
    reflected = reflected_light(
        room, positions, normals, reflectance[room.face_material[faces]], straight, generator
    )  # fmt: skip
    light = SurfaceLight(
        positions=positions, normals=normals, wavelengths_nm=wavelengths, direct=straight, reflected=reflected
    )
    built = phone_scan(
        plan, room, folder, seed=seed, light=light, direct=direct,
        shining=np.array([surface.lamp is not None for surface in room.surfaces]),
        besides=besides,
    )  # fmt: skip
    write_truth(folder / "truth", plan, room, built.true_face)
    write_run_file(folder / "room.toml", plan.file, built.file)
    return built.words


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", nargs="+", type=int, default=[1, 2, 3])
    parser.add_argument("--frames", type=int, default=140)
    parser.add_argument("--matt", action="store_true", help="black paint in place of mirror, glass and screen")
    given = parser.parse_args(arguments)
    for seed in given.seed:
        folder = given.folder / f"study-{seed}{'-matt' * given.matt}"
        besides = frames_besides(folder, seed=seed, count=given.frames, matt=given.matt)
        print(f"{folder}: {build(folder, PLAN, seed=seed, besides=besides)}", flush=True)


if __name__ == "__main__":
    main()
