"""Readings of fixed sensors as they come: from serial ports, logs that grow, and an MQTT broker."""
