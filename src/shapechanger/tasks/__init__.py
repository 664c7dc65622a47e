"""Tasks without bodies: rewards, measures, ends of episodes, and paths to follow."""

from __future__ import annotations

from shapechanger.tasks.drive import DriveReward
from shapechanger.tasks.measure import Measure

__all__ = ["DriveReward", "Measure"]
