import matplotlib.pyplot as plt
import numpy as np

from lidarspectra.mapping.photometry.quantities import light_quantity
from lidarspectra.mapping.photovoltaics.cells import find_cell
from lidarspectra.mapping.photovoltaics.currents import photocurrent_density
from lidarspectra.spectra.databases import lamp_spectrum

grid = np.arange(380.0, 781.0)  # [nm]
silicon = find_cell("silicon").efficiency.at(grid, outside="zero")
lux = light_quantity("illuminance_lx").response.at(grid, outside="zero")
quantities = {
    "melanopic EDI [lx]": light_quantity("melanopic_edi_lx").response,
    "PPFD [µmol/m²/s]": light_quantity("ppfd_umol_m2_s").response,
}

lamps = ("LED-B1", "LED-B3", "LED-B5", "FL11", "A")
found = {name: [] for name in (*quantities, "current of silicon [A/m²]")}
for lamp in lamps:
    light = lamp_spectrum(lamp).spectrum.at(grid, outside="zero")
    light *= 500.0 / np.trapezoid(light * lux, grid)  # 500 lx of each [W/m²/nm]
    for name, response in quantities.items():
        weighted = light * response.at(grid, outside="zero")
        found[name].append(np.trapezoid(weighted, grid))
    found["current of silicon [A/m²]"].append(
        photocurrent_density(light, grid, silicon)
    )

figure, panels = plt.subplots(1, 3, figsize=(9, 3), layout="constrained")
for panel, (name, values) in zip(panels, found.items(), strict=True):
    panel.bar(lamps, values, color="0.5")
    panel.set_title(name, fontsize=10)
    panel.tick_params(axis="x", rotation=45)
figure.suptitle("What 500 lx of five lamps do, from 380 to 780 nm")
plt.show()
