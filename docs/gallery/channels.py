import matplotlib.pyplot as plt

import lidarspectra as ls

progress = ls.ProgressPrinter("channels")
bands = ls.sensor_bands("as7265x-14")
# A sensor of your own: any centres and widths.
wide = ls.gaussian_bands("three colours", [450, 540, 610], [60, 60, 60])

lamps = ("LED-B3", "FL11", "A")
figure, panels = plt.subplots(3, 1, figsize=(7, 6), sharex=True, layout="constrained")
for number, (panel, name) in enumerate(zip(panels, lamps, strict=True), start=1):
    spectrum = ls.lamp_spectrum(name).spectrum
    spectrum = spectrum.scaled(1.0 / spectrum.values.max())
    narrow_values = bands.band_values(spectrum, outside="zero")
    wide_values = wide.band_values(spectrum, outside="zero")
    panel.plot(spectrum.wavelengths_nm, spectrum.values, color="0.6", label="spectrum")
    panel.plot(bands.centers_nm, narrow_values, "o", label="14 channels of 20 nm")
    panel.plot(wide.centers_nm, wide_values, "s", label="three of 60 nm")
    panel.set_title(name, loc="left")
    panel.set_ylabel("relative [1]")
    progress(number / len(lamps), name)
panels[0].legend()
panels[-1].set(xlabel="wavelength [nm]", xlim=(380, 780))
plt.show()
