"""Gymnasium envs of the simulated finger: reach a point, or follow a path."""

from __future__ import annotations

from shapechanger.errors import MissingExtra

try:
    from shapechanger.envs.finger.reach import FingerReachEnv
    from shapechanger.envs.finger.track import FingerTrackEnv
except ModuleNotFoundError as error:
    raise MissingExtra(error.name or "mujoco", "sim") from error

__all__ = ["FingerReachEnv", "FingerTrackEnv"]
