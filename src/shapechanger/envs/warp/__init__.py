"""Many bodies at once on one device: MuJoCo's physics in Warp, tasks as functions of tensors."""

from __future__ import annotations

# First, because it names a package that is missing.
import shapechanger.envs.warp.devices  # noqa: F401  # pyright: ignore[reportUnusedImport]
from shapechanger.envs.warp.batch import WarpBatch
from shapechanger.envs.warp.env import WarpVectorEnv
from shapechanger.envs.warp.make import make_warp

__all__ = ["WarpBatch", "WarpVectorEnv", "make_warp"]
