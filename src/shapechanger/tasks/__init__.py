"""Rewards and endings as functions of named quantities."""

from __future__ import annotations

from shapechanger.tasks.drive import DriveReward

__all__ = ["DriveReward"]
