"""True light is weighed as the sensor weighs it, survives its file, and knows who is inside of a table."""

from pathlib import Path

import numpy as np
import pytest

from lidarspectra.errors import MapError
from lidarspectra.radiance.engine.bands import lamp_band_flux
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.spectrum import sensor_bands
from lidarspectra.workflow.run_folder.lamps_of_run import resolve_lamps
from research.experiments.true_light import TrueLight, channel_weights, single_wavelengths, true_points
from research.experiments.true_light_file import (
    SecondOpinion,
    load_true_light,
    save_true_light,
    truth_table,
)
from research.virtual_rooms.room_plan import read_plan
from research.virtual_rooms.true_room import true_room

SCENES = ("office", "apartment", "large-office")


def test_a_single_wavelength_sees_that_wavelength_alone(project: Path) -> None:
    folder = project / "scenes" / "office"
    (lamp, _) = resolve_lamps(read_plan(folder / "plan.toml").file.lamps, folder)
    single = single_wavelengths()
    assert single.centers_nm.tolist() == list(range(380, 785, 5))
    assert single.band_values(lamp.flux, outside="zero") == pytest.approx(
        lamp.flux.at(single.centers_nm, outside="zero")
    )


def test_transport_that_is_the_same_at_all_wavelengths_gives_each_channel_its_lamp_s_flux(project: Path) -> None:
    folder = project / "scenes" / "apartment"
    lamps = resolve_lamps(read_plan(folder / "plan.toml").file.lamps, folder)
    channels = sensor_bands("as7265x-14")
    weights = channel_weights(single_wavelengths().centers_nm, lamps, channels)
    flux = lamp_band_flux([lamp.flux for lamp in lamps], channels)
    assert weights.sum(axis=1) == pytest.approx(flux, rel=1e-9)


def test_true_light_survives_its_file(tmp_path: Path) -> None:
    channels, generator = sensor_bands("as7265x-14"), np.random.default_rng(1)
    points = SensorPoints(positions=np.eye(3), normals=np.eye(3), buried=np.array([False, True, False]))
    fine, coarse = generator.random((3, 81)), generator.random((3, 14))
    light = TrueLight(
        wavelengths_nm=single_wavelengths().centers_nm,
        irradiance=fine,
        irradiance_se=0.01 * fine,
        channels=channels,
        channel_irradiance=coarse,
        channel_se=0.01 * coarse,
        points=points,
    )
    opinion = SecondOpinion(engine="another", wavelengths=14, nrmse_percent=0.5, bias_percent=0.1, bias_se_percent=0.05)
    stored = load_true_light(save_true_light(light, tmp_path / "light.nc", opinion))
    assert stored.irradiance == pytest.approx(fine, rel=1e-6)  # four bytes a number
    assert stored.channel_se == pytest.approx(0.01 * coarse, rel=1e-6)
    assert stored.buried.tolist() == [False, True, False]
    assert stored.opinion == opinion
    assert truth_table({"room": stored}).frame["NRMSE against it [%]"].tolist() == [0.5]


def test_a_missing_file_says_how_to_make_it(tmp_path: Path) -> None:
    with pytest.raises(MapError, match=r"research\.scenes\.true_light"):
        load_true_light(tmp_path / "light.nc")


def test_points_inside_of_things_or_outside_of_the_room_are_marked(project: Path) -> None:
    room = true_room(read_plan(project / "scenes" / "office" / "plan.toml"))
    places = np.array([[1.5, 1.5, 2.0], [1.5, 1.5, 3.5], [0.85, 1.5, 2.69]])  # air, above the ceiling, in a lamp plate
    assert true_points(room, places, np.tile([0.0, 0.0, 1.0], (3, 1))).buried.tolist() == [False, True, True]


@pytest.mark.parametrize("scene", SCENES)
def test_the_stored_truth_is_of_the_scene_s_points_and_another_engine_agrees(project: Path, scene: str) -> None:
    folder = project / "scenes" / scene / "truth"
    light = load_true_light(folder / "light.nc")
    table = np.loadtxt(folder / "points.csv", delimiter=",", skiprows=1)
    assert light.positions == pytest.approx(table[:, :3], abs=1e-6)
    assert light.channel_nm == pytest.approx(sensor_bands("as7265x-14").centers_nm)
    assert light.channel_irradiance[~light.buried].min() > 0
    assert light.opinion is not None
    assert light.opinion.nrmse_percent <= 1.0  # [%] the goal
    assert (folder / "light.nc").stat().st_size < 400_000
