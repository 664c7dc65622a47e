"""Arms that train in an adapted source."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import pytest

from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import RobotError, StudyError
from shapechanger.finger.parameters import NOMINAL
from shapechanger.finger.reach import FingerReachEnv
from shapechanger.transfer.executor import Serial
from shapechanger.transfer.learners.sb3 import Sb3Learner
from shapechanger.transfer.plan import ARMS, Run, TransferTask
from shapechanger.transfer.report.verdict import arm_rows, caveats
from shapechanger.transfer.runs import load_result, perform_run
from shapechanger.transfer.study import Study, default_arms, inspect_task, run_study
from tests.transfer.studies import BIG, SMALL, tiny_plan

FINGER = EnvRef("shapechanger/Finger-v1", {"max_episode_steps": 50})
REAL_LIKE = FINGER.having({"gap": "real-like"})
_EVERY = (*ARMS, "randomised", "identified")
FOLLOWS = EnvRef("shapechanger/FingerTrack-v1")


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> tuple[Study, Path, list[Any]]:
    """A small study of the gap between fingers, its folder, and the identified fingers."""
    moved: list[Any] = []

    # Identification has its own tests; here only the calls matter.
    def recorded(env: gym.Env[Any, Any], seconds: float, seed: int, actions: str) -> None:
        moved.append((env.get_wrapper_attr("parameters"), actions, seed))

    found = SimpleNamespace(parameters=NOMINAL.replace(tendon_friction=0.25))

    out = tmp_path_factory.mktemp("gap") / "study"
    task = TransferTask(FINGER, REAL_LIKE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("shapechanger.finger.identify.record_babble", recorded)
        patch.setattr("shapechanger.finger.identify.identify", lambda log: found)
        plan = tiny_plan(task=task, arms=_EVERY, source_steps=64)
        return run_study(plan, out, executor=Serial()), out, moved


def test_every_arm_is_evaluated(study: tuple[Study, Path, list[Any]]) -> None:
    """Policies of adapted sources are evaluated on the target without training."""
    made, _, _ = study
    assert set(made.summaries) == {"zero-shot", "fine-tune", "randomised", "identified"}
    for kind in ("randomised", "identified"):
        assert [[e.steps for e in result.curve] for result in made.of(kind)] == [[0], [0]]
        assert made.summaries[kind].in_target_steps.jumpstart.value is not None


def test_each_seed_has_another_target(study: tuple[Study, Path, list[Any]]) -> None:
    made, _, moved = study
    assert made.plan.individual == "finger_seed"
    fingers = [made.plan.target_of(Run("zero-shot", i)).kwargs["finger_seed"] for i in range(2)]
    assert fingers == [0, 1]
    assert moved[0][0] != moved[1][0]
    for index, (parameters, _, seed) in enumerate(moved):
        one = gym.make(FINGER.id, gap="real-like", finger_seed=index)
        assert parameters == one.get_wrapper_attr("parameters")
        assert seed == made.plan.seed_of(Run("identified", index))
        one.close()


def test_adapted_sources_are_saved(study: tuple[Study, Path, list[Any]]) -> None:
    """The adapted envs are in the folders of the runs, with their policies."""
    made, out, _ = study
    sources = {
        kind: json.loads((Run(kind, 0).folder(out) / "source.json").read_text())
        for kind in ("randomised", "identified")
    }
    assert sources["randomised"] == {
        "id": FINGER.id,
        "kwargs": {"max_episode_steps": 50, "gap": "wide", "reward": {"change": 5.0}},
    }
    assert sources["identified"]["kwargs"]["parameters"]["tendon_friction"] == 0.25
    assert all(Run(kind, 1).policy_file(out).exists() for kind in sources)
    assert made.plan.task.source == FINGER


def test_success_is_reported(study: tuple[Study, Path, list[Any]]) -> None:
    """Every arm reports success, and so does the source policy in the source."""
    made, _, _ = study
    successes = {row.kind: row.success for row in arm_rows(made)}
    assert set(successes) == {"source", "random", "zero-action", *_EVERY}
    assert successes["randomised"].startswith("0 % [0 %, 0 %]")
    assert made.plan.measure == "success"
    assert any("whose finger_seed is the index of the seed" in text for text in caveats(made))


def test_a_failed_evaluation_costs_no_training(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The policy is saved before it is evaluated, and the repeated run evaluates it."""
    plan = tiny_plan(
        task=TransferTask(FINGER, REAL_LIKE), arms=("scratch", "randomised"), source_steps=64
    )
    run = Run("randomised", 0)
    trained: list[Any] = []
    evaluate, train = Sb3Learner.evaluate, Sb3Learner.train

    def fails(*_: Any) -> Any:
        raise RobotError("The rig has stopped.")

    def counted(self: Sb3Learner, *arguments: Any, **more: Any) -> Any:
        trained.append(arguments[0])
        return train(self, *arguments, **more)

    monkeypatch.setattr(Sb3Learner, "train", counted)
    monkeypatch.setattr(Sb3Learner, "evaluate", fails)
    with pytest.raises(RobotError, match="has stopped"):
        perform_run(plan, run, str(tmp_path), None, lambda _: None)
    saved = run.policy_file(tmp_path).read_bytes()
    assert load_result(plan, tmp_path, run) is None
    monkeypatch.setattr(Sb3Learner, "evaluate", evaluate)
    perform_run(plan, run, str(tmp_path), None, lambda _: None)
    assert len(trained) == 1
    assert run.policy_file(tmp_path).read_bytes() == saved
    result = load_result(plan, tmp_path, run)
    assert result is not None
    assert [evaluation.steps for evaluation in result.curve] == [0]


def test_default_arms() -> None:
    """A target that adapts the source gets all arms, other pairs the three basic ones."""
    assert default_arms(inspect_task(TransferTask(FINGER, REAL_LIKE))) == _EVERY
    assert default_arms(inspect_task(TransferTask(FINGER, FOLLOWS))) == ARMS
    assert default_arms(inspect_task(TransferTask(SMALL, BIG))) == ARMS


def test_a_target_that_cannot_adapt_its_source_is_refused() -> None:
    with pytest.raises(StudyError, match=r"identified needs a target that can adapt"):
        tiny_plan(arms=("scratch", "identified"))


def test_an_exclusive_env_is_used_by_one_run_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    task = TransferTask(FINGER, REAL_LIKE)
    assert not tiny_plan(task=task).exclusive
    monkeypatch.setattr(FingerReachEnv, "exclusive", True, raising=False)
    assert tiny_plan(task=task).exclusive
