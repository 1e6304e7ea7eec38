"""What the materials stage is asked for: the light out of the colours, and classes beside it."""
