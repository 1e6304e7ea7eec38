"""Light that what lies beyond a scan's openings may send back: what is not known of a room that was not scanned whole.

Beyond an opening may be a dark corridor, which sends nothing back, or a wall as near as can be. How much a wall there
would add is estimated from the light that arrives at the openings, which is traced: a wall of reflectance ρ sends
M = ρ E back; a sensor that sees a share f of it gets f M, and all get the part that the room's other surfaces
reflect, as evenly as in an integrating sphere, ρ_room M A_opening / (A (1 - ρ_mean)). Where `[scan] close` has put
default walls into the openings, the same says what of the light comes from them. Lamps beyond are not counted.

References
----------
Jacquez, Kuppenheim (1955) Theory of the integrating sphere, Journal of the Optical Society of America 45(6), 460.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.scan import Scan
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.material.part_materials import TYPICAL
from lidarspectra.progress import Progress, silent
from lidarspectra.radiance.engine.engine import Engine
from lidarspectra.radiance.engine.options import Accuracy
from lidarspectra.radiance.sampling.receptors import Receptor, cosine_receptor, draw_directions
from lidarspectra.radiance.sampling.sensor_rays import SENSOR_OFFSET_M
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.scene.scene import RadianceScene
from lidarspectra.room.closing import DIRECTIONS, Openings, Surroundings
from lidarspectra.room.room import Room
from lidarspectra.room.sensor_points import SensorPoints

MIN_SHARE = 0.01  # [1] of what the sensors see; less is cracks of the mesh, and left out
SAMPLES = 32  # places in the openings at which the light is traced
RAYS = 377  # per sensor, a number of `receptors.FIBONACCI`
LIFT_M = 0.02  # [m] off the opening
_SIDE = TYPICAL["closed side"]
BRIGHT = _SIDE.reflectance + _SIDE.deviation  # [1] a bright wall: the most that an unlit surface beyond may well be


@dataclass(frozen=True, kw_only=True, eq=False)
class OpeningLight:
    """Light by way of openings.

    Parameters
    ----------
    share : (point,) float
        Of what the sensor sees, weighed by its response: what leaves the scan, or meets a default wall. [0-1]
    coefficient : (lamp, point, band) float
        What a bright wall in the openings would add or, where they are closed, what comes from the default walls;
        zero where the openings are too small to matter. [m⁻²]
    closed : bool
        Whether they are closed.
    """

    share: FloatArray
    coefficient: FloatArray
    closed: bool


def opening_light(
    scene: RadianceScene,
    scan: Scan,
    room: Room,
    materials: MaterialMap,
    points: SensorPoints,
    *,
    accuracy: Accuracy = "high",
    receptor: Receptor | None = None,
    seed: int = 0,
    workers: int | None = None,
    engine: Engine | None = None,
    progress: Progress = silent,
) -> OpeningLight:
    """Estimate the light that depends on what is not in the scan.

    Parameters
    ----------
    scene : RadianceScene
        Of the scan.
    scan, room
        Open, or closed by `close_room`.
    materials : MaterialMap
        Of the scan.
    points : SensorPoints
    accuracy, receptor, seed, workers, engine, progress
        As in `trace`.

    Returns
    -------
    light : OpeningLight

    Raises
    ------
    EngineError
        As `trace`.
    """
    receptor = cosine_receptor() if receptor is None else receptor
    around = Surroundings(scan, room)
    directions = draw_directions(
        receptor, points.normals, sets=1, count=RAYS, generator=np.random.default_rng(seed)
    ).reshape(-1, 3)
    starts = points.positions + SENSOR_OFFSET_M * points.normals
    face, left_by = around.meet(np.repeat(starts, RAYS, axis=0), directions)
    seen = (left_by >= 0).reshape(len(points), RAYS)
    closed = bool(((face >= 0) & (left_by >= 0)).sum() > (left_by[face < 0] >= 0).sum())
    share = seen.mean(axis=1)
    nothing = OpeningLight(
        share=share,
        coefficient=np.zeros((len(scene.lamp_names), len(points), len(scene.bands))),
        closed=closed,
    )
    number, openings = around.openings()
    counted = ~points.buried if not points.buried.all() else points.buried
    if share[counted].mean() < MIN_SHARE or not number.size:
        return nothing
    chosen = np.random.default_rng(seed).choice(
        number.size, size=min(SAMPLES, number.size), replace=False, p=openings.rays / openings.rays.sum()
    )
    normals = openings.normals[chosen]
    traced = trace(
        scene,
        SensorPoints(positions=openings.centers[chosen] + LIFT_M * normals, normals=normals),
        accuracy=accuracy,
        noise="draft",
        seed=seed,
        workers=workers,
        engine=engine,
        progress=progress,
    )
    arriving = traced["coefficient"].transpose("lamp", "point", "band").to_numpy().astype(np.float64)
    nearest = cKDTree(openings.centers[chosen])
    of_sample = np.asarray(nearest.query(openings.centers)[1], dtype=np.int64)
    area = np.bincount(of_sample, weights=openings.areas, minlength=chosen.size).astype(np.float64)
    reflected = _room_reflectance(scene, around, materials, openings)
    sending, spread = _sent_back(arriving, area, room, reflected, closed=closed)
    centers, _, _ = around.places(np.maximum(left_by, 0))
    view = np.zeros((len(points), chosen.size))
    row, ray = np.nonzero(seen)
    np.add.at(view, (row, nearest.query(centers[row * RAYS + ray])[1]), 1.0 / RAYS)
    direct = np.einsum("pk,lkb->lpb", view, sending)
    everywhere = (1.0 - share)[None, :, None] * spread[:, None, :]
    scale = receptor.measure_sr / np.pi  # of a Lambertian surface's exitance, for what the receptor reads of it
    return OpeningLight(share=share, coefficient=scale * (direct + everywhere), closed=closed)


def _room_reflectance(
    scene: RadianceScene, around: Surroundings, materials: MaterialMap, openings: Openings
) -> FloatArray:
    """(band,) mean reflectance of what was scanned, as the free space sees it [1]."""
    free = openings.free
    origins, directions = np.repeat(free, len(DIRECTIONS), axis=0), np.tile(DIRECTIONS, (len(free), 1))
    face, opening = around.meet(origins, directions)
    met = materials.face_material[face[(face >= 0) & (opening < 0)]]
    of_material = np.array(
        [scene.bands.band_values(material.reflectance, outside="nearest") for material in materials.materials]
    )
    counts = np.bincount(met, minlength=len(of_material))
    return np.asarray(counts @ of_material / max(1, counts.sum()), dtype=np.float64)


def _sent_back(
    arriving: FloatArray, area: FloatArray, room: Room, reflected: FloatArray, *, closed: bool
) -> tuple[FloatArray, FloatArray]:
    """Exitance of a wall in the openings, and of the room's surfaces by its light.

    Parameters
    ----------
    arriving : (lamp, opening, band) float
        Irradiance at the openings, per flux. [m⁻²]
    area : (opening,) float
        That each stands for. [m²]
    room : Room
    reflected : (band,) float
        Mean reflectance of the room's surfaces. [1]
    closed : bool
        Whether the wall is there already, and its light in `arriving`.

    Returns
    -------
    sending : (lamp, opening, band) float
        [m⁻²]
    spread : (lamp, band) float
        [m⁻²]
    """
    outlines = [np.vstack([polygon, polygon[:1]]) for polygon in room.outlines]
    around_m = sum(float(np.linalg.norm(np.diff(polygon, axis=0), axis=1).sum()) for polygon in outlines)
    whole = max(2.0 * room.area_m2 + around_m * room.height_m, 1.5 * float(area.sum()))
    scanned = whole - float(area.sum())
    gain = reflected / (scanned * (1.0 - reflected * scanned / whole))  # exitance of the room per flux sent into it
    if closed:
        sending = _SIDE.reflectance * arriving
    else:  # the wall's own light comes back to it by way of the room
        sending = BRIGHT * arriving / (1.0 - BRIGHT * gain * area.sum())
    return sending, np.einsum("lkb,k->lb", sending, area) * gain
