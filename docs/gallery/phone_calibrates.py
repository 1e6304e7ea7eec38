import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import lidarspectra as ls

with tempfile.TemporaryDirectory() as name:
    scene = ls.copy_scene("box", Path(name))
    points = scene.parent / "points.csv"
    pd.read_csv(points)[::8].to_csv(points, index=False)  # fewer: a quick look
    run_file = ls.read_run_file(scene).changed(trace={"noise": "draft"})
    run = ls.run(run_file, last="map", listener=ls.ProgressPrinter())

    # Where six readings tell most: a CSV to take along, and a plan.
    plan = ls.plan_readings(run.folder, 6, progress=ls.ProgressPrinter("planning"))
    to_take, _ = ls.save_plan(plan, run.folder)

    # Walk there with a phone and write its lux down. Here the room is a simulation
    # too: its bulb gives 25 % less than its box says, and its walls are darker.
    readings = pd.read_csv(to_take)
    both = pd.concat([readings, pd.read_csv(points)])
    everywhere = Path(name) / "everywhere.csv"
    both[["x", "y", "z", "nx", "ny", "nz"]].to_csv(everywhere, index=False)
    truth = run_file.changed(
        calibration={"lamps": {"bulb": 0.75}, "reflectance": {"walls": 0.9}},
        sensors={"points": str(everywhere), "lift": 0.001},
    )
    true_map = ls.run(truth, folder=Path(name) / "truth", last="map").map
    phone, true_lux = np.split(true_map["illuminance"].to_numpy(), [len(readings)])
    noise = np.random.default_rng(1).normal(0, 0.03, phone.size)
    readings.assign(lux=phone * np.exp(noise)).to_csv(to_take, index=False)

    found = ls.calibrate_run(
        run.folder, to_take, progress=ls.ProgressPrinter("calibrating")
    )

factors = found.unknowns.frame.set_index("name")["factor [1]"]
print(f"The bulb's flux is {factors['bulb']:.2f} of what was stated, in truth 0.75.")
points = found.points.frame
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
table = found.readings.frame
places = np.arange(len(table))
left.bar(places - 0.2, table["off before [%]"], 0.4, label="before")
left.bar(places + 0.2, table["off after [%]"], 0.4, label="after")
left.set_xticks(places, table["reading"], rotation=30)
left.set(xlabel="reading", ylabel="map over reading [%]")
left.legend()
for state in ("before", "after"):
    off = 100 * (points[f"{state} [lx]"] / true_lux - 1)
    right.hist(off, bins=20, alpha=0.7, label=state)
right.set(xlabel="map over truth, 75 points [%]", ylabel="points [1]")
right.legend()
plt.show()
