"""Cameras: simulated images, simulated camera faults, and the view that all vehicles share."""
