"""The Blender extension: place lamps and sensors, start runs, see and dim their light; not in the wheel."""
