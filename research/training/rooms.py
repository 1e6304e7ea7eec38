"""Pictures of rooms that never were: boxes in a box, dressed in materials, lit by lamps, seen by a phone's camera.

A view's square often shows the edge of two surfaces, or one that is plain; pictures of materials alone show neither. A
crop is labelled with the class of the surface in its middle. Classes have nothing to do with places here (a floor may
be of glass), so that what a room's geometry says of them is left to `place_priors`.

    texture x (ambient + sum over the lamps of I cos(t) V / d²), V from a shadow ray

A mirror shows what it reflects.
"""

from dataclasses import dataclass

import numpy as np
import trimesh

from lidarspectra.arrays import BoolArray, FloatArray, IntArray
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import bare_scan
from lidarspectra.geometry.textures import sample_image
from lidarspectra.material.views.projection import Camera, camera_towards, pixel_grid, ray_directions
from lidarspectra.spectra.colorimetry import encode_srgb
from research.training.drawn import any_color
from research.training.pictures import CLASSES, Picture

NOT_INDOORS = ("foliage", "hair", "skin", "sky", "water")  # no surfaces of a room that a scan would hold
PLAIN = {
    "painted": 0.6, "plastic": 0.4, "ceramic": 0.3, "metal": 0.25, "paper": 0.25, "fabric": 0.15, "wallpaper": 0.15,
    "carpet": 0.1, "tile": 0.1, "glass": 0.1, "leather": 0.1, "stone": 0.1, "wood": 0.05,
}  # fmt: skip  # [1] share of a class's surfaces in rooms on which a phone sees no texture; a judgement of ours
GRAIN = (0.0, 0.02)  # [1] of a plain surface's brightness, as scans show it
LOW_M, HIGH_M = (2.5, 2.5, 2.3), (8.0, 6.0, 3.2)  # [m] sides of a room
FURNITURE = (6, 16)  # boxes
SMALLEST_M, LARGEST_M = (0.15, 0.03, 0.15), (2.0, 0.9, 2.0)  # [m] sides of a box
ON_FLOOR, ON_WALL = 0.6, 0.2  # [1] shares of the boxes; the rest hang free, as table tops do
LAMPS = (1, 5)
AMBIENT = (0.15, 0.6)  # [1] share of light that comes from everywhere
TEXTURE_PX_PER_M = (60.0, 400.0)  # [px/m] of a material's picture
VIEW_PX, FIELD_DEG = 384, (60.0, 100.0)  # [px], [deg]
FINER = 2  # rays a pixel along each side
EYE_M = 0.3  # [m] least distance of the camera and the lamps from walls
LIFT_M = 1e-3  # [m] shadow and mirrored rays start just off the surface
BRIGHT_SHARE, BRIGHT = 0.95, 0.8  # [1] quantile of a view's light, and what it becomes; `phone.developed` exposes anew
CROPS = 20  # of each view
VIEWS = 2  # of each room
MIN_PX = 300  # [px] of a surface in a view, for a crop of it
CROP_PX = 128  # [px]


@dataclass(frozen=True, kw_only=True, eq=False)
class Room:
    """Triangles with their surfaces, what covers those, and the lamps.

    Parameters
    ----------
    caster : RayCaster
    surface : (face,) int
    covers : list of Picture
        What each surface is made of.
    px_per_m : (surface,) float
        [px/m]
    size : (3,) float
        [m]
    lamps : (lamp, 3) float
        [m]
    power : (lamp, 3) float
        Red, green, blue. [1]
    ambient : float
        [1]
    """

    caster: RayCaster
    surface: IntArray
    covers: list[Picture]
    px_per_m: FloatArray
    size: FloatArray
    lamps: FloatArray
    power: FloatArray
    ambient: float


def room_pictures(pictures: list[Picture], rooms: int, generator: np.random.Generator) -> list[Picture]:
    """Crops of views of rooms that are dressed in these pictures' materials.

    Parameters
    ----------
    pictures : list of Picture
    rooms : int
    generator : numpy.random.Generator

    Returns
    -------
    crops : list of Picture
        Of origin 'room', 128 pixels wide, exposed for the view; `phone.developed` makes a phone's picture of one.
    """
    covers = {label: [p for p in pictures if p.label == label] for label in range(len(CLASSES))}
    indoors = [n for n, name in enumerate(CLASSES) if name not in NOT_INDOORS and covers[n]]
    crops: list[Picture] = []
    for _ in range(rooms):
        room = _furnished(covers, indoors, generator)
        for _ in range(VIEWS):
            crops += _crops(room, generator)
    return crops


