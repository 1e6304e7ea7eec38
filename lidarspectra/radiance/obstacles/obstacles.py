"""Obstacles: closed meshes that are put into a compiled room, such as somebody who stands there."""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lidarspectra.arrays import BoolArray, FloatArray, IntArray, float_array, int_array
from lidarspectra.errors import ArrayError, SceneError
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import bare_scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.material_map import Material
from lidarspectra.radiance.engine.cluster import SCENE_SUFFIXES
from lidarspectra.radiance.engine.engine import Engine
from lidarspectra.radiance.engine.octree import extend_octree
from lidarspectra.radiance.scene import primitives
from lidarspectra.radiance.scene.scene import RadianceScene
from lidarspectra.radiance.scene.scene_record import ScenePass
from lidarspectra.radiance.scene.surfaces import surface_slots, surface_text
from lidarspectra.spectra.spectrum import Spectrum

_Floats = NDArray[np.floating]
AROUND_M = 1e-3  # [m] the cylinder around an obstacle is so much wider, against rounding


@dataclass(frozen=True, kw_only=True, eq=False)
class Obstacle:
    """A closed, opaque mesh.

    Parameters
    ----------
    vertices : (vertex, 3) float
        In the room's coordinates. [m]
    faces : (face, 3) int
    face_material : (face,) int
        Index into materials.
    materials : tuple of Material
        Neither glass nor translucent.
    """

    vertices: FloatArray
    faces: IntArray
    face_material: IntArray
    materials: tuple[Material, ...]

    def __post_init__(self) -> None:
        vertices = float_array(self.vertices, name="Obstacle.vertices", shape=(None, 3))
        faces = int_array(self.faces, name="Obstacle.faces", shape=(None, 3))
        kinds = int_array(self.face_material, name="Obstacle.face_material", shape=(len(faces),))
        if len(faces) == 0 or kinds.min() < 0 or kinds.max() >= len(self.materials):
            raise ArrayError(
                expected="faces, each with one of the materials",
                found=f"{len(faces)} faces, {len(self.materials)} materials",
                where="obstacle",
            )
        for material in self.materials:
            if material.kind in ("glass", "trans"):
                raise SceneError(
                    expected="an opaque obstacle", found=f"{material.kind}", where=f"material '{material.name}'"
                )
        for name, value in (("vertices", vertices), ("faces", faces), ("face_material", kinds)):
            object.__setattr__(self, name, value)

    @cached_property
    def _caster(self) -> RayCaster:
        return RayCaster(bare_scan(self.vertices, self.faces))

    @cached_property
    def _cylinder(self) -> tuple[FloatArray, float, float, float]:
        """Upright cylinder around it: centre in plan, radius, lowest and highest z [m]."""
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        center = 0.5 * (low + high)[:2]
        radius = float(np.linalg.norm(self.vertices[:, :2] - center, axis=1).max())
        return center, radius + AROUND_M, float(low[2]) - AROUND_M, float(high[2]) + AROUND_M

    def meets(self, origins: _Floats, directions: _Floats, lengths: _Floats) -> BoolArray:
        """Whether each ray meets the obstacle before its end.

        Parameters
        ----------
        origins, directions : (ray, 3) float
            Unit directions. [m, 1]
        lengths : (ray,) float
            May be as long as you like. [m]

        Returns
        -------
        met : (ray,) bool
        """
        met = np.zeros(len(origins), dtype=np.bool_)
        near = np.flatnonzero(self._passes_near(origins, directions, lengths))
        if near.size:
            hits = self._caster.nearest(origins[near], directions[near])
            met[near] = hits.met & (hits.distance < lengths[near])
        return met

    def _passes_near(self, origins: _Floats, directions: _Floats, lengths: _Floats) -> BoolArray:
        """Whether each ray comes into the cylinder, or its neighbourhood: quick, and never wrongly no."""
        center, radius, low, high = self._cylinder
        x, y = origins[:, 0] - center[0], origins[:, 1] - center[1]
        u, v = directions[:, 0], directions[:, 1]
        level = u * u + v * v
        along = np.clip(-(x * u + y * v) / np.maximum(level, 1e-12), 0.0, lengths)
        apart = (x + along * u) ** 2 + (y + along * v) ** 2
        start, end = origins[:, 2], origins[:, 2] + lengths * directions[:, 2]
        return np.asarray(
            (apart <= radius**2) & (np.minimum(start, end) <= high) & (np.maximum(start, end) >= low), dtype=np.bool_
        )

    def holds(self, points: FloatArray) -> BoolArray:
        """(point,) whether each (point, 3) [m] lies inside: a ray straight up leaves through the back of a face."""
        up = np.array([0.0, 0.0, 1.0])
        hits = self._caster.nearest(points, up)
        return np.asarray(hits.met & (self._caster.normals[hits.face][:, 2] > 0), dtype=np.bool_)


