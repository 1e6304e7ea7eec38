"""A year of daylight held against Radiance's own daylight coefficients, and against single hours.

An empty grey office of 5 m x 6 m x 3 m with a window to the south and one to the east stands under the synthetic year.

1. Radiance's two-phase method: rfluxmtx traces rays from the sensors to the patches of the sky, of which those count
   that happen to leave through a hole in the wall; gendaymtx and dctimestep do the rest. Sky and sun apart: the sky's
   light on the workplane, and the sun's at sensors that see no window, with finer patches for the sun.
2. Single moments: the sky that `compute_sky` has for a moment is put on the patches, and the same moment is traced as
   `lidarspectra run` does, with the sun as a source and the sky's radiance by direction, to a fine noise. Points
   that the sun lights are left out; the median is shown, since a point at the edge of a sunlit patch has a part of
   the sun's disc there, and all of it or nothing here.
3. The year's own sky at clear and overcast moments, for irradiances that SPECTRL2 has then, against the same.

    python -m research.benchmarks.annual

It takes some minutes, and a minute more the first time, for the tables of the air's scattering.
"""

import tempfile
from dataclasses import replace
from datetime import datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from platformdirs import user_cache_path
from scipy.interpolate import RegularGridInterpolator

from lidarspectra.arrays import FloatArray
from lidarspectra.mapping.photometry.annual_light import annual_light
from lidarspectra.radiance.engine.engine import Engine, find_engine, float_rows
from lidarspectra.radiance.sampling.sky_transport import trace_sky
from lidarspectra.radiance.scene.clear_sky import clear_light
from lidarspectra.radiance.scene.daylight import Window, daylight_lamps
from lidarspectra.radiance.scene.sky import (
    ALTITUDES_DEG,
    AZIMUTHS_DEG,
    SKY_WAVELENGTHS_NM,
    Daylight,
    Sky,
    compute_sky,
    directions,
    sky_spectrum,
)
from lidarspectra.radiance.scene.sky_patches import SkyPatches
from lidarspectra.radiance.scene.sky_scene import write_sky_scene
from lidarspectra.radiance.scene.weather import Weather, synthetic_year
from lidarspectra.radiance.scene.year_sky import GENDAYMTX_EFFICACY_LM_W, WEATHER_FILE, YearSky, year_sky
from lidarspectra.room.sensor_points import SensorPoints
from lidarspectra.spectra.spectrum import sensor_bands
from lidarspectra.workflow.applications.annual import SUBDIVISION, mean_radiance
from lidarspectra.workflow.room_model import RoomModel

SIZE_M = (5.0, 6.0, 3.0)
REFLECTANCES = {"floor": 0.2, "walls": 0.5, "ceiling": 0.7}
WINDOWS = (
    Window(name="south", center=(2.5, 0.01, 1.7), normal=(0.0, 1.0, 0.0), size=(3.0, 1.5)),
    Window(name="east", center=(4.99, 4.0, 1.7), normal=(-1.0, 0.0, 0.0), size=(1.0, 1.2)),
)
LATITUDE_DEG, LONGITUDE_DEG = 48.0, 11.0
CET = timezone(timedelta(hours=1))
MOMENTS = ((6, 21, 9, 0.0), (6, 21, 12, 0.0), (3, 21, 11, 0.0), (12, 21, 12, 0.0), (6, 21, 12, 1.0), (3, 21, 11, 0.5))
BANDS = sensor_bands("as7265x-14")
Quad = list[tuple[float, float, float]]
DIMMEST_LX = 10.0  # [lx] of the hours that are compared one by one
PATCHES = SkyPatches(SUBDIVISION)  # as of `lidarspectra annual`
MARGIN_M = 0.5  # [m] of the points from the walls, so that it does not matter that windows stand 1 cm before them
SUN_SUBDIVISION = 4  # of the two-phase method's sky for the sun, which it spreads over four patches: 3 degrees each


def room() -> RoomModel:
    """The office."""
    return RoomModel.from_box(*SIZE_M, **REFLECTANCES)


def traced(points: SensorPoints, sky: YearSky, patches: SkyPatches, noise: str, engine: Engine) -> xr.Dataset:
    """The transport of the sky's patches in the office."""
    model = room()
    with tempfile.TemporaryDirectory() as folder:
        scene = write_sky_scene(
            model.scan,
            model.materials,
            WINDOWS,
            BANDS,
            Path(folder),
            radiance=mean_radiance(sky, patches, WINDOWS, 0.0),
            patches=patches,
            engine=engine,
        )
        return trace_sky(scene, points, sky, noise=noise, engine=engine)  # type: ignore[arg-type]


