"""Cameras: images of the simulation, faults of cameras, and one view for all cameras."""
