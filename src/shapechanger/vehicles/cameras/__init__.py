"""Cameras: images of the simulation, corruptions of them, and one view for all cameras."""
