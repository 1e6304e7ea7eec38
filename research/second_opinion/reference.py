"""Irradiance at sensor points by Mitsuba's own path tracer, with its standard error.

    E = Σ_lamps ∫ L cosθ dω + ∫ L_reflected cosθ dω

The first half is drawn by Mitsuba's emitter sampling at the sensor. For the second, directions are drawn in proportion
to the cosine; those that meet a lamp count nothing, and along the others Mitsuba's `path` integrator tells the
radiance: emitter sampling at every corner, balanced with the surface's own directions, any number of reflections, ended
by lot alone. Both squares of random numbers are cut into cells with one sample each (`stratified`; its own independent
samples otherwise). Everything is unbiased, so the spread of independent repeats is the whole error.
"""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lidarspectra.arrays import FloatArray, float_array
from lidarspectra.geometry.scan import Scan
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.material.material_map import MaterialMap
from lidarspectra.progress import Progress, silent
from lidarspectra.radiance.engine.bands import band_groups, lamp_band_flux, spectral_groups
from lidarspectra.radiance.scene.mesh_text import CREASE_DEG
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.spectrum import BandSet
from research.second_opinion.export import RoomShape, Slots, build_scene, split_reflectance
from research.second_opinion.plugins import Custom
from research.second_opinion.variants import SLOTS, Mitsuba, find_mitsuba

SENSOR_OFFSET_M = 1e-4  # [m] rays start so far along the sensor's normal, as Radiance's do
MAX_RAYS = 2**20  # at once: about 1 GB
ALL_REFLECTIONS = -1  # Mitsuba's word for paths of any length


@dataclass(frozen=True, kw_only=True, eq=False)
class Reference:
    """What Mitsuba says.

    Parameters
    ----------
    irradiance, standard_error : (point, band) float
        [W/m²/nm]
    bands : tuple of int
        Which of the BandSet's they are.
    paths : int
        Paths a point and band, over all repeats.
    variant : str
        Of Mitsuba.
    seconds : float
        [s]
    """

    irradiance: FloatArray
    standard_error: FloatArray
    bands: tuple[int, ...]
    paths: int
    variant: str
    seconds: float

    def __post_init__(self) -> None:
        shape = (None, len(self.bands))
        object.__setattr__(self, "irradiance", float_array(self.irradiance, name="irradiance", shape=shape))
        error = float_array(self.standard_error, name="standard_error", shape=self.irradiance.shape)
        object.__setattr__(self, "standard_error", error)


def reference_irradiance(
    scan: Scan,
    materials: MaterialMap,
    lamps: Sequence[Lamp],
    bands: BandSet,
    points: SensorPoints,
    *,
    only_bands: Sequence[int] | None = None,
    cells: int = 32,
    repeats: int = 8,
    seed: int = 0,
    crease_deg: float = CREASE_DEG,
    custom: Custom = "radiance",
    stratified: bool = True,
    plain: bool = False,
    progress: Progress = silent,
) -> Reference:
    """Irradiance of a room's sensor points by Mitsuba 3.

    Parameters
    ----------
    scan, materials, lamps, bands, points
        As `write_scene` and `trace` take them.
    only_bands : sequence of int, optional
        Bands that are wanted; all if left out. Three cost what one costs.
    cells : int
        Cells along each side of a repeat's squares of random numbers: cells² paths a point.
    repeats : int
        Independent estimates, 2 or more, whose mean is given and whose spread is the error.
    seed : int
    crease_deg : float
        As in `write_scene`; 0 for flat facets. [deg]
    custom : 'textbook' or 'radiance'
        What corner normals mean, see `plugins`.
    stratified : bool
        Whether random numbers are drawn cell by cell, which is less noisy. The plain variant always does.
    plain : bool
        Use Mitsuba's plain variant even where LLVM is there.
    progress : Progress, optional

    Returns
    -------
    reference : Reference

    Raises
    ------
    EngineError
        If Mitsuba is not there.
    MaterialError, LampError
        If the scene has what is not exported: glass, trans, candela tables; with the plain variant gloss and beams.
    """
    start = time.perf_counter()
    mitsuba = find_mitsuba(plain=plain)
    room = RoomShape.of(scan, materials, lamps, crease_deg=crease_deg)
    wanted = tuple(range(len(bands))) if only_bands is None else tuple(only_bands)
    estimates = np.zeros((repeats, len(points), len(bands)))
    passes = list(_passes(materials, lamps, bands, wanted))
    for number, (carried, slots) in enumerate(passes):
        scene = build_scene(mitsuba, room, slots, custom=custom)
        for repeat in range(repeats):
            progress((number + repeat / repeats) / len(passes), f"Mitsuba: pass {number + 1} of {len(passes)}")
            value = _estimate(mitsuba, scene, points, cells, stratified=stratified, seed=seed + 1_000 * number + repeat)
            estimates[repeat][:, carried] += value[:, : len(carried)]
    estimates = estimates[..., wanted]
    progress(1.0, "Mitsuba is done")
    return Reference(
        irradiance=estimates.mean(axis=0),
        standard_error=estimates.std(axis=0, ddof=1) / np.sqrt(repeats),
        bands=wanted,
        paths=repeats * cells**2,
        variant=mitsuba.variant,
        seconds=time.perf_counter() - start,
    )


