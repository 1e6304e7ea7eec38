"""The light of a design's lamps at its points: traced, and then lit by any dimming and spectra."""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import xarray as xr

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.mapping.maps.response_weights import lamp_weights
from lidarspectra.mapping.photometry.point_light import PointLight, light_of_lamps
from lidarspectra.progress import Progress, silent
from lidarspectra.radiance.sampling.folding import spectrum_error, with_spectrum
from lidarspectra.radiance.sampling.trace import trace
from lidarspectra.radiance.scene.clearance import clear_lamps
from lidarspectra.radiance.scene.relit_scene import flux_ratio
from lidarspectra.radiance.scene.scene import write_scene
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.spectrum import BandSet, Spectrum
from lidarspectra.workflow.calibration.light import RunRoom
from lidarspectra.workflow.design.lamps import DesignLamps
from lidarspectra.workflow.design.points import TargetPoints
from lidarspectra.workflow.run_folder.light_of_run import scene_of_run

SEED = 20240519
CHECK_SEED = 7919  # another one than any that the design rests on
MAX_COVER = 0.01  # [1] of the plan that candidates may cover
LEAST_SIZE = 0.05  # [1] of a lamp's own: smaller ones are hard to sample
LEFT_OUT = ("coefficient_batches", "coefficient_se", "truncation_coefficient", "opening_coefficient")


