"""Devices that are not there: a phone, a robot and a serial module, for plans and tests."""
