"""Checks that drive a robot, on its twin or on its pins, and the faults of which it must stop."""
