"""Rooms rendered by the thousand on a graphics processor, with the class of every pixel, to learn from (PyTorch)."""
