"""The file of a cloned policy: exact round trip, and rejection of anything else."""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import torch

from shapechanger.demos.cloning.pictures import CloningError, PolicyError
from shapechanger.demos.cloning.policy import KIND, CameraPolicy
from shapechanger.demos.cloning.settings import CloneSettings
from shapechanger.errors import OutputError
from shapechanger.policy import read_tensors, tensor_bytes
from shapechanger.vehicles.envs.demonstrators import CLONES
from tests.demos.cloning.small import SMALL, demonstrations

_PICTURES = demonstrations(20, 0).pictures


def _policy(settings: CloneSettings = SMALL) -> CameraPolicy:
    return CameraPolicy.fresh(settings, 0)


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


def test_the_same_policy_is_the_same_file(path: Path, tmp_path: Path) -> None:
    CameraPolicy.load(path).save(tmp_path / "again.safetensors")
    assert (tmp_path / "again.safetensors").read_bytes() == path.read_bytes()


def test_a_policy_of_the_default_settings_is_small(path: Path) -> None:
    _policy(CloneSettings()).save(path)
    assert path.stat().st_size < 1_000_000


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
        with pytest.raises(PolicyError, match="is not a cloned policy: "):
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
        *((lambda content, new=new: new, "") for new in (b"", b"PK\x03\x04", b"not a policy")),
        *(
            (lambda content, share=share: content[: int(share * len(content))], "")
            for share in (0.1, 0.5, 0.9, 0.999)
        ),
    ],
)
def test_another_or_damaged_file_is_refused(
    path: Path, change: Callable[[bytes], bytes], words: str
) -> None:
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(
        PolicyError, match=rf"corridor\.safetensors is not a cloned policy.*{words}"
    ):
        CameraPolicy.load(path)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(PolicyError, match=r"There is no policy file .*nowhere\.safetensors"):
        CameraPolicy.load(tmp_path / "nowhere.safetensors")
    with pytest.raises(PolicyError, match="is not a cloned policy"):
        CameraPolicy.load(tmp_path)


def test_a_file_that_cannot_be_written_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "taken").mkdir()
    with pytest.raises(OutputError, match="Cannot write"):
        _policy().save(tmp_path / "taken")
    assert [file.name for file in tmp_path.iterdir()] == ["taken"]


def test_copies_share_nothing() -> None:
    """A copy can be trained without changing the original."""
    policy = _policy()
    copy = policy.copy()
    with torch.no_grad():
        copy.network.hands.bias.add_(1.0)
    assert not torch.equal(copy.network.hands.bias, policy.network.hands.bias)
    assert msgspec.json.encode(copy.card) == msgspec.json.encode(policy.card)
