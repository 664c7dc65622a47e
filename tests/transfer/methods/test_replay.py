"""Methods for learners with a replay buffer."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from shapechanger.contract.env_ref import EnvRef, layouts_of
from shapechanger.errors import StudyError
from shapechanger.transfer.body_map import BodyMap
from shapechanger.transfer.executor import Serial
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.learners.presets import resolve_learner
from shapechanger.transfer.learners.sb3 import Sb3Learner
from shapechanger.transfer.learners.settings import OffPolicySettings
from shapechanger.transfer.methods.training import (
    DomainClassifiers,
    Transitions,
    _mapped,  # pyright: ignore[reportPrivateUsage]
    collect,
)
from shapechanger.transfer.plan import TransferTask
from shapechanger.transfer.study import run_study
from tests.transfer.studies import SMALL, tiny_plan
from tests.transfer.test_learners import SHORT


def short(**more: Any) -> OffPolicySettings:
    """Return settings of SAC for trainings of a second."""
    _, settings = resolve_learner("sac", {**SHORT, **more})
    assert isinstance(settings, OffPolicySettings)
    return settings


def test_a_study_with_both(tmp_path: Path) -> None:
    """Both methods are evaluated at the steps of scratch, also with two envs."""
    plan = tiny_plan(
        short(n_envs=2),
        steps=64,
        source_steps=160,
        arms=("scratch", "prefilled-replay", "off-dynamics"),
    )
    study = run_study(plan, tmp_path, executor=Serial())
    wanted = study.curves("scratch").steps.tolist()
    for arm in ("prefilled-replay", "off-dynamics"):
        assert study.curves(arm).steps.tolist() == wanted == [0.0, 32.0, 64.0]


def test_corrections_reward_target_like_steps() -> None:
    torch.manual_seed(0)
    classifiers = DomainClassifiers(1, 1, learning_rate=3e-3)

    def batch(goes: float) -> tuple[torch.Tensor, ...]:
        seen, acted = torch.randn(256, 1), torch.randn(256, 1)
        return seen, acted, seen + goes * torch.sign(acted)

    for _ in range(300):
        classifiers.fit(batch(1.0), batch(-1.0))
    of_source = classifiers.correction(*batch(1.0))
    of_target = classifiers.correction(*batch(-1.0))
    assert of_source.mean() < -1.0
    assert of_target.mean() > 1.0
    same = DomainClassifiers(1, 1, learning_rate=3e-3)
    for _ in range(300):
        same.fit(batch(1.0), batch(1.0))
    assert same.correction(*batch(1.0)).abs().mean() < 0.3


def test_transitions_are_those_of_the_env() -> None:
    """Each transition starts where the last one ended, unless the episode ended."""
    policy = Sb3Learner("sac", short()).train(SMALL, 32, 0, on_evaluation=_ignore)
    seen = collect(SMALL, policy, 50, 3)
    assert seen.observations.shape == seen.next_observations.shape == (50, 4)
    goes_on = ~seen.terminated[:-1]
    np.testing.assert_array_equal(
        seen.next_observations[:-1][goes_on], seen.observations[1:][goes_on]
    )
    assert seen.terminated.any()
    again = collect(SMALL, policy, 50, 3)
    np.testing.assert_array_equal(again.actions, seen.actions)


def test_mapped_transitions_are_those_of_the_target() -> None:
    bodies = [EnvRef(f"shapechanger/{name}-v1").make() for name in ("Ant", "ExtendedAnt")]
    (seen, acts), (sees, does) = (layouts_of(body) for body in bodies)
    for body in bodies:
        body.close()
    body_map = BodyMap.between(seen, sees, acts, does)
    rng = np.random.default_rng(0)
    ours = Transitions(
        rng.normal(size=(3, seen.size)),
        rng.uniform(-1.0, 1.0, size=(3, acts.size)).astype(np.float32),
        np.zeros(3),
        rng.normal(size=(3, seen.size)),
        np.zeros(3, bool),
    )
    theirs = _mapped(ours, body_map)
    assert theirs.observations.shape == (3, sees.size)
    assert theirs.actions.shape == (3, does.size)
    for name in set(seen.names) & set(sees.names):
        np.testing.assert_array_equal(
            theirs.observations[:, sees.slices[name]], ours.observations[:, seen.slices[name]]
        )


def test_off_dynamics_needs_equal_spaces_and_plain_observations() -> None:
    ants = TransferTask(EnvRef("shapechanger/Ant-v1"), EnvRef("shapechanger/ExtendedAnt-v1"))
    with pytest.raises(StudyError, match="the same spaces"):
        tiny_plan(short(), task=ants, arms=("scratch", "off-dynamics"))
    with pytest.raises(StudyError, match="normalise=false"):
        tiny_plan(short(normalise=True), arms=("scratch", "off-dynamics"))


def _ignore(evaluation: Evaluation) -> None:
    del evaluation
