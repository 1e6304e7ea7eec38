"""Rooms made by hand: boxes of small noisy triangles, with a painted ceiling and painted walls."""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from lidarspectra.geometry.scan import Appearance, Scan, ScanRecord

Floats = NDArray[np.float64]
WHITE = (150, 150, 148)
SIDES = ("bottom", "top", "south", "north", "west", "east")


def paint(width_m: float, height_m: float, *, pixel_m: float = 0.005, base: tuple[int, int, int] = WHITE) -> Floats:
    """An empty picture of a surface; row 0 lies at the far end of the second edge."""
    return np.tile(np.array(base, dtype=np.float64), (round(height_m / pixel_m), round(width_m / pixel_m), 1))


@dataclass
class Builder:
    """Collects rectangles; each is a grid of triangles in the direction edge1 x edge2."""

    step_m: float = 0.1
    noise_m: float = 0.0
    seed: int = 0
    vertices: list[Floats] = field(default_factory=list)
    faces: list[NDArray[np.int64]] = field(default_factory=list)
    uv: list[Floats] = field(default_factory=list)
    color: list[Floats] = field(default_factory=list)
    image: list[NDArray[np.int64]] = field(default_factory=list)
    images: list[NDArray[np.uint8]] = field(default_factory=list)

    def rectangle(
        self,
        origin: ArrayLike,
        edge1: ArrayLike,
        edge2: ArrayLike,
        *,
        color: tuple[int, int, int] = WHITE,
        picture: Floats | None = None,
        hole: tuple[float, float, float, float] | None = None,
        step_m: float | None = None,
    ) -> None:
        origin, edge1, edge2 = (np.asarray(each, dtype=np.float64) for each in (origin, edge1, edge2))
        across, along = (
            max(1, round(float(np.linalg.norm(edge)) / (step_m or self.step_m))) for edge in (edge1, edge2)
        )
        u, v = np.meshgrid(np.linspace(0, 1, across + 1), np.linspace(0, 1, along + 1), indexing="ij")
        points = origin + u.reshape(-1, 1) * edge1 + v.reshape(-1, 1) * edge2
        rng = np.random.default_rng(self.seed + len(self.vertices))
        points = points + self.noise_m * rng.normal(size=points.shape)
        number = np.arange(u.size).reshape(u.shape)
        a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
        faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
        plane = np.stack([u.ravel(), v.ravel()], axis=1)
        if hole is not None:
            middle = plane[faces].mean(axis=1)
            open_ = (
                (middle[:, 0] > hole[0])
                & (middle[:, 0] < hole[1])
                & (middle[:, 1] > hole[2])
                & (middle[:, 1] < hole[3])
            )
            faces = faces[~open_]
        start = sum(len(each) for each in self.vertices)
        self.vertices.append(points)
        self.faces.append(faces + start)
        self.uv.append(plane[faces])
        self.color.append(np.tile(np.array(color) / 255.0, (len(faces), 3, 1)))
        if picture is None:
            self.image.append(np.full(len(faces), -1))
        else:
            self.image.append(np.full(len(faces), len(self.images)))
            self.images.append(np.clip(picture, 0, 255).astype(np.uint8))

    def box(
        self,
        low: ArrayLike,
        high: ArrayLike,
        *,
        inward: bool = False,
        leave_out: tuple[str, ...] = (),
        pictures: dict[str, Floats] | None = None,
        color: tuple[int, int, int] = WHITE,
        holes: dict[str, tuple[float, float, float, float]] | None = None,
    ) -> None:
        low, high = np.asarray(low, dtype=np.float64), np.asarray(high, dtype=np.float64)
        x, y, z = np.diag(high - low)
        # First and second edge of each side such that the normal points out of the box; the pictures' rows run down.
        sides = {
            "bottom": (low, y, x),
            "top": (low + z, x, y),
            "south": (low, x, z),
            "north": (low + y, z, x),
            "west": (low, z, y),
            "east": (low + x, y, z),
        }
        for name, (origin, first, second) in sides.items():
            if name in leave_out:
                continue
            edges = (second, first) if inward else (first, second)
            self.rectangle(
                origin,
                *edges,
                color=color,
                picture=(pictures or {}).get(name),
                hole=(holes or {}).get(name),
            )

    def scan(self, *, turn_deg: float = 0.0, shift: ArrayLike = (0.0, 0.0, 0.0), known: bool = True) -> Scan:
        angle = np.radians(turn_deg)
        turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        faces = np.concatenate(self.faces)
        return Scan(
            vertices=np.concatenate(self.vertices) @ turn.T + np.asarray(shift),
            faces=faces,
            appearance=Appearance(
                images=tuple(self.images),
                face_image=np.concatenate(self.image),
                corner_uv=np.concatenate(self.uv),
                corner_color=np.concatenate(self.color),
                known=known,
            ),
            record=ScanRecord(
                file="made.glb",
                unit="m",
                unit_confidence=1.0,
                up_axis="+z",
                up_confidence=1.0,
                faces_read=len(faces),
                faces_kept=len(faces),
            ),
        )

    def write_glb(self, path: Path) -> None:
        """Write it as a phone's app would: y up, one mesh a surface, each with its texture."""
        scene = trimesh.Scene()
        to_y_up = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
        start = 0
        for i, points in enumerate(self.vertices):
            faces, uv = self.faces[i] - start, self.uv[i]
            start += len(points)
            number = int(self.image[i][0])
            pixels = self.images[number] if number >= 0 else np.rint(255 * self.color[i][0, :1]).astype(np.uint8)[None]
            corners = points[faces].reshape(-1, 3)
            mesh = trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False)
            material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(pixels))
            mesh.visual = trimesh.visual.TextureVisuals(uv=uv.reshape(-1, 2), material=material)
            scene.add_geometry(mesh, transform=to_y_up)
        path.write_bytes(scene.export(file_type="glb"))


