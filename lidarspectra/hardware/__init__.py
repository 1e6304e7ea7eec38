"""The devices at both ends: the phone that scans the room, the sensor that reads its light."""
