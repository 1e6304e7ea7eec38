"""Small captures in the layouts of apps: a box of a room, seen by a phone that turns in its middle."""

import io
import json
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import trimesh
from PIL import Image
from scipy.spatial.transform import Rotation

from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import bare_scan

SIZE_PX, FOCAL_PX = (96, 72), 60.0
GPS: dict[str, Any] = {"latitude": 48.137, "longitude": 11.575, "title": "Anna's flat", "device": "iPhone of Anna"}


@dataclass(frozen=True, kw_only=True)
class Shot:
    """One frame to be written: camera-to-world pose with y up, encoded picture, depth [m], exposure [s], ISO."""

    pose: np.ndarray
    picture: bytes
    depth: np.ndarray
    exposure_s: float = 1 / 60
    iso: float = 100.0


def box_room() -> trimesh.Trimesh:
    """4 m x 2.6 m x 3 m, y up, in triangles of up to half a metre that face the room."""
    box = trimesh.creation.box(extents=(4.0, 2.6, 3.0))
    vertices, faces = trimesh.remesh.subdivide_to_size(box.vertices, box.faces, max_edge=0.5)
    room = trimesh.Trimesh(vertices, faces, process=False)
    room.invert()
    return room


def turning_pose(yaw_deg: float, pitch_deg: float, position: Sequence[float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """Camera-to-world: x right, y up, looking along -z, turned about y and then raised."""
    yaw, pitch = np.radians([yaw_deg, pitch_deg])
    turn = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    rise = np.array([[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn @ rise, position
    return pose


def seen_faces(room: trimesh.Trimesh, pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(row, column) number of the face that each pixel shows, and its depth along the axis [m]."""
    columns, rows = np.meshgrid(np.arange(SIZE_PX[0]) + 0.5, np.arange(SIZE_PX[1]) + 0.5)
    x, y = (columns - SIZE_PX[0] / 2) / FOCAL_PX, -(rows - SIZE_PX[1] / 2) / FOCAL_PX
    ways = np.stack([x, y, -np.ones_like(x)], axis=-1).reshape(-1, 3) @ pose[:3, :3].T
    hits = RayCaster(bare_scan(room.vertices, room.faces)).nearest(np.broadcast_to(pose[:3, 3], ways.shape), ways)
    return hits.face.reshape(columns.shape), hits.distance.reshape(columns.shape)


def jpeg(image: np.ndarray) -> bytes:
    """With a place on Earth in its EXIF, as phones write it."""
    exif = Image.Exif()
    exif.get_ifd(0x8825)[2] = (48.0, 8.0, 13.2)
    data = io.BytesIO()
    Image.fromarray(image).save(data, format="JPEG", quality=95, exif=exif)
    return data.getvalue()


def gray_shots(room: trimesh.Trimesh, count: int = 6) -> list[Shot]:
    """A turn in the room's middle, everything gray."""
    shots = []
    for number in range(count):
        pose = turning_pose(360.0 * number / count, 0.0, (0.05 * number, 0.0, 0.0))
        picture = jpeg(np.full((SIZE_PX[1], SIZE_PX[0], 3), 128, dtype=np.uint8))
        shots.append(Shot(pose=pose, picture=picture, depth=seen_faces(room, pose)[1]))
    return shots


def png(values: np.ndarray) -> bytes:
    """A single-channel PNG."""
    data = io.BytesIO()
    Image.fromarray(values).save(data, format="PNG")
    return data.getvalue()


def write_3dscanner(folder: Path, room: trimesh.Trimesh, shots: Sequence[Shot]) -> Path:
    """3D Scanner App's "All data"."""
    folder.mkdir(parents=True, exist_ok=True)
    for number, shot in enumerate(shots):
        about = {
            "time": 1000.0 + 0.5 * number,
            "exposureDuration": shot.exposure_s,
            "cameraPoseARFrame": shot.pose.ravel().tolist(),
            "intrinsics": [FOCAL_PX, 0, SIZE_PX[0] / 2, 0, FOCAL_PX, SIZE_PX[1] / 2, 0, 0, 1],
            **GPS,
        }
        (folder / f"frame_{number:05d}.json").write_text(json.dumps(about), encoding="utf-8")
        (folder / f"frame_{number:05d}.jpg").write_bytes(shot.picture)
        (folder / f"depth_{number:05d}.png").write_bytes(png(_millimetres(shot)))
        (folder / f"conf_{number:05d}.png").write_bytes(png(np.full((18, 24), 2, dtype=np.uint8)))
    (folder / "info.json").write_text(json.dumps(GPS), encoding="utf-8")
    (folder / "export.obj").write_text(trimesh.exchange.obj.export_obj(room), encoding="utf-8")
    return folder


def write_polycam(folder: Path, room: trimesh.Trimesh, shots: Sequence[Shot], alignment: np.ndarray) -> Path:
    """Polycam's raw data, the mesh turned by an alignment."""
    for number, shot in enumerate(shots):
        stem = f"{1_000_000 + 500_000 * number}"
        about: dict[str, Any] = dict(GPS)
        about |= {f"t_{row}{column}": float(shot.pose[row, column]) for row in range(3) for column in range(4)}
        about |= {"fx": FOCAL_PX, "fy": FOCAL_PX, "cx": SIZE_PX[0] / 2, "cy": SIZE_PX[1] / 2}
        about |= {"width": SIZE_PX[0], "height": SIZE_PX[1], "exposure_time": shot.exposure_s, "iso": shot.iso}
        files = {
            "cameras": (f"{stem}.json", json.dumps(about).encode()),
            "images": (f"{stem}.jpg", shot.picture),
            "depth": (f"{stem}.png", png(_millimetres(shot))),
            "confidence": (f"{stem}.png", png(np.full((18, 24), 255, dtype=np.uint8))),
        }
        for name, (file, content) in files.items():
            (folder / "keyframes" / name).mkdir(parents=True, exist_ok=True)
            (folder / "keyframes" / name / file).write_bytes(content)
    turned = room.copy()
    turned.apply_transform(alignment)
    (folder / "raw.glb").write_bytes(turned.export(file_type="glb"))
    (folder / "mesh_info.json").write_text(json.dumps({"alignmentTransform": alignment.T.ravel().tolist()}))
    return folder


def round_shots(room: trimesh.Trimesh, count: int = 24) -> list[Shot]:
    """A walk in the room's middle that looks at walls, floor and ceiling."""
    shots = []
    for number in range(count):
        turn = 2 * np.pi * number / count
        pose = turning_pose(720.0 * number / count, (-55.0, 0.0, 55.0)[number % 3], (np.cos(turn), 0.0, np.sin(turn)))
        picture = jpeg(np.full((SIZE_PX[1], SIZE_PX[0], 3), 128, dtype=np.uint8))
        shots.append(Shot(pose=pose, picture=picture, depth=seen_faces(room, pose)[1]))
    return shots


def write_record3d(path: Path, shots: Sequence[Shot]) -> Path:
    """Record3D's archive; the depth at the picture's own size."""
    import lzfse

    about: dict[str, Any] = dict(GPS)
    about |= {"w": SIZE_PX[0], "h": SIZE_PX[1], "dw": SIZE_PX[0], "dh": SIZE_PX[1], "fps": 2}
    about["poses"] = [
        [*Rotation.from_matrix(shot.pose[:3, :3]).as_quat().tolist(), *shot.pose[:3, 3].tolist()] for shot in shots
    ]
    about["perFrameIntrinsicCoeffs"] = [[FOCAL_PX, FOCAL_PX, SIZE_PX[0] / 2, SIZE_PX[1] / 2]] * len(shots)
    about["K"] = [FOCAL_PX, 0, 0, 0, FOCAL_PX, 0, SIZE_PX[0] / 2, SIZE_PX[1] / 2, 1]  # column by column
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("metadata", json.dumps(about))
        for number, shot in enumerate(shots):
            archive.writestr(f"rgbd/{number}.jpg", shot.picture)
            archive.writestr(f"rgbd/{number}.depth", lzfse.compress(shot.depth.astype("<f4").tobytes()))
            archive.writestr(f"rgbd/{number}.conf", lzfse.compress(np.full(shot.depth.shape, 2, np.uint8).tobytes()))
    return path


def write_stray(folder: Path, shots: Sequence[Shot]) -> Path:
    """Stray Scanner's folder: the pictures as a video, poses in axes of computer vision."""
    for name in ("depth", "confidence"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    video = cv2.VideoWriter(str(folder / "rgb.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), 2.0, SIZE_PX)
    lines = ["timestamp, frame, x, y, z, qx, qy, qz, qw"]
    for number, shot in enumerate(shots):
        video.write(np.asarray(Image.open(io.BytesIO(shot.picture)))[:, :, ::-1].copy())
        turned: list[float] = Rotation.from_matrix(shot.pose[:3, :3] @ np.diag([1.0, -1.0, -1.0])).as_quat().tolist()
        values = ", ".join(f"{value:.8f}" for value in (*shot.pose[:3, 3], *turned))
        lines.append(f"{100.0 + 0.5 * number:.3f}, {number:06d}, {values}")
        (folder / "depth" / f"{number:06d}.png").write_bytes(png(np.rint(1000 * shot.depth).astype(np.uint16)))
        (folder / "confidence" / f"{number:06d}.png").write_bytes(png(np.full(shot.depth.shape, 2, np.uint8)))
    video.release()
    (folder / "odometry.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    matrix: list[list[float]] = [[FOCAL_PX, 0, SIZE_PX[0] / 2], [0, FOCAL_PX, SIZE_PX[1] / 2], [0, 0, 1]]
    text = "\n".join(",".join(str(value) for value in row) for row in matrix)
    (folder / "camera_matrix.csv").write_text(text + "\n", encoding="utf-8")
    return folder


def _millimetres(shot: Shot) -> np.ndarray:
    rows, columns = np.arange(2, SIZE_PX[1], 4), np.arange(2, SIZE_PX[0], 4)
    return np.rint(1000.0 * shot.depth[np.ix_(rows, columns)]).astype(np.uint16)
