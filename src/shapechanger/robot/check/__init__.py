"""Checks of a robot: computer and settings, wiring, and a test with LEDs instead of motors."""