def _furnished(covers: dict[int, list[Picture]], indoors: list[int], generator: np.random.Generator) -> Room:
    size = generator.uniform(LOW_M, HIGH_M)
    shell = trimesh.creation.box(bounds=np.stack([np.zeros(3), size]))
    shell.invert()
    parts = [(shell.vertices, shell.faces, np.abs(shell.face_normals).argmax(axis=1) * 2 + _upper(shell))]
    for number in range(int(generator.integers(*FURNITURE))):
        box = _box(size, generator)
        parts.append((box.vertices, box.faces, np.full(len(box.faces), 6 + number)))
    first = np.cumsum([0] + [len(vertices) for vertices, _, _ in parts])
    faces = np.concatenate([part + start for (_, part, _), start in zip(parts, first, strict=False)])
    surface = np.concatenate([each for _, _, each in parts])
    count = int(surface.max()) + 1
    low, high = np.log(TEXTURE_PX_PER_M)
    lamps = generator.uniform([EYE_M] * 3, size - EYE_M, (int(generator.integers(*LAMPS)), 3))
    lamps[:, 2] = size[2] - generator.uniform(0.02, 0.6, len(lamps))
    return Room(
        caster=RayCaster(bare_scan(np.concatenate([vertices for vertices, _, _ in parts]), faces)),
        surface=surface,
        covers=[_cover(covers[int(generator.choice(indoors))], generator) for _ in range(count)],
        px_per_m=np.exp(generator.uniform(low, high, count)),
        size=size,
        lamps=lamps,
        power=np.exp(generator.normal(0.0, 0.08, (len(lamps), 3))),
        ambient=float(generator.uniform(*AMBIENT)),
    )


def _upper(shell: trimesh.Trimesh) -> IntArray:
    """(face,) 1 on the side of larger coordinates: normals of the shell point inwards."""
    return np.asarray(shell.face_normals.sum(axis=1) < 0, dtype=np.int64)


def _box(size: FloatArray, generator: np.random.Generator) -> trimesh.Trimesh:
    """A piece of furniture, on the floor, on a wall or between."""
    box: trimesh.Trimesh = trimesh.creation.box(
        extents=generator.uniform(SMALLEST_M, np.minimum(LARGEST_M, 0.8 * size))
    )
    yaw = 0.5 * np.pi * generator.integers(4)
    where = generator.random()
    middle = generator.uniform(0.1, 0.9, 3) * size
    if where < ON_FLOOR:
        middle[2] = 0.5 * box.extents[2]
        yaw += generator.normal(0.0, 0.3) * (generator.random() < 0.4)
    elif where < ON_FLOOR + ON_WALL:
        axis = int(generator.integers(2))
        middle[axis] = size[axis] * generator.integers(2)
    turn = trimesh.transformations.rotation_matrix(yaw, [0, 0, 1])  # type: ignore[no-untyped-call]
    box.apply_transform(turn)
    box.apply_translation(middle)
    return box


def _cover(pictures: list[Picture], generator: np.random.Generator) -> Picture:
    """One of these pictures, or a plain one of their class."""
    picture = pictures[int(generator.integers(len(pictures)))]
    name = CLASSES[picture.label]
    if generator.random() >= PLAIN.get(name, 0.0):
        return picture
    grain = generator.uniform(*GRAIN) * generator.standard_normal((64, 64, 1))
    image = np.clip(any_color(generator) * (1.0 + grain), 0.0, 1.0)
    return Picture(
        image=np.asarray(np.rint(255.0 * image), dtype=np.uint8),
        label=picture.label,
        material=f"plain {name} {generator.integers(2**31)}",
        origin="drawn",
    )


