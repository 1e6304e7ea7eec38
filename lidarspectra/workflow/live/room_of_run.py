"""A finished run as a room of lamps and fixed sensors: what each reads by each lamp, and how well that is known."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.hardware.sensor.as7265x import CHANNEL_LABELS, DEFAULT_SETTINGS, nominal_responsivity
from lidarspectra.hardware.sensor.calibration_files import calibration_by_label
from lidarspectra.lamps.lamp_spectra import dark_channels
from lidarspectra.lamps.lamps import Lamp, is_daylight
from lidarspectra.mapping.calibration.model import READING_SD
from lidarspectra.mapping.maps.map_schema import kept_points
from lidarspectra.mapping.maps.response_weights import lamp_weights
from lidarspectra.mapping.maps.visible_bands import covers_vision
from lidarspectra.mapping.photometry.quantities import light_quantity
from lidarspectra.mapping.present_light.model import LampKnowledge, SensorModel
from lidarspectra.mapping.present_light.now import LitRoom
from lidarspectra.progress import Progress, silent
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.room.surface_parts import PARTS
from lidarspectra.spectra.spectrum import BandSet, Spectrum
from lidarspectra.workflow.calibration.calibrating import priors_of
from lidarspectra.workflow.calibration.light import coefficients, run_room
from lidarspectra.workflow.calibration.readings import CHANNEL_SD
from lidarspectra.workflow.calibration.unknowns_of_run import calibrated_covariance
from lidarspectra.workflow.live.sensors_file import SensorSection, SensorsFile
from lidarspectra.workflow.live.sources import settings_of_sensor
from lidarspectra.workflow.run_folder.light_of_run import present_lamps_of_run, scene_of_run, transport_of_run

STRAY_SHARE = 3e-3  # [1] of a sensor's strongest channel, that every channel sees of other light
QUANTITIES = ("illuminance_lx", "melanopic_edi_lx", "ppfd_umol_m2_s")


def lit_room(run: Path, sensors: SensorsFile, *, workers: int | None = None, progress: Progress = silent) -> LitRoom:
    """Read a finished run, and trace the light of sensors that stand at none of its points.

    Parameters
    ----------
    run : Path
    sensors : SensorsFile
    workers : int, optional
        Processes of the trace.
    progress : callable

    Returns
    -------
    room : LitRoom

    Raises
    ------
    WorkspaceError
        If the run has no finished trace.
    MapError
        If a sensor stands at no point of the run, or gives channels that the run has not.
    """
    transport, lamps = transport_of_run(run), present_lamps_of_run(run)
    bands = scene_of_run(run).bands
    by_name = {lamp.name: lamp for lamp in lamps}
    ordered = tuple(by_name[str(name)] for name in transport["lamp"].to_numpy())
    for switch in sensors.switches:
        if switch.lamp not in by_name:
            raise MapError(
                expected=f"one of the run's lamps ({', '.join(by_name)})", found=f"'{switch.lamp}'", where="switches"
            )
    coefficient = transport["coefficient"].transpose("lamp", "point", "band").to_numpy().astype(np.float64)
    at_sensors = _coefficients_at(run, sensors.sensors, transport, coefficient, workers, progress)
    numbers, model = sensor_model(sensors.sensors, at_sensors, ordered, bands)
    weights = [_weights(light_quantity(name).response, ordered, bands) for name in QUANTITIES]
    counted = np.isin(np.arange(transport.sizes["point"]), kept_points(transport))
    return LitRoom(
        lamps=tuple(lamp.name for lamp in ordered),
        sensors=tuple(each.name for each in sensors.sensors),
        quantities=QUANTITIES,
        numbers=numbers,
        model=model,
        knowledge=_knowledge(run, ordered),
        map_light=np.array([np.einsum("lb,lpb->pl", each, coefficient) for each in weights]),
        sensor_light=np.array([np.einsum("lb,lpb->pl", each, at_sensors) for each in weights]),
        counted=counted if counted.any() else np.ones_like(counted),
    )


def _coefficients_at(
    run: Path,
    sensors: Sequence[SensorSection],
    transport: xr.Dataset,
    coefficient: FloatArray,
    workers: int | None,
    progress: Progress,
) -> FloatArray:
    """(lamp, sensor, band) coefficients [m⁻²]: the run's own at its points, traced where a sensor has a place."""
    count = coefficient.shape[1]
    found = np.empty((coefficient.shape[0], len(sensors), coefficient.shape[2]))
    placed = []
    for index, sensor in enumerate(sensors):
        if sensor.point is None:
            placed.append(index)
            continue
        if sensor.point > count or bool(transport["buried"].to_numpy()[sensor.point - 1]):
            raise MapError(
                expected=f"a point from 1 to {count} that is not buried in furniture",
                found=f"point {sensor.point}",
                where=f"sensor '{sensor.name}'",
                todo="The report's room in 3D shows the points' numbers; or give a position, in metres.",
            )
        found[:, index] = coefficient[:, sensor.point - 1]
    if placed:
        points = SensorPoints(
            positions=np.array([sensors[index].position for index in placed], dtype=np.float64),
            normals=np.array([sensors[index].direction for index in placed], dtype=np.float64),
        )
        room = run_room(run)
        traced = coefficients(room, points, np.ones(len(PARTS)), workers=workers, progress=progress)
        rank = {lamp.name: place for place, lamp in enumerate(room.lamps)}
        order = [rank[str(name)] for name in transport["lamp"].to_numpy()]
        found[:, placed] = traced[order]
    return found


