"""Rooms with closed-form answers, made through the same scene writer as any run."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
import xarray as xr
from numpy.typing import ArrayLike

from lidarspectra.geometry.scan import Appearance, Scan, ScanRecord
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import shape_of
from lidarspectra.material.material_map import Material, MaterialMap
from lidarspectra.radiance.scene.scene import RadianceScene, write_scene
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.spectrum import BandSet, Spectrum, uniform_bands

BANDS = uniform_bands(400.0, 700.0, 3)
RANGE_NM = np.array([380.0, 780.0])


def flat(value: float) -> Spectrum:
    """The same value at all wavelengths."""
    return Spectrum(wavelengths_nm=RANGE_NM, values=np.full(2, value))


def _material(reflectance: float | Spectrum | Material) -> Material:
    if isinstance(reflectance, Material):
        return reflectance
    return wall(reflectance)


def wall(reflectance: float | Spectrum, **more: Any) -> Material:
    """A matt material, or with `kind` and what belongs to it another one."""
    return Material(
        name="wall",
        category="test",
        reflectance=reflectance if isinstance(reflectance, Spectrum) else flat(reflectance),
        source="test",
        provenance="modelled",
        confidence=1.0,
        measured_range_nm=(380.0, 780.0),
        color=(0.5, 0.5, 0.5),
        **more,
    )


def _scan(mesh: trimesh.Trimesh) -> Scan:
    count = len(mesh.faces)
    return Scan(
        vertices=np.array(mesh.vertices),
        faces=np.array(mesh.faces),
        appearance=Appearance(
            images=(),
            face_image=np.full(count, -1),
            corner_uv=np.zeros((count, 3, 2)),
            corner_color=np.full((count, 3, 3), 0.5),
        ),
        record=ScanRecord(
            file="test",
            unit="m",
            unit_confidence=1.0,
            up_axis="+z",
            up_confidence=1.0,
            faces_read=count,
            faces_kept=count,
        ),
    )


class Rooms:
    """Writes scenes into one temporary folder."""

    bands = BANDS
    wall = staticmethod(wall)

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._count = 0

    def scene(
        self,
        lamps: Sequence[Lamp],
        surfaces: Sequence[tuple[trimesh.Trimesh, float | Spectrum | Material]] = (),
        *,
        bands: BandSet = BANDS,
        mode: str = "native",
    ) -> RadianceScene:
        """Surfaces (mesh, reflectance or material) under lamps; without surfaces, empty space."""
        if not surfaces:
            far = trimesh.Trimesh(vertices=[[0, 0, -100], [0.01, 0, -100], [0, 0.01, -100]], faces=[[0, 1, 2]])
            surfaces = [(far, 0.0)]
        meshes = [mesh for mesh, _ in surfaces]
        faces = np.concatenate([np.full(len(mesh.faces), index) for index, mesh in enumerate(meshes)])
        materials = MaterialMap(
            materials=tuple(_material(value) for _, value in surfaces),
            face_material=faces,
            face_color=np.full((len(faces), 3), 0.5),
            face_seen=np.ones(len(faces)),
        )
        self._count += 1
        scan = _scan(trimesh.util.concatenate(meshes))
        return write_scene(scan, materials, lamps, bands, self._folder / f"scene{self._count}", mode=mode)

    @staticmethod
    def lamp(
        shape: str, center: ArrayLike, size: float | tuple[float, ...], *, name: str = "lamp", **more: object
    ) -> Lamp:
        """A lamp of 1 W/nm, so that its irradiance is its coefficient; down unless `normal` is given."""
        given: dict[str, object] = {"flux": flat(1.0), "normal": (0.0, 0.0, -1.0)} | more
        sizes = size if isinstance(size, tuple) else (size,)
        options = {key: given.pop(key) for key in ("beam_angle_deg", "candela_text") if key in given}
        return Lamp(name=name, shape=shape_of(shape, sizes, **options), center=np.asarray(center, dtype=float), **given)

    @staticmethod
    def room(size: float = 1.0) -> trimesh.Trimesh:
        """A cube seen from inside, its lowest corner in the origin."""
        mesh = trimesh.creation.box(bounds=[[0, 0, 0], [size, size, size]])
        mesh.invert()
        return mesh

    @staticmethod
    def ball(radius: float, center: ArrayLike = (0, 0, 0), *, inside: bool = True) -> trimesh.Trimesh:
        """A sphere of 5120 triangles."""
        mesh = trimesh.creation.icosphere(subdivisions=4, radius=radius)
        mesh.apply_translation(center)
        if inside:
            mesh.invert()
        return mesh


@pytest.fixture
def rooms(tmp_path: Path) -> Rooms:
    return Rooms(tmp_path)


@pytest.fixture(scope="session")
def sensors() -> Callable[..., SensorPoints]:
    """Points from positions and one or as many normals."""

    def make(positions: ArrayLike, normals: ArrayLike) -> SensorPoints:
        places = np.atleast_2d(np.asarray(positions, dtype=float))
        return SensorPoints(
            positions=places,
            normals=np.broadcast_to(np.asarray(normals, dtype=float), places.shape),
            buried=np.zeros(len(places), dtype=bool),
        )

    return make


@pytest.fixture(scope="session")
def section() -> Callable[..., dict[str, Any]]:
    """Arguments of `trace` for two processes."""

    def make(accuracy: str = "low", noise: str = "fine") -> dict[str, Any]:
        return {"accuracy": accuracy, "noise": noise, "workers": 2}

    return make


@pytest.fixture(scope="session")
def check() -> Callable[..., None]:
    """Hold coefficients to a closed form by their own standard error.

    Eight of it: a lone sensor's is known from eight batches, and what it names for 95 % is passed eightfold once in
    40,000 values; the engine's numbers differ from run to run.
    `shape` is how far the model's geometry itself is from the closed form's, relative; `most` is the largest
    standard error for which the comparison means anything, relative.
    """

    def hold(transport: xr.Dataset, expected: ArrayLike, *, shape: float = 1e-3, most: float = 0.03) -> None:
        found = transport["coefficient"].to_numpy().sum(axis=0)
        error = transport["irradiance_se"].to_numpy()
        wanted = np.broadcast_to(np.asarray(expected, dtype=float), found.shape)
        assert np.all(np.abs(found - wanted) <= 8.0 * error + shape * wanted), (found / wanted, error / wanted)
        assert np.all(error <= most * wanted), error / wanted

    return hold
