"""`shapechanger policies`: cards, and conversion of Stable-Baselines3 files."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from sb3_contrib import TQC
from stable_baselines3 import A2C, PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from torch import nn

from shapechanger.cli import main
from shapechanger.finger.task import POLICIES
from shapechanger.policy import load_policy
from shapechanger.transfer.learners.settings import OffPolicySettings
from shapechanger.vehicles.envs.demonstrators import CLONES


def _zip(path: Path, env: str = "shapechanger/InvertedPendulum-v1", **arguments: object) -> PPO:
    model = PPO("MlpPolicy", gym.make(env), n_steps=32, batch_size=32, seed=3, **arguments)
    model.save(path)
    return model


def test_a_card_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    """The card gives training env, steps and inputs."""
    main(["policies", "show", str(POLICIES["reach"])])
    output = capsys.readouterr().out
    assert "shapechanger/Finger-v1" in output
    assert "307,200" in output
    assert "PIP_flexion" in output or "angle" in output


def test_a_clone_is_shown_and_listed(capsys: pytest.CaptureFixture[str]) -> None:
    main(["policies", "show", str(CLONES["car"])])
    output = capsys.readouterr().out
    assert "steering, throttle" in output
    assert "shapechanger train Car" in output
    main(["policies", "list", str(CLONES["car"].parent)])
    lines = capsys.readouterr().out.splitlines()
    assert sum("cloning" in line for line in lines) == len(CLONES)


def test_a_zip_of_stable_baselines3_is_converted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The same actions, from a file that cannot run code and says which command wrote it."""
    model = _zip(tmp_path / "mine.zip", policy_kwargs={"net_arch": [8, 8]})
    out = tmp_path / "mine.safetensors"
    convert = ["policies", "convert", str(tmp_path / "mine.zip"), "InvertedPendulum"]
    monkeypatch.setattr("sys.argv", ["shapechanger", "policies", "convert", "mine.zip"])
    main([*convert, "--out", str(out), "--trust"])
    policy = load_policy(out)
    seen = np.random.default_rng(0).normal(size=(20, 4))
    np.testing.assert_array_equal(policy.act(seen), model.predict(seen, deterministic=True)[0])
    assert policy.card.env.id == "shapechanger/InvertedPendulum-v1"
    assert policy.card.settings.net_arch == (8, 8)
    capsys.readouterr()
    main(["policies", "show", str(out)])
    assert "command      shapechanger policies convert mine.zip\n" in capsys.readouterr().out


