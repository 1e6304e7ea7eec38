"""Light at sensor points, with its standard error."""