@pytest.fixture(scope="session")
def builder() -> Callable[..., Builder]:
    return Builder


@pytest.fixture(scope="session")
def painted() -> Callable[..., Floats]:
    return paint


@dataclass
class Ceiling:
    """The picture of an inward box's top, painted in the room's own coordinates."""

    low: tuple[float, float]
    high: tuple[float, float]
    pixel_m: float = 0.005
    base: tuple[int, int, int] = WHITE
    picture: Floats = field(init=False)

    def __post_init__(self) -> None:
        self.picture = paint(
            self.high[1] - self.low[1], self.high[0] - self.low[0], pixel_m=self.pixel_m, base=self.base
        )

    @property
    def x(self) -> Floats:
        rows = self.picture.shape[0]
        return (self.high[0] - (np.arange(rows) + 0.5) / rows * (self.high[0] - self.low[0]))[:, None]

    @property
    def y(self) -> Floats:
        columns = self.picture.shape[1]
        return (self.low[1] + (np.arange(columns) + 0.5) / columns * (self.high[1] - self.low[1]))[None, :]

    def rectangle(
        self, center: tuple[float, float], size: tuple[float, float], *, turn_deg: float = 0.0, color: ArrayLike = 255.0
    ) -> None:
        angle = np.radians(turn_deg)
        x, y = self.x - center[0], self.y - center[1]
        along, across = np.cos(angle) * x + np.sin(angle) * y, -np.sin(angle) * x + np.cos(angle) * y
        self.picture[(np.abs(along) <= size[0] / 2) & (np.abs(across) <= size[1] / 2)] = color

    def disc(self, center: tuple[float, float], diameter: float, *, color: ArrayLike = 255.0) -> None:
        self.picture[np.hypot(self.x - center[0], self.y - center[1]) <= diameter / 2] = color

    def glow(self, center: tuple[float, float], radius: float) -> None:
        """A pool of light that fades out."""
        distance = np.hypot(self.x - center[0], self.y - center[1])[..., None]
        self.picture = np.maximum(self.picture, 300.0 * np.exp(-0.5 * (distance / radius) ** 2))


@pytest.fixture(scope="session")
def ceiling() -> Callable[..., Ceiling]:
    return Ceiling
