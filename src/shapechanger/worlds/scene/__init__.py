"""How a course looks in MuJoCo, and what of it can be touched."""

from __future__ import annotations

from shapechanger.worlds.scene.course_scene import add_course

__all__ = ["add_course"]
