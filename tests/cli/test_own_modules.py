"""Envs, learners and methods in a module of the current folder."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from tests.cli.running import Cli

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
    """The current folder, which an installed program does not search for modules."""
    found = [path for path in sys.path if path not in ("", str(Path.cwd()))]
    monkeypatch.setattr(sys, "path", found)
    monkeypatch.setattr("shapechanger.registry.METHODS._registered", {})
    monkeypatch.chdir(tmp_path)
    return tmp_path


SUITE = "envs = ['Ant', 'BigAnt']\narms = ['scratch', 'suite_method:reluctant']\n"


@pytest.mark.parametrize(
    ("module", "content", "arguments", "words"),
    [
        (
            "my_learner",
            LEARNER,
            ["train", "InvertedPendulum", "--learner", "my_learner:build", "--steps", "10"],
            "A budget of 10 steps is smaller than one evaluation",
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
    module: str, content: str, arguments: list[str], words: str, folder: Path, cli: Cli
) -> None:
    """As the documentation of a user's own methods and learners promises."""
    (folder / f"{module}.py").write_text(content)
    (folder / "mine.toml").write_text(SUITE)
    assert words in cli.refused(*arguments)


def test_names_of_ours_leave_the_path_alone(folder: Path, cli: Cli) -> None:
    """A module next to a policy cannot be imported by naming one of our learners."""
    cli.refused("train", "Ant", "--learner", "ppo-run", "--steps", "10")
    assert str(folder) not in sys.path
