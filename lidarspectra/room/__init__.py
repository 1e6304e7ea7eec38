"""Floor, walls and ceiling of a scan, the free space between them, and sensor points in it."""
