"""Many envs stepped together by a few threads, with the numbers of Gymnasium's `SyncVectorEnv`."""

from __future__ import annotations

from shapechanger.envs.vector.env import ThreadVectorEnv
from shapechanger.envs.vector.infos import Restart
from shapechanger.envs.vector.make import make_vec

__all__ = ["Restart", "ThreadVectorEnv", "make_vec"]
