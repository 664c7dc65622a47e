"""Training in an env of which only one instance can exist."""

from __future__ import annotations

from typing import Any

import pytest

from shapechanger.contract.env_ref import EnvRef
from shapechanger.finger.reach import FingerReachEnv
from shapechanger.transfer.learners.evaluation import EVALUATION_SEED, Evaluation
from shapechanger.transfer.learners.sb3 import Sb3Learner
from tests.transfer.studies import TINY

FINGER = EnvRef("shapechanger/Finger-v1")


_STEPS = 100  # Steps of an episode.


def test_training_and_evaluation_alternate(monkeypatch: pytest.MonkeyPatch) -> None:
    """Training and evaluation share the env; each rollout starts an episode."""
    called: dict[int, list[int | str | None]] = {}
    reset, step = FingerReachEnv.reset, FingerReachEnv.step

    def counted_reset(
        self: FingerReachEnv, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> Any:
        called.setdefault(id(self), []).append(seed)
        return reset(self, seed=seed, options=options)

    def counted_step(self: FingerReachEnv, action: Any) -> Any:
        called[id(self)].append("step")
        return step(self, action)

    monkeypatch.setattr(FingerReachEnv, "reset", counted_reset)
    monkeypatch.setattr(FingerReachEnv, "step", counted_step)
    monkeypatch.setattr(FingerReachEnv, "side_by_side", False, raising=False)
    curve: list[Evaluation] = []
    policy = Sb3Learner("tiny", TINY).train(FINGER, 96, 0, on_evaluation=curve.append)
    assert [evaluation.steps for evaluation in curve] == [0, 32, 64, 96]
    assert policy.card.steps == 96
    (calls,) = called.values()
    # Last episodes of the evaluations; each but the last is followed by training.
    ends = [i for i, call in enumerate(calls) if call == EVALUATION_SEED + TINY.eval_episodes - 1]
    assert len(ends) == 4
    for i in ends:
        assert set(calls[i + 1 : i + 1 + _STEPS]) == {"step"}
        assert calls[i + 1 + _STEPS :][:1] in ([], [None], [0])  # Never a step after the end.
    assert calls[ends[-1] + 1 + _STEPS :] == []