@dataclass(frozen=True, kw_only=True, eq=False)
class TracedLamps:
    """Transport of some lamps to points.

    Parameters
    ----------
    transport : xarray.Dataset
    fluxes : mapping of str to Spectrum
        By lamp, with which it was traced. [W/nm]
    bands : BandSet
    """

    transport: xr.Dataset
    fluxes: Mapping[str, Spectrum]
    bands: BandSet

    def lit(self, fluxes: Mapping[str, Spectrum]) -> PointLight:
        """Light at the points under other fluxes and spectra; lamps that are not among them are off [W/nm]."""
        transport, names = self.transport, [str(name) for name in self.transport["lamp"].to_numpy()]
        for name in names:
            if name in fluxes and flux_ratio(self.fluxes[name], fluxes[name]) is None:
                transport = with_spectrum(transport, name, fluxes[name])
        used = {**self.fluxes, **fluxes}
        sent = np.stack([self.bands.band_values(used[name], outside="zero") for name in names])
        transport = transport.assign(flux=(("lamp", "band"), sent, transport["flux"].attrs))
        off = {name: 0.0 for name in names if name not in fluxes}
        return light_of_lamps(transport, used, off)

    def coefficient(self, name: str, flux: Spectrum, points: IntArray) -> FloatArray:
        """(point, band) coefficients of a lamp with a spectrum [m⁻²]."""
        some = self.transport.drop_vars(LEFT_OUT, errors="ignore").sel(lamp=[name]).isel(point=points)
        if flux_ratio(self.fluxes[name], flux) is None:
            some = with_spectrum(some, name, flux)
        values = some["coefficient"].transpose("lamp", "point", "band").to_numpy()
        return np.asarray(values[0], dtype=np.float64)

    def spectrum_error(self, name: str, flux: Spectrum) -> float:
        """Predicted error of the reflected light of the worst channel with another spectrum [1]."""
        if flux_ratio(self.fluxes[name], flux) is not None:
            return 0.0
        return float(np.abs(spectrum_error(self.transport, name, flux)).max(initial=0.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class DesignLight:
    """Transport of a design's lamps, and of the run's as they are.

    Parameters
    ----------
    places : xarray.Dataset
        The run's points.
    run, own : TracedLamps
        The design's lamps, at the run's points and at places that the targets name (None if there are none).
    run_before, own_before : TracedLamps
        The run's lamps, at the same.
    """

    places: xr.Dataset
    run: TracedLamps
    own: TracedLamps | None
    run_before: TracedLamps
    own_before: TracedLamps | None

    def traced(self, points: TargetPoints) -> TracedLamps:
        """The design's lamps at the points that a target's are among."""
        found = self.own if points.own else self.run
        assert found is not None  # since a target names such places
        return found

    def weights(self, points: TargetPoints, lamps: DesignLamps, response: Spectrum) -> tuple[FloatArray, FloatArray]:
        """A quantity at a target's points by each source at full, and by the lamps that stay.

        Parameters
        ----------
        points : TargetPoints
        lamps : DesignLamps
        response : Spectrum
            Of the quantity. [unit of the quantity per W/m²]

        Returns
        -------
        light : (point, source) float
            [unit of the quantity]
        fixed : (point,) float
            [unit of the quantity]
        """
        centers = self.run.bands.centers_nm
        by_band, fixed = self._by_band(points, lamps, lambda flux: lamp_weights(centers, response, flux))
        return by_band.sum(axis=1), fixed.sum(axis=1)

    def channels(self, points: TargetPoints, lamps: DesignLamps) -> tuple[FloatArray, FloatArray]:
        """(point, band, source) and (point, band) irradiance in the channels [W/m²/nm]; parameters as of `weights`."""
        bands = self.run.bands
        return self._by_band(points, lamps, lambda flux: bands.band_values(flux, outside="zero"))

    def _by_band(
        self, points: TargetPoints, lamps: DesignLamps, weigh: Callable[[Spectrum], FloatArray]
    ) -> tuple[FloatArray, FloatArray]:
        traced = self.traced(points)
        columns = [
            traced.coefficient(free.lamp.name, choice.flux, points.index) * weigh(choice.flux)
            for free in lamps.free
            for choice in free.choices
        ]
        fixed = np.zeros_like(columns[0])
        for lamp in lamps.fixed:
            fixed += traced.coefficient(lamp.name, lamp.flux, points.index) * weigh(lamp.flux)
        return np.stack(columns, axis=-1), fixed


def present_light(
    run: Path,
    room: RunRoom,
    places: xr.Dataset,
    own: SensorPoints | None,
    *,
    workers: int | None = None,
    progress: Progress = silent,
) -> DesignLight:
    """Light of the run's lamps; traced only at places of one's own.

    Parameters
    ----------
    run : Path
    room : RunRoom
    places : xarray.Dataset
        The run's transport.
    own : SensorPoints or None
        Places that the targets name.
    workers : int, optional
    progress : callable

    Returns
    -------
    light : DesignLight
        Of a design that changes these lamps alone.
    """
    present = {lamp.name: lamp.flux for lamp in room.lamps}
    at_run = TracedLamps(transport=places, fluxes=present, bands=room.bands)
    at_own = None
    if own is not None:
        transport = trace(
            scene_of_run(run),
            own,
            accuracy=room.run_file.trace.accuracy,
            noise=room.run_file.trace.noise,
            seed=SEED,
            workers=workers,
            progress=progress,
        )
        at_own = TracedLamps(transport=transport, fluxes=present, bands=room.bands)
    return DesignLight(places=places, run=at_run, own=at_own, run_before=at_run, own_before=at_own)


def light_with_candidates(
    present: DesignLight,
    room: RunRoom,
    lamps: DesignLamps,
    *,
    small: bool,
    workers: int | None = None,
    progress: Progress = silent,
) -> DesignLight:
    """Light of lamps that the run does not have, traced in one go at all points.

    Parameters
    ----------
    present : DesignLight
        Of the run's lamps.
    room : RunRoom
    lamps : DesignLamps
    small : bool
        Whether candidates are so small that they hide next to nothing of the ceiling, since most of them will not hang.
    workers : int, optional
    progress : callable

    Returns
    -------
    light : DesignLight
    """
    free = shrunk(lamps, room) if small else tuple(each.lamp for each in lamps.free)
    used = (*lamps.fixed, *free)
    fluxes = {lamp.name: lamp.flux for lamp in used}
    points, count = run_points(present.places), present.places.sizes["point"]
    if present.own is not None:
        own = run_points(present.own.transport)
        points = SensorPoints(
            positions=np.concatenate([points.positions, own.positions]),
            normals=np.concatenate([points.normals, own.normals]),
            buried=np.concatenate([points.buried, own.buried]),
        )
    found = trace_lamps(room, used, points, seed=SEED + small, workers=workers, progress=progress)
    parts = [found.isel(point=slice(0, count)), found.isel(point=slice(count, None))]
    traced = [TracedLamps(transport=part, fluxes=fluxes, bands=room.bands) for part in parts]
    return replace(present, run=traced[0], own=None if present.own is None else traced[1])


def shrunk(lamps: DesignLamps, room: RunRoom) -> tuple[Lamp, ...]:
    """The lamps, candidates of the same flux and distribution so small that together they cover 1 % of the plan.

    What shines is black to other light: a ceiling full of candidates would reflect much less than one with a few lamps.
    """
    area = sum(each.lamp.shape.area for each in lamps.free if each.is_candidate)
    factor = min(1.0, max(float(np.sqrt(MAX_COVER * room.room.area_m2 / area)), LEAST_SIZE))
    found = []
    for each in lamps.free:
        shape = each.lamp.shape
        small = type(shape).of_size(tuple(factor * side for side in shape.size), shape.options)
        found.append(replace(each.lamp, shape=small) if each.is_candidate else each.lamp)
    return tuple(found)


def run_points(places: xr.Dataset) -> SensorPoints:
    """The points of a transport."""
    return SensorPoints(
        positions=np.stack([places[name].to_numpy() for name in "xyz"], axis=1),
        normals=np.stack([places[f"n{name}"].to_numpy() for name in "xyz"], axis=1),
        buried=places["buried"].to_numpy().astype(np.bool_),
    )


def trace_lamps(
    room: RunRoom,
    lamps: Sequence[Lamp],
    points: SensorPoints,
    *,
    seed: int,
    workers: int | None = None,
    progress: Progress = silent,
) -> xr.Dataset:
    """Transport of any lamps in a run's room, with its accuracy and noise; lamps behind a surface move before it."""
    clear = clear_lamps(lamps, room.scan)
    with tempfile.TemporaryDirectory(prefix="lidarspectra-") as name:
        scene = write_scene(clear.scan, room.materials, clear.lamps, room.bands, Path(name))
        return trace(
            scene,
            points,
            accuracy=room.run_file.trace.accuracy,
            noise=room.run_file.trace.noise,
            seed=seed,
            workers=workers,
            progress=progress,
        )
