import tempfile
from pathlib import Path

import matplotlib.pyplot as plt

import lidarspectra as ls

with tempfile.TemporaryDirectory() as folder:
    # A closed cube of 3 m, reflectance 0.5, with one bulb of 1000 lm.
    run_file = ls.read_run_file(ls.copy_scene("box", Path(folder)))
    drafted = run_file.changed(trace={"noise": "draft"})
    summary = ls.run(drafted, last="map", listener=ls.ProgressPrinter())
    light, transport = summary.map, summary.transport

area, reflectance = 6 * 3.0**2, 0.5
expected = transport["flux"].sel(lamp="bulb") / (area * (1 - reflectance))  # [W/m²/nm]

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained")
left.plot(expected["band"], 1e3 * expected, "-", label="energy balance")
left.plot(
    light["band"],
    1e3 * light["irradiance"].mean("point"),
    "o",
    label="mean of 600 sensors",
)
left.set(xlabel="wavelength [nm]", ylabel="mean irradiance [mW/m²/nm]")
left.legend()
right.hist(1e3 * light["irradiance"].sel(band=560), bins=30)
right.axvline(1e3 * float(expected.sel(band=560)), color="k")
right.set(xlabel="irradiance at 560 nm [mW/m²/nm]", ylabel="sensors [1]")
plt.show()
