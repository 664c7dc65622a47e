"""The file of a cloned policy: exact round trip, and rejection of anything else."""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from shapechanger.demos.cloning.card import CloneCard
from shapechanger.demos.cloning.pictures import CloningError, Framing, PolicyError
from shapechanger.demos.cloning.policy import KIND, CameraPolicy
from shapechanger.policy import read_tensors, tensor_bytes
from shapechanger.vehicles.envs.demonstrators import CLONES
from tests.demos.cloning.data import SMALL, STATE, corridor

_PICTURES = cast("NDArray[np.uint8]", corridor(20, 0).pictures)


def _policy() -> CameraPolicy:
    return CameraPolicy.fresh(SMALL, 0)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A file with a policy."""
    file = tmp_path / "policies" / "corridor.safetensors"
    _policy().save(file)
    return file


def test_a_policy_round_trips(path: Path) -> None:
    policy = _policy().described(command="clone it", minutes=3, seeds=[1, 2])
    policy.save(path)
    again = CameraPolicy.load(path)
    np.testing.assert_array_equal(again.predict_many(_PICTURES), policy.predict_many(_PICTURES))
    assert again.card == policy.card
    assert again.card.data == {"minutes": 3, "seeds": [1, 2]}
    assert again.card.command == "clone it"
    again.save(path.with_name("again.safetensors"))
    assert path.with_name("again.safetensors").read_bytes() == path.read_bytes()


def test_single_and_batch_predictions_agree() -> None:
    policy = _policy()
    many = policy.predict_many(_PICTURES)
    assert many.dtype == np.float32
    assert np.abs(many).max() <= 1.0
    for picture, action in zip(_PICTURES, many, strict=True):
        np.testing.assert_allclose(policy.predict(picture), action, atol=1e-6)


def test_predictions_hardly_depend_on_brightness() -> None:
    policy = _policy()
    bright = (_PICTURES // 2) * 2
    np.testing.assert_allclose(
        policy.predict_many(bright // 2), policy.predict_many(bright), atol=0.02
    )


def test_other_sizes_are_accepted_and_missing_images_refused() -> None:
    assert _policy().predict(np.zeros((50, 50, 3), np.uint8)).shape == (2,)
    with pytest.raises(CloningError, match="Images must be uint8"):
        _policy().predict(np.zeros((50, 50), np.uint8))
    with pytest.raises(CloningError, match="needs an image, and none was given"):
        _policy().predict(None, np.zeros(3))


def _changed(path: Path, weights: dict[str, Any] | None = None, **card: Any) -> None:
    """Rewrite a file with other weights or another card, and a matching hash."""
    content, old = read_tensors(path, KIND)
    card_fields = {**json.loads(content), **card}
    path.write_bytes(
        tensor_bytes(old if weights is None else weights, json.dumps(card_fields).encode(), KIND)
    )


def test_unsuitable_weights_are_refused(path: Path) -> None:
    state = {name: value.numpy() for name, value in _policy().network.state_dict().items()}
    bias = "hands.bias"
    for weights in (
        {**state, bias: np.zeros(3, np.float32)},
        {**state, "more": np.zeros(3, np.float32)},
        {name: value.astype(np.float64) for name, value in state.items()},
        {**state, bias: np.array([0.0, np.nan], np.float32)},
        {name: value for name, value in state.items() if name != bias},
        {},
    ):
        _changed(path, weights)
        with pytest.raises(PolicyError, match="is not a policy that"):
            CameraPolicy.load(path)


@pytest.mark.parametrize("write", [torch.save, pickle.dump], ids=["torch", "pickle"])
def test_nothing_is_unpickled(
    path: Path, write: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    """Policy files are untrusted."""
    with path.open("wb") as file:
        write({"hands.bias": _Trap()}, file)
    with pytest.raises(PolicyError, match="not a safetensors file"):
        CameraPolicy.load(path)
    assert "trapped" not in capsys.readouterr().out


class _Trap:
    """Runs code when it is unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return (print, ("trapped",))


@pytest.mark.parametrize("clone", [*CLONES.values()], ids=[*CLONES])
def test_the_policies_of_the_package_load(clone: Path) -> None:
    action = CameraPolicy.load(clone).predict(np.zeros((120, 160, 3), np.uint8))
    assert action.shape == (2,)


@pytest.mark.parametrize(
    "changes",
    [
        {"features": "many"},
        {"features": 10**6},
        {"features": 0},
        {"channels": [8, 16]},
        {"framing": {"height": 0}},
        {"framing": {"height": 10**7, "width": 10**7}},
        {"framing": {"height": 10**30}},
        {"members": 33},
    ],
)
def test_an_invalid_card_is_refused(path: Path, changes: dict[str, Any]) -> None:
    _changed(path, **changes)
    with pytest.raises(PolicyError, match=r"corridor\.safetensors is n"):
        CameraPolicy.load(path)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda content: content[:-100] + bytes([content[-100] ^ 1]) + content[-99:], "its hash"),
        (lambda content: tensor_bytes({"policy.weight": np.zeros(3)}, b"{}"), "it is a policy"),
        (lambda content: content[: len(content) // 2], ""),
        (lambda _: b"PK\x03\x04", ""),
    ],
)
def test_another_or_damaged_file_is_refused(
    path: Path, change: Callable[[bytes], bytes], words: str
) -> None:
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(PolicyError, match=rf"corridor\.safetensors is not a policy that.*{words}"):
        CameraPolicy.load(path)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(PolicyError, match=r"There is no policy file .*nowhere\.safetensors"):
        CameraPolicy.load(tmp_path / "nowhere.safetensors")
    with pytest.raises(PolicyError, match="is not a policy that"):
        CameraPolicy.load(tmp_path)


@pytest.mark.parametrize("eyes", ["none", "colours"])
def test_a_clone_with_a_state_acts_on_states(eyes: Any) -> None:
    """Without images an observation is the state; with both it is a mapping."""
    card = CloneCard(
        framing=Framing(height=24, width=32),
        channels=(4, 6),
        features=8,
        eyes=eyes,
        nerves=(8,),
        state_layout=STATE,
    )
    clone = CameraPolicy.blank(card, seed=1)
    states = np.array([[0.5, 1.0, 0.1], [1.5, 0.2, 0.3]])
    images = None if eyes == "none" else np.full((2, 60, 80, 3), 90, np.uint8)
    observations = states if images is None else {"image": images, "state": states}
    acted = clone.act(observations)
    np.testing.assert_array_equal(acted, clone.predict_many(images, states))
    assert not np.array_equal(acted[0], acted[1])
