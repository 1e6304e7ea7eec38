"""Pictures of a room as it will look: luminance and colour at every pixel, and the glare in it."""
