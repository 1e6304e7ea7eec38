"""Where a run's sensors stand, how they see, and which engine traces for them."""

from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

from lidarspectra.config import SensorsSection
from lidarspectra.geometry.scan import Scan
from lidarspectra.radiance.engine.cluster import cluster_engine
from lidarspectra.radiance.engine.engine import Engine, find_engine
from lidarspectra.radiance.sampling.receptors import Receptor, cone_receptor, cosine_receptor, read_receptor
from lidarspectra.room.free_space import FreeSpace
from lidarspectra.room.room import Room
from lidarspectra.room.sensor_points import SensorPoints, grid_points, place_points, read_points
from lidarspectra.words import two_digits


def sensor_points(
    scan: Scan, room: Room, section: SensorsSection, *, folder: Path, free: FreeSpace | None = None
) -> SensorPoints:
    """Sensor points as `[sensors]` asks for them: a grid in the air, or a file of points lifted off surfaces.

    Parameters
    ----------
    scan : Scan
    room : Room
    section : SensorsSection
    folder : Path
        Where relative file names start.
    free : FreeSpace or None
        The scan's, where the caller has it already.

    Returns
    -------
    points : SensorPoints

    Raises
    ------
    SensorError
        As `grid_points`, `read_points` and `place_points` do.
    """
    if section.points is not None:
        positions, normals = read_points(folder / section.points)
        return place_points(scan, positions, normals, section.lift, free=free)
    assert section.grid is not None  # the section has either a grid or a file of points
    points = grid_points(scan, room, **section.grid.model_dump(), free=free)
    if section.grid.height >= section.lift:
        return points
    # So low a grid lies in the floor's own noise; it needs the lift that points on surfaces get.
    return place_points(scan, points.positions, points.normals, section.lift, free=free)


def receptor_of_run(sensors: SensorsSection, base: Path) -> Receptor:
    """The sensors' angular response: the cosine, a restricted view, or a measured table."""
    if sensors.receptor is not None:
        return read_receptor(base / sensors.receptor)
    return cosine_receptor() if sensors.field_of_view_deg is None else cone_receptor(sensors.field_of_view_deg)


def seen_by(sensors: SensorsSection, receptor: Receptor) -> str:
    """The sensors' response in words; empty for the cosine, which reads irradiance."""
    if receptor.is_cosine:
        return ""
    given = f"field_of_view_deg = {sensors.field_of_view_deg:g}" if sensors.receptor is None else "its receptor's table"
    return f"{given}, which reads {two_digits(100 * receptor.share_of_even_light)} % of even light"


def trace_engine(cluster: str | None) -> AbstractContextManager[Engine]:
    """The engine of this machine, or that of a cluster at an address, for the time of a `with` block."""
    return nullcontext(find_engine()) if cluster is None else cluster_engine(cluster)
