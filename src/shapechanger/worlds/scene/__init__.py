"""Courses in MuJoCo: visual meshes with precomputed light, and collision geoms."""

from __future__ import annotations

from shapechanger.worlds.scene.course_scene import add_course

__all__ = ["add_course"]
