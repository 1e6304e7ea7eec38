import matplotlib.pyplot as plt
import numpy as np

import lidarspectra as ls

grid = np.arange(380.0, 781.0)  # [nm]
silicon = ls.find_cell("silicon").efficiency.at(grid, outside="zero")
lux = ls.light_quantity("illuminance_lx").response.at(grid, outside="zero")
quantities = {
    "melanopic EDI [lx]": ls.light_quantity("melanopic_edi_lx").response,
    "PPFD [µmol/m²/s]": ls.light_quantity("ppfd_umol_m2_s").response,
}

lamps = ("LED-B1", "LED-B3", "LED-B5", "FL11", "A")
found = {name: [] for name in (*quantities, "current of silicon [A/m²]")}
progress = ls.ProgressPrinter("weighing light")
for lamp in lamps:
    light = ls.lamp_spectrum(lamp).spectrum.at(grid, outside="zero")
    light *= 500.0 / np.trapezoid(light * lux, grid)  # 500 lx of each [W/m²/nm]
    for name, response in quantities.items():
        weighted = light * response.at(grid, outside="zero")
        found[name].append(np.trapezoid(weighted, grid))
    current = ls.photocurrent_density(light, grid, silicon)
    found["current of silicon [A/m²]"].append(current)
    progress(len(found["PPFD [µmol/m²/s]"]) / len(lamps), lamp)

figure, panels = plt.subplots(1, 3, figsize=(9, 3), layout="constrained")
for panel, (name, values) in zip(panels, found.items(), strict=True):
    panel.bar(lamps, values, color="0.5")
    panel.set_title(name, fontsize=10)
    panel.tick_params(axis="x", rotation=45)
figure.suptitle("What 500 lx of five lamps do, from 380 to 780 nm")
plt.show()
