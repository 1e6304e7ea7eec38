"""`lidarspectra sensor ...`: check and record a spectral sensor, calibrate it, and place its readings in a room.

Libraries that take long to load are imported inside the commands, so that `--help` answers at once and a Raspberry Pi
records with little more than pyserial and NumPy.
"""

import typer

from lidarspectra.sensor_cli import calibrating, logs, recording

app = typer.Typer(no_args_is_help=True, help="The AS7265x spectral sensor: check, record, calibrate, place in a room.")
for part in (recording, logs, calibrating):
    app.registered_commands += part.app.registered_commands
