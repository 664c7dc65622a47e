"""`shapechanger policies`: show, convert, evaluate and export; and `play` with clones."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from sb3_contrib import TQC
from stable_baselines3 import A2C, PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from torch import nn

from shapechanger.cli import main
from shapechanger.finger.task import POLICIES
from shapechanger.policy import load_policy
from shapechanger.transfer.learners.settings import OffPolicySettings
from shapechanger.vehicles.envs.demonstrators import CLONES
from tests.cli.running import Cli


def _zip(path: Path, env: str = "shapechanger/InvertedPendulum-v1", **arguments: object) -> PPO:
    model = PPO("MlpPolicy", gym.make(env), n_steps=32, batch_size=32, seed=3, **arguments)
    model.save(path)
    return model


def _convert(folder: Path, env: str = "InvertedPendulum") -> tuple[object, ...]:
    return "policies", "convert", folder / "mine.zip", env


def test_policies_are_shown_and_listed(cli: Cli) -> None:
    output = cli.output("policies", "show", POLICIES["reach"])
    for part in ("shapechanger/Finger-v1", "307,200", "PIP_flexion"):
        assert part in output
    output = cli.output("policies", "show", CLONES["car"])
    for part in ("steering, throttle", "shapechanger train Car"):
        assert part in output
    lines = cli.output("policies", "show", CLONES["car"].parent).splitlines()
    assert sum("cloning" in line for line in lines) == len(CLONES)


@pytest.mark.parametrize("kind", [PPO, SAC, TQC])
def test_a_zip_of_stable_baselines3_is_converted(
    kind: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cli: Cli
) -> None:
    """The converted file gives the same actions, cannot run code, and names its command."""
    env = gym.make("shapechanger/InvertedPendulum-v1")
    networks = {"net_arch": [8, 8] if kind is PPO else {"pi": [8, 8], "qf": [8, 8]}}
    few = {"train_freq": 4, "buffer_size": 100}
    if kind is PPO:
        few = {"n_steps": 32, "batch_size": 32}
    model = kind("MlpPolicy", env, seed=3, policy_kwargs=networks, **few)
    model.save(tmp_path / "mine.zip")
    out = tmp_path / "mine.safetensors"
    monkeypatch.setattr("sys.argv", ["shapechanger", "policies", "convert", "mine.zip"])
    cli.output(*_convert(tmp_path), "--out", out, "--trust")
    policy = load_policy(out)
    seen = np.random.default_rng(0).normal(size=(20, 4))
    np.testing.assert_array_equal(policy.act(seen), model.predict(seen, deterministic=True)[0])
    assert policy.card.env.id == "shapechanger/InvertedPendulum-v1"
    assert policy.card.settings.net_arch == (8, 8)
    shown = cli.output("policies", "show", out)
    assert "command      shapechanger policies convert mine.zip\n" in shown
    if kind is not PPO:
        assert policy.card.settings == OffPolicySettings(
            algorithm=kind.__name__,
            net_arch=(8, 8),
            buffer_size=100,
            learning_starts=100,
            train_freq=4,
            gradient_steps=1,
            steps=4,
            eval_every=4,
        )
        for name, weight in model.policy.state_dict().items():
            assert torch.equal(policy.model.policy.state_dict()[name], weight)


@pytest.mark.parametrize(
    ("kind", "arguments", "words"),
    [
        (SAC, {"train_freq": (1, "episode")}, "it must update after steps"),
        (SAC, {"policy_kwargs": {"n_critics": 3}}, "These policy_kwargs change the networks"),
        (SAC, {"policy_kwargs": {"activation_fn": nn.Tanh}}, "layers must be the same, with ReLU"),
        (A2C, {}, "is of another algorithm or policy class"),
        (PPO, {"policy_kwargs": {"net_arch": {"pi": [8], "vf": [9]}}}, "layers must be the same"),
    ],
)
def test_zips_that_do_not_fit_are_refused(
    kind: type[BaseAlgorithm], arguments: dict[str, object], words: str, tmp_path: Path, cli: Cli
) -> None:
    make: Any = kind
    make("MlpPolicy", gym.make("InvertedPendulum-v5"), **arguments).save(tmp_path / "mine.zip")
    out = tmp_path / "mine.safetensors"
    assert words in cli.refused(*_convert(tmp_path), "--out", out, "--trust")
    assert not out.exists()


def test_a_zip_needs_trust_and_an_env_that_fits(tmp_path: Path, cli: Cli) -> None:
    out = ("--out", tmp_path / "mine.safetensors")
    assert "There is no policy file" in cli.refused(*_convert(tmp_path), *out, "--trust")
    _zip(tmp_path / "mine.zip")
    assert "give --trust if you trust its author" in cli.refused(*_convert(tmp_path), *out)
    answer = cli.refused(*_convert(tmp_path, "Ant"), *out, "--trust")
    assert "observation of the policy" in answer
    assert [path.name for path in tmp_path.iterdir()] == ["mine.zip"]


@pytest.fixture
def trained(tmp_path: Path, cli: Cli) -> Path:
    _zip(tmp_path / "mine.zip", policy_kwargs={"net_arch": [8]})
    out = tmp_path / "policies" / "mine.safetensors"
    out.parent.mkdir()
    cli.output(*_convert(tmp_path), "--out", out, "--trust")
    return out


def test_a_folder_is_listed(trained: Path, cli: Cli) -> None:
    (trained.parent / "other.safetensors").write_text("no")
    output = cli.output("policies", "show", trained.parent)
    for part in ("mine.safetensors", "shapechanger/InvertedPendulum-v1", "is not a policy"):
        assert part in output
    (trained.parent / "empty").mkdir()
    answer = cli.refused("policies", "show", trained.parent / "empty")
    assert "There is no policy in" in answer


@pytest.mark.gl
def test_clones_are_evaluated_and_played(tmp_path: Path, cli: Cli) -> None:
    """A clone also acts in another vehicle, but not in a body with other actions."""
    film = ("--max-steps", 3, "--out", tmp_path / "film.mp4")
    for shown in ([CLONES["car"]], ["Tank", "--policy", CLONES["car"]]):
        assert "in 3 steps" in cli.output("play", *shown, *film)
    both = cli.refused("play", CLONES["car"], "--policy", CLONES["car"])
    assert "give an env with --policy, or only the file" in both
    answer = cli.refused("policies", "evaluate", CLONES["car"], "--env", "Ant")
    assert "The actions of the policy are steering, throttle" in answer


def test_an_exported_policy_evaluates_the_same(trained: Path, cli: Cli) -> None:
    exported = trained.with_suffix(".onnx")
    cli.output("policies", "export", trained, "--out", exported)
    short = ("--episodes", 2)
    for env in ([], ["--env", "BigInvertedPendulum"]):
        both = (trained, exported)
        one, other = (cli.output("policies", "evaluate", file, *short, *env) for file in both)
        assert one == other
        assert one.startswith("return ")
        assert "steps" in one
    mapped = cli.output("policies", "evaluate", trained, "--env", "InvertedDoublePendulum")
    assert mapped.startswith("Constant, because the other body has no counterpart: hinge/angle.")
    answer = cli.refused("policies", "evaluate", exported, "--episodes", 0)
    assert "--episodes must be at least 1" in answer


OWN = """
from stable_baselines3 import A2C