def copy_compiled(scene: RadianceScene, folder: Path) -> None:
    """Copy what the engine reads of a scene (octrees, meshes, data) into another folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for path in sorted(scene.folder.iterdir()):
        if path.suffix in SCENE_SUFFIXES:
            shutil.copyfile(path, folder / path.name)


def add_obstacle(
    engine: Engine, folder: Path, scene: RadianceScene, lamps: Sequence[Lamp], obstacle: Obstacle, *, name: str
) -> dict[str, str]:
    """Compile the octrees of the room with an obstacle in it; the room itself is not compiled again.

    Parameters
    ----------
    engine : Engine
    folder : Path
        That `copy_compiled` filled.
    scene : RadianceScene
    lamps : sequence of Lamp
        The scene's.
    obstacle : Obstacle
    name : str
        Safe beginning of the files' names.

    Returns
    -------
    octrees : dict of str to str
        File name of the octree of each pass, by the pass's name.

    Raises
    ------
    SceneError
        If the obstacle reaches out of the room.
    """
    octrees = {}
    for scene_pass in scene.passes:
        octree = f"{name}_{scene_pass.name}"
        text = _obstacle_text(obstacle, scene, scene_pass, lamps, name)
        (folder / f"{octree}.rad").write_text(text, encoding="utf-8", newline="\n")
        extend_octree(engine, folder, scene_pass.octree, [f"{octree}.rad"], f"{octree}.oct")
        (folder / f"{octree}.rad").unlink()
        octrees[scene_pass.name] = f"{octree}.oct"
    return octrees


def _obstacle_text(
    obstacle: Obstacle, scene: RadianceScene, scene_pass: ScenePass, lamps: Sequence[Lamp], name: str
) -> str:
    light = _light_of(scene, scene_pass, lamps)
    modifiers = [f"{name}_m{index}" for index in range(len(obstacle.materials))]
    texts = [
        surface_text(modifier, material, surface_slots(material, light, scene.slots.bands, scene_pass.group))
        for modifier, material in zip(modifiers, obstacle.materials, strict=True)
    ]
    corners = obstacle.vertices[obstacle.faces]
    for face, material in enumerate(obstacle.face_material.tolist()):
        texts.append(primitives.polygon(modifiers[material], f"{name}_f{face}", corners[face]))
    return "".join(texts)


def _light_of(scene: RadianceScene, scene_pass: ScenePass, lamps: Sequence[Lamp]) -> Spectrum:
    """The light that weighs the pass's reflectances: the sum over the lamps of all passes that share its surfaces."""
    members = {lamp for other in scene.passes if other.surfaces == scene_pass.surfaces for lamp in other.lamps}
    grid = scene.bands.wavelengths_nm
    total = np.sum([lamps[index].flux.means(grid) for index in sorted(members)], axis=0)
    return Spectrum(wavelengths_nm=grid, values=total, name="light of the group")
