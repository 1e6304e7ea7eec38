"""A scan's colours from its frames: one radiometry for all of them, and their radiance on the mesh."""
