"""The mesh of a scan, and rays in it."""
