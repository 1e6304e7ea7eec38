"""Where the readings were taken: poses, their clock and their frame."""
