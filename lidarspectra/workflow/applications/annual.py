"""A year of daylight in a run's room: the patches of the sky traced once, then every hour by arithmetic."""

import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.config import DaylightSection, RunFile
from lidarspectra.errors import RunFileError
from lidarspectra.geometry.rays import RayCaster
from lidarspectra.geometry.scan import Scan, bare_scan
from lidarspectra.lamps.lamp_spectra import unknown_channels
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Window as WindowShape
from lidarspectra.mapping.figures.floor_plan import floor_plan
from lidarspectra.mapping.maps.map_files import save_map, save_map_table
from lidarspectra.mapping.photometry.annual_light import YEAR_FILE, annual_light, map_of_hour, save_year
from lidarspectra.mapping.photometry.annual_metrics import SUMMER_TIME, point_metrics, room_metrics
from lidarspectra.mapping.report.annual_page import write_annual_page
from lidarspectra.progress import Progress, shares, silent
from lidarspectra.radiance.engine.engine import Engine
from lidarspectra.radiance.sampling.sky_transport import trace_sky
from lidarspectra.radiance.sampling.transport import KEPT_BATCH_VALUES, save_transport
from lidarspectra.radiance.scene.clearance import clear_lamps
from lidarspectra.radiance.scene.daylight import Window, window_shape
from lidarspectra.radiance.scene.openings import CURTAIN_M
from lidarspectra.radiance.scene.placement import placement_notes
from lidarspectra.radiance.scene.sky import SKY_WAVELENGTHS_NM, sky_spectrum
from lidarspectra.radiance.scene.sky_patches import SkyPatches, patch_geometry, sun_areas
from lidarspectra.radiance.scene.sky_scene import write_sky_scene
from lidarspectra.radiance.scene.weather import SYNTHETIC, Weather, read_epw, synthetic_year
from lidarspectra.radiance.scene.year_sky import YearSky, year_sky
from lidarspectra.spectra.sensor_files import find_bands
from lidarspectra.spectra.spectrum import BandSet
from lidarspectra.words import two_digits
from lidarspectra.workflow.pipeline import Listener, RunSummary, run
from lidarspectra.workflow.rules.year import plane_notes
from lidarspectra.workflow.run_folder.annual_inputs import FOLDER, with_inputs, year_inputs
from lidarspectra.workflow.run_folder.calibration_of_run import calibrated_materials
from lidarspectra.workflow.run_folder.inputs import Inputs, read_inputs
from lidarspectra.workflow.run_folder.lamps_of_run import ScannedRoom, lamps_of_run, windows_of_run
from lidarspectra.workflow.run_folder.sensing_of_run import sensor_points, trace_engine
from lidarspectra.workflow.run_folder.workspace import made_folder, writing_run

TRANSPORT_FILE = "sky-transport.nc"
SHARES = (0.03, 0.05, 0.8, 0.07, 0.05)  # of the time: weather, scene, trace, hours, page
SEED = 20240513
SUBDIVISION = 2  # of the sky, 577 patches: with 145 the sun that reaches deep rooms is smeared twice as much
CALIBRATED_CHANGE = 0.1  # [1] of the logarithm of a window's light, above which its factor is noted
NEAR_DEG = 2.0  # [deg] of latitude or longitude between the run file and its weather, above which that is noted


