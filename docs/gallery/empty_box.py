import matplotlib.pyplot as plt
import numpy as np

import lidarspectra as ls

room = ls.RoomModel.from_box(4.0, 3.0, 2.7, floor=0.2, walls=0.5, ceiling=0.7)
lamp = ls.make_lamp(
    "panel", (2.0, 1.5, 2.6), size=0.6, spectrum="LED-B3", luminous_flux_lm=3400
)
desks = room.grid(0.75, spacing=0.1)
light = room.light([lamp], desks, progress=ls.ProgressPrinter("empty box"))
print(f"mean {float(light['illuminance'].mean()):.0f} lx")

x, y = (np.unique(light[axis]) for axis in "xy")
lux = light["illuminance"].to_numpy().reshape(len(y), len(x))
figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
shown = axes.pcolormesh(x, y, lux, shading="nearest")
lines = axes.contour(x, y, lux, colors="white", linewidths=0.7)
axes.clabel(lines, fmt="%.0f lx")
axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
figure.colorbar(shown, label="illuminance at 0.75 m [lx]")
plt.show()
