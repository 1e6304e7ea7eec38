import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

import lidarspectra as ls

panel = {"size": 0.6, "spectrum": "LED-B3", "luminous_flux_lm": 3400}
with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    scan = ls.read_scan(ls.scenes_folder() / "box" / "scan.ply", unit="m", up="+z")
    room = ls.find_room(scan)
    # In place of render_views and estimate_materials: this scan has no colours.
    materials = ls.one_material(scan, "white-wall")
    lamps = [
        ls.make_lamp("panel", (0.8, 1.5, 2.9), name="west", **panel),
        ls.make_lamp("panel", (2.2, 1.5, 2.9), name="east", **panel),
    ]
    bands = ls.sensor_bands("as7265x-14")
    progress = ls.ProgressPrinter("scene")
    scene = ls.write_scene(scan, materials, lamps, bands, folder, progress=progress)
    points = ls.grid_points(scan, room, height=0.75, spacing=0.25)
    progress = ls.ProgressPrinter("trace")
    transport = ls.trace(
        scene, points, accuracy="medium", noise="draft", seed=1, progress=progress
    )

as_traced = ls.spectral_map(transport, lamps=lamps)
dimmed = ls.relight(transport, {"east": ls.LampChange(dim=0.2)}, lamps=lamps)

brightest = as_traced["illuminance"].max()
figure, panels = plt.subplots(1, 2, figsize=(9, 4), layout="constrained", sharey=True)
titles = ("both lamps", "east at 20 %")
for axes, light, title in zip(panels, (as_traced, dimmed), titles, strict=True):
    lux = light["illuminance"]
    dots = axes.scatter(light["x"], light["y"], c=lux, s=90, vmin=0, vmax=brightest)
    axes.set(title=title, xlabel="x [m]", aspect="equal")
panels[0].set_ylabel("y [m]")
figure.colorbar(dots, ax=panels, label="illuminance [lx]")
plt.show()
