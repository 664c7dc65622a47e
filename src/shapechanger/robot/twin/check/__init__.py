"""Checks that drive a robot, on its twin or on its pins, and faults after which it must stop."""