def _passes(
    materials: MaterialMap, lamps: Sequence[Lamp], bands: BandSet, wanted: Sequence[int]
) -> Iterator[tuple[list[int], Slots]]:
    """Bands carried, and slots, of every pass: the lamps of one spectral group in three bands, the others black."""
    flux = lamp_band_flux([lamp.flux for lamp in lamps], bands)
    groups = band_groups(len(bands), "native")
    for light in spectral_groups([lamp.flux for lamp in lamps], bands):
        rho = np.array([bands.reflected_values(each.reflectance, light.light) for each in materials.materials])
        diffuse, glossy, roughness = np.empty_like(rho), np.empty_like(rho), np.empty(len(rho))
        for index, material in enumerate(materials.materials):
            for group in groups:
                part = list(group.bands)
                diffuse[index, part], glossy[index, part], roughness[index] = split_reflectance(
                    material, rho[index, part]
                )
        lit = np.zeros((len(lamps), 1))
        lit[list(light.lamps)] = 1.0
        for first in range(0, len(wanted), SLOTS):
            carried = list(wanted[first : first + SLOTS])
            padded = [*carried, *[carried[-1]] * (SLOTS - len(carried))]
            slots = Slots(
                diffuse=diffuse[:, padded], glossy=glossy[:, padded], roughness=roughness, flux=(lit * flux)[:, padded]
            )
            yield carried, slots


def _estimate(
    mitsuba: Mitsuba, scene: Any, points: SensorPoints, cells: int, *, stratified: bool, seed: int
) -> FloatArray:
    """(point, 3) one independent estimate [W/m²/nm]."""
    if not mitsuba.is_fast:
        return _estimate_plain(mitsuba, scene, points, cells, seed=seed)
    at_once = max(1, MAX_RAYS // cells**2)
    parts = []
    for number, first in enumerate(range(0, len(points), at_once)):
        some = slice(first, first + at_once)
        parts.append(
            _estimate_many(
                mitsuba,
                scene,
                points.positions[some],
                points.normals[some],
                cells,
                stratified=stratified,
                seed=seed + 10_000_019 * number,
            )
        )
    return np.concatenate(parts)


def _estimate_many(
    mitsuba: Mitsuba,
    scene: Any,
    positions: FloatArray,
    normals: FloatArray,
    cells: int,
    *,
    stratified: bool,
    seed: int,
) -> FloatArray:
    mi, dr = mitsuba.mi, mitsuba.dr
    paths = cells * cells
    count = paths * len(positions)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, count)
    index = dr.arange(mi.UInt32, count)
    point, cell = index // paths, index % paths
    corner = mi.Point2f(mi.Float(cell % cells), mi.Float(cell // cells)) if stratified else mi.Point2f(0.0, 0.0)
    side = cells if stratified else 1
    normal = dr.gather(mi.Normal3f, mi.Normal3f(normals.T.astype(np.float32)), point)
    origin = dr.gather(mi.Point3f, mi.Point3f(positions.T.astype(np.float32)), point) + SENSOR_OFFSET_M * normal

    place = dr.zeros(mi.Interaction3f, count)
    place.p, place.n = origin, normal
    towards, light = scene.sample_emitter_direction(place, (corner + sampler.next_2d()) / side, True)
    direct = light * dr.maximum(dr.dot(normal, towards.d), 0.0)

    local = mi.warp.square_to_cosine_hemisphere((corner + sampler.next_2d()) / side)
    ray = mi.RayDifferential3f(mi.Ray3f(origin, mi.Frame3f(normal).to_world(local)))
    met = scene.ray_intersect(ray)
    dark = met.is_valid() & met.shape.is_emitter()
    radiance, _, _ = _integrator(mitsuba).sample(scene, sampler, ray, None, ~dark)
    reflected = np.pi * dr.select(dark, 0.0, radiance)
    total = np.array(direct + reflected, dtype=np.float64)
    return np.asarray(total.reshape(3, len(positions), paths).mean(axis=2).T, dtype=np.float64)


def _estimate_plain(mitsuba: Mitsuba, scene: Any, points: SensorPoints, cells: int, *, seed: int) -> FloatArray:
    mi = mitsuba.mi
    integrator, sampler = _integrator(mitsuba), mi.load_dict({"type": "independent"})
    sampler.seed(seed)
    totals = np.zeros((len(points), SLOTS))
    for number, (position, normal) in enumerate(zip(points.positions, points.normals, strict=True)):
        origin, frame = position + SENSOR_OFFSET_M * normal, mi.Frame3f(normal.tolist())
        place = mi.Interaction3f()
        place.p, place.n, place.t, place.time = origin.tolist(), normal.tolist(), 0.0, 0.0
        for corner in np.ndindex(cells, cells):
            first, second = np.array(sampler.next_2d()), np.array(sampler.next_2d())
            towards, light = scene.sample_emitter_direction(place, ((corner + first) / cells).tolist(), True)
            totals[number] += np.array(light) * max(float(np.dot(normal, np.array(towards.d))), 0.0)
            local = mi.warp.square_to_cosine_hemisphere(((corner + second) / cells).tolist())
            ray = mi.RayDifferential3f(mi.Ray3f(origin.tolist(), frame.to_world(local)))
            met = scene.ray_intersect(ray)
            if not (met.is_valid() and met.shape.is_emitter()):
                totals[number] += np.pi * np.array(integrator.sample(scene, sampler, ray)[0])
    return totals / cells**2


def _integrator(mitsuba: Mitsuba) -> Any:
    return mitsuba.mi.load_dict({"type": "path", "max_depth": ALL_REFLECTIONS})
