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
)
from lidarspectra.lamps.lamps import resolve_lamps
from lidarspectra.mapping.localization.person import Person
from lidarspectra.mapping.localization.traced_fingerprints import (
    FingerprintRequest,
    PlacedPerson,
    trace_fingerprints,
)
from lidarspectra.material.viewpoints import render_views
from lidarspectra.room.room import find_room
from lidarspectra.room.sensor_points import sensor_points
from lidarspectra.spectra.databases import load_reflectances, scenes_folder

panel = LampSection(
    name="panel",
    shape="panel",
    center=(1.5, 1.5, 2.9),
    size=(0.6, 0.6),
    spectrum="LED-B3",
    luminous_flux_lm=3400,
)
red = Person(upper="cc-red", lower="cc-neutral-3-5", yaw_deg=200.0)
place = np.array([0.9, 1.8, 0.0])
with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    scan = lidarspectra.read_scan(
        scenes_folder() / "box" / "scan.ply", unit="m", up="+z"
    )
    room = find_room(scan)
    views = render_views(scan, room, coverage=0.5)
    one_for_all = MaterialsSection(method="default", default="white-wall")
    materials = lidarspectra.estimate_materials(scan, views, one_for_all)
    lamps = resolve_lamps([panel], folder)
    bands = lidarspectra.sensor_bands("as7265x-14")
    scene = lidarspectra.write_scene(scan, materials, lamps, bands, folder / "scene")
    # Sensors under the ceiling that look down.
    grid = GridSection(height=2.8, spacing=0.5, normal=(0.0, 0.0, -1.0))
    points = sensor_points(scan, room, SensorsSection(grid=grid), folder=folder)
    table = trace_fingerprints(
        scene,
        lamps,
        points,
        [PlacedPerson(label="here", place_m=place, person=red)],
        load_reflectances(),
        folder / "parts",
        FingerprintRequest(accuracy="medium", target=0.05, effect_target=0.006),
    )

change = 100 * (table["irradiance"] / table["empty"] - 1).isel(fingerprint=0)
most = float(abs(change).max())
figure, panels = plt.subplots(1, 2, figsize=(9, 4), layout="constrained", sharey=True)
for axes, center in zip(panels, (460, 645), strict=True):
    dots = axes.scatter(
        *points.positions[:, :2].T,
        c=change.sel(band=center),
        s=250,
        cmap="magma",
        vmin=-most,
        vmax=0.0,
    )
    axes.plot(*place[:2], "x", color="tab:cyan")
    axes.set(title=f"{center} nm", xlabel="x [m]", aspect="equal")
panels[0].set_ylabel("y [m]")
figure.colorbar(dots, ax=panels, label="change by a person in a red shirt [%]")
plt.show()
