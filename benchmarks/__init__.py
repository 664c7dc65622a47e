"""Measurements of every number that Shapechanger promises."""
