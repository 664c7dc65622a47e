"""Shipped suite files, and errors for mistakes in suite files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from shapechanger.envs.catalogue import driven, env_ref, short_name
from shapechanger.envs.suite_file import load_suite, shipped_suites, suite_tasks
from shapechanger.transfer.plan import TransferTask
from tests.cli.running import Cli


def _pairs(name: str) -> list[tuple[str, str, str]]:
    tasks = suite_tasks(load_suite(name))
    return [(name, str(task.source), str(task.target)) for name, task in tasks]


def test_the_shipped_suites_have_the_studies_of_the_docs() -> None:
    counts = {name: len(_pairs(name)) for name in shipped_suites()}
    few = {"lenses": 4, "methods": 1, "pendulums": 6, "replay": 1, "shank": 9}
    assert counts == few | {"ants": 12, "vehicles": 12, "waypoints": 12}
    assert {load_suite(name).name for name in counts}.isdisjoint(counts)
    for _, task in suite_tasks(load_suite("vehicles")):
        assert task.source.kwargs == task.target.kwargs == {"put_back": True}
    lenses = dict(suite_tasks(load_suite("lenses")))
    car = driven(env_ref("Car"))
    assert lenses["Car-to-Car-night"] == TransferTask(car, driven(car, ("night",)))
    shank = dict(suite_tasks(load_suite("shank")))["Ant-to-Ant-2.5"]
    edits = [{"edit": "stretch", "body": "shank_*", "factor": 2.5}]
    assert json.loads(shank.target.kwargs["body"]) == edits


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("seeds = 3\nsed = 4\n", "line 2: No key of a suite matches 'sed'. Did you mean 'seed'?"),
        (
            "sources = ['Ant']\ntargets = [\n{env = 'Ant', bdy = 'BigAnt'}]\n",
            "line 3: No key in targets matches 'bdy'. Did you mean 'body'? There are: env, name,",
        ),
        ("\nseeds = 'many'\n", "line 2: Expected `int`, got `str`"),
        ("envs = [", "cannot be read"),
        ("name = ''\n", "line 1: Expected `str` of length >= 1"),
        ("envs = ['Ant']\nsources = ['Ant']\ntargets = ['BigAnt']\n", "in one way"),
        ("envs = ['Ant',\n'Bigant', 'Hopper']\n", "mine.toml, line 2: No env"),
        ("pairs = [['Ant', {env = 'Ant', body = 'BigAnt'}], ['Ant', 'Ant']]", "called Ant-to-Ant"),
        (
            "envs = ['Ant', 'BigAnt']\nlearner = 'ppo-run'\n[settings]\nlearning_rte = 1.0\n",
            "mine.toml, line 4: No setting of ppo-run matches 'learning_rte'. Did you mean",
        ),
        (
            "envs = ['Ant', 'BigAnt']\nlearner = 'ppo-run'\n[settings]\nlearning_rate = 'x'\n",
            "mine.toml, line 4: The settings of ppo-run are wrong: Expected `float`, got `str`",
        ),
        (
            "envs = ['Ant', 'BigAnt']\nmeasure = 'forward sped'\n",
            "mine.toml, line 2: No measure matches 'forward sped'. Did you mean 'forward speed'?",
        ),
        (
            "envs = ['Ant', 'BigAnt']\n# 'fine-tun'\narms = ['scratch', 'fine-tune', 'fine-tun']\n",
            "mine.toml, line 3: No method matches 'fine-tun'. Did you mean 'fine-tune'?",
        ),
    ],
)
def test_a_mistake_in_a_file_gives_one_sentence(
    text: str, message: str, tmp_path: Path, cli: Cli
) -> None:
    """The sentence has the line, alternatives and the nearest spelling; no study is run."""
    file = tmp_path / "mine.toml"
    file.write_text(text)
    assert message in cli.refused("suite", "run", file, "--out", tmp_path / "out")
    assert not (tmp_path / "out").exists()
    assert "Did you mean 'vehicles'?" in cli.refused("suite", "run", "vehicle")


@pytest.mark.parametrize(
    ("env_id", "name"),
    [
        ("shapechanger/BigAnt-v1", "BigAnt"),
        ("odrl/hopper-gravity-0.5", "odrl-hopper-gravity-0.5"),
        ("shapechanger/odrl-hopper-v1", "odrl-hopper"),
        ("robots/dog.xml@tricks.dogs:Sit", "dog-Sit"),
        ("dog.urdf", "dog"),
    ],
)
def test_folders_are_named_after_envs(env_id: str, name: str) -> None:
    """The folder's name has no characters that other operating systems refuse."""
    assert short_name(env_id) == name
