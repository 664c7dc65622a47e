"""Small studies of real envs, for tests."""

from __future__ import annotations

from typing import Any

import msgspec

from shapechanger.contract.env_ref import EnvRef
from shapechanger.transfer.learners.settings import PpoSettings
from shapechanger.transfer.plan import Plan, TransferTask
from shapechanger.transfer.study import Study, make_plan

SMALL = EnvRef("shapechanger/SmallInvertedPendulum-v1")
BIG = EnvRef("shapechanger/BigInvertedPendulum-v1")

# Two envs and updates of 32 steps: a run takes a second and learns nothing.
TINY = PpoSettings(
    n_envs=2,
    n_steps=16,
    batch_size=16,
    n_epochs=1,
    learning_rate=1e-3,
    net_arch=(8,),
    steps=96,
    eval_every=32,
    eval_episodes=2,
)
TINY_NORMALISED = msgspec.structs.replace(TINY, normalise=True)


def tiny_plan(settings: PpoSettings = TINY, **arguments: Any) -> Plan:
    task = arguments.pop("task", TransferTask(SMALL, BIG))
    return make_plan(task, "tiny", settings, **{"seeds": 2, **arguments})


def curves(study: Study) -> dict[str, list[tuple[int, float]]]:
    return {
        result.run.name: [(e.steps, e.mean_return) for e in result.curve] for result in study.runs
    }
