"""Tasks without bodies: rewards, ends of episodes, and paths to follow."""

from __future__ import annotations

from shapechanger.tasks.drive import DriveReward

__all__ = ["DriveReward"]
