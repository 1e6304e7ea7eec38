"""`lidarspectra sensor ...`: check and record a spectral sensor, calibrate it, and place its readings in a room.

Libraries that take long to load are imported inside the commands, so that `--help` answers at once and a Raspberry Pi
records with little more than pyserial and NumPy.
"""

import typer

from lidarspectra.cli import sensor_calibrating, sensor_logs, sensor_recording, sensor_show

app = typer.Typer(no_args_is_help=True, help="The AS7265x spectral sensor: check, record, calibrate, place in a room.")
for part in (sensor_recording, sensor_show, sensor_logs, sensor_calibrating):
    app.registered_commands += part.app.registered_commands
