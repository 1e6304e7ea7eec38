"""What real sensors would read of traced fingerprints: whole counts, gains and dies of their own, drift and noise.

Each sensor of the table becomes a virtual AS7265x (`hardware.virtual.spectral_sensor`) drawn by lot, uncalibrated. The
empty room is read many times first, as one would; then each fingerprint a few times at some later hour
(`read_by_sensors`), or on and on while people come and go (`watch_by_sensors`).
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from lidarspectra.arrays import FloatArray, IntArray
from lidarspectra.errors import MapError
from lidarspectra.hardware.sensor.as7265x import SensorSettings, mask_counts
from lidarspectra.hardware.virtual.spectral_sensor import best_settings, counts_of, draw_sensor
from lidarspectra.mapping.localization.fingerprint_table import make_fingerprints, quantity_of
from lidarspectra.spectra.spectrum import AS7265X_CENTERS_NM, AS7265X_FWHM_NM, gaussian_bands

EMPTY_READINGS = 60  # of the empty room, whose mean is its reading: a minute at one a second
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
        The readings of one fingerprint stand together; labels, persons, positions and sensors are the table's. The
        attributes gain and integration_ms tell the settings.

    Raises
    ------
    MapError
        If the table holds no irradiances, or bands that are no channels of the AS7265x.
    """
    generator = np.random.default_rng([seed, noise_seed])
    rows = np.repeat(np.arange(table.sizes["fingerprint"]), max(readings, 0))
    late_h = hours * generator.random(rows.size)
    extra = {"time_s": 3600.0 * late_h}
    if "draw" in table.coords:
        extra["draw"] = table["draw"].to_numpy()[rows]
    return _read(table, rows, late_h, seed=seed, generator=generator, settings=settings, extra=extra)


@dataclass(frozen=True, kw_only=True)
class Visits:
    """How people come and go, one at a time, while sensors read on.

    Parameters
    ----------
    stay_s : (float, float)
        Shortest and longest stay at a place; each is drawn evenly in between. [s]
    lead_s : float
        How long there were visits before those that are asked for, so that a running median is there. [s]
    period_s : float
        Between readings. [s]
    after_h : float
        When the first visit that is asked for begins, since the empty room was read. [h]
    """

    stay_s: tuple[float, float] = (20.0, 100.0)
    lead_s: float = 600.0
    period_s: float = 1.0
    after_h: float = 2.0

    def __post_init__(self) -> None:
        shortest, longest = self.stay_s
        if not (0 < self.period_s <= shortest <= longest and self.lead_s >= 0 and self.after_h >= 0):
            raise MapError(
                expected="stays of a period or more, the shortest first, and times of 0 or more",
                found=f"stays {shortest:g} to {longest:g} s, period {self.period_s:g} s, lead {self.lead_s:g} s,"
                f" after {self.after_h:g} h",
                where="visits",
            )


def watch_by_sensors(
    table: xr.Dataset,
    visits: Visits,
    *,
    seed: int,
    settings: SensorSettings | None = None,
    noise_seed: int = 0,
) -> xr.Dataset:
    """Let virtual sensors read on while people visit the places of fingerprints, as `localize live` hears them.

    Each fingerprint is a visit, in an order by lot; who leaves one place is at the next at once, and the room is never
    empty. Sensors drift and scatter as in `read_by_sensors`.

    Parameters
    ----------
    table : xarray.Dataset
        Traced fingerprints of channels of the AS7265x.
    visits : Visits
    seed, settings, noise_seed
        As in `read_by_sensors`; the lot of the visits hangs on both seeds.

    Returns
    -------
    counts : xarray.Dataset
        Readings in order of time (`time_s` since the empty room was read). Those of the lead have no label and no
        position; their visits are the last of the order, so that each place is visited before its turn.

    Raises
    ------
    MapError
        As `read_by_sensors`.
    """
    generator = np.random.default_rng([seed, noise_seed])
    count = table.sizes["fingerprint"]
    order = generator.permutation(count)
    stays = np.rint(generator.uniform(*visits.stay_s, count) / visits.period_s).astype(np.int64)
    asked = np.repeat(order, stays)
    lead = int(np.ceil(visits.lead_s / visits.period_s))
    rows = np.concatenate([np.resize(asked[::-1], lead)[::-1], asked])
    times_s: FloatArray = 3600.0 * visits.after_h + visits.period_s * (np.arange(rows.size) - lead).astype(np.float64)
    read = _read(
        table, rows, times_s / 3600.0, seed=seed, generator=generator, settings=settings, extra={"time_s": times_s}
    )
    is_lead = np.arange(rows.size) < lead
    labels = np.where(is_lead, "", read["label"].to_numpy().astype(str))
    positions = np.where(is_lead[:, None], np.nan, read["position_m"].to_numpy())
    return read.assign_coords(
        label=("fingerprint", labels, read["label"].attrs),
        position_m=(("fingerprint", "axis"), positions, read["position_m"].attrs),
    )


def _read(
    table: xr.Dataset,
    rows: IntArray,
    late_h: FloatArray,
    *,
    seed: int,
    generator: np.random.Generator,
    settings: SensorSettings | None,
    extra: Mapping[str, FloatArray],
) -> xr.Dataset:
    """Counts of fingerprints `rows` (reading,) at times `late_h` (reading,) [h] after the empty room was read."""
    if quantity_of(table) != "irradiance" or not rows.size:
        raise MapError(
            expected="traced fingerprints, and one reading or more",
            found=f"{quantity_of(table)}, {rows.size} readings",
            where="virtual sensors",
        )
    channels = _channels(table["band"].to_numpy())
    light = table["irradiance"].to_numpy()[rows]
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
    return make_fingerprints(
        counts,
        quantity="counts",
        labels=table["label"].to_numpy()[rows].astype(str).tolist(),
        positions_m=table["position_m"].to_numpy()[rows],
        sensors=table["sensor"].to_numpy().astype(str).tolist(),
        bands=gaussian_bands("as7265x", np.array(AS7265X_CENTERS_NM)[channels], AS7265X_FWHM_NM),
        empty=empty,
        extra=extra,
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
