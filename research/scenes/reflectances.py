"""Write the true reflectances of our rooms' surfaces, from smooth models.

    python -m research.scenes.reflectances

scenes/reflectances.csv has those of the scenes; research/scenes/rooms/reflectances.csv and
research/scenes/held_out/reflectances.csv have those and the ones of the rooms there.

Each spectrum is a base, plus steps (pigments and dyes that open up at some wavelength: sigmoids), plus bumps
(Gaussians, negative ones are absorption bands). They are modelled, not measured: levels and edges follow what
paints, laminates, textiles and metals do, but no spectrum is that of a real surface or of a built-in library, so
that an estimate which names the right library entry is still not exact.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lidarspectra.arrays import FloatArray
from lidarspectra.spectra.spectrum import Spectrum
from lidarspectra.spectra.spectrum_files import TableRow, write_table

WAVELENGTHS_NM = np.arange(360.0, 965.0, 5.0)  # [nm] covers the AS7265x with its widths
TABLE = Path(__file__).parents[2] / "scenes" / "reflectances.csv"
OTHER_TABLE = Path(__file__).parent / "rooms" / "reflectances.csv"
HELD_OUT_TABLE = Path(__file__).parent / "held_out" / "reflectances.csv"


@dataclass(frozen=True, kw_only=True)
class Model:
    """A reflectance model.

    Parameters
    ----------
    id, name, category : str
        As in the table.
    base : float
        What is left of every wavelength. [1]
    steps : tuple of (float, float, float)
        (height [1], centre [nm], width [nm]) of sigmoids that rise with the wavelength; a negative height falls.
    bumps : tuple of (float, float, float)
        (height [1], centre [nm], standard deviation [nm]) of Gaussians.
    """

    id: str
    name: str
    category: str
    base: float
    steps: tuple[tuple[float, float, float], ...] = ()
    bumps: tuple[tuple[float, float, float], ...] = ()

    def reflectance(self) -> FloatArray:
        """(wavelength,) reflectance on `WAVELENGTHS_NM` [1]."""
        values = np.full(WAVELENGTHS_NM.size, self.base)
        for height, center, width in self.steps:
            values += height / (1.0 + np.exp(-(WAVELENGTHS_NM - center) / width))
        for height, center, deviation in self.bumps:
            values += height * np.exp(-0.5 * ((WAVELENGTHS_NM - center) / deviation) ** 2)
        return values


# Titanium white absorbs below 400 nm; organic dyes turn transparent in the near infrared, black ones from 700 nm.
MODELS = (
    Model(id="ceiling-white", name="matt white ceiling paint", category="painted", base=0.06,
          steps=((0.73, 402.0, 8.0), (0.06, 500.0, 60.0))),
    Model(id="wall-orange", name="orange wall paint", category="painted", base=0.075,
          steps=((0.17, 522.0, 12.0), (0.43, 578.0, 13.0), (0.05, 660.0, 30.0)), bumps=((0.02, 425.0, 20.0),)),
    Model(id="wall-cream", name="cream wall paint", category="painted", base=0.07,
          steps=((0.53, 405.0, 9.0), (0.20, 490.0, 30.0))),
    Model(id="wall-sage", name="sage green wall paint", category="painted", base=0.09,
          steps=((0.22, 405.0, 10.0), (0.13, 720.0, 25.0)), bumps=((0.15, 545.0, 48.0),)),
    Model(id="wall-grey", name="light grey wall paint", category="painted", base=0.08,
          steps=((0.47, 404.0, 9.0), (-0.02, 640.0, 40.0))),
    Model(id="floor-lino", name="grey-beige linoleum", category="stone", base=0.10,
          steps=((0.10, 470.0, 45.0), (0.08, 590.0, 45.0), (0.09, 760.0, 40.0))),
    Model(id="floor-oak", name="oiled oak boards", category="wood", base=0.06,
          steps=((0.16, 500.0, 35.0), (0.20, 590.0, 40.0), (0.14, 690.0, 45.0))),
    Model(id="floor-tile", name="pale stoneware tile", category="tile", base=0.17,
          steps=((0.18, 420.0, 22.0), (0.09, 560.0, 50.0))),
    Model(id="carpet-blue", name="blue carpet", category="carpet", base=0.045,
          steps=((0.38, 728.0, 18.0),), bumps=((0.11, 455.0, 38.0),)),
    Model(id="beech", name="beech veneer", category="wood", base=0.12,
          steps=((0.20, 475.0, 32.0), (0.22, 575.0, 42.0), (0.12, 690.0, 40.0))),
    Model(id="walnut", name="walnut veneer", category="wood", base=0.045,
          steps=((0.05, 520.0, 45.0), (0.10, 630.0, 40.0), (0.22, 730.0, 40.0))),
    Model(id="laminate-white", name="white laminate", category="plastic", base=0.08,
          steps=((0.70, 412.0, 9.0), (0.04, 560.0, 50.0))),
    Model(id="whiteboard", name="enamelled steel whiteboard", category="ceramic", base=0.10,
          steps=((0.72, 398.0, 8.0), (-0.04, 640.0, 60.0))),
    Model(id="fabric-blue", name="blue upholstery", category="fabric", base=0.04,
          steps=((0.42, 716.0, 15.0),), bumps=((0.17, 450.0, 30.0), (0.04, 500.0, 30.0))),
    Model(id="fabric-grey", name="grey upholstery", category="fabric", base=0.16,
          steps=((0.05, 500.0, 60.0), (0.27, 735.0, 22.0))),
    Model(id="fabric-red", name="red blanket", category="fabric", base=0.045,
          steps=((0.40, 603.0, 11.0), (0.18, 700.0, 25.0)), bumps=((0.02, 430.0, 25.0),)),
    Model(id="steel-grey", name="grey powder-coated steel", category="metal", base=0.12,
          steps=((0.20, 402.0, 9.0), (-0.02, 580.0, 50.0))),
    Model(id="steel-brushed", name="brushed stainless steel", category="metal", base=0.38,
          steps=((0.17, 520.0, 110.0),)),
    Model(id="cabinet-green", name="green lacquered steel", category="metal", base=0.06,
          steps=((0.05, 405.0, 10.0), (0.16, 745.0, 22.0)), bumps=((0.22, 522.0, 34.0),)),
    Model(id="door-white", name="white door enamel", category="painted", base=0.07,
          steps=((0.62, 406.0, 8.0), (0.09, 520.0, 45.0))),
    Model(id="plastic-black", name="black plastic", category="plastic", base=0.042,
          steps=((0.01, 640.0, 80.0),)),
    Model(id="paper-book", name="book covers, red-brown", category="paper", base=0.08,
          steps=((0.25, 600.0, 16.0), (0.15, 690.0, 30.0))),
    Model(id="poster-yellow", name="yellow poster", category="paper", base=0.07,
          steps=((0.66, 505.0, 13.0), (0.06, 620.0, 40.0))),
    Model(id="leaf", name="leaves of a house plant", category="foliage", base=0.045,
          steps=((0.42, 712.0, 10.0),), bumps=((0.085, 552.0, 24.0), (0.01, 640.0, 20.0))),
    Model(id="terracotta", name="terracotta pot", category="ceramic", base=0.09,
          steps=((0.12, 555.0, 20.0), (0.20, 600.0, 28.0), (0.07, 720.0, 40.0))),
    Model(id="diffuser", name="opal lamp diffuser", category="plastic", base=0.10,
          steps=((0.70, 400.0, 10.0),)),
    Model(id="grey-50", name="neutral grey of 50 %", category="painted", base=0.50),
)  # fmt: skip

OTHER_MODELS = (
    Model(id="timber-dark", name="dark stained timber", category="wood", base=0.035,
          steps=((0.03, 510.0, 40.0), (0.07, 600.0, 35.0), (0.20, 715.0, 38.0))),
    Model(id="paint-black", name="matt black paint", category="painted", base=0.048,
          steps=((0.006, 450.0, 40.0),)),
    Model(id="oak-dark", name="smoked oak boards", category="wood", base=0.05,
          steps=((0.07, 500.0, 40.0), (0.12, 600.0, 42.0), (0.15, 700.0, 40.0))),
    Model(id="leather-brown", name="brown leather", category="leather", base=0.04,
          steps=((0.04, 540.0, 30.0), (0.11, 610.0, 28.0), (0.22, 720.0, 32.0))),
    Model(id="rug-beige", name="beige wool rug", category="carpet", base=0.14,
          steps=((0.22, 465.0, 38.0), (0.16, 575.0, 50.0), (0.08, 700.0, 40.0))),
    Model(id="paper-white", name="white office paper", category="paper", base=0.10,
          steps=((0.74, 408.0, 7.0),), bumps=((0.04, 450.0, 18.0),)),
    Model(id="brass", name="tarnished brass", category="metal", base=0.12,
          steps=((0.14, 505.0, 25.0), (0.12, 600.0, 70.0))),
    Model(id="floor-rubber", name="grey rubber floor", category="plastic", base=0.09,
          steps=((0.10, 415.0, 15.0), (0.03, 560.0, 60.0), (0.05, 740.0, 30.0)), bumps=((-0.02, 650.0, 35.0),)),
    Model(id="wall-greige", name="greige wall paint", category="painted", base=0.07,
          steps=((0.40, 406.0, 9.0), (0.10, 540.0, 55.0))),
    Model(id="carpet-charcoal", name="charcoal carpet", category="carpet", base=0.055,
          steps=((0.015, 560.0, 50.0), (0.30, 735.0, 20.0))),
    Model(id="ceiling-tile", name="mineral ceiling tiles", category="painted", base=0.09,
          steps=((0.56, 402.0, 9.0), (0.06, 520.0, 60.0))),
    Model(id="wall-pale-blue", name="pale blue wall paint", category="painted", base=0.10,
          steps=((0.52, 403.0, 9.0), (-0.16, 560.0, 40.0), (0.08, 730.0, 30.0))),
    Model(id="board-green", name="green notice board", category="fabric", base=0.05,
          steps=((0.30, 720.0, 18.0),), bumps=((0.14, 515.0, 38.0),)),
    Model(id="carpet-green", name="green carpet", category="carpet", base=0.05,
          steps=((0.02, 410.0, 15.0), (0.34, 722.0, 18.0)), bumps=((0.17, 540.0, 36.0),)),
    Model(id="ceiling-off-white", name="off-white ceiling paint", category="painted", base=0.06,
          steps=((0.58, 405.0, 8.0), (0.10, 500.0, 45.0))),
    Model(id="wall-beige", name="beige wall paint", category="painted", base=0.07,
          steps=((0.30, 408.0, 10.0), (0.22, 520.0, 45.0), (0.05, 650.0, 40.0))),
    Model(id="wall-red", name="red wall paint", category="painted", base=0.055,
          steps=((0.50, 597.0, 10.0), (0.10, 670.0, 30.0)), bumps=((0.015, 440.0, 25.0),)),
    Model(id="velvet-blue", name="blue velvet", category="fabric", base=0.03,
          steps=((0.45, 705.0, 16.0),), bumps=((0.12, 445.0, 28.0), (0.03, 495.0, 25.0))),
    Model(id="lacquer-yellow", name="yellow lacquer", category="painted", base=0.06,
          steps=((0.60, 515.0, 12.0), (0.10, 590.0, 35.0))),
    Model(id="curtain-purple", name="purple curtain", category="fabric", base=0.05,
          steps=((0.16, 625.0, 16.0), (0.30, 690.0, 22.0)), bumps=((0.15, 435.0, 32.0),)),
    Model(id="tile-pale", name="pale porcelain tile", category="tile", base=0.20,
          steps=((0.30, 415.0, 18.0), (0.10, 550.0, 55.0))),
    Model(id="tile-white", name="white glazed tile", category="tile", base=0.12,
          steps=((0.66, 400.0, 9.0), (0.02, 520.0, 50.0))),
    Model(id="paint-brilliant", name="brilliant white paint", category="painted", base=0.05,
          steps=((0.82, 403.0, 7.0), (0.01, 500.0, 50.0))),
    Model(id="lacquer-white", name="white kitchen lacquer", category="painted", base=0.07,
          steps=((0.71, 408.0, 8.0), (0.03, 510.0, 45.0))),
    Model(id="steel-satin", name="satin steel", category="metal", base=0.42,
          steps=((0.10, 480.0, 90.0), (0.06, 700.0, 120.0))),
    Model(id="stone-black", name="black granite", category="stone", base=0.055,
          steps=((0.012, 600.0, 90.0),)),
    Model(id="enamel-orange", name="orange enamel", category="ceramic", base=0.06,
          steps=((0.12, 550.0, 12.0), (0.40, 585.0, 10.0))),
)  # fmt: skip
"""Of research/scenes/rooms, which nothing was set on before they were written."""

HELD_OUT_MODELS = (
    Model(id="ceiling-black", name="matt black ceiling paint", category="painted", base=0.047),
    Model(id="ceiling-tired", name="yellowed white ceiling paint", category="painted", base=0.07,
          steps=((0.50, 408.0, 10.0), (0.13, 480.0, 35.0))),
    Model(id="ceiling-fresh", name="fresh white ceiling paint", category="painted", base=0.07,
          steps=((0.79, 400.0, 8.0), (0.015, 500.0, 50.0))),
    Model(id="timber-stained", name="dark stained timber", category="wood", base=0.035,
          steps=((0.03, 510.0, 40.0), (0.06, 610.0, 40.0), (0.18, 735.0, 40.0))),
    Model(id="floor-stained", name="dark stained floor boards", category="wood", base=0.04,
          steps=((0.04, 530.0, 45.0), (0.05, 640.0, 45.0), (0.15, 740.0, 40.0))),
    Model(id="floor-cork", name="cork floor", category="wood", base=0.07,
          steps=((0.10, 505.0, 38.0), (0.14, 590.0, 42.0), (0.12, 700.0, 45.0))),
    Model(id="screed", name="polished cement screed", category="stone", base=0.22,
          steps=((0.07, 440.0, 40.0), (0.03, 580.0, 60.0))),
    Model(id="pine", name="varnished pine boards", category="wood", base=0.10,
          steps=((0.24, 485.0, 30.0), (0.26, 560.0, 40.0), (0.08, 680.0, 45.0))),
    Model(id="birch", name="birch plywood", category="wood", base=0.20,
          steps=((0.28, 450.0, 30.0), (0.18, 545.0, 45.0))),
    Model(id="brick", name="red brick", category="brick", base=0.06,
          steps=((0.06, 540.0, 25.0), (0.16, 592.0, 22.0), (0.07, 710.0, 45.0))),
    Model(id="granite", name="dark grey granite", category="stone", base=0.13, steps=((0.03, 480.0, 70.0),)),
    Model(id="wall-bluegrey", name="blue-grey wall paint", category="painted", base=0.10,
          steps=((0.33, 406.0, 9.0), (-0.10, 590.0, 45.0), (0.10, 740.0, 30.0))),
    Model(id="wall-ochre", name="ochre wall paint", category="painted", base=0.08,
          steps=((0.16, 470.0, 25.0), (0.35, 545.0, 22.0))),
    Model(id="wall-red", name="red wall paint", category="painted", base=0.045,
          steps=((0.42, 598.0, 10.0), (0.12, 660.0, 30.0)), bumps=((0.03, 420.0, 30.0),)),
    Model(id="carpet-green", name="green carpet", category="carpet", base=0.035,
          steps=((0.36, 722.0, 18.0),), bumps=((0.13, 528.0, 34.0),)),
    Model(id="cloth-navy", name="navy cloth", category="fabric", base=0.028,
          steps=((0.40, 725.0, 20.0),), bumps=((0.05, 450.0, 32.0),)),
    Model(id="rug-beige", name="beige wool rug", category="carpet", base=0.22,
          steps=((0.16, 480.0, 40.0), (0.10, 580.0, 45.0))),
    Model(id="leather-brown", name="brown leather", category="leather", base=0.045,
          steps=((0.05, 560.0, 30.0), (0.10, 640.0, 35.0), (0.22, 735.0, 35.0))),
    Model(id="lacquer-yellow", name="yellow lacquer", category="painted", base=0.06,
          steps=((0.62, 512.0, 14.0), (0.08, 630.0, 40.0))),
    Model(id="tile-white", name="white glazed tile", category="tile", base=0.10,
          steps=((0.68, 402.0, 8.0), (0.03, 520.0, 50.0))),
    Model(id="tile-light", name="off-white floor tile", category="tile", base=0.12,
          steps=((0.46, 410.0, 12.0), (0.10, 500.0, 40.0))),
    Model(id="brass", name="brushed brass", category="metal", base=0.28,
          steps=((0.30, 515.0, 20.0), (0.08, 620.0, 50.0))),
)  # fmt: skip
"""Of research/scenes/held_out, which nothing was set on before they were written either."""


def rows(models: tuple[Model, ...]) -> tuple[TableRow, ...]:
    """Return every model as a row of a table."""
    return tuple(
        TableRow(
            id=model.id,
            name=model.name,
            category=model.category,
            spectrum=Spectrum(wavelengths_nm=WAVELENGTHS_NM, values=model.reflectance(), name=model.name),
            properties={"provenance": "modelled"},
        )
        for model in models
    )


if __name__ == "__main__":
    for table, models in (
        (TABLE, MODELS),
        (OTHER_TABLE, MODELS + OTHER_MODELS),
        (HELD_OUT_TABLE, MODELS + HELD_OUT_MODELS),
    ):
        write_table(table, rows(models))
        print(f"{len(models)} reflectances, {WAVELENGTHS_NM[0]:g} to {WAVELENGTHS_NM[-1]:g} nm: {table}")
