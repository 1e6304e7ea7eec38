"""Make scans of the scenes as frames: the raw data of an app, beside the textured scan of the same phone and light.

    python -m research.scenes.frames FOLDER [--scene office ...] [--case night day] [--seed 1 2 3] [--lamps]

    FOLDER/office-day-1/plan.toml, room.toml, scan.glb, truth/   as `research.scenes.by_day` makes them
    FOLDER/office-day-1/frames/                                  3D Scanner App's "All data" of the same walk
    FOLDER/office-day-1/gains.csv                                the true gain of every frame in three channels
    FOLDER/office-day-1/face-light.npy                           the true radiosity of every face of scan.glb

`--lamps` makes `office-day-1-lamps`: the walk ends with looks straight at each lamp, whose exposure has a phone's whole
range, so that the lamps are not cut at white in all frames.

Even seeds are written in Polycam's layout, whose exposures are told; odd ones in 3D Scanner App's, where they are not.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.textures import mean_texture_colors
from lidarspectra.hardware.phone.texture_atlas import Atlas
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps
from research.scenes.build import Besides, spectral_flux
from research.scenes.by_day import CASES, WINDOW, WINDOWS, Case, build_by_day, openings_of
from research.virtual_rooms.camera import DirectLight, SurfaceLight, light_colors, seen_light
from research.virtual_rooms.day_light import relative_radiance
from research.virtual_rooms.frame_camera import FramePlan, Shining, write_frames
from research.virtual_rooms.phone import ScannedShape
from research.virtual_rooms.room_plan import RoomPlan
from research.virtual_rooms.true_room import TrueRoom

LAMP_FRAMES, LAMP_EXPOSURE_RANGE = 6, 7.0  # [1] of looks at each lamp; of log exposure: 1/8000 s, ISO 32 to 1/60 s, 200
FRAMES, GAINS, FACE_LIGHT = "frames", "gains.csv", "face-light.npy"


def frames_besides(scene: str, case: Case, folder: Path, *, seed: int, count: int, at_lamps: bool = False) -> Besides:
    """What makes the frames of a scan, from its shape and light."""

    def besides(
        plan: RoomPlan, room: TrueRoom, shape: ScannedShape, atlas: Atlas, light: SurfaceLight, direct: DirectLight
    ) -> None:
        generator = np.random.default_rng(seed + 2000)
        camera = plan.file.camera.model_copy(update={"exposure_spread": 0.0})
        texture, surface = seen_light(room, shape, atlas, light, direct, camera, generator)
        sky = np.zeros(surface.shape, dtype=np.bool_)
        for number, sent in _shining(scene, case, plan, room, folder, light).items():
            color = light_colors(np.ones((1, sent.size)), light, sent[None], camera)[0, 0]
            texture[surface == number] = color
            sky |= (surface == number) & room.surfaces[number].part.startswith(WINDOW)
        np.save(folder / FACE_LIGHT, mean_texture_colors(texture.astype(np.float32), atlas.corner_uv))
        gains = write_frames(
            folder / FRAMES, room, shape, atlas, Shining(texture=texture.astype(np.float32), sky=sky),
            plan_of(count, camera.tone, at_lamps=at_lamps), relative_radiance, generator,
            layout="3dscanner" if seed % 2 else "polycam",
        )  # fmt: skip
        lines = ["red,green,blue", *(",".join(f"{value:.5g}" for value in row) for row in gains)]
        (folder / GAINS).write_text("\n".join(lines) + "\n", encoding="utf-8")

    return besides


def plan_of(count: int, tone: float, *, at_lamps: bool) -> FramePlan:
    """How frames are taken."""
    if not at_lamps:
        return FramePlan(count=count, tone=tone)
    return FramePlan(count=count, tone=tone, lamp_frames=LAMP_FRAMES, exposure_range=LAMP_EXPOSURE_RANGE)


def _shining(
    scene: str, case: Case, plan: RoomPlan, room: TrueRoom, folder: Path, light: SurfaceLight
) -> dict[int, FloatArray]:
    """Spectral radiosity of the surfaces that shine, by their number; of windows pi times that of the zenith."""
    lamps = resolve_lamps(plan.file.lamps, folder)
    flux = {lamp.name: row for lamp, row in zip(lamps, spectral_flux(lamps, light.wavelengths_nm), strict=True)}
    area = {lamp.name: lamp.shape.area for lamp in lamps}
    openings = iter(openings_of(scene, case, plan, folder, light.wavelengths_nm))
    sent = {}
    for number, surface in enumerate(room.surfaces):
        if surface.lamp is not None and case.lamps > 0:
            sent[number] = case.lamps * flux[surface.lamp] / area[surface.lamp]
        elif surface.part.startswith(WINDOW):
            radiance = next(openings).radiance
            if case.day > 0:
                sent[number] = np.pi * radiance
    return sent


def main(arguments: Sequence[str] | None = None) -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--scene", nargs="+", choices=sorted(WINDOWS), default=["office"])
    parser.add_argument("--case", nargs="+", choices=sorted(CASES), default=["night", "day"])
    parser.add_argument("--seed", nargs="+", type=int, default=[1, 2, 3])
    parser.add_argument("--frames", type=int, default=120)
    parser.add_argument("--lamps", action="store_true", help="look straight at each lamp, too")
    given = parser.parse_args(arguments)
    for scene in given.scene:
        for name in given.case:
            for seed in given.seed:
                case, folder = CASES[name], given.folder / f"{scene}-{name}-{seed}{'-lamps' * given.lamps}"
                besides = frames_besides(scene, case, folder, seed=seed, count=given.frames, at_lamps=given.lamps)
                built = build_by_day(scene, case, folder, seed=seed, besides=besides)
                print(f"{built.file}: {built.words}", flush=True)


if __name__ == "__main__":
    main()
