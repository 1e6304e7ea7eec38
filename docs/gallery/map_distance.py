import matplotlib.pyplot as plt
import numpy as np

import lidarspectra as ls

generator = np.random.default_rng(7)
truth = 1e-3 * (1.0 + generator.random((176, 14)))  # (point, band) [W/m²/nm]
errors = np.array([0.02, 0.05, 0.1, 0.2, 0.4])
maps = [truth * generator.lognormal(sigma=error, size=truth.shape) for error in errors]
progress, found = ls.ProgressPrinter("comparing maps"), []
for number, synthetic in enumerate(maps, start=1):
    found.append(ls.compare_maps(synthetic, truth))
    progress(number / len(maps), f"scatter of {errors[number - 1]:g}")

figure, axes = plt.subplots(figsize=(6, 3.5), layout="constrained")
axes.loglog(errors, [100 * each.nrmse_mean for each in found], "o-", label="NRMSE [%]")
axes.loglog(errors, [each.mape_mean for each in found], "s-", label="MAPE [%]")
axes.loglog(
    errors, [each.angle_mean_deg for each in found], "^-", label="spectral angle [deg]"
)
axes.set(xlabel="scatter of the synthetic map [1]", ylabel="distance")
axes.legend()
plt.show()
