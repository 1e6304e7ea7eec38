"""The light of now: states of lamps and daylight told by fixed sensors, the map under them, and whether it fits."""
