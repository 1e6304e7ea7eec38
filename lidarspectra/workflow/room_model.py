"""A room made in Python, without a scan or a run file: surfaces with reflectances, lit by lamps, seen by sensors."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import get_args

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from lidarspectra.arguments import all_of, instance_of, one_of
from lidarspectra.arrays import FloatArray, IntArray, float_array, int_array
from lidarspectra.errors import ArgumentError, ArrayError, LampError
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.maps.spectral_map import spectral_map
from lidarspectra.material.assignments import database_material
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.progress import Progress, part_of, silent
from lidarspectra.radiance.engine.options import Accuracy, Noise, NoiseOf, TraceMethod
from lidarspectra.radiance.sampling.plain_rtrace import trace_plain
from lidarspectra.radiance.sampling.receptors import Receptor
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.scene.clearance import clear_lamps
from lidarspectra.radiance.scene.scene import LAMPS_PER_PASS, write_scene
from lidarspectra.room.room import Room, find_room
from lidarspectra.room.sensor_points import UP, SensorPoints, grid_points
from lidarspectra.spectra.databases import load_reflectances
from lidarspectra.spectra.sensor_files import find_bands
from lidarspectra.spectra.spectrum import BandSet, Spectrum

DEVICE = "as7265x-14"
FLATNESS_M = 1e-3  # [m] largest distance of a polygon's corners from its plane
EVEN_RANGE_NM = (300.0, 1100.0)  # [nm] range of a reflectance given as one number
SCENE_SHARE = 0.1  # [1] of the time, for writing the scene; the rest is the trace
Reflectance = float | str | Spectrum | Material


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """A surface of a room: a flat polygon, or a mesh of triangles.

    Parameters
    ----------
    corners : (corner, 3) float
        Of a flat convex polygon, counter-clockwise seen from the room; or the vertices of a mesh. [m]
    reflectance : float, str, Spectrum or Material
        One number for all wavelengths, an ID of the built-in database ('white-wall'), a spectrum, or a material with
        gloss and roughness. Diffuse unless the material says otherwise. [0 to 0.99]
    name : str
        For reports.
    faces : (face, 3) int, optional
        Corners of triangles, counter-clockwise seen from the room, where the surface is a mesh.
    """

    corners: FloatArray
    reflectance: Reflectance
    name: str = "surface"
    faces: IntArray | None = None

    def __post_init__(self) -> None:
        where = f"surface '{self.name}'"
        corners = float_array(self.corners, name=f"{where} corners", shape=(None, 3))
        if self.faces is None:
            _check_polygon(corners, where)
            count = len(corners)
            fan = np.column_stack([np.zeros(count - 2), np.arange(1, count - 1), np.arange(2, count)])
            faces = int_array(fan, name="faces", shape=(None, 3))
        else:
            faces = int_array(self.faces, name=f"{where} faces", shape=(None, 3))
        if faces.size == 0 or faces.min() < 0 or faces.max() >= len(corners):
            raise ArrayError(
                expected="faces whose corners are among the vertices", found="indices beyond them", where=where
            )
        object.__setattr__(self, "corners", corners)
        object.__setattr__(self, "faces", faces)
        object.__setattr__(self, "reflectance", _material(self.reflectance, self.name, where))

    @property
    def material(self) -> Material:
        """The surface's material."""
        assert isinstance(self.reflectance, Material)  # since __post_init__
        return self.reflectance

    def __repr__(self) -> str:
        value = float(self.material.reflectance.at([555.0], outside="nearest")[0])
        return f"<Surface '{self.name}': {len(self.corners)} corners, reflectance {value:.2f} at 555 nm>"


