"""A room as Radiance reads it."""
