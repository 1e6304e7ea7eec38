"""The frames of a virtual phone: pictures along a walk, exposed anew, with noise, vignetting and wrong poses.

The camera looks at the scanned shape, whose every texel sends the light that the true surface sends there; lamps and
windows send theirs, far above white. Where the shape has a hole, the room has none: the camera sees the true surface,
and the LiDAR measures nothing. Each frame is exposed for what it shows, lags behind as a phone does, and its
white balance wanders. What is written beside it is the pose with an error, and depth with noise: in the layout of
3D Scanner App (the exposure's ISO untold) or of Polycam (exposure time and ISO told).
"""

import io
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from PIL import Image
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import bare_scan
from lidarspectra.geometry.textures import sample_image
from lidarspectra.hardware.phone.orientation import upright_rotation
from lidarspectra.hardware.phone.texture_atlas import Atlas
from lidarspectra.spectra.colorimetry import encode_srgb
from research.virtual_rooms.camera import SIDE_WEIGHT_M, tone_curve
from research.virtual_rooms.gloss_light import Gloss, thrown_back
from research.virtual_rooms.pane_light import ShownPanes
from research.virtual_rooms.phone import ScannedShape
from research.virtual_rooms.true_room import TrueRoom

Layout = Literal["3dscanner", "polycam"]
WIDTH_PX, HEIGHT_PX, FOCAL_PX = 640, 480, 483.0  # [px] a phone's 1920 x 1440 and 1448 over three
DEPTH_PX = (192, 256)  # [px] rows and columns
PATH_HEIGHT_M, PATH_REACH = 1.45, 0.3  # [m], [1] of the room's extent
LAPS, FRAMES_PER_SWEEP = 2, 12  # around the room; from floor to ceiling and back
PITCH_DEG = (-50.0, 62.0)  # [deg] of a sweep
FRAME_S = 0.5  # [s] between frames
EXPOSED_SHARE, EXPOSED_LEVEL = 0.9, 0.75  # [1] the radiance that this share of a frame does not pass gets this level
EXPOSURE_LAG = 0.5  # [1] of the log of the last frame's exposure in this one's
EXPOSURE_RANGE = 2.5  # [1] of the log of exposure about the median frame's
TEXEL_STEP = 4  # of the shape's texels, those by which the light behind its holes is told
OTHER_PART_M = 1e3  # [m] beyond any room: what that far apart is another part of it
LAMP_AWAY_M = (0.9, 0.35)  # [m] from a lamp that is looked at straight, along its axis and beside it
BALANCE_STEP = 0.015  # [1] of the log of red and blue over green from frame to frame
BALANCE_RETURN = 0.9  # [1] of it that stays
VIGNETTING = -0.12  # [1] log of light in a corner: most of a phone's is corrected
NOISE, SHOT_NOISE = 0.003, 0.004  # [1] of white, and of its root
BLUR_PX = 0.7  # [px] mean of the motion blur's deviation
JPEG_QUALITY = 90
DEPTH_NOISE, DEPTH_BIAS = 0.008, 0.004  # [1] of depth, pixel by pixel and frame by frame
EXPOSURE_UNSURE = 0.02  # [1] of the exposure that is told
BASE_EXPOSURE_S, BASE_ISO = 1 / 60, 200.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Shining:
    """What the scanned shape sends.

    Parameters
    ----------
    texture : (size, size, 3) float32
        Radiosity in linear colour, in any one unit.
    sky : (size, size) bool
        Where it is a window, whose radiance depends on the direction.
    gloss : Gloss, optional
        How glossy it is; matt everywhere if left out.
    panes : ShownPanes, optional
        Its mirrors and panes of glass.
    """

    texture: "np.ndarray[tuple[int, ...], np.dtype[np.float32]]"
    sky: "np.ndarray[tuple[int, ...], np.dtype[np.bool_]]"
    gloss: Gloss | None = None
    panes: ShownPanes | None = None


