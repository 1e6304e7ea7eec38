"""The true light of a grey room is the lamp's light, at every wavelength by the same factor; and channels keep it."""

from pathlib import Path

import numpy as np
import pytest

from lidarspectra.radiance.engine.bands import lamp_band_flux
from lidarspectra.spectra.spectrum import sensor_bands
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps
from research.experiments.true_light import true_light, true_points
from research.virtual_rooms.room_plan import read_plan
from research.virtual_rooms.true_room import true_room


@pytest.mark.slow
def test_in_a_grey_room_every_wavelength_and_channel_has_the_closed_form_s_light(project: Path, tmp_path: Path) -> None:
    folder = project / "scenes" / "box"
    plan = read_plan(folder / "plan.toml")
    room, lamps, channels = true_room(plan), resolve_lamps(plan.file.lamps, folder), sensor_bands("as7265x-14")
    table = np.loadtxt(folder / "points.csv", delimiter=",", skiprows=1)
    points = true_points(room, table[:, :3], table[:, 3:])
    light = true_light(room, lamps, points, channels, tmp_path, noise="draft", seed=1)
    factor = light.channel_irradiance.mean(axis=0) / lamp_band_flux([lamp.flux for lamp in lamps], channels)[0]
    # 1/(S(1 - ρ)), S = 54 m², ρ = 0.5; the points' mean lies 0.3 % above, and 600 points of 3 % leave 0.2 % of noise.
    assert factor == pytest.approx(np.full(14, 1.003 / 27.0), rel=0.02)
    lit = lamps[0].flux.at(light.wavelengths_nm, outside="zero") > 0.01 * lamps[0].flux.values.max()
    single = light.irradiance.mean(axis=0)[lit] / lamps[0].flux.at(light.wavelengths_nm[lit], outside="zero")
    assert single == pytest.approx(np.full(int(lit.sum()), 1.003 / 27.0), rel=0.02)
