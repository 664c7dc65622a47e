"""Worlds of a twin: the plain room with its vehicles, and the choice of a place.

Products open others: `shapechanger.vehicles.twin` and `shapechanger.finger.twin`.
"""