@dataclass(frozen=True, kw_only=True, eq=False)
class RoomModel:
    """A room of surfaces, to be lit and mapped.

    Parameters
    ----------
    surfaces : sequence of Surface
        Floor, walls, ceiling and furniture, each seen from the room; z is up. [m]
    """

    surfaces: Sequence[Surface] = field(repr=False)

    def __post_init__(self) -> None:
        surfaces = all_of(self.surfaces, Surface, name="surfaces", todo="Write Surface(corners=..., reflectance=...).")
        if not surfaces:
            raise ArgumentError(expected="one or more surfaces", found="none", where="surfaces")
        object.__setattr__(self, "surfaces", surfaces)

    @classmethod
    def from_box(
        cls,
        length: float,
        width: float,
        height: float,
        *,
        floor: Reflectance = 0.2,
        walls: Reflectance = 0.5,
        ceiling: Reflectance = 0.7,
    ) -> "RoomModel":
        """An empty box with a corner at the origin: x along its length, y along its width, z up.

        Parameters
        ----------
        length, width, height : float
            [m]
        floor, walls, ceiling : float, str, Spectrum or Material
            Their reflectances, see `Surface`; 0.2, 0.5 and 0.7 are lighting design's usual ones. [0 to 0.99]

        Returns
        -------
        model : RoomModel

        Raises
        ------
        ArrayError
            If a side is not above 0, or a reflectance out of range.
        """
        x, y, z = float_array((length, width, height), name="sides of the box", shape=(3,)).tolist()
        if min(x, y, z) <= 0:
            raise ArrayError(expected="sides above 0 m", found=f"{x:g}, {y:g}, {z:g}", where="sides of the box")
        corners = {
            "floor": [(0, 0, 0), (x, 0, 0), (x, y, 0), (0, y, 0)],
            "ceiling": [(0, 0, z), (0, y, z), (x, y, z), (x, 0, z)],
            "south wall": [(0, 0, 0), (0, 0, z), (x, 0, z), (x, 0, 0)],
            "north wall": [(0, y, 0), (x, y, 0), (x, y, z), (0, y, z)],
            "west wall": [(0, 0, 0), (0, y, 0), (0, y, z), (0, 0, z)],
            "east wall": [(x, 0, 0), (x, 0, z), (x, y, z), (x, y, 0)],
        }
        given = {"floor": floor, "ceiling": ceiling}
        return cls(
            surfaces=[
                Surface(corners=np.array(places), reflectance=given.get(name, walls), name=name)
                for name, places in corners.items()
            ]
        )

    @cached_property
    def scan(self) -> Scan:
        """The surfaces as one mesh, without colours."""
        starts = np.cumsum([0, *(len(surface.corners) for surface in self.surfaces)])
        faces = [_faces(surface) + start for surface, start in zip(self.surfaces, starts, strict=False)]
        vertices = np.vstack([surface.corners for surface in self.surfaces])
        return bare_scan(vertices, np.vstack(faces), file="surfaces given in Python")

    @cached_property
    def room(self) -> Room:
        """Floor, ceiling, walls and outline, as found in the mesh."""
        return find_room(self.scan)

    @cached_property
    def materials(self) -> MaterialMap:
        """The material of every face."""
        counts = [len(_faces(surface)) for surface in self.surfaces]
        member = np.repeat(np.arange(len(counts)), counts)
        colors = np.array([surface.material.color for surface in self.surfaces])
        return MaterialMap(
            materials=tuple(surface.material for surface in self.surfaces),
            face_material=member,
            face_color=colors[member],
            face_seen=np.ones(len(member)),
        )

    def grid(
        self,
        height: float = 0.75,
        *,
        spacing: float | None = None,
        count: int | None = None,
        margin: float = 0.1,
        normal: ArrayLike = UP,
    ) -> SensorPoints:
        """Sensors on a horizontal grid in the room's free space.

        Parameters
        ----------
        height : float
            Above the floor. [m]
        spacing : float, optional
            Distance between neighbours; give this or `count`. [m]
        count : int, optional
            How many.
        margin : float
            Least distance from walls and furniture. [m]
        normal : (3,) float
            Direction that they face; up by default.

        Returns
        -------
        points : SensorPoints

        Raises
        ------
        ScanError
            If the surfaces show no room.
        SensorError
            If they do not fit on the plane.
        """
        return grid_points(
            self.scan, self.room, height=height, spacing=spacing, count=count, margin=margin, normal=normal
        )

    def trace(
        self,
        lamps: Sequence[Lamp],
        points: SensorPoints,
        *,
        bands: BandSet | str = DEVICE,
        accuracy: Accuracy = "high",
        noise: Noise = "standard",
        noise_of: NoiseOf = "mean",
        method: TraceMethod = "adaptive",
        seed: int = 0,
        workers: int | None = None,
        receptor: Receptor | None = None,
        progress: Progress = silent,
    ) -> xr.Dataset:
        """Trace the transport coefficients of every lamp at the sensors, for maps and for relighting.

        Parameters
        ----------
        lamps : sequence of Lamp
            Each with a unique name (`make_lamp`). One that lies in a surface, or up to 10 cm behind it, is moved to
            just before it, so that all its light reaches the room.
        points : SensorPoints
        bands : BandSet or str
            Channels, or a device's name.
        accuracy, noise, noise_of, seed, workers, receptor, progress
            As in `trace`.
        method : {"adaptive", "rtrace"}
            Adaptive sampling, or one plain run of rtrace for each band group and lamp (`trace_plain`): it has the
            cosine receptor alone, no seed, and the noise of a fixed number of rays.

        Returns
        -------
        transport : xarray.Dataset
            As `trace` gives it.

        Raises
        ------
        LampError
            If there is no lamp, or two have one name.
        ArgumentError, SceneError, EngineError
            If an argument has the wrong type, or does not go with the method; as `write_scene` and `trace`.
        """
        lit = _checked_lamps(lamps)
        plain = one_of(method, get_args(TraceMethod), name="method") == "rtrace"
        if plain and (receptor is not None or noise_of != "mean"):
            raise ArgumentError(
                expected="receptor and noise_of left out, since plain rtrace knows neither",
                found="a receptor" if receptor is not None else f"noise_of={noise_of!r}",
                where="method='rtrace'",
                todo="Leave it out, or trace with method='adaptive'.",
            )
        instance_of(points, SensorPoints, name="points", todo="model.grid(spacing=0.5) or SensorPoints(positions=...).")
        channels = find_bands(bands, Path()) if isinstance(bands, str) else instance_of(bands, BandSet, name="bands")
        clear = clear_lamps(lit, self.scan)
        with tempfile.TemporaryDirectory() as folder:
            scene = write_scene(
                clear.scan,
                self.materials,
                clear.lamps,
                channels,
                Path(folder),
                lamps_per_pass=1 if plain else LAMPS_PER_PASS,
                progress=part_of(progress, 0.0, SCENE_SHARE),
            )
            tracing = part_of(progress, SCENE_SHARE, 1.0)
            if plain:
                return trace_plain(scene, points, accuracy=accuracy, noise=noise, workers=workers, progress=tracing)
            return trace(
                scene,
                points,
                accuracy=accuracy,
                noise=noise,
                noise_of=noise_of,
                seed=seed,
                workers=workers,
                receptor=receptor,
                progress=tracing,
            )

    def light(
        self,
        lamps: Sequence[Lamp],
        points: SensorPoints,
        *,
        bands: BandSet | str = DEVICE,
        accuracy: Accuracy = "high",
        noise: Noise = "standard",
        noise_of: NoiseOf = "mean",
        method: TraceMethod = "adaptive",
        seed: int = 0,
        workers: int | None = None,
        progress: Progress = silent,
    ) -> xr.Dataset:
        """Spectral map at sensors: irradiance in every channel, and illuminance [lx].

        Parameters
        ----------
        lamps, points, bands, accuracy, noise, noise_of, method, seed, workers, progress
            As in `RoomModel.trace`.

        Returns
        -------
        map : xarray.Dataset
            As `spectral_map` gives it: irradiance [W/m²/nm], illuminance [lx], and their standard errors.

        Raises
        ------
        LidarSpectraError
            As `RoomModel.trace`.
        """
        transport = self.trace(
            lamps,
            points,
            bands=bands,
            accuracy=accuracy,
            noise=noise,
            noise_of=noise_of,
            method=method,
            seed=seed,
            workers=workers,
            progress=progress,
        )
        return spectral_map(transport, lamps=lamps)

    def __repr__(self) -> str:
        low, high = self.scan.bounds
        size = " x ".join(f"{side:.2f}" for side in high - low)
        names = ", ".join(surface.name for surface in self.surfaces[:8])
        more = f" and {len(self.surfaces) - 8} more" if len(self.surfaces) > 8 else ""
        return f"<RoomModel: {size} m, {len(self.surfaces)} surfaces: {names}{more}>"


