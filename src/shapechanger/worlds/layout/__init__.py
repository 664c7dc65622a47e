"""Courses laid out by a seed: corridors, yards and harbours, without pictures or physics."""

from __future__ import annotations

from typing import Final

from shapechanger.worlds.layout.courses import WORLDS, lay_out, occupancy, start_pose

__all__: Final[list[str]] = ["WORLDS", "lay_out", "occupancy", "start_pose"]
