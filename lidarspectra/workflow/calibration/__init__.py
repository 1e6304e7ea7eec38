"""What a run does not know of its room's light, and readings that tell it."""
