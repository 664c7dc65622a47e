"""Runs of different versions are never mixed, and parts of other packages are found."""

from __future__ import annotations

import shutil
import sys
from importlib.metadata import EntryPoint
from pathlib import Path

import msgspec
import pytest

from shapechanger import registry
from shapechanger.errors import ForeignStudy, StudyError
from shapechanger.policy import load_policy
from shapechanger.transfer.executor import Serial
from shapechanger.transfer.learners.presets import resolve_learner
from shapechanger.transfer.plan import Run, TransferTask
from shapechanger.transfer.runs import load_result, perform_run, require_planned
from shapechanger.transfer.study import Study, make_plan, run_study
from shapechanger.transfer.suite import merge_study, open_study_folder
from tests.demos.exchange.small import snapshot
from tests.transfer.own_robot import (
    METHOD,
    TASK,
    XML,
    forget,
    plan_of,
    study_of,
    task_of,
    write_project,
)
from tests.transfer.studies import BIG, SMALL


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a project called `shared` and a finished study of it."""
    folder = tmp_path_factory.mktemp("project")
    write_project(folder, "shared")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.syspath_prepend(str(folder))
        patch.setattr("shapechanger.registry.METHODS._registered", {})
        study_of(plan_of("shared"), Path("study"))
        forget("shared")
    return folder


@pytest.fixture
def copied(done: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the folder with the finished study, as the current directory."""
    folder = tmp_path / "copy"
    shutil.copytree(done, folder)
    monkeypatch.chdir(folder)
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.setattr("shapechanger.registry.METHODS._registered", {})
    forget("shared")
    return folder


_EDITS = {
    "target's mass": ("b.xml", XML.format(0.5), r"b\.xml.*: its model has changed from \w+ to \w+"),
    "source's damping": (
        "a.xml",
        XML.format(1.5).replace('damping="5"', 'damping="6"'),
        r"a\.xml.*: its model has changed from \w+ to \w+",
    ),
    "the observed part": (
        "b.xml",
        XML.format(2.5).replace("</body>", '<site name="tip" pos="0 0 1"/></body>'),
        "the observed part of its model has changed .* its motion is the same",
    ),
    "the task": (
        "shared_task.py",
        TASK.format(name="shared").replace("abs", "2 * abs"),
        r"shared_task\.py has changed from \w+ to \w+",
    ),
    "a module that the task imports": (
        "shared_goal.py",
        "HEIGHT = 0.6\n",
        r"shared_goal\.py has changed from \w+ to \w+",
    ),
    "the method": (
        "shared_method.py",
        METHOD.format(name="shared") + "    paper = 'mine'\n",
        r"the method .*: shared_method\.py has changed from \w+ to \w+",
    ),
}


@pytest.mark.parametrize(("edit", "seeds"), [*((edit, 2) for edit in _EDITS), ("the task", 3)])
def test_a_study_with_an_edited_file_is_not_resumed(edit: str, seeds: int, copied: Path) -> None:
    """Resuming and adding seeds are refused; the message names the change, and no file changes."""
    file, content, text = _EDITS[edit]
    (copied / file).write_text(content)
    before = snapshot(copied / "study")
    plan = plan_of("shared", seeds)
    with pytest.raises(ForeignStudy, match=f"{text}.*give another --out, or delete"):
        study_of(plan, Path("study"))
    assert snapshot(copied / "study") == before


_LOOKS = {
    "a colour": ("b.xml", XML.format(2.5).replace("<geom ", '<geom rgba="1 0 0 1" ')),
    "a comment in a robot": ("b.xml", XML.format(2.5).replace("<geom ", "<!-- box --><geom ")),
    "line ends": ("shared_goal.py", "HEIGHT = 0.5\r\n"),
    "what only a script runs": (
        "shared_goal.py",
        "HEIGHT = 0.5\nif __name__ == '__main__':\n    print(HEIGHT)\n",
    ),
}


@pytest.mark.parametrize("look", _LOOKS)
def test_an_edit_without_effect_resumes(look: str, copied: Path) -> None:
    """Edits that change neither motion, sensors nor executed code do not count."""
    file, content = _LOOKS[look]
    (copied / file).write_text(content, newline="")
    before = (copied / "study" / "study.json").read_bytes()
    study_of(plan_of("shared"), Path("study"))
    assert (copied / "study" / "study.json").read_bytes() == before


def test_growing_an_unchanged_study_gives_the_same_numbers(copied: Path) -> None:
    """Two seeds and then a third equal three seeds at once, bit for bit."""
    grown = study_of(plan_of("shared", 3), Path("study"))
    at_once = study_of(plan_of("shared", 3), Path("other"))
    assert [run.curve for run in grown.runs] == [run.curve for run in at_once.runs]
    assert all(run.identity for run in grown.runs)


