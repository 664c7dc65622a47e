"""A learner and a method of another package are one file each, found by entry points."""

from __future__ import annotations

import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

from shapechanger import registry
from shapechanger.errors import StudyError
from shapechanger.transfer.executor import Serial
from shapechanger.transfer.learners.presets import resolve_learner
from shapechanger.transfer.plan import TransferTask
from shapechanger.transfer.study import Study, make_plan, run_study
from tests.transfer.studies import BIG, SMALL, files_of

_LEARNER = '''
import msgspec, numpy as np
from shapechanger.transfer.body_map import MappedEnv
from shapechanger.transfer.learners import Learner, LearnerSettings, ignore
from shapechanger.transfer.learners.evaluation import EVALUATION_SEED, evaluate

class Settings(LearnerSettings, msgspec.Struct, frozen=True, kw_only=True, tag="constant"):
    """Settings of a learner that always pushes the same."""
    push: float = 0.0
    steps: int = 4
    source_steps: int = 2
    eval_every: int = 2
    eval_episodes: int = 1

    takes = frozenset()
    learner = f"{__name__}:Constant"
    last_k = 1
    episode_limit = 20

    def whole_updates(self, steps):
        return steps

class Policy(msgspec.Struct):
    push: float

    def act(self, observations):
        return np.full((len(observations), 1), self.push, np.float32)

    def save(self, path):
        path.write_bytes(msgspec.json.encode(self))

class Constant(Learner):
    def require(self, env, traits):
        pass

    def train(self, env, steps, seed, *, start=None, body_map=None, on_evaluation=ignore,
              on_steps=lambda steps: None):
        policy = start or Policy(self.settings.push)
        for done in range(0, steps + 1, self.settings.eval_every):
            envs = self.evaluation_envs(env)
            on_evaluation(evaluate(policy.act, envs, EVALUATION_SEED, done))
        on_steps(steps)
        return policy

    def evaluate(self, env, policy, body_map):
        envs = [MappedEnv(one, body_map) for one in self.evaluation_envs(env)]
        return evaluate(policy.act, envs, EVALUATION_SEED)

    def load(self, path):
        return msgspec.json.decode(path.read_bytes(), type=Policy)
'''
_METHOD = '''
from shapechanger.transfer.methods import Method

class Patient(Method):
    """Learn the target from the start, as scratch does."""
    name = "patient"
    uses_source_policy = False
    uses_source = False

    def learn(self, run):
        return run.train(run.target, run.steps, on_evaluation=run.report)
'''


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two packages of others with an entry point each."""
    (tmp_path / "a_learner.py").write_text(_LEARNER)
    (tmp_path / "a_method.py").write_text(_METHOD)
    monkeypatch.syspath_prepend(tmp_path)
    points = (
        EntryPoint("constant", "a_learner:Settings", "shapechanger.learners"),
        EntryPoint("patient", "a_method:Patient", "shapechanger.methods"),
    )
    for point in points:
        monkeypatch.delitem(sys.modules, point.module, raising=False)

    def found(group: str, name: str = "") -> list[EntryPoint]:
        return [each for each in points if each.group == group and name in ("", each.name)]

    monkeypatch.setattr(registry, "entry_points", found)


def _study(out: Path, arms: tuple[str, ...]) -> Study:
    learner, settings = resolve_learner("constant", {"push": 0.5})
    plan = make_plan(TransferTask(SMALL, BIG), learner, settings, seeds=2, arms=arms)
    return run_study(plan, out, executor=Serial())


def test_a_study_runs_with_a_learner_and_a_method_of_others(
    installed: None, tmp_path: Path
) -> None:
    """The plan is read back, so that it can be resumed, and nothing runs twice."""
    arms = ("scratch", "zero-shot", "fine-tune", "patient")
    study = _study(tmp_path / "study", arms)
    assert [e.steps for e in study.of("patient")[0].curve] == [0, 2, 4]
    before = files_of(tmp_path / "study")
    again = _study(tmp_path / "study", arms)
    assert (again.runs, again.plan) == (study.runs, study.plan)
    assert files_of(tmp_path / "study") == before
    assert "a_learner.py" in study.plan.identity["learner"].files


@pytest.mark.parametrize("arm", ["kickstart", "prefilled-replay", "rehearsal", "generalist"])
def test_methods_refuse_learners_without_what_they_need(
    arm: str, installed: None, tmp_path: Path
) -> None:
    with pytest.raises(StudyError, match=f"{arm} needs .*: leave this arm out"):
        _study(tmp_path / "study", ("scratch", arm))
