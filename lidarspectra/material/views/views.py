"""Views of a scan: what a camera at a place in the room sees, with the depth and the face behind every pixel."""

import json
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from lidarspectra.arrays import ByteArray, FloatArray, IntArray, float_array, int_array
from lidarspectra.errors import ArrayError, MaterialError, WorkspaceError
from lidarspectra.geometry.rays import Hits, RayCaster
from lidarspectra.geometry.scan import Scan
from lidarspectra.io.array_files import read_arrays, write_arrays
from lidarspectra.io.png_files import write_png
from lidarspectra.material.views.projection import Camera, pixel_grid, ray_directions, shift_of_rays
from lidarspectra.spectra.colorimetry import encode_srgb
from lidarspectra.threads import cores_for

VIEWS_FILE = "views.json"
VIEWS_FORMAT = 1
MIN_CONTRAST = 24  # [1/255] above which a pixel has more than one ray; elsewhere they would change it by 0.2 on average


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """One image of the room.

    Parameters
    ----------
    name : str
        Viewpoint and direction ("v0 east").
    camera : Camera
        Where it was taken.
    image : (height, width, 3) uint8
        sRGB encoded; black where nothing was met.
    depth : (height, width) float
        Z buffer: distance along the camera's forward axis; infinite where nothing was met. [m]
    face : (height, width) int
        Face behind each pixel's centre; -1 where nothing was met.
    """

    name: str
    camera: Camera
    image: ByteArray
    depth: FloatArray
    face: IntArray

    def __post_init__(self) -> None:
        shape = (self.camera.height, self.camera.width)
        if self.image.shape != (*shape, 3) or self.depth.shape != shape or self.face.shape != shape:
            raise ArrayError(
                expected=f"image, depth and face of {shape[1]} x {shape[0]} pixels",
                found=f"shapes {self.image.shape}, {self.depth.shape}, {self.face.shape}",
                where=f"view '{self.name}'",
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class ViewSet:
    """The views that Algorithm 1 chose, and how much of the scan they cover.

    Parameters
    ----------
    views : tuple of View
        In the order they were taken; the first six look in the six directions from v0.
    viewpoints : (viewpoint, 3) float
        v0, v1, ... [m]
    face_seen : (face,) float
        Fraction of each face's area that some view saw well enough. [0-1]
    area_coverage, point_coverage : float
        Share of the surface area, and of the vertices (the paper counts points), that was seen. [0-1]
    threshold : float
        Completeness threshold T. [0-1]
    history : (viewpoint,) float
        Coverage by area after each viewpoint. [0-1]
    stopped : str
        Why the loop ended, in words.
    """

    views: tuple[View, ...]
    viewpoints: FloatArray
    face_seen: FloatArray
    area_coverage: float
    point_coverage: float
    threshold: float
    history: FloatArray
    stopped: str

    def __post_init__(self) -> None:
        viewpoints = float_array(self.viewpoints, name="ViewSet.viewpoints", shape=(None, 3))
        seen = float_array(self.face_seen, name="ViewSet.face_seen", shape=(None,))
        if seen.size and (seen.min() < 0 or seen.max() > 1):
            raise ArrayError(expected="fractions from 0 to 1", found="others", where="ViewSet.face_seen")
        object.__setattr__(self, "viewpoints", viewpoints)
        object.__setattr__(self, "face_seen", seen)
        object.__setattr__(self, "history", float_array(self.history, name="ViewSet.history", shape=(len(viewpoints),)))

    def __repr__(self) -> str:
        return (
            f"<ViewSet: {len(self.views)} views from {len(self.viewpoints)} viewpoints cover "
            f"{100 * self.area_coverage:.1f} % of the area (wanted {100 * self.threshold:.0f} %)>"
        )


def no_views(faces: int, *, coverage: float, why: str) -> ViewSet:
    """A set without views.

    Parameters
    ----------
    faces : int
        Of the scan.
    coverage : float
        Completeness threshold T. [0-1]
    why : str
        In words.

    Returns
    -------
    views : ViewSet
    """
    return ViewSet(
        views=(),
        viewpoints=np.zeros((0, 3)),
        face_seen=np.zeros(faces),
        area_coverage=0.0,
        point_coverage=0.0,
        threshold=coverage,
        history=np.zeros(0),
        stopped=why,
    )


def capture_image(scan: Scan, camera: Camera, *, name: str, caster: RayCaster, samples: int = 2) -> View:
    """Render what a camera sees (Algorithm 1's CaptureImage): nearest face by ray casting, colour from its texture.

    Depth, face and colour of a pixel are those of the ray through its centre. Where its colour differs from that of a
    neighbour, as at edges and in textures finer than a pixel, it is the mean of `samples`² rays on a lattice within the
    pixel, averaged as light (Whitted 1980, An improved illumination model for shaded display, CACM 23(6)).

    Parameters
    ----------
    scan : Scan
    camera : Camera
    name : str
        For the view.
    caster : RayCaster
        Loaded with the same scan.
    samples : int
        Rays a pixel along each side, where there are more than one.

    Returns
    -------
    view : View
    """
    shape = (camera.height, camera.width)
    directions = ray_directions(camera, pixel_grid(camera))
    centre = _cast(caster, camera, directions)
    image = _encoded(_light(scan, centre)).reshape(*shape, 3)
    if samples > 1:
        chosen = np.flatnonzero(_contrast(image) > MIN_CONTRAST)
        shifts = (np.arange(samples) + 0.5) / samples - 0.5
        lattice = np.array([shift_of_rays(camera, np.array([x, y])) for y in shifts for x in shifts])
        finer = _light(scan, _cast(caster, camera, (directions[chosen] + lattice[:, None]).reshape(-1, 3)))
        image.reshape(-1, 3)[chosen] = _encoded(finer.reshape(len(lattice), -1, 3).mean(axis=0))
    return View(
        name=name,
        camera=camera,
        image=image,
        depth=centre.distance.reshape(shape),
        face=centre.face.reshape(shape),
    )


def _cast(caster: RayCaster, camera: Camera, directions: FloatArray) -> Hits:
    """What rays of (n, 3) directions from a camera meet."""
    return caster.nearest(np.broadcast_to(camera.position, directions.shape), directions)


def _light(scan: Scan, hits: Hits) -> FloatArray:
    """(n, 3) linear colour where rays met a face; black where they met none [0-1]."""
    met = hits.met
    if met.all():
        return scan.appearance.sample(hits.face, hits.barycentric)
    light = np.zeros((hits.face.size, 3))
    light[met] = scan.appearance.sample(hits.face[met], hits.barycentric[met])
    return light


def _encoded(light: FloatArray) -> ByteArray:
    return np.asarray(np.rint(255.0 * encode_srgb(light)), dtype=np.uint8)


def _contrast(image: ByteArray) -> ByteArray:
    """(pixel,) range of the colours of each pixel and its eight neighbours, of the channel where it is largest."""
    around = np.ones((3, 3), np.uint8)
    return np.asarray((cv2.dilate(image, around) - cv2.erode(image, around)).max(axis=2).ravel(), dtype=np.uint8)


def save_views(views: ViewSet, folder: Path, *, workers: int | None = None) -> None:
    """Write views as PNG images, their buffers as npz, and the rest as views.json into a folder that exists.

    Parameters
    ----------
    views : ViewSet
    folder : Path
        Files in it of the same names are replaced.
    workers : int, optional
        Processor cores that may be used, since most of the time is compression; all if left out.

    Raises
    ------
    ArgumentError
        If fewer than one worker is asked for.
    """
    stems = [f"view-{number:02d}" for number in range(len(views.views))]
    with ThreadPoolExecutor(max_workers=cores_for(workers), thread_name_prefix="views") as pool:
        for done in [
            pool.submit(_save_view, view, folder / stem) for view, stem in zip(views.views, stems, strict=True)
        ]:
            done.result()
    entries = []
    for stem, view in zip(stems, views.views, strict=True):
        camera = view.camera
        entries.append(
            {
                "name": view.name,
                "stem": stem,
                "position_m": camera.position.tolist(),
                "axes": camera.axes.tolist(),
                "width": camera.width,
                "height": camera.height,
                "focal_px": camera.focal_px,
            }
        )
    write_arrays(folder / "seen.npz", face_seen=views.face_seen)
    record = {
        "format": VIEWS_FORMAT,
        "threshold": views.threshold,
        "area_coverage": views.area_coverage,
        "point_coverage": views.point_coverage,
        "stopped": views.stopped,
        "viewpoints_m": views.viewpoints.tolist(),
        "history": views.history.tolist(),
        "views": entries,
    }
    (folder / VIEWS_FILE).write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def _save_view(view: View, path: Path) -> None:
    """Write a view's image and its buffers; `path` is without suffix."""
    write_png(path.with_suffix(".png"), view.image)
    write_arrays(path.with_suffix(".npz"), depth_m=view.depth.astype(np.float32), face=view.face.astype(np.int32))


def load_views(folder: Path) -> ViewSet:
    """Read what `save_views` wrote.

    Raises
    ------
    MaterialError
        If a file is missing or is none of ours.
    """
    try:
        record = json.loads((folder / VIEWS_FILE).read_text(encoding="utf-8"))
        if record["format"] != VIEWS_FORMAT:
            raise ValueError(f"format {record['format']} where {VIEWS_FORMAT} is known")
        return ViewSet(
            views=tuple(_load_view(folder, entry) for entry in record["views"]),
            viewpoints=np.array(record["viewpoints_m"], dtype=np.float64).reshape(-1, 3),
            face_seen=float_array(read_arrays(folder / "seen.npz")["face_seen"], name="face_seen", shape=(None,)),
            area_coverage=float(record["area_coverage"]),
            point_coverage=float(record["point_coverage"]),
            threshold=float(record["threshold"]),
            history=np.array(record["history"]),
            stopped=str(record["stopped"]),
        )
    except (OSError, ValueError, TypeError, KeyError, SyntaxError, ArrayError, WorkspaceError) as cause:
        raise MaterialError(
            expected="the views that an earlier stage wrote",
            found=f"{type(cause).__name__}: {cause}",
            where=str(folder),
            todo="Run the views stage again.",
        ) from cause


def _load_view(folder: Path, entry: dict[str, object]) -> View:
    stem = Path(str(entry["stem"])).name
    with Image.open(folder / f"{stem}.png") as picture:
        image = np.asarray(picture.convert("RGB"))
    arrays = read_arrays(folder / f"{stem}.npz")
    camera = Camera(
        position=np.array(entry["position_m"]),
        axes=np.array(entry["axes"]),
        width=int(str(entry["width"])),
        height=int(str(entry["height"])),
        focal_px=float(str(entry["focal_px"])),
    )
    return View(
        name=str(entry["name"]),
        camera=camera,
        image=image,
        depth=arrays["depth_m"].astype(np.float64),
        face=int_array(arrays["face"], name="face", shape=(None, None)),
    )
