"""Checks that drive a robot, watched on its twin or at its pins; faults that must stop it."""