# --- 1. Radiance's own coefficients

SKY_TEXT = """#@rfluxmtx h=u u=Y
void glow ground_glow
0
0
4 1 1 1 0
ground_glow source ground
0
0
4 0 0 -1 180
#@rfluxmtx h=r{subdivision} u=Y
void glow sky_glow
0
0
4 1 1 1 0
sky_glow source sky
0
0
4 0 0 1 180
"""


def plain_room_text() -> str:
    """The office for Radiance, with holes for windows and panes of the same transmittance by angle in them."""
    x, y, z = SIZE_M
    paint = "".join(
        f"void plastic {name}\n0\n0\n5 {value} {value} {value} 0 0\n" for name, value in REFLECTANCES.items()
    )
    text = paint + "void plastic black\n0\n0\n5 0 0 0 0 0\n"
    quads: dict[str, list[Quad]] = {
        "floor": [[(0, 0, 0), (x, 0, 0), (x, y, 0), (0, y, 0)]],
        "ceiling": [[(0, 0, z), (0, y, z), (x, y, z), (x, 0, z)]],
        "walls": [[(0, y, 0), (x, y, 0), (x, y, z), (0, y, z)], [(0, 0, 0), (0, y, 0), (0, y, z), (0, 0, z)]],
    }
    for window in WINDOWS:
        axis = 0 if window.normal[1] else 1  # of the wall, along which the window's first side lies
        across = 1 - axis
        level = 0.0 if window.normal[across] > 0 else SIZE_M[across]
        low, high = (window.center[axis] + sign * window.size[0] / 2 for sign in (-1, 1))
        sill, head = (window.center[2] + sign * window.size[1] / 2 for sign in (-1, 1))
        parts = ((0.0, low, 0.0, z), (high, SIZE_M[axis], 0.0, z), (low, high, 0.0, sill), (low, high, head, z))
        quads["walls"] += [_upright(axis, level, *part) for part in parts]
        inward = " ".join(str(value) for value in window.normal)
        name = f"pane_{window.name}"
        cosine = f"abs(Dx*({window.normal[0]})+Dy*({window.normal[1]}))"
        share = f"{window.transmittance}*min(1.018*{cosine}*(1+(1-{cosine}^2)^1.5),1)"
        text += f"# {inward}\nvoid mixfunc {name}\n4 void black {share} .\n0\n0\n"
        quads[name] = [_upright(axis, level, low, high, sill, head)]
    for material, polygons in quads.items():
        for number, corners in enumerate(polygons):
            numbers = " ".join(f"{value:.6g}" for corner in corners for value in corner)
            text += f"{material} polygon {material}{number}\n0\n0\n{3 * len(corners)} {numbers}\n"
    return text


def _upright(axis: int, level: float, low: float, high: float, sill: float, head: float) -> Quad:
    """Corners of an upright rectangle along an axis."""
    corners = []
    for along, up in ((low, sill), (high, sill), (high, head), (low, head)):
        corners.append((along, level, up) if axis == 0 else (level, along, up))
    return corners


def two_phase(
    weather: Weather,
    points: SensorPoints,
    patches: SkyPatches,
    engine: Engine,
    folder: Path,
    *,
    part: str,
    divisions: int = 100_000,
) -> FloatArray:
    """Illuminance by rfluxmtx, gendaymtx and dctimestep.

    Parameters
    ----------
    weather : Weather
        Its file of gendaymtx is in the folder already (`year_sky`).
    points : SensorPoints
    patches : SkyPatches
    engine : Engine
    folder : Path
    part : str
        '-s' for the sky, '-d' for the sun spread over the patches around it.
    divisions : int
        Rays of a sensor.

    Returns
    -------
    illuminance : (hour, point) float
        [lx]
    """
    (folder / "plain.rad").write_text(plain_room_text(), encoding="utf-8")
    (folder / "glow.rad").write_text(SKY_TEXT.format(subdivision=patches.subdivision), encoding="utf-8")
    rows = np.concatenate([points.positions, points.normals], axis=1)
    stdin = "".join(" ".join(f"{value:.6f}" for value in row) + "\n" for row in rows).encode()

    options = ["-I+", "-ab", "9", "-ad", str(divisions), "-lw", f"{0.3 / divisions:.3g}", "-fad"]
    words = ["-V-", "-n", "2", "-y", str(len(rows)), "-", "glow.rad", "plain.rad"]
    run = engine.run("rfluxmtx", [*options, *words], folder=folder, stdin=stdin)
    (folder / "coefficients.mtx").write_bytes(run.output)
    sky = engine.run(
        "gendaymtx",
        ["-m", str(patches.subdivision), "-c", "1", "1", "1", "-g", "0", "0", "0", part, "-O0", "-of", WEATHER_FILE],
        folder=folder,
    )
    (folder / "sky.smx").write_bytes(sky.output)

    run = engine.run("dctimestep", ["-h", "-of", "coefficients.mtx", "sky.smx"], folder=folder)
    values = float_rows(run, rows=len(rows), columns=3 * len(weather.times))
    return GENDAYMTX_EFFICACY_LM_W * values[:, ::3].T


