"""A sensor at a serial port, kept connected: the recorder, begun anew where it cannot reach the device."""

import math
from pathlib import Path

from lidarspectra.errors import DeviceError
from lidarspectra.hardware.incoming.arrivals import BACK_OFF_S, Arrival, Notice, Put, Stop, pause
from lidarspectra.hardware.incoming.channel_light import UNCALIBRATED, ChannelLight
from lidarspectra.hardware.sensor.gaps import Gap
from lidarspectra.hardware.sensor.identify import Wishes
from lidarspectra.hardware.sensor.reading_log import Entry, LogWriter
from lidarspectra.hardware.sensor.recorder import RecordOptions, record
from lidarspectra.hardware.sensor.sensor_records import Reading
from lidarspectra.hardware.sensor.serial_link import Port


class SerialSource:
    """A source: an AS7265x at a port.

    Parameters
    ----------
    port : Port
    sensor : str
        Name of the sensor.
    log : Path
        The recorder's log, with counts, gaps and their causes; continued if it is there.
    light : ChannelLight
    wishes : Wishes
        Rate and settings that the device is asked for.
    baud : int or None
        None tries the usual ones.
    """

    def __init__(
        self,
        port: Port,
        *,
        sensor: str,
        log: Path,
        light: ChannelLight | None = None,
        wishes: Wishes | None = None,
        baud: int | None = None,
    ) -> None:
        self._port = port
        self._sensor = sensor
        self._log = log
        self._light = light or ChannelLight()
        self._options = RecordOptions(wishes=wishes or Wishes(), baud=baud, give_up_s=math.inf)

    @property
    def name(self) -> str:
        """Its port."""
        return self._port.name

    def run(self, put: Put, stop: Stop) -> None:
        """Give readings; a port that is not there is tried again, said once."""
        attempt, said = 0, ""
        is_doubtful = not self._light.is_calibrated
        blind: set[str] = set()

        def tell(entry: Entry) -> None:
            nonlocal attempt, said, is_doubtful
            if isinstance(entry, Reading):
                if is_doubtful:
                    is_doubtful = False
                    put(Notice(source=self.name, text=UNCALIBRATED.format(sensor=self._sensor)))
                if said:
                    put(Notice(source=self.name, text=f"Sensor '{self._sensor}' gives readings again."))
                attempt, said = 0, ""
                values = self._light.values(entry.counts, entry.module_values, entry.gain, entry.integration_ms)
                why = self._light.why_none(entry.counts, entry.module_values) if not values else None
                if why is not None and why not in blind:
                    blind.add(why)
                    put(Notice(source=self.name, text=f"Sensor '{self._sensor}' gives no light: {why}"))
                if values:
                    device_s = None if entry.device_ms is None else 1e-3 * entry.device_ms
                    put(Arrival(sensor=self._sensor, values=values, unix_s=entry.moment.unix_s, device_s=device_s))
            elif isinstance(entry, Gap) and entry.is_open and not said:
                said = "gap"
                put(Notice(source=self.name, text=f"Sensor '{self._sensor}' gives no readings: {entry.reason}."))

        while not stop():
            try:
                with LogWriter(self._log, append=True) as log:
                    record(self._port, log, options=self._options, stop=stop, on_entry=tell)
            except DeviceError as error:
                if not said:
                    put(Notice(source=self.name, text=f"{error} It is tried again until it answers."))
                said = "error"
                pause(BACK_OFF_S[min(attempt, len(BACK_OFF_S) - 1)], stop)
                attempt += 1
