"""Make scans of the scenes as frames: the raw data of an app, beside the textured scan of the same phone and light.

    python -m research.scenes.frames FOLDER [--scene office ...] [--case night day] [--seed 1 2 3] [--lamps] [--gloss]

    FOLDER/office-day-1/plan.toml, room.toml, scan.glb, truth/   as `research.scenes.by_day` makes them
    FOLDER/office-day-1/frames/                                  3D Scanner App's "All data" of the same walk
    FOLDER/office-day-1/gains.csv                                the true gain of every frame in three channels
    FOLDER/office-day-1/face-light.npy                           the true radiosity of every face of scan.glb

`--lamps` makes `office-day-1-lamps`: the walk ends with looks straight at each lamp, whose exposure has a phone's whole
range, so that the lamps are not cut at white in all frames.

`--gloss` makes `office-night-1-gloss`: floor, desks and cabinet throw back lamps and room (`gloss.csv`: how much).

Even seeds are written in Polycam's layout, whose exposures are told; odd ones in 3D Scanner App's, where they are not.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.geometry.textures import mean_texture_colors
from lidarspectra.hardware.phone.texture_atlas import Atlas
from lidarspectra.material.frames.gloss_lobe import LampPieces
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps
from research.scenes.build import Besides, spectral_flux
from research.scenes.by_day import CASES, FLUX_RATIO, WINDOW, WINDOWS, Case, build_by_day, openings_of
from research.virtual_rooms.camera import DirectLight, SurfaceLight, light_colors, seen_light
from research.virtual_rooms.day_light import relative_radiance
from research.virtual_rooms.frame_camera import FramePlan, Shining, write_frames
from research.virtual_rooms.gloss_light import Gloss
from research.virtual_rooms.phone import ScannedShape
from research.virtual_rooms.room_plan import CameraSection, RoomPlan
from research.virtual_rooms.true_room import TrueRoom

LAMP_FRAMES, LAMP_EXPOSURE_RANGE = 6, 7.0  # [1] of looks at each lamp; of log exposure: 1/8000 s, ISO 32 to 1/60 s, 200
FRAMES, GAINS, FACE_LIGHT, GLOSS = "frames", "gains.csv", "face-light.npy", "gloss.csv"
# Specularity and roughness of the glossy rooms' materials, by seed; polished, usual and silk-matt finishes.
GLOSSES = (
    {"linoleum": (0.04, 0.12), "beech": (0.05, 0.08), "green lacquer": (0.04, 0.1)},
    {"linoleum": (0.06, 0.2), "beech": (0.03, 0.12), "green lacquer": (0.05, 0.06)},
    {"linoleum": (0.025, 0.07), "beech": (0.06, 0.18), "green lacquer": (0.03, 0.15)},
)


def frames_besides(
    scene: str, case: Case, folder: Path, *, seed: int, count: int, at_lamps: bool = False, glossy: bool = False
) -> Besides:
    """What makes the frames of a scan, from its shape and light."""

    def besides(
        plan: RoomPlan, room: TrueRoom, shape: ScannedShape, atlas: Atlas, light: SurfaceLight, direct: DirectLight
    ) -> None:
        generator = np.random.default_rng(seed + 2000)
        camera = plan.file.camera.model_copy(update={"exposure_spread": 0.0})
        texture, surface = seen_light(room, shape, atlas, light, direct, camera, generator)
        lobes = _lobes(room, seed) if glossy else {}
        for number, (specularity, _) in lobes.items():
            texture[surface == number] *= _scattered_share(room, number, specularity, light, camera)
        sky = np.zeros(surface.shape, dtype=np.bool_)
        for number, sent in _shining(scene, case, plan, room, folder, light).items():
            color = light_colors(np.ones((1, sent.size)), light, sent[None], camera)[0, 0]
            texture[surface == number] = color
            sky |= (surface == number) & room.surfaces[number].part.startswith(WINDOW)
        gloss = None
        if glossy:
            sends = {room.surfaces[number].lamp: texture[surface == number][:1] for number in range(len(room.surfaces))}
            gloss = _gloss(plan, folder, room, shape, atlas, surface, lobes, sends)
            write_gloss(folder / GLOSS, room, lobes)
        np.save(folder / FACE_LIGHT, mean_texture_colors(texture.astype(np.float32), atlas.corner_uv))
        gains = write_frames(
            folder / FRAMES, room, shape, atlas, Shining(texture=texture.astype(np.float32), sky=sky, gloss=gloss),
            plan_of(count, camera.tone, at_lamps=at_lamps), relative_radiance, generator,
            layout="3dscanner" if seed % 2 else "polycam",
        )  # fmt: skip
        lines = ["red,green,blue", *(",".join(f"{value:.5g}" for value in row) for row in gains)]
        (folder / GAINS).write_text("\n".join(lines) + "\n", encoding="utf-8")

    return besides


def _lobes(room: TrueRoom, seed: int) -> dict[int, tuple[float, float]]:
    """Specularity and roughness of the room's surfaces that are glossy with this seed, by their number."""
    named = GLOSSES[(seed - 1) % len(GLOSSES)]
    materials = [room.materials[surface.material].name for surface in room.surfaces]
    return {number: named[name] for number, name in enumerate(materials) if name in named}


