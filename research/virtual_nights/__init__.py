"""Virtual nights: fixed sensors in an office, people at places, and all that differs from one night to the next."""
