"""A first run file for a scan: what was found, what is guessed, and what the user must give."""