def _keys(sensor: SensorSection, bands: BandSet) -> tuple[str, ...]:
    """Keys of the numbers that a sensor may give."""
    keys: list[str] = []
    if "lux" in sensor.reads:
        if not covers_vision(bands.centers_nm):
            raise MapError(
                expected="channels that cover V(λ), for a sensor that reads lux",
                found=", ".join(bands.labels),
                where=f"sensor '{sensor.name}'",
                todo="Run with a device whose channels cover 430 to 680 nm, or read channels.",
            )
        keys.append("lux")
    if "channels" in sensor.reads:
        missing = [label for label in sensor.topics if label not in bands.labels]
        if missing:
            raise MapError(
                expected=f"channels of the run ({', '.join(bands.labels)})",
                found=", ".join(missing),
                where=f"topics of sensor '{sensor.name}'",
            )
        keys += sensor.topics or bands.labels
    return tuple(keys)


def sensor_model(
    sensors: Sequence[SensorSection], at_sensors: FloatArray, lamps: Sequence[Lamp], bands: BandSet
) -> tuple[tuple[tuple[str, str], ...], SensorModel]:
    """What each number should read by each lamp.

    Parameters
    ----------
    sensors : sequence of SensorSection
    at_sensors : (lamp, sensor, band) float
        Coefficients. [m⁻²]
    lamps : sequence of Lamp
    bands : BandSet

    Returns
    -------
    numbers : tuple of (str, str)
        Sensor, and 'lux' or a channel's label, of those that tell of the lamps: `dark_channels` are left out.
    model : SensorModel
        Of these.

    Raises
    ------
    MapError
        If no number of a sensor has any light.
    """
    fluxes = [lamp.flux for lamp in lamps]
    dark = {label for label, out in zip(bands.labels, dark_channels(fluxes, bands), strict=True) if out}
    flux = np.stack([bands.band_values(each, outside="zero") for each in fluxes])
    lux = _weights(light_quantity("illuminance_lx").response, lamps, bands)
    numbers: list[tuple[str, str]] = []
    rows, of_sensor, deviation, floor = [], [], [], []
    for index, sensor in enumerate(sensors):
        light = {
            key: np.einsum("lb,lb->l", lux if key == "lux" else flux * (np.array(bands.labels) == key), found)
            for key, found in ((key, at_sensors[:, index]) for key in _keys(sensor, bands))
        }
        lit = {key: row for key, row in light.items() if row.sum() > 0 and key not in dark}
        if not lit:
            raise MapError(
                expected="a place that some lamp of the run lights",
                found=f"no light of any lamp in {', '.join(light)}",
                where=f"sensor '{sensor.name}'",
                todo="Look at its position and direction, and at the lamps' spectra.",
            )
        strongest = max((float(row.sum()) for key, row in lit.items() if key != "lux"), default=0.0)
        for key, row in lit.items():
            numbers.append((sensor.name, key))
            rows.append(row)
            of_sensor.append(index)
            deviation.append(sensor.sd or (READING_SD if key == "lux" else CHANNEL_SD))
            floor.append(0.0 if key == "lux" else float(np.hypot(STRAY_SHARE * strongest, _rounding(sensor, key))))
    model = SensorModel(
        light=np.array(rows), sensor=np.array(of_sensor), reading_sd=np.array(deviation), floor=np.array(floor)
    )
    return tuple(numbers), model


def _rounding(sensor: SensorSection, label: str) -> float:
    """Standard uncertainty of a channel by whole counts [W/m²/nm]; 0 for channels that an AS7265x does not have."""
    if label not in CHANNEL_LABELS:
        return 0.0
    responsivity = nominal_responsivity()[0]
    if sensor.calibration is not None:
        calibration = calibration_by_label(sensor.calibration)
        if calibration.signal == "basic counts":
            responsivity = float(calibration.responsivity[CHANNEL_LABELS.index(label)])
    settings = settings_of_sensor(sensor) or DEFAULT_SETTINGS
    return float(1.0 / np.sqrt(12.0) / (settings.gain * settings.integration_ms * responsivity))


def _weights(response: Spectrum, lamps: Sequence[Lamp], bands: BandSet) -> FloatArray:
    """(lamp, band) weights of the coefficients for a quantity."""
    return np.stack([lamp_weights(bands.centers_nm, response, lamp.flux) for lamp in lamps])


def _knowledge(run: Path, lamps: Sequence[Lamp]) -> LampKnowledge:
    """How well the lamps are known: by a calibration on which the run's map rests too, or else beforehand."""
    room, names = run_room(run), [lamp.name for lamp in lamps]
    calibrated = calibrated_covariance(room.run_file.calibration, run, names)
    if isinstance(calibrated, tuple):
        covariance = calibrated[0][: len(names), : len(names)]
        flux_sd = np.sqrt(np.diag(covariance))
        correlation = covariance / np.outer(flux_sd, flux_sd)
    else:
        priors = priors_of(room, np.zeros(0))
        place = {lamp.name: index for index, lamp in enumerate(room.lamps)}
        order = [place[name] for name in names]
        flux_sd, correlation = priors.flux_sd[order], priors.flux_correlation[np.ix_(order, order)]
    dims = {lamp.name: lamp.dim for lamp in room.run_file.lamps}
    return LampKnowledge(
        flux_sd=flux_sd,
        full=np.array([1.0 / dims.get(name, 1.0) for name in names]),
        is_daylight=np.array([is_daylight(lamp) for lamp in lamps]),
        flux_correlation=correlation,
    )