def _scattered_share(
    room: TrueRoom, number: int, specularity: float, light: SurfaceLight, camera: CameraSection
) -> FloatArray:
    """(3,) share of a glossy surface's reflectance, in linear colour, that is scattered (Radiance's plastic)."""
    whole = room.materials[room.surfaces[number].material].reflectance.at(light.wavelengths_nm, outside="nearest")
    both = np.stack([whole, np.maximum(whole - specularity, 0.0)])
    color = light_colors(both, light, light.irradiance.mean(axis=0)[None], camera)[0]
    return np.asarray(color[1] / np.maximum(color[0], 1e-9), dtype=np.float64)


def _gloss(
    plan: RoomPlan,
    folder: Path,
    room: TrueRoom,
    shape: ScannedShape,
    atlas: Atlas,
    surface: IntArray,
    lobes: dict[int, tuple[float, float]],
    sends: "dict[str | None, np.ndarray[tuple[int, ...], np.dtype[np.float64]]]",
) -> Gloss:
    """The gloss of a shape's texels, their true normals, and the lamps with what their plates send."""
    lobe = np.zeros((*surface.shape, 2), dtype=np.float32)
    for number, values in lobes.items():
        lobe[surface == number] = values
    rows, columns = np.nonzero(lobe[:, :, 0] > 0)
    face = atlas.texel_face[rows, columns]
    points = np.einsum("nk,nkc->nc", atlas.barycentric(rows, columns), shape.vertices[shape.faces[face]])
    true_face = room.nearest_faces(points, atlas.chart_normal[atlas.face_chart[face]])
    normal = np.zeros((*surface.shape, 3), dtype=np.float32)
    normal[rows, columns] = room.normals[true_face]
    lamps = resolve_lamps(plan.file.lamps, folder)
    shining = np.isin(surface, [number for number, each in enumerate(room.surfaces) if each.lamp is not None])
    return Gloss(
        lobe=lobe,
        normal=normal,
        lamps=tuple(LampPieces.of(lamp) for lamp in lamps),
        radiosity=np.concatenate([sends[lamp.name] for lamp in lamps]),
        shining=shining,
    )


def write_gloss(path: Path, room: TrueRoom, lobes: dict[int, tuple[float, float]]) -> None:
    """Write the true gloss of each material."""
    named = {room.materials[room.surfaces[number].material].name: values for number, values in lobes.items()}
    lines = ["material,specularity,roughness", *(f"{name},{s},{alpha}" for name, (s, alpha) in sorted(named.items()))]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


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
    openings = iter(openings_of(FLUX_RATIO[scene], case, plan, folder, light.wavelengths_nm))
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
    parser.add_argument("--gloss", action="store_true", help="with glossy floor, desks and cabinet")
    parser.add_argument("--lamps", action="store_true", help="look straight at each lamp, too")
    given = parser.parse_args(arguments)
    for scene in given.scene:
        for name in given.case:
            for seed in given.seed:
                case, folder = (
                    CASES[name],
                    given.folder / f"{scene}-{name}-{seed}{'-lamps' * given.lamps}{'-gloss' * given.gloss}",
                )
                besides = frames_besides(
                    scene, case, folder, seed=seed, count=given.frames, at_lamps=given.lamps, glossy=given.gloss
                )
                built = build_by_day(scene, case, folder, seed=seed, besides=besides)
                print(f"{built.file}: {built.words}", flush=True)


if __name__ == "__main__":
    main()
