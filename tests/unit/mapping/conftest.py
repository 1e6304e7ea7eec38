"""A synthetic Transport: two panels over a 3 m x 3 m room with a table, in closed form, for tests without an engine."""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from lidarspectra.arrays import FloatArray
from lidarspectra.geometry.scan import ScanRecord
from lidarspectra.lamps.lamps import Lamp
from lidarspectra.lamps.shapes import Panel
from lidarspectra.mapping.figures.floor_plan import FloorPlan
from lidarspectra.mapping.maps.spectral_map import spectral_map
from lidarspectra.mapping.report.report import ReportInput, ReportView, StageRow
from lidarspectra.mapping.report.room_view import RoomSurfaces
from lidarspectra.material.material_map import Material
from lidarspectra.spectra.spectrum import BandSet, Spectrum, sensor_bands

ROOM_M = 3.0
LAMP_CENTERS_M = ((0.9, 1.5, 2.66), (2.1, 1.5, 2.66))
TABLE_M = ((0.2, 0.2), (1.4, 0.2), (1.4, 1.0), (0.2, 1.0))
RELATIVE_SE = 0.008
BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
SOFTWARE_WEBGL = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"]  # no graphics card is needed

MakeTransport = Callable[..., xr.Dataset]
MakeReport = Callable[..., ReportInput]
MakeMaterial = Callable[[str], Material]


def led_flux(radiant_flux_W: float, name: str) -> Spectrum:
    """A white LED: a blue peak and a broad phosphor, scaled to a radiant flux."""
    grid = np.arange(380.0, 781.0, 1.0)
    shape = 0.9 * np.exp(-0.5 * ((grid - 452) / 9) ** 2) + np.exp(-0.5 * ((grid - 580) / 60) ** 2)
    spectrum = Spectrum(wavelengths_nm=grid, values=shape, name=name)
    return spectrum.scaled(radiant_flux_W / spectrum.integral())


def _grid(count: int) -> FloatArray:
    side = int(np.ceil(np.sqrt(count)))
    axis = np.linspace(0.15, ROOM_M - 0.15, side)
    xy = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)
    keep = np.linspace(0, xy.shape[0] - 1, count).round().astype(int)
    return xy[keep]


def _coefficients(positions: FloatArray, bands: BandSet, lamp_centers: tuple[tuple[float, ...], ...]) -> FloatArray:
    """Direct light of a small Lambertian panel, a shadow under the table, and a constant bounced part."""
    offset = positions[None, :, :] - np.asarray(lamp_centers)[:, None, :]
    distance = np.linalg.norm(offset, axis=-1)
    cosine = -offset[..., 2] / distance
    (x0, y0), (x1, y1) = TABLE_M[0], TABLE_M[2]
    x, y = positions[:, 0], positions[:, 1]
    shaded = (x > x0) & (x < x1) & (y > y0) & (y < y1)
    direct = np.where(shaded, 0.05, 1.0) * cosine**2 / (np.pi * distance**2)
    reflectance = 0.35 + 0.4 / (1 + np.exp(-(bands.centers_nm - 590) / 30))
    bounced = reflectance / (1 - reflectance) / (6 * ROOM_M**2)
    return direct[:, :, None] + np.where(shaded, 0.4, 1.0)[None, :, None] * bounced[None, None, :]


@pytest.fixture(scope="session")
def bands() -> BandSet:
    return sensor_bands("as7265x-14")


@pytest.fixture(scope="session")
def lamps() -> tuple[Lamp, ...]:
    return tuple(
        Lamp(
            name=f"panel {number}",
            shape=Panel(0.6, 0.6),
            center=np.array(center),
            flux=led_flux(11.0 * number, f"LED {number}"),
            normal=np.array([0.0, 0.0, -1.0]),
        )
        for number, center in enumerate(LAMP_CENTERS_M, start=1)
    )


@pytest.fixture(scope="session")
def make_transport(bands: BandSet, lamps: tuple[Lamp, ...]) -> MakeTransport:
    def make(*, points: int = 176, buried: tuple[int, ...] = (), seed: int = 5, height: float = 0.3) -> xr.Dataset:
        random = np.random.default_rng(seed)
        positions = np.column_stack([_grid(points), np.full(points, height)])
        exact = _coefficients(positions, bands, LAMP_CENTERS_M)
        noise = RELATIVE_SE * exact
        is_buried = np.zeros(points, dtype=bool)
        is_buried[list(buried)] = True
        band = ("lamp", "point", "band")
        return xr.Dataset(
            {
                "coefficient": (band, exact + noise * random.normal(size=exact.shape), {"units": "m-2"}),
                "coefficient_se": (band, noise, {"units": "m-2"}),
                "flux": (
                    ("lamp", "band"),
                    [bands.band_values(lamp.flux, outside="zero") for lamp in lamps],
                    {"units": "W nm-1"},
                ),
            },
            coords={
                "lamp": ("lamp", [lamp.name for lamp in lamps]),
                "x": ("point", positions[:, 0], {"units": "m"}),
                "y": ("point", positions[:, 1], {"units": "m"}),
                "z": ("point", positions[:, 2], {"units": "m"}),
                "nx": ("point", np.zeros(points), {"units": "1"}),
                "ny": ("point", np.zeros(points), {"units": "1"}),
                "nz": ("point", np.ones(points), {"units": "1"}),
                "buried": ("point", is_buried),
                "band": ("band", bands.centers_nm, {"units": "nm"}),
                "band_width": ("band", bands.widths_nm, {"units": "nm"}),
                "band_label": ("band", list(bands.labels)),
            },
            attrs={"accuracy": "ultra", "bounces": 20, "noise": "standard", "target_relative_se": 0.01,
                   "achieved_relative_se": RELATIVE_SE, "seconds": 12.5},
        )  # fmt: skip

    return make