@pytest.mark.parametrize("kind", [SAC, TQC])
def test_zips_of_off_policy_learners_are_converted(kind: type[SAC], tmp_path: Path) -> None:
    env = gym.make("shapechanger/InvertedPendulum-v1")
    networks = {"net_arch": {"pi": [8, 8], "qf": [8, 8]}}
    model = kind("MlpPolicy", env, seed=3, train_freq=4, buffer_size=100, policy_kwargs=networks)
    model.save(tmp_path / "mine.zip")
    out = tmp_path / "mine.safetensors"
    convert = ["policies", "convert", str(tmp_path / "mine.zip"), "InvertedPendulum"]
    main([*convert, "--out", str(out), "--trust"])
    policy = load_policy(out)
    seen = np.random.default_rng(0).normal(size=(20, 4))
    np.testing.assert_array_equal(policy.act(seen), model.predict(seen, deterministic=True)[0])
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
        (SAC, {"train_freq": (1, "episode")}, "only updates after steps fit"),
        (SAC, {"policy_kwargs": {"n_critics": 3}}, "These policy_kwargs change the networks"),
        (SAC, {"policy_kwargs": {"activation_fn": nn.Tanh}}, "both must be the same, with ReLU"),
        (A2C, {}, "is of another algorithm or policy class"),
        (TD3, {}, "is of another algorithm or policy class"),
    ],
)
def test_other_zips_are_refused(
    kind: type[BaseAlgorithm],
    arguments: dict[str, object],
    words: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    make: Any = kind
    make("MlpPolicy", gym.make("InvertedPendulum-v5"), **arguments).save(tmp_path / "mine.zip")
    out = tmp_path / "mine.safetensors"
    convert = ["policies", "convert", str(tmp_path / "mine.zip"), "InvertedPendulum"]
    with pytest.raises(SystemExit):
        main([*convert, "--out", str(out), "--trust"])
    message = capsys.readouterr().err
    assert words in message
    assert message.count("\n") == 1
    assert not out.exists()


@pytest.mark.parametrize(
    ("arguments", "env", "trust", "words"),
    [
        ({}, "InvertedPendulum", False, "give --trust if you trust its author"),
        ({}, "Ant", True, "observation of the policy"),
        ({"policy_kwargs": {"activation_fn": nn.ReLU}}, "InvertedPendulum", True, "with Tanh"),
        (
            {"policy_kwargs": {"net_arch": {"pi": [8], "vf": [9]}}},
            "InvertedPendulum",
            True,
            "both must be the same",
        ),
        (None, "InvertedPendulum", True, "There is no policy file"),
    ],
)
def test_unsuitable_policies_give_one_sentence(
    arguments: dict[str, object] | None,
    env: str,
    trust: bool,
    words: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    if arguments is not None:
        _zip(tmp_path / "mine.zip", **arguments)
    out = tmp_path / "mine.safetensors"
    convert = ["policies", "convert", str(tmp_path / "mine.zip"), env, "--out", str(out)]
    with pytest.raises(SystemExit) as stop:
        main([*convert, *(["--trust"] if trust else [])])
    message = capsys.readouterr().err
    assert stop.value.code == 2
    assert words in message
    assert message.count("\n") == 1
    assert not out.exists()


@pytest.fixture
def trained(tmp_path: Path) -> Path:
    """A pendulum policy in its own folder."""
    _zip(tmp_path / "mine.zip", policy_kwargs={"net_arch": [8]})
    out = tmp_path / "policies" / "mine.safetensors"
    out.parent.mkdir()
    convert = ["policies", "convert", str(tmp_path / "mine.zip"), "InvertedPendulum"]
    main([*convert, "--out", str(out), "--trust"])
    return out


def test_a_folder_is_listed(trained: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Invalid files are listed with the reason; an empty folder is an error."""
    (trained.parent / "other.safetensors").write_text("no")
    main(["policies", "list", str(trained.parent)])
    output = capsys.readouterr().out
    assert "mine.safetensors" in output
    assert "shapechanger/InvertedPendulum-v1" in output
    assert "is not a policy" in output
    (trained.parent / "empty").mkdir()
    with pytest.raises(SystemExit):
        main(["policies", "list", str(trained.parent / "empty")])
    assert "There is no policy in" in capsys.readouterr().err


@pytest.mark.gl
def test_a_policy_is_played_from_its_file(
    trained: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In the env of its training, and in another through the body map; also exported."""
    exported = trained.with_suffix(".onnx")
    main(["policies", "export", str(trained), "--out", str(exported)])
    film = tmp_path / "film.mp4"
    for env in ([], ["--env", "BigInvertedPendulum"], ["--body", "BigInvertedPendulum"]):
        returns: list[str] = []
        for file in (trained, exported):
            capsys.readouterr()
            main(["policies", "play", str(file), "--max-steps", "5", "--out", str(film), *env])
            returns.append(capsys.readouterr().out)
            assert film.stat().st_size > 0
        assert returns[0] == returns[1]
        assert returns[0].startswith("episode 0: return ")


@pytest.mark.gl
def test_clones_are_evaluated_and_played(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In the vehicle that they learned in, and in another; not in a body with other actions."""
    film = tmp_path / "film.mp4"
    for env in ([], ["--env", "Tank"]):
        main(["policies", "play", str(CLONES["car"]), "--max-steps", "3", "--out", str(film), *env])
        assert "in 3 steps" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["policies", "evaluate", str(CLONES["car"]), "--env", "Ant"])
    assert "The actions of the policy are steering, throttle" in capsys.readouterr().err


def test_an_exported_policy_evaluates_the_same(
    trained: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    exported = trained.with_suffix(".onnx")
    main(["policies", "export", str(trained), "--out", str(exported)])
    capsys.readouterr()
    for env in ([], ["--env", "BigInvertedPendulum"]):
        output: list[str] = []
        for file in (trained, exported):
            main(["policies", "evaluate", str(file), "--episodes", "2", *env])
            output.append(capsys.readouterr().out)
        assert output[0] == output[1]
        assert output[0].startswith("return ")
        assert "steps" in output[0]
    main(["policies", "evaluate", str(trained), "--env", "InvertedDoublePendulum"])
    assert capsys.readouterr().out.startswith(
        "Without a counterpart in the other body, and so constant: hinge/angle."
    )
    with pytest.raises(SystemExit):
        main(["policies", "evaluate", str(exported), "--episodes", "0"])
    assert "at least one episode" in capsys.readouterr().err


OWN = """
from stable_baselines3 import A2C

def build(envs, seed):
    return A2C("MlpPolicy", envs, seed=seed, device="cpu", n_steps=64)
"""


def test_a_policy_of_ones_own_learner_is_evaluated_when_it_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its file alone does not import the user's module."""
    (tmp_path / "own_a2c.py").write_text(OWN)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    small = ["steps_per_update=64", "eval_every=64", "eval_episodes=1"]
    own = ["--learner", "own_a2c:build"]
    train = ["train", "InvertedPendulum", *own, "--steps", "64", "--set", *small]
    main([*train, "--out", "own.safetensors"])
    monkeypatch.delitem(sys.modules, "own_a2c")
    capsys.readouterr()
    evaluate = ["policies", "evaluate", "own.safetensors", "--episodes", "1"]
    with pytest.raises(SystemExit):
        main(evaluate)
    assert capsys.readouterr().err.endswith("or --learner own_a2c:build.\n")
    assert "own_a2c" not in sys.modules
    main([*evaluate, *own])
    assert "length" in capsys.readouterr().out