@dataclass(frozen=True, kw_only=True, eq=False)
class AnnualDaylight:
    """A year of daylight.

    Parameters
    ----------
    year : xarray.Dataset
        Hourly illuminance, melanopic EDI and sunlight at every point; see `mapping.photometry.annual_light`.
    transport : xarray.Dataset
        What it was made of; see `radiance.sampling.sky_transport`.
    bands : BandSet
        The sensor's channels.
    points, room : pandas.DataFrame
        Metrics of every point, and of the room with what the noise may change (`annual_metrics`).
    page : Path
        The page; everything else is beside it.
    notes : tuple of str
        Notes to the user: full sentences.
    """

    year: xr.Dataset
    transport: xr.Dataset
    bands: BandSet
    points: pd.DataFrame
    room: pd.DataFrame
    page: Path
    notes: tuple[str, ...]

    def map_at(self, time: str) -> xr.Dataset:
        """Spectral map of the hour that a time lies in.

        Parameters
        ----------
        time : str
            Month, day and hour in local standard time: '06-21 12:30', or with any year before, and then with an offset
            from UTC too.

        Returns
        -------
        map : xarray.Dataset
            A spectral map, as of a run.

        Raises
        ------
        RunFileError
            If it is no time, or an hour without daylight.
        """
        return map_of_hour(self.year, self.transport, self.bands, _hour_at(self.year, time))


def annual_daylight(
    run_file: str | PathLike[str] | RunFile,
    folder: str | PathLike[str] | None = None,
    *,
    maps: Sequence[str] = (),
    workers: int | None = None,
    cluster: str | None = None,
    listener: Listener | None = None,
    progress: Progress = silent,
) -> AnnualDaylight:
    """Make a run's missing stages up to its materials, then trace the sky's patches and compute the year.

    Parameters
    ----------
    run_file : str, path or RunFile
        As in `run`; `[daylight] weather` names an EPW file, or is 'synthetic'.
    folder : str or path, optional
        The run folder; NAME.run beside NAME.toml by default. The year goes to the folder annual there.
    maps : sequence of str
        Hours whose spectral maps are written too, as `AnnualDaylight.map_at` takes them.
    workers, cluster, listener
        As in `pipeline.run`.
    progress : Progress, optional
        Of the tracing.

    Returns
    -------
    annual : AnnualDaylight

    Raises
    ------
    LidarSpectraError
        If anything that the user gave does not fit.
    """
    inputs = read_inputs(run_file, workers=workers, cluster=cluster)
    section = _daylight(inputs.run_file, where=inputs.name)
    weather = _weather(section, inputs.base)
    summary = run(run_file, folder, last="materials", workers=workers, cluster=cluster, listener=listener)
    bands = find_bands(inputs.run_file.sensors.device, inputs.base)
    scanned = ScannedRoom(scan=summary.scan, room=summary.room)
    lamps = lamps_of_run(inputs.run_file, scanned, base=inputs.base)
    placed = clear_windows(_calibrated_windows(inputs.run_file), lamps, summary.scan)
    out = made_folder(summary.folder / FOLDER)
    with trace_engine(cluster) as engine:
        transport, year = _traced(inputs, summary, weather, bands, placed, engine, progress)
    year = with_inputs(year, year_inputs(inputs.run_file, inputs.base, summary.folder))
    if section.summer_time is not None:
        year.attrs[SUMMER_TIME] = " ".join(section.summer_time)
    points, room = point_metrics(year), room_metrics(year)
    notes = (
        *_notes(transport, weather, section),
        *plane_notes(year, summary.room.floor_at(np.stack([year["x"], year["y"]], axis=1))),
        *_calibration_notes(inputs.run_file),
        *placed.notes,
        *_glass_notes(summary, transport, placed.windows),
        *(channel_notes(bands) if maps else ()),
    )
    with writing_run(out):
        save_transport(_for_file(transport), out / TRANSPORT_FILE)
        save_year(year, out / YEAR_FILE)
    plan = floor_plan(summary.scan, summary.room)
    page = write_annual_page(out, year, points, room, plan, title=inputs.name, notes=notes)
    annual = AnnualDaylight(
        year=year, transport=transport, bands=bands, points=points, room=room, page=page, notes=notes
    )
    for time in maps:
        _save_map(annual, time, out)
    progress(1.0, "done")
    return annual


