"""The robot: poses, their clock, and their frame of reference."""
