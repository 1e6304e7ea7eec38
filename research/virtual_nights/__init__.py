"""Virtual nights: fixed sensors in an office, people at places, and what differs from night to night."""