def _traced(
    inputs: Inputs,
    summary: RunSummary,
    weather: Weather,
    bands: BandSet,
    placed: "PlacedWindows",
    engine: Engine,
    progress: Progress,
) -> tuple[xr.Dataset, xr.Dataset]:
    """The transport of the sky's patches and the year."""
    skying, writing, tracing, computing, _ = shares(progress, SHARES)
    run_file, section = inputs.run_file, _daylight(inputs.run_file, where=inputs.name)
    windows, patches = placed.windows, SkyPatches(SUBDIVISION)
    scanned = ScannedRoom(scan=summary.scan, room=summary.room)
    points = sensor_points(summary.scan, summary.room, run_file.sensors, folder=inputs.base)
    with tempfile.TemporaryDirectory(prefix="lidarspectra-") as name:
        skying(0.0, "sky of every hour")
        sky = year_sky(
            weather,
            patches,
            Path(name),
            engine,
            aerosol_optical_depth=section.aerosol_optical_depth,
            ground_reflectance=section.ground_reflectance,
        )
        scene = write_sky_scene(
            placed.scan,
            calibrated_materials(summary.materials, scanned, run_file.calibration),
            windows,
            bands,
            Path(name),
            radiance=mean_radiance(sky, patches, windows, section.north_deg),
            lamps=placed.lamps,
            north_deg=section.north_deg,
            patches=patches,
            engine=engine,
            progress=writing,
        )
        transport = trace_sky(
            scene,
            points,
            sky,
            accuracy=run_file.trace.accuracy,
            noise=run_file.trace.noise,
            seed=SEED,
            workers=inputs.workers,
            engine=engine,
            progress=tracing,
        )
    computing(0.0, "light of every hour")
    return transport, annual_light(transport, sky, weather)


@dataclass(frozen=True, kw_only=True, eq=False)
class PlacedWindows:
    """Windows, lamps and a scan of which none hides the windows' light.

    Parameters
    ----------
    windows : tuple of Window
    lamps : tuple of Lamp
        Electric ones, which stand in the way.
    scan : Scan
        The same faces; some vertices may have moved.
    notes : tuple of str
        What was moved, and which windows are misplaced.
    """

    windows: tuple[Window, ...]
    lamps: tuple[Lamp, ...]
    scan: Scan
    notes: tuple[str, ...]


def clear_windows(windows: Sequence[Window], lamps: Sequence[Lamp], scan: Scan) -> PlacedWindows:
    """Windows and lamps where a run of a single moment has them: those that touch the scan are cleared.

    Parameters
    ----------
    windows : sequence of Window
    lamps : sequence of Lamp
    scan : Scan
        With normals towards the room.

    Returns
    -------
    placed : PlacedWindows
    """
    light = sky_spectrum(np.ones(SKY_WAVELENGTHS_NM.size), "any")
    panes = [
        Lamp(
            name=window.name,
            shape=WindowShape(*window.size),
            center=np.array(window.center),
            normal=np.array(window.normal),
            rotation_deg=window.rotation_deg,
            flux=light,
        )
        for window in windows
    ]
    clear = clear_lamps((*lamps, *panes), scan)
    moved = clear.lamps[len(lamps) :]
    return PlacedWindows(
        windows=tuple(
            replace(window, center=tuple(pane.center.tolist())) for window, pane in zip(windows, moved, strict=True)
        ),
        lamps=clear.lamps[: len(lamps)],
        scan=clear.scan,
        notes=(*clear.notes, *placement_notes(moved, clear.scan)),
    )


def _calibrated_windows(run_file: RunFile) -> tuple[Window, ...]:
    """The windows, with the calibration's factors on their light."""
    factors = {} if run_file.calibration is None else run_file.calibration.lamps
    return tuple(replace(window, factor=factors.get(window.name, 1.0)) for window in windows_of_run(run_file))


