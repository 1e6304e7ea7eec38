"""What real sensors would read of traced fingerprints: whole counts, gains and dies of their own, drift and noise.

Each sensor of the table becomes a virtual AS7265x (`hardware.virtual.spectral_sensor`) drawn by lot, uncalibrated. The
empty room is read many times first, as one would; then each fingerprint a few times at some later hour.
"""

import numpy as np
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.errors import MapError
from lidarspectra.hardware.sensor.as7265x import SensorSettings, mask_counts
from lidarspectra.hardware.virtual.spectral_sensor import best_settings, counts_of, draw_sensor
from lidarspectra.mapping.localization.fingerprint_table import make_fingerprints, quantity_of
from lidarspectra.spectra import AS7265X_CENTERS_NM, AS7265X_FWHM_NM, gaussian_bands

EMPTY_READINGS = 60  # [1] of the empty room, whose mean is its reading: a minute at one a second
BAND_TOLERANCE_NM = 1.0  # [nm] by which a channel is known again


def read_by_sensors(
    table: xr.Dataset,
    *,
    seed: int,
    readings: int = 1,
    hours: float = 2.0,
    settings: SensorSettings | None = None,
    noise_seed: int = 0,
) -> xr.Dataset:
    """Read fingerprints by virtual sensors.

    A channel is taken to see what its nominal response sees: the shift of its centre, which `draw_sensor` draws too, is
    left out, for the table has no finer spectrum. It would change both readings of a ratio alike.

    Parameters
    ----------
    table : xarray.Dataset
        Traced fingerprints of channels of the AS7265x.
    seed : int
        Another one draws other sensors.
    readings : int
        Of each fingerprint.
    hours : float
        Within which all are read after the empty room, at random. [h]
    settings : SensorSettings, optional
        Gain and integration time of all of them; without it the highest gain at which no reading saturates.
    noise_seed : int
        Another one draws other noise of the same sensors.

    Returns
    -------
    counts : xarray.Dataset
        The readings of one fingerprint stand together; labels, positions and sensors are the table's. The attributes
        gain and integration_ms tell the settings.

    Raises
    ------
    MapError
        If the table holds no irradiances, or bands that are no channels of the AS7265x.
    """
    if quantity_of(table) != "irradiance" or readings < 1:
        raise MapError(
            expected="traced fingerprints, and one reading or more of each",
            found=f"{quantity_of(table)}, {readings} readings",
            where="virtual sensors",
        )
    channels = _channels(table["band"].to_numpy())
    generator = np.random.default_rng([seed, noise_seed])
    light = np.repeat(table["irradiance"].to_numpy(), readings, axis=0)
    late_h = hours * generator.random(len(light))
    lot = np.random.default_rng(seed)
    sensors = [draw_sensor(int(lot.integers(2**31))) for _ in range(light.shape[1])]
    basic, basic_empty = np.empty_like(light), np.empty((EMPTY_READINGS, *light.shape[1:]))
    for number, sensor in enumerate(sensors):
        responsivity, drift = sensor.responsivity[channels], sensor.drift_per_hour[channels]
        basic[:, number] = light[:, number] * responsivity * (1.0 + np.outer(late_h, drift))
        basic_empty[:, number] = table["empty"].to_numpy()[number] * responsivity
    used = settings or best_settings(sensors[0], np.maximum(basic.max(axis=0), basic_empty[0]))
    counts, empty = np.empty_like(basic), np.empty(light.shape[1:])
    for number, sensor in enumerate(sensors):
        counts[:, number] = mask_counts(counts_of(sensor, basic[:, number], generator, used))[0]
        empty[number] = mask_counts(counts_of(sensor, basic_empty[:, number], generator, used))[0].mean(axis=0)
    repeated = np.repeat(np.arange(table.sizes["fingerprint"]), readings)
    return make_fingerprints(
        counts,
        quantity="counts",
        labels=table["label"].to_numpy()[repeated].astype(str).tolist(),
        positions_m=table["position_m"].to_numpy()[repeated],
        sensors=table["sensor"].to_numpy().astype(str).tolist(),
        bands=gaussian_bands("as7265x", np.array(AS7265X_CENTERS_NM)[channels], AS7265X_FWHM_NM),
        empty=empty,
        extra={"time_s": 3600.0 * late_h},
        attributes={
            "source": f"{table.attrs.get('source', 'fingerprints')}, read by virtual sensors",
            "gain": used.gain,
            "integration_ms": used.integration_ms,
        },
    )


def _channels(bands_nm: FloatArray) -> list[int]:
    """Which channels of the AS7265x the bands are."""
    centers = np.array(AS7265X_CENTERS_NM)
    found = np.abs(centers[None, :] - bands_nm[:, None]).argmin(axis=1)
    if np.abs(centers[found] - bands_nm).max() > BAND_TOLERANCE_NM:
        raise MapError(
            expected="channels of the AS7265x: " + ", ".join(f"{center:g}" for center in centers) + " nm",
            found=", ".join(f"{band:g}" for band in bands_nm) + " nm",
            where="virtual sensors",
        )
    return [int(channel) for channel in found]