def build(envs, seed):
    return A2C("MlpPolicy", envs, seed=seed, device="cpu", n_steps=64)
"""


def test_a_policy_of_a_users_learner_is_evaluated_if_the_learner_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cli: Cli
) -> None:
    (tmp_path / "own_a2c.py").write_text(OWN)
    monkeypatch.delitem(sys.modules, "own_a2c", raising=False)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    small = ["steps_per_update=64", "eval_every=64", "eval_episodes=1"]
    own = ["--learner", "own_a2c:build"]
    train = ["train", "InvertedPendulum", *own, "--steps", "64", "--set", *small]
    cli.output(*train, "--out", "own.safetensors")
    monkeypatch.delitem(sys.modules, "own_a2c")
    evaluate = ["policies", "evaluate", "own.safetensors", "--episodes", "1"]
    assert cli.refused(*evaluate).endswith("or --learner own_a2c:build.\n")
    assert "own_a2c" not in sys.modules
    assert "length" in cli.output(*evaluate, *own)


_TINY = ["n_envs=3", "n_steps=16", "batch_size=48", "n_epochs=1", "eval_every=48"]
_TINY += ["eval_episodes=1"]


@pytest.fixture(scope="module")
def policy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("policies") / "ants.safetensors"
    main(["train", "Ant", "--bodies", "3", "--steps", "48", "--set", *_TINY, "--out", str(out)])
    return out


def test_a_policy_is_trained_in_drawn_bodies(policy: Path) -> None:
    card = load_policy(policy).card
    assert card.env.kwargs == {"bodies": {"split": "train", "count": 3, "seed": 0}}
    assert card.learner == "limbs"


@pytest.mark.slow
def test_rsl_ppo_trains_a_limb_policy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "ants.safetensors"
    of_two = ["train", "Ant", "--bodies", "2", "--learner", "rsl-ppo", "--steps", "48"]
    main([*of_two, "--out", str(out), "--set", *_TINY, 'device="cpu"'])
    card = load_policy(out).card
    assert card.env.kwargs == {"bodies": {"split": "train", "count": 2, "seed": 0}}
    assert (card.learner, card.settings.n_envs) == ("rsl-limbs", 3)
    main(["policies", "evaluate", str(out), "--env", "ExtendedAnt", "--episodes", "1"])
    assert "forward speed" in capsys.readouterr().out


def test_a_policy_is_evaluated_in_any_body(policy: Path, cli: Cli) -> None:
    """A limb policy acts without a map in its family's body, or in the body of --env."""
    evaluate = ("policies", "evaluate", policy, "--episodes", "1")
    own, other = cli.output(*evaluate), cli.output(*evaluate, "--env", "ExtendedAnt")
    assert "forward speed" in own
    assert "forward speed" in other
    assert own != other
    assert "counterpart" not in other


@pytest.mark.slow
def test_a_policy_is_exported_for_one_body(policy: Path, tmp_path: Path) -> None:
    out = tmp_path / "ant.onnx"
    main(["policies", "export", str(policy), "--env", "ExtendedAnt", "--out", str(out)])
    card = load_policy(out).card
    assert card.action.size == 12
    assert card.env.id == "shapechanger/ExtendedAnt-v1"


@pytest.mark.parametrize("command", ["evaluate {} --env HalfCheetah", "export {} --env Walker2d"])
def test_a_policy_does_not_fit_another_family(command: str, policy: Path, cli: Cli) -> None:
    words = command.format(policy).split()
    out = ["--out", "a.onnx"] if words[0] == "export" else []
    assert "another family than" in cli.refused("policies", *words, *out)


def test_only_limb_policies_are_exported_for_another_body(tmp_path: Path, cli: Cli) -> None:
    export = ("policies", "export", POLICIES["reach"], "--env", "Finger")
    answer = cli.refused(*export, "--out", tmp_path / "finger.onnx")
    assert "Only a limb policy can be exported for another body" in answer
