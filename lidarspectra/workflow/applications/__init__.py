"""What a finished run is used for: localization, solar cells, a year of daylight, readings."""
