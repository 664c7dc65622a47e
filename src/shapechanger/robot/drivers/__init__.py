"""Drivers of outputs and sensors, one module per chip."""
