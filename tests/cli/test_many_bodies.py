"""The commands for one policy of many bodies: train, evaluate, export."""

from __future__ import annotations

from pathlib import Path

import pytest

from shapechanger.cli import main
from shapechanger.policy import load_policy
from shapechanger.transfer.onnx_policy import OnnxPolicy

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


def test_it_is_evaluated_in_any_body(policy: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without a body in the family's own, otherwise in the named one, without a body map."""
    main(["policies", "evaluate", str(policy), "--episodes", "1"])
    own = capsys.readouterr().out
    main(["policies", "evaluate", str(policy), "--env", "ExtendedAnt", "--episodes", "1"])
    other = capsys.readouterr().out
    assert "forward speed" in own
    assert "forward speed" in other
    assert own != other
    assert "counterpart" not in other


@pytest.mark.slow
def test_it_is_exported_for_one_body(policy: Path, tmp_path: Path) -> None:
    out = tmp_path / "ant.onnx"
    main(["policies", "export", str(policy), "--env", "ExtendedAnt", "--out", str(out)])
    card = OnnxPolicy(out).card
    assert card.action.size == 12
    assert card.env.id == "shapechanger/ExtendedAnt-v1"


@pytest.mark.parametrize(
    ("command", "sentence"),
    [
        ("train Ant --bodies 3 --learner ppo-run", "ppo-run learns in one body: give --learner l"),
        ("train Ant --bodies 3 --body BigAnt", "--bodies takes a number above 0, and no --body"),
        ("train Swimmer --bodies 3", "The family Swimmer declares no axes"),
        ("train Car --bodies 3", "belongs to no family to draw from"),
        ("train HalfCheetah --bodies 70", "70 bodies need as many envs, and there are 64"),
        (
            "train Ant --bodies 3 --learner rsl-ppo --tensorboard logs",
            "rsl-limbs has no TensorBoard logs",
        ),
        ("policies evaluate POLICY --env HalfCheetah", "another family than"),
        ("policies export POLICY --env Walker2d --out a.onnx", "another family than"),
        (
            "transfer Ant BigAnt --arms scratch generalist",
            "generalist needs a policy that fits many bodies: give --learner limbs",
        ),
    ],
)
def test_mistakes_give_one_sentence(
    command: str,
    sentence: str,
    policy: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit):
        main([str(policy) if word == "POLICY" else word for word in command.split()])
    error = capsys.readouterr().err
    assert sentence in " ".join(error.split())
    assert "Traceback" not in error


def test_other_policies_are_exported_for_their_own_body(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A body with a policy that fits only one is refused."""
    from shapechanger.finger.task import POLICIES

    out = str(tmp_path / "finger.onnx")
    with pytest.raises(SystemExit):
        main(["policies", "export", str(POLICIES["reach"]), "--env", "Finger", "--out", out])
    assert "Only a policy of limbs fits another body" in capsys.readouterr().err