def _calibration_notes(run_file: RunFile) -> tuple[str, ...]:
    """A note where a calibration changes the windows by much: its readings saw glass and sky of one moment together."""
    factors = {} if run_file.calibration is None else run_file.calibration.lamps
    changed = [
        f"'{window.name}' x {factors[window.name]:.2g}"
        for window in windows_of_run(run_file)
        if abs(math.log(factors.get(window.name, 1.0))) > CALIBRATED_CHANGE
    ]
    if not changed:
        return ()
    return (
        f"The windows have the factors of [calibration] in all hours: {', '.join(changed)}. Its readings tell glass "
        "and sky of their moment together, so that a cloud which the run file did not know of is taken for dark glass. "
        "Leave the factor out, or give the glass its transmittance, if the sky was another one.",
    )


def mean_radiance(sky: YearSky, patches: SkyPatches, windows: Sequence[Window], north_deg: float) -> FloatArray:
    """(patch, wavelength) mean over the year's hours, with the sun's light spread over the patches around it.

    Of patches that windows see, in W/m²/sr/nm: so much radiance sends the flux that sky and sun send.
    """
    geometry = patch_geometry(patches, windows, north_deg)
    areas = sun_areas(patches, windows, north_deg, sky.sun_direction) * sky.sun_illuminance[:, None]
    from_sun = areas.T @ sky.sun_spectra / len(sky)
    spread = np.divide(from_sun, geometry[:, None], out=np.zeros_like(from_sun), where=geometry[:, None] > 0)
    return np.asarray(sky.mean_radiance + spread)


def _daylight(run_file: RunFile, *, where: str) -> DaylightSection:
    section = run_file.daylight
    if section is None or section.weather is None:
        raise RunFileError(
            expected="[daylight] with windows and weather, an EPW file or 'synthetic'",
            found="no [daylight]" if section is None else "no weather there",
            where=where,
            todo='Write weather = "synthetic" to try it; docs/howto-annual.md has an example.',
        )
    sensors = run_file.sensors
    if sensors.receptor is not None or sensors.field_of_view_deg is not None:
        raise RunFileError(
            expected="the cosine receptor, by which illuminance is defined",
            found="receptor" if sensors.receptor is not None else "field_of_view_deg",
            where=f"{where}, [sensors]",
            todo="Leave it out in the run file of the annual daylight.",
        )
    return section


def _weather(section: DaylightSection, base: Path) -> Weather:
    if section.weather != SYNTHETIC:
        return read_epw(base / str(section.weather))
    return synthetic_year(
        section.latitude_deg,
        section.longitude_deg,
        aerosol_optical_depth=section.aerosol_optical_depth,
        ground_reflectance=section.ground_reflectance,
    )


def _notes(transport: xr.Dataset, weather: Weather, section: DaylightSection) -> tuple[str, ...]:
    notes = [*weather.notes]
    if section.weather == SYNTHETIC:
        notes.append(
            "The weather is the synthetic year: the sun of the place under clouds that were drawn at random, not its "
            "climate. Give an EPW file of the place as [daylight] weather for a verdict on the room."
        )
    elif (
        max(
            abs(weather.latitude_deg - section.latitude_deg),
            abs((weather.longitude_deg - section.longitude_deg + 180.0) % 360.0 - 180.0),
        )
        > NEAR_DEG
    ):
        notes.append(
            f"The weather file is of {weather.name}, at {weather.latitude_deg:.1f}° north and "
            f"{weather.longitude_deg:.1f}° east, not of the run file's place, {section.latitude_deg:.1f}° and "
            f"{section.longitude_deg:.1f}°; the year is the weather file's. Correct one of them if that is not meant."
        )
    achieved, target = (transport.attrs[f"{kind}_relative_se"] for kind in ("achieved", "target"))
    if achieved > target:
        notes.append(
            f"The standard error of the year's mean light is {100 * achieved:.1f} %, above the target of "
            f"{100 * target:.1f} %, because the ray budget was used up. The ranges beside the metrics include it; "
            "write a coarser noise in [trace] if that is enough."
        )
    truncated = float(transport.attrs.get("truncated_share", 0.0))
    if truncated > target:
        notes.append(
            f"About {two_digits(100 * truncated)} % of the mean light is missing, because it is followed for "
            f'{transport.attrs["bounces"]} reflections only. Write accuracy = "all" in [trace] to follow all of it.'
        )
    return tuple(notes)