@pytest.fixture(scope="session")
def make_material() -> MakeMaterial:
    def make(name: str) -> Material:
        return Material(
            name=name,
            category=name,
            reflectance=Spectrum(wavelengths_nm=[380.0, 780.0], values=[0.4, 0.6]),
            source=name,
            provenance="measured",
            confidence=0.9,
            measured_range_nm=(400.0, 700.0),
            color=(0.4, 0.5, 0.6),
        )

    return make


@pytest.fixture(scope="session")
def room_surfaces() -> RoomSurfaces:
    """The room's box, its triangles facing inwards: walls and ceiling of material 0, the floor of material 1."""
    vertices = ROOM_M * np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 0.9)])
    quads = ((0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6))  # floor first
    faces = np.array([corners for a, b, c, d in quads for corners in ((a, b, c), (a, c, d))])
    return RoomSurfaces(
        vertices=vertices,
        faces=faces,
        face_material=np.array([1, 1] + 10 * [0]),
        face_color=np.tile([0.3, 0.25, 0.2], (12, 1)),
    )


@pytest.fixture(scope="session")
def make_report(lamps: tuple[Lamp, ...], make_material: MakeMaterial, room_surfaces: RoomSurfaces) -> MakeReport:
    """All that a report tells of, for a transport."""

    def make(transport: xr.Dataset, *, lamps: tuple[Lamp, ...] = lamps) -> ReportInput:
        return ReportInput(
            title="Office",
            spectral_map=spectral_map(transport),
            transport=transport,
            plan=FloorPlan(outline=np.array([[0.0, 0.0], [ROOM_M, 0.0], [ROOM_M, ROOM_M], [0.0, ROOM_M]])),
            scan=ScanRecord(
                file="scan.glb",
                unit="m",
                unit_confidence=0.9,
                up_axis="+y",
                up_confidence=0.8,
                faces_read=100,
                faces_kept=90,
                holes_closed=3,
                hole_area_m2=0.4,
                area_m2=40.0,
            ),
            materials=(make_material("wall"), make_material("floor")),
            material_areas_m2=np.array([30.0, 9.0]),
            lamps=lamps,
            surfaces=room_surfaces,
            views=(ReportView(name="east", image=np.full((30, 40, 3), 90, dtype=np.uint8)),),
            stages=(StageRow(stage="scan", summary="100 triangles", seconds=1.25, peak_memory_mib=210.0),),
            warnings=("1 of 64 points is buried",),
            provenance={"lidarspectra": "9.9.9", "numpy": "2"},
            run_file='[scan]\nfile = "scan.glb"\n',
        )

    return make


@pytest.fixture(scope="session")
def browser():
    """Chromium, as the system has it or as playwright brought it."""
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as driver:
        found = next((path for path in map(shutil.which, BROWSERS) if path), driver.chromium.executable_path)
        if not Path(found).is_file():
            pytest.skip(f"no browser: none of {', '.join(BROWSERS)} is on this machine, nor playwright's own")
        chromium = driver.chromium.launch(executable_path=found, args=SOFTWARE_WEBGL)
        yield chromium
        chromium.close()


@pytest.fixture
def split_transport(make_transport: MakeTransport, bands: BandSet, lamps: tuple[Lamp, ...]) -> xr.Dataset:
    """A transport whose channels are two slots each, below and above their centre, with coefficients of their own."""
    transport = make_transport(points=25, buried=(3,))
    grid = bands.wavelengths_nm
    halves = [
        np.where(side, weights, 0.0)
        for weights, center in zip(bands.weights, bands.centers_nm, strict=True)
        for side in (grid < center, grid >= center)
    ]
    share = np.array([half.sum() for half in halves])
    weights = np.array(halves) / share[:, None]
    channel = np.repeat(np.arange(len(bands)), 2)
    flux = np.array([weights @ lamp.flux.at(grid, outside="zero") for lamp in lamps])
    whole = transport["coefficient"].to_numpy()
    slots = whole[:, :, channel] * np.tile([0.9, 1.1], len(bands))
    folded = np.zeros_like(whole)
    for slot, band in enumerate(channel):
        folded[:, :, band] += (
            slots[:, :, slot] * (share[slot] * flux[:, slot] / transport["flux"][:, band].to_numpy())[:, None]
        )
    mean = 0.35 + 0.4 / (1 + np.exp(-(grid - 590) / 30))
    lit = np.array([[(half * light * mean).sum() / (half * light).sum() for half in weights]
                    for light in (lamp.flux.at(grid, outside="zero") for lamp in lamps)])  # fmt: skip
    return transport.assign(
        coefficient=(("lamp", "point", "band"), folded, {"units": "m-2"}),
        slot_coefficient=(("lamp", "point", "slot"), slots),
        slot_flux=(("lamp", "slot"), flux),
        slot_share=("slot", share),
        slot_channel=("slot", channel),
        slot_weights=(("slot", "wavelength"), weights),
        slot_reflectance=(("lamp", "slot"), np.nan_to_num(lit, nan=0.5)),
        mean_reflectance=("wavelength", mean),
    ).assign_coords(wavelength=grid)