@dataclass(frozen=True, kw_only=True)
class FramePlan:
    """How frames are taken.

    Parameters
    ----------
    count : int
        Of frames.
    tone : float
        Strength of the tone curve.
    pose_m, pose_deg : float
        Root mean square of the poses' errors. [m], [deg]
    lamp_frames : int
        At the end of the walk, straight at each lamp from a metre away.
    exposure_range : float
        Of the log of exposure about the median frame's. [1]
    """

    count: int = 120
    tone: float = 0.6
    pose_m: float = 0.01
    pose_deg: float = 0.5
    lamp_frames: int = 0
    exposure_range: float = EXPOSURE_RANGE


def write_frames(
    folder: Path,
    room: TrueRoom,
    shape: ScannedShape,
    atlas: Atlas,
    shining: Shining,
    plan: FramePlan,
    sky: Callable[[FloatArray], FloatArray],
    generator: np.random.Generator,
    *,
    layout: Layout = "3dscanner",
    poses: Sequence[FloatArray] = (),
) -> FloatArray:
    """Take and write the frames of a walk.

    Parameters
    ----------
    folder : Path
        Made; the app's layout begins in it.
    room : TrueRoom
        In whose air the walk is.
    shape : ScannedShape
    atlas : Atlas
        Of the shape.
    shining : Shining
    plan : FramePlan
    sky : callable
        From the (n,) sines of elevation of directions out of a window to the radiance over the texture's.
    generator : numpy.random.Generator
    layout : str
    poses : sequence of (4, 4) float
        Camera to world, z up, in place of the walk around the room.

    Returns
    -------
    gain : (frame, 3) float
        True gains, over the texture's unit.
    """
    caster = RayCaster(bare_scan(shape.vertices, shape.faces))
    poses = list(poses) or _walk(room, plan.count, generator) + _looks_at_lamps(room, plan.lamp_frames)
    eye = _Eye(caster=caster, atlas=atlas, shining=shining, sky=sky, holes=_BehindHoles.of(room, shape, atlas, shining))
    seen = [_look(pose, eye, generator) for pose in poses]
    gain = _gains([light for light, _ in seen], plan.exposure_range, generator)
    write = _write_3dscanner if layout == "3dscanner" else _write_polycam
    folder.mkdir(parents=True, exist_ok=True)
    for number, (pose, (light, depth)) in enumerate(zip(poses, seen, strict=True)):
        picture = _picture(light * gain[number], plan.tone, generator)
        told = _with_error(pose, plan, generator)
        write(folder, number, _y_up(told), picture, _lidar(depth, generator), _told_exposure(gain[number], generator))
    _write_mesh(folder, shape, layout)
    return gain


def _walk(room: TrueRoom, count: int, generator: np.random.Generator) -> list[FloatArray]:
    """Camera-to-world poses, z up, of a phone held upright that sweeps from floor to ceiling along the walls."""
    low, high = room.vertices.min(axis=0), room.vertices.max(axis=0)
    middle, reach = 0.5 * (low + high), PATH_REACH * (high - low)
    poses = []
    for number in range(count):
        angle = 2 * np.pi * LAPS * number / count
        position = np.array(
            [middle[0] + reach[0] * np.cos(angle), middle[1] + reach[1] * np.sin(angle), low[2] + PATH_HEIGHT_M]
        )
        if not room.in_air(position[None])[0]:
            continue
        # Across the room on one lap, along the near wall on the next: walls are seen from far and near.
        lap = int(LAPS * number / count)
        heading = angle + (np.pi if lap % 2 == 0 else 0.0) + generator.normal(scale=0.1)
        phase = 0.5 - 0.5 * np.cos(2 * np.pi * number / FRAMES_PER_SWEEP)
        pitch = np.radians(PITCH_DEG[0] + phase * (PITCH_DEG[1] - PITCH_DEG[0]))
        poses.append(upright_pose(position, heading, pitch))
    return poses


