"""The phone: scan files read, set upright, repaired."""
