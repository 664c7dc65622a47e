"""The commands refuse to mix versions of a user's files, and find the user's modules."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.cli.running import Cli
from tests.transfer.own_robot import XML, forget, plan_of, study_of, task_of, write_project


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a project called `cliown` and a suite with one finished study of it."""
    folder = tmp_path_factory.mktemp("project")
    write_project(folder, "cliown")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.syspath_prepend(str(folder))
        patch.setattr("shapechanger.registry.METHODS._registered", {})
        study_of(plan_of("cliown", task=task_of("cliown")), Path("suite", "a-to-b"))
        forget("cliown")
    return folder


@pytest.fixture
def folder(done: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """That folder, as an installed program sees it: modules are not looked for there."""
    monkeypatch.chdir(done)
    monkeypatch.setattr(sys, "path", [each for each in sys.path if each not in ("", str(done))])
    monkeypatch.setattr("shapechanger.registry.METHODS._registered", {})
    forget("cliown")
    return done


_POLICY = "suite/a-to-b/runs/scratch-0/policy.safetensors"


def test_a_policy_is_evaluated_in_its_own_robot_until_that_changes(folder: Path, cli: Cli) -> None:
    """The task is found as `train` finds it; an edited robot or task is refused and named."""
    evaluate = ("policies", "evaluate", _POLICY, "--episodes", "1")
    assert "return" in cli.output(*evaluate)
    assert "cliown_task.py" in cli.output("policies", "show", _POLICY)
    for file, content, words in (
        ("b.xml", XML.format(0.5), "its model has changed from"),
        ("cliown_goal.py", "HEIGHT = 0.7\n", "cliown_goal.py has changed from"),
    ):
        was = (folder / file).read_text()
        (folder / file).write_text(content)
        for command, *more in (("evaluate",), ("play", "--out", "film.mp4")):
            told = " ".join(cli.refused("policies", command, _POLICY, *more).split())
            assert words in told
            assert "give --env to try the policy" in told
        cli.output(*evaluate, "--env", "b.xml@cliown_task:Hold")
        (folder / file).write_text(was)
    cli.output(*evaluate)


def test_a_suite_is_watched_with_own_methods(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cli: Cli
) -> None:
    """From elsewhere the message says where to go, and to delete nothing."""
    assert "a-to-b" in cli.output("suite", "watch", "suite")
    monkeypatch.setattr(sys, "path", [each for each in sys.path if each != str(folder)])
    monkeypatch.setattr("shapechanger.registry.METHODS._registered", {})
    forget("cliown")
    monkeypatch.chdir(tmp_path)
    told = " ".join(cli.refused("suite", "watch", folder / "suite").split())
    assert "go to the folder that the study was started in" in told
    assert "delete" not in told
