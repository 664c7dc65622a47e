"""Checks of a robot: of its computer and settings, its wires, and LEDs instead of its motors."""
