"""Worlds of a twin: the plain room with its vehicles, a finger, and the choice of a place.

Courses in MuJoCo come from `shapechanger.worlds`.
"""