def _crops(room: Room, generator: np.random.Generator) -> list[Picture]:
    """Crops of one view, of each surface in it about as many."""
    eye = generator.uniform([EYE_M] * 3, room.size - EYE_M)
    aim = generator.normal(size=3) * (1.0, 1.0, 0.7)
    camera = camera_towards(
        eye, aim, width=FINER * VIEW_PX, height=FINER * VIEW_PX, field_of_view_deg=generator.uniform(*FIELD_DEG)
    )
    light, surface = _render(room, camera)
    light = light.reshape(VIEW_PX, FINER, VIEW_PX, FINER, 3).mean(axis=(1, 3))
    surface = surface.reshape(VIEW_PX, FINER, VIEW_PX, FINER)[:, 0, :, 0]
    exposed = np.clip(light * (BRIGHT / max(float(np.quantile(light, BRIGHT_SHARE)), 1e-9)), 0.0, 1.0)
    image = np.asarray(np.rint(255.0 * encode_srgb(exposed)), dtype=np.uint8)
    half = CROP_PX // 2
    wide = np.pad(image, ((half, half), (half, half), (0, 0)), mode="reflect")
    shown = [k for k in np.unique(surface[surface >= 0]) if np.count_nonzero(surface == k) >= MIN_PX]
    crops = []
    for _ in range(CROPS if shown else 0):
        chosen = int(generator.choice(shown))
        cover = room.covers[chosen]
        rows, columns = np.nonzero(surface == chosen)
        place = int(generator.integers(len(rows)))
        row, column = int(rows[place]), int(columns[place])
        crops.append(
            Picture(
                image=np.ascontiguousarray(wide[row : row + CROP_PX, column : column + CROP_PX]),
                label=cover.label,
                material=cover.material,
                origin="room",
            )
        )
    return crops


def _render(room: Room, camera: Camera) -> tuple[FloatArray, IntArray]:
    """(pixel, 3) linear light and (pixel,) surface, -1 where there is none."""
    directions = ray_directions(camera, pixel_grid(camera))
    origins = np.broadcast_to(camera.position, directions.shape)
    light, surface, points, normals = _seen(room, origins, directions)
    mirrors = [n for n, cover in enumerate(room.covers) if CLASSES[cover.label] == "mirror"]
    mirroring = np.flatnonzero(np.isin(surface, mirrors))
    if mirroring.size:
        inwards, normal = directions[mirroring], normals[mirroring]
        back = inwards - 2.0 * np.einsum("nc,nc->n", inwards, normal)[:, None] * normal
        light[mirroring] = 0.9 * _seen(room, points[mirroring] + LIFT_M * normal, back)[0]
    return light, surface


def _seen(
    room: Room, origins: FloatArray, directions: FloatArray
) -> tuple[FloatArray, IntArray, FloatArray, FloatArray]:
    """(ray, 3) light, (ray,) surface, (ray, 3) points and (ray, 3) normals towards the eye of what rays meet."""
    hits = room.caster.nearest(origins, directions)
    met = hits.met
    surface = np.where(met, room.surface[hits.face], -1)
    points = origins + np.where(met, hits.distance, 0.0)[:, None] * directions
    normals = room.caster.normals[hits.face]
    normals = np.where(np.einsum("nc,nc->n", normals, directions)[:, None] > 0, -normals, normals)
    color = np.zeros(points.shape)
    along = np.abs(normals).argmax(axis=1)
    for number in np.unique(surface[met]):
        here = np.flatnonzero(surface == number)
        plane = np.array([[1, 2], [0, 2], [0, 1]])[along[here]]
        image = room.covers[number].image
        turns = np.take_along_axis(points[here], plane, axis=1) * room.px_per_m[number] / np.array(image.shape[1::-1])
        if room.covers[number].origin != "tile":  # those are continued by their mirror image, without a seam
            turns = 1.0 - np.abs(1.0 - turns % 2.0)
        color[here] = sample_image(image, turns)
    return color * irradiance(room, points, normals, met), surface, points, normals


def irradiance(room: Room, points: FloatArray, normals: FloatArray, met: BoolArray) -> FloatArray:
    """(point, 3) light that falls on points, of lamps that are seen from there and from everywhere."""
    total = np.full(points.shape, room.ambient)
    start = points + LIFT_M * normals
    for place, power in zip(room.lamps, room.power, strict=True):
        sight = place - start
        square = np.einsum("nc,nc->n", sight, sight)
        cosine = np.einsum("nc,nc->n", sight, normals) / np.sqrt(square)
        lit = np.flatnonzero(met & (cosine > 0))
        clear = ~room.caster.nearest(start[lit], sight[lit], max_distance=1.0).met
        share = np.zeros(len(points))
        share[lit] = clear * cosine[lit] / np.maximum(square[lit], EYE_M**2)
        total += share[:, None] * power
    return total
