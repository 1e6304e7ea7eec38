import matplotlib.pyplot as plt
import numpy as np

import lidarspectra as ls


def grid(first: float, step: float) -> np.ndarray:
    ticks = np.arange(first, 6, step)
    return np.array([(x, y) for x in ticks for y in ticks if y < 5])


# People in a room of 6 m x 5 m; a ceiling sensor loses 6 % to one who stands below it.
places, sensors = grid(0.6, 1.2), grid(0.5, 1.0)
away = np.linalg.norm(places[:, None] - sensors[None], axis=2)  # (place, sensor) [m]
change = -0.06 * np.exp(-0.5 * away**2)  # of the reading's logarithm
noise = 0.005
chosen = ls.choose_to_locate(
    (change / noise)[:, :, None],
    12,
    positions_m=places,
    progress=ls.ProgressPrinter("choosing"),
)

figure, (room, curve) = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
room.plot(*places.T, "x", color="grey", label="places")
room.plot(*sensors.T, ".", color="lightgrey", label="candidates")
room.plot(*sensors[chosen.order].T, "o", mfc="none", color="tab:blue", label="chosen")
for number, (x, y) in enumerate(sensors[chosen.order], start=1):
    room.annotate(f"{number}", (x, y), textcoords="offset points", xytext=(5, 4))
room.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", xlim=(0, 6), ylim=(0, 5))
room.legend(ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0), columnspacing=1)
curve.semilogy(range(chosen.loss.size), chosen.loss, "o-")
curve.set(xlabel="sensors", ylabel="error of choosing between two places [m]")
plt.show()
