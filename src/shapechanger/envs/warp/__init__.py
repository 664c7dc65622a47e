"""Many bodies at once on one device: MuJoCo's physics in Warp, tasks as functions of tensors."""

from __future__ import annotations

# Imported first, because its error names the package that is missing.
from shapechanger.envs.warp.devices import find_device
from shapechanger.envs.warp.env import WarpVectorEnv
from shapechanger.envs.warp.reader import make_reader

__all__ = ["WarpVectorEnv", "find_device", "make_reader"]