def hidden_points(count: int) -> SensorPoints:
    """Sensors that face the north wall and see no window: all their light is reflected."""
    x, y = np.linspace(0.5, SIZE_M[0] - 0.5, count), np.full(count, SIZE_M[1] - 1.0)
    positions = np.stack([x, y, np.full(count, 1.2)], axis=1)
    return SensorPoints(positions=positions, normals=np.tile([0.0, 1.0, 0.0], (count, 1)), buried=np.zeros(count, bool))


def against_two_phase(engine: Engine, *, count: int = 30, noise: str = "standard") -> None:
    """Print the year's light by sky, and by reflected sun, over that of Radiance's two-phase method."""
    weather = synthetic_year(LATITUDE_DEG, LONGITUDE_DEG, ground_reflectance=0.0)
    up = room().grid(0.76, count=count, margin=MARGIN_M)
    for words, part, points, theirs_cut in (
        ("sky, workplane", "-s", up, PATCHES),
        ("sun, reflected to sensors that see no window", "-d", hidden_points(count), SkyPatches(SUN_SUBDIVISION)),
    ):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            sky = year_sky(weather, PATCHES, folder, engine, ground_reflectance=0.0)
            transport = traced(points, sky, PATCHES, noise, engine)
            one = (
                replace(sky, sun_illuminance=np.zeros_like(sky.sun_illuminance))
                if part == "-s"
                else replace(sky, luminance=np.zeros_like(sky.luminance))
            )
            ours = annual_light(transport, one, weather)["illuminance"].to_numpy()
            theirs = two_phase(weather, points, theirs_cut, engine, folder, part=part)[sky.hours]
        lit = theirs.mean(axis=1) > DIMMEST_LX
        of_year = ours.mean(axis=0) / theirs.mean(axis=0)
        of_hour = ours[lit].mean(axis=1) / theirs[lit].mean(axis=1)
        print(
            f"{words}: year's mean over the points {ours.mean() / theirs.mean():.4f}; year's mean by point "
            f"{of_year.min():.3f} to {of_year.max():.3f}; hours, mean over the points: standard deviation "
            f"{of_hour.std():.4f}, {np.percentile(of_hour, 1):.3f} to {np.percentile(of_hour, 99):.3f} (98 %)"
        )


# --- 2. and 3. single moments


def patch_radiance(sky: Sky, patches: SkyPatches) -> FloatArray:
    """(patch, wavelength) mean radiance of a moment's sky over each patch [W/m²/sr/nm]."""
    azimuths, altitudes = np.arange(0.25, 360.0, 0.5), np.arange(-89.75, 90.0, 0.5)
    patch = patches.patch_of(directions(azimuths, altitudes)).ravel()
    weight = np.broadcast_to(np.cos(np.radians(altitudes)), (azimuths.size, altitudes.size)).ravel()
    table = RegularGridInterpolator((AZIMUTHS_DEG, ALTITUDES_DEG), sky.radiance)
    values = table(np.stack(np.meshgrid(azimuths, altitudes, indexing="ij"), axis=-1)).reshape(patch.size, -1)
    sums = [np.bincount(patch, weights=weight * column, minlength=len(patches)) for column in values.T]
    return np.stack(sums, axis=1) / np.bincount(patch, weights=weight)[:, None]


