"""A year by the patches of the sky, held against Radiance's own daylight coefficients and against single moments."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lidarspectra.mapping.photometry.annual_light import annual_light, load_year, map_of_hour, save_year
from lidarspectra.radiance.engine.engine import find_engine
from lidarspectra.radiance.scene.daylight import daylight_lamps
from lidarspectra.radiance.scene.sky import ALTITUDES_DEG, AZIMUTHS_DEG, SKY_WAVELENGTHS_NM, Sky, cie_overcast
from lidarspectra.radiance.scene.sky_patches import SkyPatches
from lidarspectra.radiance.scene.weather import synthetic_year
from lidarspectra.radiance.scene.year_sky import YearSky, year_sky
from research.benchmarks import annual

PATCHES = SkyPatches()


@pytest.fixture(scope="module")
def points():
    return annual.room().grid(0.76, count=12, margin=annual.MARGIN_M)


@pytest.fixture(scope="module")
def year(points, tmp_path_factory: pytest.TempPathFactory):
    """Weather, sky, and transport of the office, over dark ground."""
    engine = find_engine()
    folder = tmp_path_factory.mktemp("year")
    weather = synthetic_year(annual.LATITUDE_DEG, annual.LONGITUDE_DEG, ground_reflectance=0.0)
    sky = year_sky(weather, PATCHES, folder, engine, ground_reflectance=0.0)
    return weather, sky, annual.traced(points, sky, PATCHES, "draft", engine), folder


@pytest.mark.slow
def test_the_skys_light_of_a_year_is_that_of_rfluxmtx_gendaymtx_and_dctimestep(year, points) -> None:
    weather, sky, transport, folder = year
    ours = annual_light(transport, replace(sky, sun_illuminance=0.0 * sky.sun_illuminance), weather)["illuminance"]
    theirs = annual.two_phase(weather, points, PATCHES, find_engine(), folder, part="-s", divisions=20_000)[sky.hours]
    # Their noise of a point is 1.5 % of its year, ours .5 %; six standard deviations of the mean over twelve points.
    assert float(ours.mean()) == pytest.approx(theirs.mean(), rel=0.03)
    assert ours.mean("hour").to_numpy() == pytest.approx(theirs.mean(axis=0), rel=0.1)
    lit = theirs.mean(axis=1) > annual.DIMMEST_LX
    assert ours.to_numpy()[lit].mean(axis=1) == pytest.approx(theirs[lit].mean(axis=1), rel=0.04)


@pytest.mark.slow
def test_a_moment_by_patches_is_that_moment_traced_by_itself(points) -> None:
    sky = made_sky(np.array([0.1, -0.8, 0.5]))
    truth = annual.room().light(daylight_lamps(sky, annual.WINDOWS), points, noise="standard")["irradiance"].to_numpy()
    nothing = np.zeros((1, SKY_WAVELENGTHS_NM.size))
    there = YearSky(
        hours=np.zeros(1, dtype=np.int64),
        luminance=np.ones((1, len(PATCHES))),
        sun_illuminance=np.zeros(1),
        sun_direction=np.array([sky.sun_direction]),
        sky_spectra=1.0 + nothing,
        ground_spectra=1.0 + nothing,
        sun_spectra=1.0 + nothing,
    )
    transport = annual.traced(points, there, PATCHES, "standard", find_engine())
    shade = transport["sunlit"].to_numpy()[0] == 0  # the edge of the sun's disc is sharp by patches
    overcast = replace(sky, sun_direction=None, sun_irradiance=0.0 * sky.sun_irradiance)
    dull = annual.room().light(daylight_lamps(overcast, annual.WINDOWS), points, noise="standard")["irradiance"]
    by_patches = annual.from_patches(transport, overcast, PATCHES, 0)
    assert by_patches == pytest.approx(dull.to_numpy(), rel=0.12)  # six standard errors of a point
    assert by_patches.mean() == pytest.approx(float(dull.mean()), rel=0.03)
    # The sun's reflected light is spread over patches of 12 degrees, and noisier: 5 % of the mean, six times.
    assert annual.from_patches(transport, sky, PATCHES, 0)[shade].mean() == pytest.approx(truth[shade].mean(), rel=0.3)
    lit = annual.from_patches(transport, sky, PATCHES, 0)[~shade]
    assert lit.mean() == pytest.approx(truth[~shade].mean(), rel=0.05)  # straight from the sun


def made_sky(towards_sun: np.ndarray) -> Sky:
    """An overcast sky with a sun."""
    radiance = np.zeros((AZIMUTHS_DEG.size, ALTITUDES_DEG.size, SKY_WAVELENGTHS_NM.size))
    above = ALTITUDES_DEG > 0
    radiance[:, above] = 0.1 * cie_overcast(ALTITUDES_DEG[above])[:, None]
    radiance[:, ~above] = 0.02
    direction = towards_sun / np.linalg.norm(towards_sun)
    return Sky(radiance=radiance, sun_direction=direction, sun_irradiance=np.ones(SKY_WAVELENGTHS_NM.size))


@pytest.mark.slow
def test_an_hours_map_is_that_hour_of_the_year_also_from_file(year, tmp_path: Path) -> None:
    weather, sky, transport, _ = year
    made = annual_light(transport, sky, weather)
    read = load_year(save_year(made, tmp_path / "annual.nc"))
    assert read["time"].dtype.kind == "M"
    hour = int(np.argmax(made["sun_normal_illuminance"].to_numpy()))
    light = map_of_hour(read, transport, annual.BANDS, hour)
    assert light["illuminance"].to_numpy() == pytest.approx(made["illuminance"].to_numpy()[hour])
    green = light["irradiance"].sel(band=560.0)
    # By the bands alone the illuminance is a few per cent off; 560 nm is the nearest to its peak.
    assert np.corrcoef(green, light["illuminance"])[0, 1] > 0.999
    assert float((made["illuminance_se"] / made["illuminance"]).mean()) < 0.05