def test_plan_run_and_card_contain_identities(copied: Path) -> None:
    """They contain the robot's fingerprint and the hashes of the task, its goal and the method."""
    plan = plan_of("shared")
    method = f"method {plan.arms[1]}"
    assert set(plan.identity) == {"source", "target", method}
    assert set(plan.identity["target"].files) == {"shared_goal.py", "shared_task.py"}
    assert plan.identity["source"].model != plan.identity["target"].model
    run = Run(plan.arms[1], 0)
    result = load_result(plan, Path("study"), run)
    assert result is not None
    assert result.identity == plan.identity
    card = load_policy(run.policy_file(Path("study"))).card
    assert card.identity == {"env": plan.identity["target"], method: plan.identity[method]}
    scratch = load_result(plan, Path("study"), Run("scratch", 0))
    assert scratch is not None
    assert set(scratch.identity) == {"target"}


def test_a_run_whose_env_differs_from_the_plan_is_refused(copied: Path) -> None:
    """No file is written; runs that do not use the changed env are not refused."""
    plan = plan_of("shared")
    (copied / "b.xml").write_text(XML.format(0.5))
    run = Run("scratch", 0)
    before = snapshot(copied / "study")
    with pytest.raises(ForeignStudy, match=r"b\.xml.*: its model has changed from \w+ to \w+"):
        perform_run(plan, run, "study", None, lambda steps: None)
    assert snapshot(copied / "study") == before
    require_planned(plan, Run("source", 0))  # The source has not changed.
    with pytest.raises(ForeignStudy, match="An env or code of this study has changed"):
        study_of(plan, Path("new"))


def test_a_run_of_another_version_is_refused(copied: Path) -> None:
    """This can happen if the folder of a run is copied into the study."""
    plan = plan_of("shared")
    path = copied / "study" / "runs" / "scratch-0" / "run.json"
    result = msgspec.json.decode(path.read_bytes())
    result["identity"]["target"]["model"] = "0" * 16
    path.write_bytes(msgspec.json.encode(result))
    with pytest.raises(ForeignStudy, match="result of another version than the planned one"):
        load_result(plan, Path("study"), Run("scratch", 0))


def test_folders_of_two_versions_are_not_merged(copied: Path) -> None:
    (copied / "b.xml").write_text(XML.format(0.5))
    study_of(plan_of("shared", arms=("scratch", "zero-shot")), Path("other"))
    with pytest.raises(ForeignStudy, match=r"its model has changed.*Merge only folders"):
        merge_study([Path("study"), Path("other")], Path("whole"))
    assert not Path("whole").exists()


def test_a_suite_has_one_version_of_each_robot(copied: Path) -> None:
    """A study of an edited robot cannot join a suite with runs of the old robot."""
    Path("suite").mkdir()
    Path("study").rename("suite/a-to-b")
    (copied / "b.xml").write_text(XML.format(0.5))
    task = task_of("shared")
    back = msgspec.structs.replace(task, source=task.target, target=task.source)
    with pytest.raises(ForeignStudy, match=r"its model has changed.*has one version of each"):
        open_study_folder(plan_of("shared", task=back), Path("suite"), "b-to-a")


def test_a_given_policy_of_an_edited_robot_is_refused(copied: Path) -> None:
    policy = Run("source", 0).policy_file(Path("study"))
    arms = ("scratch", "zero-shot")
    plan_of("shared", source_policy=policy, source_steps=None, arms=arms)
    (copied / "a.xml").write_text(XML.format(0.1))
    with pytest.raises(ForeignStudy, match=r"a\.xml.* has changed since .* was trained in it"):
        plan_of("shared", source_policy=policy, source_steps=None, arms=arms)


_LEARNER = '''
import msgspec, numpy as np
from shapechanger.transfer.body_map import MappedEnv
from shapechanger.transfer.learners import Learner, LearnerSettings, ignore
from shapechanger.transfer.learners.evaluation import EVALUATION_SEED, evaluate

class Settings(LearnerSettings, msgspec.Struct, frozen=True, kw_only=True, tag="constant"):
    """Settings of a learner whose policy always has the same action."""
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
    """Two packages with one entry point each: a learner and a method."""
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


def test_a_study_uses_parts_of_other_packages(installed: None, tmp_path: Path) -> None:
    """The study is resumed with the plan from its folder, and no run is repeated."""
    arms = ("scratch", "zero-shot", "fine-tune", "patient")
    study = _study(tmp_path / "study", arms)
    assert [e.steps for e in study.of("patient")[0].curve] == [0, 2, 4]
    before = snapshot(tmp_path / "study")
    again = _study(tmp_path / "study", arms)
    assert (again.runs, again.plan) == (study.runs, study.plan)
    assert snapshot(tmp_path / "study") == before
    assert "a_learner.py" in study.plan.identity["learner"].files


@pytest.mark.parametrize("arm", ["kickstart", "prefilled-replay", "rehearsal", "generalist"])
def test_methods_refuse_learners_without_what_they_need(
    arm: str, installed: None, tmp_path: Path
) -> None:
    with pytest.raises(StudyError, match=f"{arm} needs .*: leave this arm out"):
        _study(tmp_path / "study", ("scratch", arm))
