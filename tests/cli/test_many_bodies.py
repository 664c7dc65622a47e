"""The commands for one policy of many bodies: train, evaluate, export."""

from __future__ import annotations

from pathlib import Path

import pytest

from shapechanger.cli import main
from shapechanger.finger.task import POLICIES
from shapechanger.policy import load_policy
from tests.cli.running import Cli

_TINY = [
    "n_envs=3",
    "n_steps=16",
    "batch_size=48",
    "n_epochs=1",
    "eval_every=48",
    "eval_episodes=1",
]


@pytest.fixture(scope="module")
def policy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A policy of three ants that has hardly learned."""
    out = tmp_path_factory.mktemp("policies") / "ants.safetensors"
    main(["train", "Ant", "--bodies", "3", "--steps", "48", "--set", *_TINY, "--out", str(out)])
    return out


def test_it_is_trained_in_drawn_bodies(policy: Path) -> None:
    """The card names the bodies, and belongs to a policy of limbs."""
    card = load_policy(policy).card
    assert card.env.kwargs == {"bodies": {"split": "train", "count": 3, "seed": 0}}
    assert card.learner == "limbs"


@pytest.mark.slow
def test_it_is_trained_on_a_device(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In many bodies `rsl-ppo` has the network of limbs; the policy acts in a body it never had."""
    out = tmp_path / "ants.safetensors"
    of_two = ["train", "Ant", "--bodies", "2", "--learner", "rsl-ppo", "--steps", "48"]
    main([*of_two, "--out", str(out), "--set", *_TINY, 'device="cpu"'])
    card = load_policy(out).card
    assert card.env.kwargs == {"bodies": {"split": "train", "count": 2, "seed": 0}}
    assert (card.learner, card.settings.n_envs) == ("rsl-limbs", 3)
    main(["policies", "evaluate", str(out), "--env", "ExtendedAnt", "--episodes", "1"])
    assert "forward speed" in capsys.readouterr().out


def test_it_is_evaluated_in_any_body(policy: Path, cli: Cli) -> None:
    """Without a body in the family's own, otherwise in the named one, without a body map."""
    evaluate = ("policies", "evaluate", policy, "--episodes", "1")
    own, other = cli.output(*evaluate), cli.output(*evaluate, "--env", "ExtendedAnt")
    assert "forward speed" in own
    assert "forward speed" in other
    assert own != other
    assert "counterpart" not in other


@pytest.mark.slow
def test_it_is_exported_for_one_body(policy: Path, tmp_path: Path) -> None:
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


def test_other_policies_are_exported_for_their_own_body(tmp_path: Path, cli: Cli) -> None:
    """A body with a policy that fits only one is refused."""
    export = ("policies", "export", POLICIES["reach"], "--env", "Finger")
    answer = cli.refused(*export, "--out", tmp_path / "finger.onnx")
    assert "Only a limb policy can be exported for another body" in answer