def upright_pose(position: FloatArray, heading: float, pitch: float) -> FloatArray:
    """(4, 4) camera to world, z up, of a phone that is held upright at a (3,) position [m]; angles [rad]."""
    ahead = np.array([np.cos(pitch) * np.cos(heading), np.cos(pitch) * np.sin(heading), np.sin(pitch)])
    side = np.array([np.sin(heading), -np.cos(heading), 0.0])
    above = np.cross(side, ahead)
    # The sensor's rows run upright in a phone that is held upright: camera x down, y to the right.
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1], pose[:3, 2] = -above, side, -ahead
    pose[:3, 3] = position
    return pose


@dataclass(frozen=True, kw_only=True, eq=False)
class _BehindHoles:
    """The true surface, which a camera sees where the scanned shape has a hole, and the texels whose light it has."""

    caster: RayCaster
    face_surface: IntArray
    texel: IntArray
    places: cKDTree

    @classmethod
    def of(cls, room: TrueRoom, shape: ScannedShape, atlas: Atlas, shining: Shining) -> "_BehindHoles":
        rows, columns = (each[::TEXEL_STEP] for each in np.nonzero(atlas.covered))
        face = atlas.texel_face[rows, columns]
        points = np.einsum("nk,nkc->nc", atlas.barycentric(rows, columns), shape.vertices[shape.faces[face]])
        true_face = room.nearest_faces(points, atlas.chart_normal[atlas.face_chart[face]])
        return cls(
            caster=RayCaster(room.scan),
            face_surface=room.face_surface,
            texel=np.stack([rows, columns], axis=1),
            places=cKDTree(_alike(points, room.normals[true_face], room.face_surface[true_face])),
        )

    def texels(self, start: FloatArray, ways: FloatArray) -> tuple[IntArray, IntArray]:
        """(m, 2) nearest texel of the same part of the room that the (m,) of some rays meet; the others meet none."""
        hits = self.caster.nearest(start, ways)
        front = np.flatnonzero(hits.met & (np.einsum("nc,nc->n", self.caster.normals[hits.face], ways) < 0))
        face = hits.face[front]
        points = start[front] + hits.distance[front, None] * ways[front]
        away, index = self.places.query(_alike(points, self.caster.normals[face], self.face_surface[face]))
        of_part = away < OTHER_PART_M
        return self.texel[index[of_part]], front[of_part]


def _alike(points: FloatArray, normals: FloatArray, surface: IntArray) -> FloatArray:
    """(n, 7) coordinates in which points of one part of the room that look the same way are near one another [m]."""
    return np.column_stack([points, SIDE_WEIGHT_M * normals, OTHER_PART_M * surface])