def from_patches(transport: xr.Dataset, sky: Sky, patches: SkyPatches, hour: int) -> FloatArray:
    """(point, band) irradiance under a moment's own sky on the patches [W/m²/nm]."""
    lit = transport["patch"].to_numpy()
    values = patch_radiance(sky, patches)[lit]
    sent = np.array([BANDS.band_values(sky_spectrum(each, "sky"), outside="zero") for each in values])
    normal = BANDS.band_values(sky_spectrum(sky.sun_irradiance, "sun"), outside="zero")
    sun = transport["sun_area"].to_numpy()[hour][:, None] * normal
    coefficient, direct = transport["coefficient"].to_numpy(), transport["direct_coefficient"].to_numpy()
    flux = sent * transport["geometry"].to_numpy()[:, None]
    found = np.einsum("lpb,lb->pb", coefficient, flux + sun) - direct.T @ sun
    return np.asarray(found + transport["sunlit"].to_numpy()[hour][:, None] * normal)


def moments(engine: Engine) -> tuple[list[Sky], Weather, list[Daylight]]:
    """The skies of `MOMENTS`, and the weather that SPECTRL2 has for them."""
    days = [
        Daylight(
            latitude_deg=LATITUDE_DEG,
            longitude_deg=LONGITUDE_DEG,
            time=datetime(2023, month, day, hour, 0, tzinfo=CET),
            cloud_cover=cloud,
        )
        for month, day, hour, cloud in MOMENTS
    ]
    atmosphere = user_cache_path("lidarspectra") / "atmosphere"
    with tempfile.TemporaryDirectory() as folder:
        skies = [compute_sky(day, Path(folder), engine, atmosphere=atmosphere) for day in days]
    times = pd.DatetimeIndex([day.time for day in days])
    clear = clear_light(times, LATITUDE_DEG, LONGITUDE_DEG, aerosol_optical_depth=0.1, ground_reflectance=0.2)
    cover = np.array([day.cloud_cover for day in days])
    bins = SKY_WAVELENGTHS_NM[1] - SKY_WAVELENGTHS_NM[0]
    visible = clear.sky.sum(axis=1) * bins
    diffuse = np.array([(replace(sky, sun_direction=None).horizontal_irradiance * bins).sum() for sky in skies])
    weather = Weather(
        name="moments",
        latitude_deg=LATITUDE_DEG,
        longitude_deg=LONGITUDE_DEG,
        times=times,
        dni=(1.0 - cover) * clear.dni,
        dhi=clear.dhi * diffuse / visible,
    )
    return skies, weather, days


def against_single_hours(engine: Engine, *, count: int = 60, subdivisions: tuple[int, ...] = (1, SUBDIVISION)) -> None:
    """Print the light of single moments, by patches over that traced for the moment."""
    skies, weather, _ = moments(engine)
    model, points = room(), room().grid(0.76, count=count, margin=MARGIN_M)
    single = [model.light(daylight_lamps(sky, WINDOWS), points, noise="fine") for sky in skies]
    for subdivision in subdivisions:
        patches = SkyPatches(subdivision)
        with tempfile.TemporaryDirectory() as folder:
            sky = year_sky(weather, patches, Path(folder), engine)
        transport = traced(points, sky, patches, "fine", engine)
        year = annual_light(transport, sky, weather)
        print(f"{len(patches) - 1} patches")
        for hour, (moment, own, light) in enumerate(zip(MOMENTS, skies, single, strict=True)):
            truth = light["irradiance"].to_numpy()
            found = from_patches(transport, own, patches, hour)
            shade = transport["sunlit"].to_numpy()[hour] == 0
            ratio = found[shade].mean(axis=1) / truth[shade].mean(axis=1)
            noise = float((light["irradiance_se"] / light["irradiance"]).mean("band").to_numpy()[shade].mean())
            perez = year["illuminance"].to_numpy()[hour][shade] / light["illuminance"].to_numpy()[shade]
            print(
                f"{moment[0]:02d}-{moment[1]:02d} {moment[2]} h, cloud {moment[3]:g}: same sky, points in the "
                f"shade: median {np.median(ratio):.4f}, middle half {np.percentile(ratio, 25):.3f} to "
                f"{np.percentile(ratio, 75):.3f} (noise of the moment {noise:.3f}); the year's sky: median "
                f"{np.median(perez):.3f}"
            )


def main() -> None:
    """Print all comparisons."""
    engine = find_engine()
    against_two_phase(engine)
    against_single_hours(engine)


if __name__ == "__main__":
    main()
