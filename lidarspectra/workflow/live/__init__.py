"""A run kept live: its fixed sensors' readings to the light of now, and a page that shows it."""
