"""Teleoperation: robots driven with the keys of a terminal."""
