import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import lidarspectra
from lidarspectra.config import (
    GridSection,
    LampSection,
    MaterialsSection,
    SensorsSection,
    TraceSection,
)
from lidarspectra.lamps.lamps import resolve_lamps
from lidarspectra.material.viewpoints import render_views
from lidarspectra.room.room import find_room
from lidarspectra.room.sensor_points import sensor_points
from lidarspectra.spectra.databases import scenes_folder

panel = {
    "shape": "panel",
    "size": (0.6, 0.6),
    "spectrum": "LED-B3",
    "luminous_flux_lm": 3400,
}
with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    scan = lidarspectra.read_scan(
        scenes_folder() / "box" / "scan.ply", unit="m", up="+z"
    )
    room = find_room(scan)
    views = render_views(scan, room, coverage=0.5)
    one_for_all = MaterialsSection(method="default", default="white-wall")
    materials = lidarspectra.estimate_materials(scan, views, one_for_all)
    lamps = resolve_lamps(
        [
            LampSection(name="west", center=(0.8, 1.5, 2.9), **panel),
            LampSection(name="east", center=(2.2, 1.5, 2.9), **panel),
        ],
        folder,
    )
    bands = lidarspectra.sensor_bands("as7265x-14")
    scene = lidarspectra.write_scene(scan, materials, lamps, bands, folder)
    grid = SensorsSection(grid=GridSection(height=0.75, spacing=0.25))
    points = sensor_points(scan, room, grid, folder=folder)
    exactness = TraceSection(accuracy="medium", noise="draft")
    transport = lidarspectra.trace(scene, points, exactness, seed=1)

as_traced = lidarspectra.spectral_map(transport)
flux = transport["flux"].to_numpy()
# The second lamp at a fifth of its flux.
dimmed = lidarspectra.spectral_map(transport, flux * np.array([[1.0], [0.2]]))

brightest = 1e3 * as_traced["irradiance"].sel(band=560).max()
figure, panels = plt.subplots(1, 2, figsize=(9, 4), layout="constrained", sharey=True)
titles = ("both lamps", "east at 20 %")
for axes, light, title in zip(panels, (as_traced, dimmed), titles, strict=True):
    values = 1e3 * light["irradiance"].sel(band=560)
    dots = axes.scatter(light["x"], light["y"], c=values, s=90, vmin=0, vmax=brightest)
    axes.set(title=title, xlabel="x [m]", aspect="equal")
panels[0].set_ylabel("y [m]")
figure.colorbar(dots, ax=panels, label="irradiance at 560 nm [mW/m²/nm]")
plt.show()
