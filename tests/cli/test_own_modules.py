"""Envs, learners and methods in a module of the current folder."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.cli.running import Cli
from tests.transfer.own_robot import XML, forget, plan_of, study_of, task_of, write_project

LEARNER = "def build(envs, seed):\n    raise NotImplementedError\n"
METHOD = """
from shapechanger.errors import StudyError
from shapechanger.transfer.methods import Method, register


@register
class Reluctant(Method):
    name = "reluctant"

    def require(self, source, target, settings):
        raise StudyError("reluctant was asked.")
"""
ENV = """
import gymnasium as gym


class Bare(gym.Env):
    observation_space = gym.spaces.Box(0.0, 1.0, (1,))
    action_space = gym.spaces.Box(0.0, 1.0, (1,))


gym.register("Bare-v0", Bare)
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder; Python's path does not contain it, as for an installed program."""
    found = [path for path in sys.path if path not in ("", str(Path.cwd()))]
    monkeypatch.setattr(sys, "path", found)
    monkeypatch.setattr("shapechanger.registry.METHODS._registered", {})
    monkeypatch.chdir(tmp_path)
    return tmp_path


SUITE = "envs = ['Ant', 'BigAnt']\narms = ['scratch', 'suite_method:reluctant']\n"


@pytest.mark.parametrize(
    ("module", "content", "arguments", "message"),
    [
        (
            "my_learner",
            LEARNER,
            ["train", "InvertedPendulum", "--learner", "my_learner:build", "--steps", "10"],
            "A budget of 10 steps is too small",
        ),
        (
            "my_method",
            METHOD,
            ["transfer", "Ant", "BigAnt", "--arms", "scratch", "my_method:reluctant"],
            "reluctant was asked.",
        ),
        ("suite_method", METHOD, ["suite", "run", "mine.toml"], "reluctant was asked."),
        ("my_env", ENV, ["train", "my_env:Bare-v0"], "publishes no observation_layout"),
    ],
)
def test_a_module_of_the_current_folder_is_found(
    module: str, content: str, arguments: list[str], message: str, folder: Path, cli: Cli
) -> None:
    (folder / f"{module}.py").write_text(content)
    (folder / "mine.toml").write_text(SUITE)
    assert message in cli.refused(*arguments)


def test_names_of_shipped_learners_do_not_change_the_path(folder: Path, cli: Cli) -> None:
    cli.refused("train", "Ant", "--learner", "ppo-run", "--steps", "10")
    assert str(folder) not in sys.path


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    project = tmp_path_factory.mktemp("project")
    write_project(project, "cliown")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(project)
        patch.syspath_prepend(str(project))
        patch.setattr("shapechanger.registry.METHODS._registered", {})
        study_of(plan_of("cliown", task=task_of("cliown")), Path("suite", "a-to-b"))
        forget("cliown")
    return project


@pytest.fixture
def project(done: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder of `done`, which is not in the module path, as for an installed program."""
    monkeypatch.chdir(done)
    monkeypatch.setattr(sys, "path", [each for each in sys.path if each not in ("", str(done))])
    monkeypatch.setattr("shapechanger.registry.METHODS._registered", {})
    forget("cliown")
    return done


_POLICY = "suite/a-to-b/runs/scratch-0/policy.safetensors"


def test_a_policy_is_evaluated_in_its_robot_until_the_robot_changes(
    project: Path, cli: Cli
) -> None:
    """The task is found as in `train`; an edited robot or task is refused and named."""
    evaluate = ("policies", "evaluate", _POLICY, "--episodes", "1")
    assert "return" in cli.output(*evaluate)
    assert "cliown_task.py" in cli.output("policies", "show", _POLICY)
    for file, content, message in (
        ("b.xml", XML.format(0.5), "its model has changed from"),
        ("cliown_goal.py", "HEIGHT = 0.7\n", "cliown_goal.py has changed from"),
    ):
        was = (project / file).read_text()
        (project / file).write_text(content)
        for command in (("policies", "evaluate", _POLICY), ("play", _POLICY, "--out", "film.mp4")):
            told = " ".join(cli.refused(*command).split())
            assert message in told
            assert "or name the env, to try the policy" in told
        cli.output(*evaluate, "--env", "b.xml@cliown_task:Hold")
        (project / file).write_text(was)
    cli.output(*evaluate)


def test_a_suite_is_watched_with_own_methods(
    project: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cli: Cli
) -> None:
    """From another folder, the error suggests changing the folder, not deleting the suite."""
    assert "a-to-b" in cli.output("suite", "watch", "suite")
    monkeypatch.setattr(sys, "path", [each for each in sys.path if each != str(project)])
    monkeypatch.setattr("shapechanger.registry.METHODS._registered", {})
    forget("cliown")
    monkeypatch.chdir(tmp_path)
    told = " ".join(cli.refused("suite", "watch", project / "suite").split())
    assert "go to the folder that the study was started in" in told
    assert "delete" not in told
