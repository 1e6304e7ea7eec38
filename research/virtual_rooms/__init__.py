"""Rooms made of plans, and a virtual phone that scans them."""
