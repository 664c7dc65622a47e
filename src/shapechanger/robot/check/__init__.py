"""Checks of a robot: of its computer and settings, its wires, and LEDs in place of its motors."""
