"""Vector envs that step many envs with a few threads, with the results of `SyncVectorEnv`."""

from __future__ import annotations

from shapechanger.envs.vector.env import ThreadVectorEnv

__all__ = ["ThreadVectorEnv"]
