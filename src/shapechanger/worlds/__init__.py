"""Worlds: courses laid out from a seed, their look, and vehicles that drive on them.

`course` and `layout` describe and lay out courses, `scene`, `paint` and `look` draw them, `lens`
degrades pictures, `expert` drives, and `simulation` puts a vehicle on a course.
"""
