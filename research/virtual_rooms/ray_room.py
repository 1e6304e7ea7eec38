"""Rooms of any shape whose light is found by rays alone: no plan, no Radiance, nothing of the product.

Matt surfaces, each of one reflectance in linear sRGB, in the light of lamps that are as white as daylight. The mesh is
cut fine; each face gathers direct light by points on the lamps, and the rest by cosine-weighted rays, each of which
brings the radiance of the face that it meets (radiosity by rays, bounce by bounce):

    L_i = ρ_i / π (E_i + π mean_k L_hit(i, k)).

The scan is that mesh with noise, and at each corner the radiance as a camera without tone curve shows it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import trimesh

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.spectra.colorimetry import LUMINANCE_FROM_SRGB, encode_srgb

RAYS, BOUNCES = 200, 14  # of each face
LAMP_POINTS = 96  # of all lamps, for each face's direct light
AT_POINT = (4000, 1500)  # rays and lamp points of a sensor point
BATCH = 2_000_000  # rays at once
LIFT_M = 1e-4  # [m] of rays above what they start from
LEAST_M2 = 1e-4  # [m²] squared distance, floor of what is divided by
NOISE_M = 0.004  # [m] of the scan's corners
SHOWN = (0.9, 0.6)  # [1] quantile of the radiance over the area, and what of white the picture has there


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """A surface of one reflectance.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        [m], normals towards the air.
    reflectance : tuple of float
        Linear sRGB. [1]
    radiance : float
        That it sends itself, in units in which `Solved.illuminance` is in lux; 0 but for a lamp.
    """

    mesh: trimesh.Trimesh
    reflectance: tuple[float, float, float]
    radiance: float = 0.0


@dataclass(eq=False)
class RayRoom:
    """A room to which parts are added.

    Parameters
    ----------
    edge_m : float
        Longest edge of a face. [m]
    """

    edge_m: float = 0.08
    parts: list[Part] = field(default_factory=list)

    def add(
        self,
        mesh: trimesh.Trimesh,
        reflectance: float | tuple[float, float, float],
        *,
        radiance: float = 0.0,
        seen_from: Sequence[float] | None = None,
    ) -> None:
        """Add a surface; `seen_from` a place [m], its faces are turned towards that."""
        corners, faces = trimesh.remesh.subdivide_to_size(  # type: ignore[no-untyped-call]
            mesh.vertices, mesh.faces, self.edge_m, max_iter=20
        )
        fine = trimesh.Trimesh(corners, faces, process=False)
        if seen_from is not None:
            away = np.einsum("fk,fk->f", np.asarray(seen_from) - fine.triangles_center, fine.face_normals) < 0
            turned = fine.faces.copy()
            turned[away] = turned[away][:, ::-1]
            fine = trimesh.Trimesh(corners, turned, process=False)
        color = (reflectance,) * 3 if isinstance(reflectance, float) else reflectance
        self.parts.append(Part(mesh=fine, reflectance=color, radiance=radiance))

    @property
    def lamps(self) -> list[tuple[FloatArray, float]]:
        """Middle [m] and luminous flux [lm] of each lamp."""
        lit = [part for part in self.parts if part.radiance > 0]
        return [(part.mesh.bounds.mean(axis=0), float(np.pi * part.mesh.area * part.radiance)) for part in lit]

    def solved(self, *, rays: int = RAYS, seed: int = 1) -> "Solved":
        """The light of all faces."""
        meshes = [part.mesh for part in self.parts]
        starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])[:-1]
        faces = np.vstack([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)])
        counts = [len(mesh.faces) for mesh in meshes]
        mesh = trimesh.Trimesh(np.vstack([mesh.vertices for mesh in meshes]), faces, process=False)
        reflectance = np.repeat([part.reflectance for part in self.parts], counts, axis=0)
        own = np.repeat([part.radiance for part in self.parts], counts)
        return Solved.of(mesh, reflectance, own, rays=rays, generator=np.random.default_rng(seed))


@dataclass(frozen=True, kw_only=True, eq=False)
class Solved:
    """A room and its light.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        All faces. [m]
    reflectance : (face, 3) float
        Linear sRGB. [1]
    own : (face,) float
        Radiance that faces send themselves.
    irradiance : (face, 3) float
        That falls on them, over the lamps' white.
    """

    mesh: trimesh.Trimesh
    reflectance: FloatArray
    own: FloatArray
    irradiance: FloatArray

    @classmethod
    def of(
        cls,
        mesh: trimesh.Trimesh,
        reflectance: FloatArray,
        own: FloatArray,
        *,
        rays: int,
        generator: np.random.Generator,
    ) -> "Solved":
        """Solve a mesh bounce by bounce."""
        dark = cls(mesh=mesh, reflectance=reflectance, own=own, irradiance=np.zeros_like(reflectance))
        middles, normals = mesh.triangles_center, mesh.face_normals
        direct = np.repeat(dark._direct(middles, normals, LAMP_POINTS, generator)[:, None], 3, axis=1)
        met = dark._met(middles, normals, rays, generator)
        irradiance = direct
        for _ in range(BOUNCES):
            irradiance = direct + _gathered(reflectance * irradiance, met)
        return cls(mesh=mesh, reflectance=reflectance, own=own, irradiance=irradiance)

    @property
    def exitance(self) -> FloatArray:
        """(face, 3) what faces reflect, over the lamps' white."""
        return np.asarray(self.reflectance * self.irradiance)

    def illuminance(self, places: FloatArray, *, seed: int = 5) -> FloatArray:
        """(place,) on (place, 3) points [m] that look up [lx]."""
        generator = np.random.default_rng(seed)
        up = np.broadcast_to([0.0, 0.0, 1.0], places.shape)
        rays, lamp_points = AT_POINT
        gathered = _gathered(self.exitance, self._met(places, up, rays, generator))
        return np.asarray(self._direct(places, up, lamp_points, generator) + gathered @ LUMINANCE_FROM_SRGB)

    def save_scan(
        self, path: Path, *, seed: int = 3, shown: float = SHOWN[1], balance: tuple[float, float, float] = (1, 1, 1)
    ) -> None:
        """Write a PLY file with a colour at each corner, where those of a part are its own.

        The quantile `SHOWN[0]` is `shown` of white, and the camera leaves the light's hue by a factor on each channel.
        """
        corners = self.mesh.vertices
        total, weight = np.zeros((len(corners), 3)), np.zeros(len(corners))
        sent = self.exitance / np.pi + self.own[:, None]
        for corner in self.mesh.faces.T:
            np.add.at(total, corner, sent * self.mesh.area_faces[:, None])
            np.add.at(weight, corner, self.mesh.area_faces)
        radiance = total / np.maximum(weight, 1e-12)[:, None]
        luminance = radiance @ LUMINANCE_FROM_SRGB
        rising = np.argsort(luminance)
        mass = np.cumsum(weight[rising]) / weight.sum()
        exposed = radiance * balance * shown / luminance[rising][np.searchsorted(mass, SHOWN[0])]
        color = np.rint(255.0 * encode_srgb(np.clip(exposed, 0.0, 1.0))).astype(np.uint8)
        noise = np.random.default_rng(seed).normal(0.0, NOISE_M, corners.shape)
        color = np.hstack([color, np.full((len(color), 1), 255, np.uint8)])
        trimesh.Trimesh(corners + noise, self.mesh.faces, vertex_colors=color, process=False).export(path)

    def _met(self, places: FloatArray, normals: FloatArray, count: int, generator: np.random.Generator) -> IntArray:
        """(place, ray) number of the face whose front each cosine-weighted ray meets; -1 for none."""
        met = np.empty((len(places), count), np.int64)
        for first in range(0, len(places), step := max(1, BATCH // count)):
            own = slice(first, first + step)
            ways = _cosine_weighted(normals[own], count, generator)
            starts = np.repeat(places[own] + LIFT_M * normals[own], count, axis=0)
            face = self.mesh.ray.intersects_first(starts, ways.reshape(-1, 3)).reshape(-1, count)
            front = np.einsum("prk,prk->pr", self.mesh.face_normals[face], ways) < 0
            met[own] = np.where((face >= 0) & front, face, -1)
        return met

    def _direct(
        self, places: FloatArray, normals: FloatArray, count: int, generator: np.random.Generator
    ) -> FloatArray:
        """(place,) light of the lamps by (count) points on them, drawn by their flux."""
        lamps = np.flatnonzero(self.own > 0)
        flux = self.own[lamps] * self.mesh.area_faces[lamps]
        light = np.zeros(len(places))
        for first in range(0, len(places), step := max(1, BATCH // count)):
            own = slice(first, first + step)
            face = lamps[generator.choice(len(lamps), (len(places[own]), count), p=flux / flux.sum())]
            ways = self._points_on(face, generator) - places[own][:, None]
            squared = np.einsum("prk,prk->pr", ways, ways)
            ways /= np.sqrt(np.maximum(squared, LEAST_M2))[..., None]
            here = np.einsum("prk,pk->pr", ways, normals[own])
            there = -np.einsum("prk,prk->pr", ways, self.mesh.face_normals[face])
            lit = (here > 0) & (there > 0)
            starts = np.broadcast_to((places[own] + LIFT_M * normals[own])[:, None], ways.shape)
            lit[lit] = self.own[self.mesh.ray.intersects_first(starts[lit], ways[lit])] > 0
            light[own] = flux.sum() * (lit * here * there / np.maximum(squared, LEAST_M2)).mean(axis=1)
        return light

    def _points_on(self, face: IntArray, generator: np.random.Generator) -> FloatArray:
        """(..., 3) a point on each face, even over it [m]."""
        root, share = np.sqrt(generator.random(face.shape))[..., None], generator.random(face.shape)[..., None]
        first, second, third = np.moveaxis(self.mesh.triangles[face], -2, 0)
        return np.asarray((1.0 - root) * first + root * (1.0 - share) * second + root * share * third)


def _gathered(exitance: FloatArray, met: IntArray) -> FloatArray:
    """(place, 3) irradiance by rays that met (place, ray) faces."""
    with_nothing = np.vstack([exitance, np.zeros(3)])  # which the number -1 picks
    parts = np.array_split(met, max(1, met.size // BATCH))
    return np.concatenate([with_nothing[part].mean(axis=1) for part in parts])


def _cosine_weighted(normals: FloatArray, count: int, generator: np.random.Generator) -> FloatArray:
    """(place, ray, 3) unit vectors."""
    share, turn = generator.random((2, len(normals), count))
    turn = 2.0 * np.pi * turn
    helper = np.where(np.abs(normals[:, :1]) > 0.8, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    first = np.cross(normals, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normals, first)
    axes = (first, second, normals)
    along = (np.sqrt(share) * np.cos(turn), np.sqrt(share) * np.sin(turn), np.sqrt(1.0 - share))
    return np.asarray(sum(axis[:, None] * part[..., None] for axis, part in zip(axes, along, strict=True)))
