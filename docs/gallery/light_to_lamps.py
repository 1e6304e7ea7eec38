import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

import lidarspectra as ls

with tempfile.TemporaryDirectory() as folder:
    # A closed cube of 3 m with one bulb; sensors at desk height.
    run_file = ls.read_run_file(ls.copy_scene("box", Path(folder)))
    grid = {"height": 0.75, "count": 36}
    drafted = run_file.changed(
        trace={"noise": "draft"},
        sensors={"points": None, "grid": grid},
    )
    run = ls.run(drafted, last="map", listener=ls.ProgressPrinter()).folder
    target = {
        "targets": [{"name": "desks", "at_least": 60, "uniformity": 0.6}],
        "candidates": {"spacing": 0.8, "margin": 0.7},
        "lamps": {"efficacy_lm_W": 100},
    }
    # How many lamps, out of a grid of nine, and how much does one more save?
    designs = {}
    for count in (1, 2, 4):
        target["lamps"]["count"] = count
        progress = ls.ProgressPrinter(f"{count} lamps")
        designs[count] = ls.design_lighting(run, target, progress=progress)

figure, panels = plt.subplots(1, 3, figsize=(9, 3.4), layout="constrained", sharey=True)
for axes, (count, design) in zip(panels, designs.items(), strict=True):
    lamps = design.lamps.frame[design.lamps.frame["state"] != "removed"]
    axes.scatter(lamps["x [m]"], lamps["y [m]"], s=12, color="0.7")
    lit = lamps[lamps["state"] == "lit"]
    axes.scatter(lit["x [m]"], lit["y [m]"], s=250 * lit["dim [1]"], color="tab:orange")
    met = "" if design.is_met else ", missed"
    axes.set(title=f"at most {count}: {design.power_W:.1f} W{met}")
    axes.set(xlim=(0, 3), ylim=(0, 3), aspect="equal", xlabel="x [m]")
panels[0].set_ylabel("y [m]")
plt.show()
