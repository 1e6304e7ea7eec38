"""What a body in the room does to the light."""