@dataclass(frozen=True, kw_only=True, eq=False)
class _Eye:
    """What a camera looks at."""

    caster: RayCaster
    atlas: Atlas
    shining: Shining
    sky: Callable[[FloatArray], FloatArray]
    holes: _BehindHoles

    def sees(
        self, start: FloatArray, ways: FloatArray, *, lamps: bool = True
    ) -> tuple[FloatArray, FloatArray, IntArray, IntArray]:
        """(n, 3) light, (n,) distance over the ways' lengths, (m, 2) texels, and the (m,) ways that meet a front."""
        hits = self.caster.nearest(start, ways)
        front = np.flatnonzero(hits.met & (np.einsum("nc,nc->n", self.caster.normals[hits.face], ways) < 0))
        light, shining, size = np.zeros((len(ways), 3)), self.shining, self.atlas.size_px
        uv = np.einsum("nk,nkc->nc", hits.barycentric[front], self.atlas.corner_uv[hits.face[front]])
        light[front] = sample_image(shining.texture, uv)
        texel = np.clip(np.stack([1.0 - uv[:, 1], uv[:, 0]], axis=1) * size, 0, size - 1).astype(np.int64)
        is_sky = shining.sky[texel[:, 0], texel[:, 1]]
        out = front[is_sky]
        light[out] *= self.sky(ways[out, 2] / np.linalg.norm(ways[out], axis=1))[:, None]
        if not lamps and shining.gloss is not None:
            light[front[shining.gloss.shining[texel[:, 0], texel[:, 1]]]] = 0.0
        distance = np.zeros(len(ways))
        distance[front] = hits.distance[front]
        missed = np.setdiff1d(np.arange(len(ways)), front, assume_unique=True)
        light[missed] = self._through_holes(start[missed], ways[missed], lamps=lamps)
        return light, distance, texel, front

    def _through_holes(self, start: FloatArray, ways: FloatArray, *, lamps: bool) -> FloatArray:
        """(n, 3) light of the true surface, along rays that no front of the shape stops."""
        light, shining = np.zeros((len(ways), 3)), self.shining
        (row, column), met = (each.T for each in self.holes.texels(start, ways))
        light[met] = shining.texture[row, column]
        out = met[shining.sky[row, column]]
        light[out] *= self.sky(ways[out, 2] / np.linalg.norm(ways[out], axis=1))[:, None]
        if not lamps and shining.gloss is not None:
            light[met[shining.gloss.shining[row, column]]] = 0.0
        return light

    def glossy(
        self, start: FloatArray, ways: FloatArray, distance: FloatArray, texel: IntArray, generator: np.random.Generator
    ) -> FloatArray:
        """(m, 3) light that the surfaces met throw back."""
        gloss = self.shining.gloss
        if gloss is None:
            return np.zeros((len(ways), 3))
        row, column = texel.T
        light = np.zeros((len(ways), 3))
        some = np.flatnonzero(gloss.lobe[row, column, 0] > 0)
        row, column = row[some], column[some]
        light[some] = thrown_back(
            start[some] + distance[some, None] * ways[some],
            -ways[some] / np.linalg.norm(ways[some], axis=1, keepdims=True),
            gloss.normal[row, column].astype(np.float64), gloss.lobe[row, column].astype(np.float64), gloss,
            self.caster,
            lambda origin, way: self.sees(origin, way, lamps=False)[0], generator,
        )  # fmt: skip
        return light


