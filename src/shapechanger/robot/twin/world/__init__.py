"""Worlds of a twin: the plain room with its vehicles, a finger, and the choice of a place.

Courses in MuJoCo are opened by `shapechanger.vehicles.twin`.
"""
