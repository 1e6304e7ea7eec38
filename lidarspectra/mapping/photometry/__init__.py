"""Light for people and plants: photometric, melanopic and photosynthetic quantities at points."""

from lidarspectra.mapping.maps.visible_bands import covers_vision
from lidarspectra.mapping.photometry.illuminance import illuminance, illuminance_from_map
from lidarspectra.mapping.photometry.point_light import PointLight, light_of_lamps, light_of_map

__all__ = ["PointLight", "covers_vision", "illuminance", "illuminance_from_map", "light_of_lamps", "light_of_map"]