def _look(pose: FloatArray, eye: _Eye, generator: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """(row, column, 3) light and (row, column) depth along the axis [m]; 0 where the shape has a hole."""
    columns, rows = np.meshgrid(np.arange(WIDTH_PX) + 0.5, np.arange(HEIGHT_PX) + 0.5)
    x, y = (columns - WIDTH_PX / 2) / FOCAL_PX, -(rows - HEIGHT_PX / 2) / FOCAL_PX
    ways = np.stack([x, y, -np.ones_like(x)], axis=-1).reshape(-1, 3) @ pose[:3, :3].T
    start = np.broadcast_to(pose[:3, 3], ways.shape)
    light, depth, texel, front = eye.sees(start, ways)
    light[front] += eye.glossy(start[front], ways[front], depth[front], texel, generator)
    if (panes := eye.shining.panes) is not None:
        light, beyond, met = panes.seen(start, ways, eye.sees)
        shape = (HEIGHT_PX, WIDTH_PX)
        depth = panes.lidar(depth.reshape(shape), beyond.reshape(shape), met.reshape(shape), generator)
    return light.reshape(HEIGHT_PX, WIDTH_PX, 3), depth.reshape(HEIGHT_PX, WIDTH_PX)


def _looks_at_lamps(room: TrueRoom, count: int) -> list[FloatArray]:
    """Camera-to-world poses, z up: some straight at each lamp from around it, where the room has air."""
    poses = []
    for number, surface in enumerate(room.surfaces):
        if surface.lamp is None:
            continue
        member = room.face_surface == number
        center, normal = room.scan.centers[member].mean(axis=0), room.normals[member].mean(axis=0)
        for each in range(count):
            turn = 2 * np.pi * each / count
            beside = np.cross(normal, (np.cos(turn), np.sin(turn), 0.3))
            position = center + LAMP_AWAY_M[0] * normal + LAMP_AWAY_M[1] * beside / np.linalg.norm(beside)
            if room.in_air(position[None])[0]:
                ahead = (center - position) / np.linalg.norm(center - position)
                side = np.cross(ahead, (np.cos(turn), np.sin(turn), 0.1))
                side /= np.linalg.norm(side)
                pose = np.eye(4)
                pose[:3, 0], pose[:3, 1], pose[:3, 2], pose[:3, 3] = side, np.cross(side, ahead), -ahead, position
                poses.append(pose)
    return poses


def _gains(seen: list[FloatArray], reach: float, generator: np.random.Generator) -> FloatArray:
    """(frame, 3) gains of an automatic exposure that lags, and of a white balance that wanders."""
    wanted = np.array([EXPOSED_LEVEL / np.quantile(light.max(axis=2), EXPOSED_SHARE) for light in seen])
    middle = float(np.median(np.log(wanted)))
    log, balance = float(np.log(wanted[0])), np.zeros(3)
    gains = []
    for each in wanted:
        target = float(np.clip(np.log(each), middle - reach, middle + reach))
        log = EXPOSURE_LAG * log + (1.0 - EXPOSURE_LAG) * target
        balance = BALANCE_RETURN * balance + generator.normal(scale=BALANCE_STEP, size=3) * (1.0, 0.0, 1.0)
        gains.append(np.exp(log + balance))
    return np.array(gains)


def _picture(exposed: FloatArray, tone: float, generator: np.random.Generator) -> bytes:
    """JPEG of exposed light: vignetting, motion blur, noise, cut at white, tone curve."""
    rows, columns = np.indices(exposed.shape[:2])
    radius2 = ((rows - HEIGHT_PX / 2) ** 2 + (columns - WIDTH_PX / 2) ** 2) / (0.25 * (HEIGHT_PX**2 + WIDTH_PX**2))
    light = exposed * np.exp(VIGNETTING * radius2)[..., None]
    turn, length = generator.uniform(0, np.pi), generator.exponential(BLUR_PX)
    size = 2 * int(np.ceil(3 * length)) + 1
    across = np.arange(size) - size // 2
    kernel = np.exp(-0.5 * ((np.cos(turn) * across + np.sin(turn) * across[:, None]) / max(length, 0.05)) ** 2)
    kernel *= np.exp(-0.5 * ((np.sin(turn) * across - np.cos(turn) * across[:, None]) / 0.3) ** 2)
    light = cv2.filter2D(light, -1, kernel / kernel.sum())
    light = light + generator.normal(size=light.shape) * np.hypot(NOISE, SHOT_NOISE * np.sqrt(np.maximum(light, 0.0)))
    shown = encode_srgb(tone_curve(np.clip(light, 0.0, 1.0), tone))
    data = io.BytesIO()
    Image.fromarray(np.rint(255.0 * shown).astype(np.uint8)).save(data, format="JPEG", quality=JPEG_QUALITY)
    return data.getvalue()


def _with_error(pose: FloatArray, plan: FramePlan, generator: np.random.Generator) -> FloatArray:
    told = pose.copy()
    turn = Rotation.from_rotvec(np.radians(plan.pose_deg) / np.sqrt(3.0) * generator.normal(size=3)).as_matrix()
    told[:3, :3] = turn @ pose[:3, :3]
    told[:3, 3] += plan.pose_m / np.sqrt(3.0) * generator.normal(size=3)
    return told


def _y_up(pose: FloatArray) -> FloatArray:
    """The same pose in axes with y up, as ARKit has them."""
    turned = np.eye(4)
    turned[:3] = upright_rotation("+y").T @ pose[:3]
    return turned


def _lidar(depth: FloatArray, generator: np.random.Generator) -> tuple[bytes, bytes]:
    """PNG of depth [mm] and of confidence, at the LiDAR's resolution."""
    small = cv2.resize(depth, DEPTH_PX[::-1], interpolation=cv2.INTER_NEAREST)
    factor = 1.0 + DEPTH_BIAS * generator.normal() + DEPTH_NOISE * generator.normal(size=small.shape)
    millimetres = np.clip(1000.0 * small * factor, 0, 65535).astype(np.uint16)
    edge = cv2.Laplacian(small, cv2.CV_64F)
    sure = np.where(small <= 0, 0, np.where(np.abs(edge) > 0.05 * small, 1, 2)).astype(np.uint8)
    return _png(millimetres), _png(sure)


def _png(values: "np.ndarray[tuple[int, ...], np.dtype[np.integer]]") -> bytes:
    data = io.BytesIO()
    Image.fromarray(values).save(data, format="PNG")
    return data.getvalue()


def _told_exposure(gain: FloatArray, generator: np.random.Generator) -> float:
    return float(gain[1] * np.exp(EXPOSURE_UNSURE * generator.normal()))


def _write_3dscanner(
    folder: Path, number: int, pose: FloatArray, picture: bytes, lidar: tuple[bytes, bytes], exposure: float
) -> None:
    about = {
        "frame_index": number,
        "time": FRAME_S * number,
        "exposureDuration": BASE_EXPOSURE_S,
        "cameraPoseARFrame": pose.ravel().tolist(),
        "intrinsics": [FOCAL_PX, 0, WIDTH_PX / 2, 0, FOCAL_PX, HEIGHT_PX / 2, 0, 0, 1],
    }
    (folder / f"frame_{number:05d}.json").write_text(json.dumps(about), encoding="utf-8")
    (folder / f"frame_{number:05d}.jpg").write_bytes(picture)
    (folder / f"depth_{number:05d}.png").write_bytes(lidar[0])
    (folder / f"conf_{number:05d}.png").write_bytes(lidar[1])


def _write_polycam(
    folder: Path, number: int, pose: FloatArray, picture: bytes, lidar: tuple[bytes, bytes], exposure: float
) -> None:
    stem = f"{1_000_000 + round(1e6 * FRAME_S * number)}"
    about = {f"t_{row}{column}": float(pose[row, column]) for row in range(3) for column in range(4)}
    about |= {"fx": FOCAL_PX, "fy": FOCAL_PX, "cx": WIDTH_PX / 2, "cy": HEIGHT_PX / 2}
    about |= {"width": WIDTH_PX, "height": HEIGHT_PX, "blur_score": 100.0}
    about |= {"exposure_time": BASE_EXPOSURE_S, "iso": BASE_ISO * exposure}
    sure = np.asarray(Image.open(io.BytesIO(lidar[1]))).astype(np.int64) * 127.5
    files = {
        "cameras": (f"{stem}.json", json.dumps(about).encode()),
        "images": (f"{stem}.jpg", picture),
        "depth": (f"{stem}.png", lidar[0]),
        "confidence": (f"{stem}.png", _png(sure.astype(np.uint8))),
    }
    for name, (file, content) in files.items():
        (folder / "keyframes" / name).mkdir(parents=True, exist_ok=True)
        (folder / "keyframes" / name / file).write_bytes(content)


def _write_mesh(folder: Path, shape: ScannedShape, layout: Layout) -> None:
    """The app's mesh, without colour, in the axes of the poses."""
    vertices: FloatArray = shape.vertices @ upright_rotation("+y")
    faces: IntArray = shape.faces
    if layout == "polycam":
        import trimesh

        mesh = trimesh.Trimesh(vertices, faces, process=False)
        mesh.export(folder / "raw.glb")
        (folder / "mesh_info.json").write_text(json.dumps({"alignmentTransform": np.eye(4).ravel().tolist()}))
        return
    lines = [f"v {x:.4f} {y:.4f} {z:.4f}" for x, y, z in vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in faces + 1]
    (folder / "export.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")
