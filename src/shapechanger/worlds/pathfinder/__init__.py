"""Who knows the whole course, and so always knows the way: paths round it and an expert driver."""

from __future__ import annotations

from shapechanger.worlds.pathfinder.disturbance import Disturbance
from shapechanger.worlds.pathfinder.expert import Expert
from shapechanger.worlds.pathfinder.path import Path, plan_path
from shapechanger.worlds.pathfinder.progress import Progress

__all__ = ["Disturbance", "Expert", "Path", "Progress", "plan_path"]
