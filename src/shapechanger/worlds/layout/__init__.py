"""Layout of courses from a seed: corridors, yards and harbours."""

from __future__ import annotations

from shapechanger.worlds.layout.courses import WORLDS, lay_out, start_pose

__all__ = ["WORLDS", "lay_out", "start_pose"]
