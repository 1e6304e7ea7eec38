"""A small room that all tests of the virtual phone scan."""

from pathlib import Path

import numpy as np
import pytest

from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.spectra.spectrum_files import TableRow, write_table
from research.virtual_rooms.room_plan import RoomPlan, read_plan
from research.virtual_rooms.true_room import TrueRoom, true_room

PLAN = """
name = "cell"
reflectances = "reflectances.csv"
[[rooms]]
name = "cell"
low = [0.0, 0.0, 0.0]
high = [1.6, 1.2, 1.4]
floor = "grey"
ceiling = "white"
walls = "red"
accents = { north = "white" }
[[materials]]
name = "grey"
reflectance = "grey"
[[materials]]
name = "white"
reflectance = "white"
[[materials]]
name = "red"
reflectance = "red"
[[parts]]
name = "table"
shape = "table"
center = [0.5, 0.6]
size = [0.6, 0.5]
height = 0.5
thickness = 0.06
leg = 0.08
material = "white"
leg_material = "grey"
yaw_deg = 10.0
[[parts]]
name = "block"
shape = "box"
low = [1.2, -0.1, -0.1]
high = [1.7, 0.4, 0.6]
material = "red"
[[parts]]
name = "plate"
shape = "box"
low = [0.6, 0.4, 1.36]
high = [1.0, 0.8, 1.45]
material = "white"
lamp = "panel"
[[lamps]]
name = "panel"
shape = "panel"
center = [0.8, 0.6, 1.30]
size = [0.4, 0.4]
spectrum = "LED-B3"
luminous_flux_lm = 500.0
[sensors]
grid = { count = 12 }
[phone]
voxel_m = 0.04
edge_m = 0.07
hole_share = 0.02
[camera]
texture_px = 256
"""


@pytest.fixture(scope="session")
def plan_text() -> str:
    """A plan with every kind of thing that a room may have."""
    return PLAN


@pytest.fixture(scope="session")
def plan_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The plan on disk, beside its table of reflectances."""
    folder = tmp_path_factory.mktemp("cell")
    wavelengths = np.arange(380.0, 785.0, 5.0)
    step = 1.0 / (1.0 + np.exp(-(wavelengths - 600.0) / 10.0))
    spectra = {"grey": 0.3 + 0 * step, "white": 0.8 + 0 * step, "red": 0.05 + 0.5 * step}
    write_table(
        folder / "reflectances.csv",
        [
            TableRow(
                id=name, name=name, category="painted", spectrum=Spectrum(wavelengths_nm=wavelengths, values=values)
            )
            for name, values in spectra.items()
        ],
    )
    path = folder / "plan.toml"
    path.write_text(PLAN, encoding="utf-8")
    return path


@pytest.fixture(scope="session")
def plan(plan_file: Path) -> RoomPlan:
    """The plan, read."""
    return read_plan(plan_file)


@pytest.fixture(scope="session")
def room(plan: RoomPlan) -> TrueRoom:
    """The plan's true surface."""
    return true_room(plan)
