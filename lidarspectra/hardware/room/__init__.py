"""The room that the scan shows: planes, outline, furniture, free space."""
