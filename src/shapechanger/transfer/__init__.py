"""Transfer of policies between bodies: maps, transplants, studies and measures.

This package exports learner-independent names only. `shapechanger.transfer.study` runs studies and
`shapechanger.transfer.transplant` moves the weights of a policy; both need the extra `learn`.
"""

from __future__ import annotations

from shapechanger.contract.env_ref import EnvRef, layouts_of
from shapechanger.transfer.body_map import BodyMap, MappedEnv
from shapechanger.transfer.plan import Plan, TransferTask

__all__ = ["BodyMap", "EnvRef", "MappedEnv", "Plan", "TransferTask", "layouts_of"]
