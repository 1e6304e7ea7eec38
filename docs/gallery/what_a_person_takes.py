import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import lidarspectra as ls

panel = ls.make_lamp(
    "panel", (1.5, 1.5, 2.9), size=0.6, spectrum="LED-B3", luminous_flux_lm=3400
)
red = ls.Person(upper="cc-red", lower="cc-neutral-3-5", yaw_deg=200.0)
place = np.array([0.9, 1.8, 0.0])
with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    room = ls.RoomModel.from_box(3.0, 3.0, 3.0, floor=0.8, walls=0.8, ceiling=0.8)
    bands = ls.sensor_bands("as7265x-14")
    scene = ls.write_scene(room.scan, room.materials, [panel], bands, folder / "scene")
    # Sensors under the ceiling that look down.
    points = room.grid(2.8, spacing=0.5, normal=(0.0, 0.0, -1.0))
    table = ls.trace_fingerprints(
        scene,
        [panel],
        points,
        [ls.PlacedPerson(label="here", place_m=place, person=red)],
        ls.load_reflectances(),
        folder / "parts",
        ls.FingerprintRequest(accuracy="medium", target=0.05, effect_target=0.006),
        progress=ls.ProgressPrinter("person"),
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
