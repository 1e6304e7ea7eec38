"""The light of now: states of lamps and daylight inferred from fixed sensors, the map under them, and its fit."""
