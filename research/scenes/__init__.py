"""Scripts that make the scenes."""
