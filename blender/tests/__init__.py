"""Tests of the extension in Blender's Python: `make test-blender`."""
