"""Changed lamps in a finished run: its light, its pictures, before and after."""
