"""Which numbers of a run file a room can have; outside of these they are typing errors, or in another unit."""

from lidarspectra.workflow.checks.findings import Plausible

_LUMENS = "The lumens stand on the lamp or its package: a bulb has about 800, a ceiling panel 2,000 to 6,000."
_METRES = "Lengths are in metres: 0.6 for 60 cm."

LUMINOUS_FLUX = Plausible(
    quantity="the luminous flux of one lamp",
    unit="lm",
    usual=(10.0, 30_000.0),  # an indicator lamp, a high-bay light of an industrial hall
    possible=(0.01, 300_000.0),  # the strongest floodlights of stadiums
    remedy=_LUMENS,
)
RADIANT_FLUX = Plausible(
    quantity="the radiant flux of one lamp",
    unit="W",
    usual=(0.01, 150.0),  # of light, not of electric power
    possible=(1e-5, 2_000.0),
    remedy="It is the power of the light, in watts: about a third of an LED lamp's electric power.",
)
LAMP_SIZE = Plausible(
    quantity="a side or the diameter of a lamp", unit="m", usual=(0.005, 12.0), possible=(0.001, 40.0), remedy=_METRES
)
WINDOW_SIZE = Plausible(
    quantity="a side of a window", unit="m", usual=(0.1, 12.0), possible=(0.01, 60.0), remedy=_METRES
)
EXITANCE = Plausible(
    quantity="the luminous exitance of lamps",
    unit="lm/m²",
    usual=(500.0, 100_000.0),  # a luminous ceiling, a downlight
    possible=(10.0, 10_000_000.0),  # a bare filament
    remedy="A common ceiling panel of 0.6 m x 0.6 m and 3600 lm has 10,000 lm/m².",
)
GRID_HEIGHT = Plausible(
    quantity="the height of the sensor grid above the floor",
    unit="m",
    usual=(0.0, 3.0),
    possible=(0.0, 30.0),
    remedy="Give the height above the floor in metres: 0.75 for a desk, 0 for the floor.",
)
GRID_SPACING = Plausible(
    quantity="the distance between sensor points", unit="m", usual=(0.05, 5.0), possible=(0.005, 100.0), remedy=_METRES
)
GRID_MARGIN = Plausible(
    quantity="the margin of the sensor grid", unit="m", usual=(0.0, 1.0), possible=(0.0, 20.0), remedy=_METRES
)
GRID_POINTS = Plausible(
    quantity="the number of sensor points",
    unit="points",
    usual=(1.0, 20_000.0),
    possible=(0.0, 1_000_000.0),  # as `count` allows
    remedy="The time goes up with the number of points: a spacing of 0.2 m shows all that light does in a room.",
)
HOLE = Plausible(
    quantity="the longest hole that is closed", unit="m", usual=(0.0, 5.0), possible=(0.0, 100.0), remedy=_METRES
)
CELL_AREA = Plausible(
    quantity="the area of a solar cell",
    unit="cm²",
    usual=(0.1, 10_000.0),
    possible=(1e-4, 1_000_000.0),
    remedy="It is in cm²: 10 for a cell of 2 cm x 5 cm.",
)
CELL_VOLTAGE = Plausible(
    quantity="the voltage of a solar cell",
    unit="V",
    usual=(0.1, 60.0),
    possible=(0.001, 1_500.0),
    remedy="It is the voltage at which a converter holds the cell: 0.3 to 0.6 for a single cell of silicon.",
)
CELL_SCALE = Plausible(
    quantity="the factor on a cell's curve",
    unit="",
    usual=(0.05, 20.0),
    possible=(1e-6, 1e6),
    remedy="It comes from a calibration; leave it out if there was none.",
)
LIGHT_OUTPUT_RATIO = (0.2, 1.2)  # [1] a luminaire's light over that of its lamps; 1 at most, but for rounded lumens