def _faces(surface: Surface) -> IntArray:
    assert surface.faces is not None  # since __post_init__
    return surface.faces


def _checked_lamps(lamps: Sequence[Lamp]) -> tuple[Lamp, ...]:
    found = all_of(lamps, Lamp, name="lamps", todo="Make each with make_lamp(...).")
    if not found:
        raise LampError(
            expected="one or more lamps", found="none", where="lamps", todo="Add a lamp: without light there is no map."
        )
    names = [lamp.name for lamp in found]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise LampError(
            expected="a unique name for each lamp",
            found=f"two lamps '{twice[0]}'",
            where="lamps",
            todo="Give each make_lamp(...) its own name=...; relighting refers to lamps by name.",
        )
    return found


def _check_polygon(corners: FloatArray, where: str) -> None:
    """Refuse polygons that a fan of triangles does not fill: bent, concave or self-crossing ones."""
    edges = np.roll(corners, -1, axis=0) - corners
    turns = np.cross(edges, np.roll(edges, -1, axis=0))
    area = np.cross(corners - corners[0], np.roll(corners, -1, axis=0) - corners[0]).sum(axis=0)
    length = float(np.linalg.norm(area))
    if len(corners) < 3 or length == 0:
        raise ArrayError(expected="three or more corners that span an area", found=f"{len(corners)}", where=where)
    normal = area / length
    if np.abs((corners - corners[0]) @ normal).max() > FLATNESS_M:
        raise ArrayError(
            expected="a flat polygon", found="corners off its plane", where=where, todo="Give triangles as faces=..."
        )
    if (turns @ normal < -(FLATNESS_M**2)).any():
        raise ArrayError(
            expected="a convex polygon", found="one with a corner inwards", where=where, todo="Cut it in convex parts."
        )


def _material(given: Reflectance, name: str, where: str) -> Material:
    if isinstance(given, Material):
        return given
    if isinstance(given, str):
        library = load_reflectances()
        return database_material(library.find(given), library, provenance="assigned", confidence=1.0)
    if not isinstance(given, Spectrum | int | float | np.floating) or isinstance(given, bool):
        raise ArgumentError(
            expected="a number from 0 to 0.99, an ID of a reflectance, a Spectrum or a Material",
            found=f"a value of type {type(given).__name__}",
            where=f"reflectance of {where}",
        )
    if not isinstance(given, Spectrum):
        given = Spectrum(wavelengths_nm=np.array(EVEN_RANGE_NM), values=np.full(2, float(given)), name=name)
    gray = float(np.clip(given.at([555.0], outside="nearest")[0], 0.0, 1.0))
    return Material(
        name=name,
        category="unknown",
        reflectance=given,
        source=f"given for {where}",
        provenance="assigned",
        confidence=1.0,
        measured_range_nm=given.range_nm,
        color=(gray, gray, gray),
    )