def _glass_notes(summary: RunSummary, transport: xr.Dataset, windows: Sequence[Window]) -> tuple[str, ...]:
    """A note where glass in the room stands between points and windows: the light cast straight stops at it."""
    clear = np.array([material.transmittance > 0 for material in summary.materials.materials])
    faces = summary.scan.faces[clear[summary.materials.face_material]]
    if not len(faces):
        return ()
    caster = RayCaster(bare_scan(summary.scan.vertices, faces))
    places = np.stack([transport[axis].to_numpy() for axis in "xyz"], axis=1)
    behind = np.zeros(len(places), dtype=np.bool_)
    for window in windows:
        inside = np.array(window.center) + CURTAIN_M * window_shape(window).normal  # its own pane does not count
        behind |= caster.blocked(places, inside - places, max_distance=1.0)
    if not behind.any():
        return ()
    return (
        f"At {int(behind.sum())} of {len(places)} points glass in the room stands before a window. What comes straight "
        "from sky and sun is left out behind it, so that these points, their sDA and ASE come out too low; what the "
        "room reflects passes. Judge them by 'lidarspectra run' at single moments.",
    )


def channel_notes(bands: BandSet) -> tuple[str, ...]:
    """A note on channels of an hour's map that daylight, as it is computed, does not reach."""
    daylight = sky_spectrum(np.ones(SKY_WAVELENGTHS_NM.size), "daylight")
    missing = np.array(bands.labels)[unknown_channels(daylight, bands)].tolist()
    if not missing:
        return ()
    return (
        f"Daylight is computed up to {daylight.range_nm[1]:g} nm: the maps' {', '.join(missing)} nm lack what comes "
        "beyond, and are no darkness.",
    )


def _for_file(transport: xr.Dataset) -> xr.Dataset:
    """The transport, without its independent estimates where they would make too large a file."""
    large = transport["coefficient"].size * transport.sizes.get("batch", 0) > KEPT_BATCH_VALUES
    return transport.drop_vars("coefficient_batches") if large else transport


def _hour_at(year: xr.Dataset, time: str) -> int:
    """Place among the hours with light of the one that a time lies in."""
    times = pd.DatetimeIndex(year["time"].to_numpy())
    words = time.strip().replace("T", " ")
    try:
        wanted = pd.Timestamp(words if words.count("-") > 1 else f"{times[0].year}-{words}")
        if wanted.tzinfo is not None:
            wanted = wanted.tz_convert("UTC").tz_localize(None) + pd.Timedelta(hours=float(year.attrs["utc_offset_h"]))
        wanted = wanted.replace(year=times[0].year).floor("h")
    except ValueError as cause:
        raise RunFileError(
            expected="month, day and hour, as 06-21 12:30", found=f"'{time}'", where="time of a map"
        ) from cause
    found = np.flatnonzero(times.floor("h") == wanted)
    if not found.size:
        raise RunFileError(
            expected="an hour with daylight",
            found=f"{wanted:%m-%d %H:%M}, when there is none",
            where="time of a map",
            todo="Times are local standard time, without summer time; or give them with their offset from UTC.",
        )
    return int(found[0])


def _save_map(annual: AnnualDaylight, time: str, folder: Path) -> None:
    light = annual.map_at(time)
    stem = f"map-{pd.Timestamp(light.attrs['time']):%m-%d-%H}h"
    with writing_run(folder):
        save_map(light, folder / f"{stem}.nc")
        save_map_table(light, folder / f"{stem}.csv")
