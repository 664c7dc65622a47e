"""Clones in files, of safetensors and ONNX: equal actions, and refusals of anything else."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any, cast

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray
from onnx import TensorProto, helper

from shapechanger.demos.cloning.clone import Clone
from shapechanger.demos.cloning.network import CameraPolicy
from shapechanger.errors import DemosError, PolicyError
from shapechanger.layout import Feature, Layout
from shapechanger.policy import load_policy, read_tensors, tensor_bytes
from shapechanger.vehicles.envs.demonstrators import CLONES
from tests.demos.cloning.data import SMALL, clone_card, corridor

_PICTURES = cast("NDArray[np.uint8]", corridor(20, 0).pictures)
_STATE = Layout((Feature("speed", "m/s"), Feature("distance", "m"), Feature("bump", "1")))
_STATES = np.array([[1.5, np.nan, 1.0], [0.5, 1.0, 0.1]], np.float32)
_CARDS = {
    "edges": clone_card(eyes="edges", low=(-0.5, 0.0), high=(0.5, 1.0)),
    "both, several": clone_card(None, _STATE, nerves=(8, 4), members=3),
    "state, classes": clone_card(
        None,
        _STATE,
        eyes="none",
        nerves=(8,),
        unseen=("bump",),
        classes=((-1.0, 0.5), (0.0, 1.0), (1.0, 0.5)),
        class_names=("left", "forward", "right"),
    ),
}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "policies" / "corridor.safetensors"
    CameraPolicy.fresh(SMALL, 0).save(file)
    return file


@pytest.mark.parametrize("kind", _CARDS)
def test_files_have_the_same_card_and_actions(kind: str, tmp_path: Path) -> None:
    card = _CARDS[kind]
    policy = CameraPolicy.blank(card, seed=1).carded(command="clone it")
    saved, exported = tmp_path / "policy.safetensors", tmp_path / "policy.onnx"
    policy.save(saved)
    again = load_policy(saved)
    assert again.card == policy.card
    again.save(tmp_path / "again.safetensors")
    assert (tmp_path / "again.safetensors").read_bytes() == saved.read_bytes()

    policy.export(exported)
    onnx = load_policy(exported)
    assert type(onnx) is Clone
    assert onnx.card == policy.card
    with pytest.raises(PolicyError, match="cannot be written again"):
        onnx.save(saved)

    images = None if policy.net.eyes == "none" else _PICTURES[:2]
    states = None if card.observation is None else _STATES
    acted = policy.predict_many(images, states)
    both = {"image": images, "state": states}
    seen = both if images is not None and states is not None else (images, states)[images is None]
    for one in (policy, again):
        np.testing.assert_array_equal(one.act(seen), acted)
        single = one.predict(*(None if part is None else part[0] for part in both.values()))
        np.testing.assert_allclose(single, acted[0], atol=1e-6)
    np.testing.assert_allclose(onnx.act(seen), acted, atol=1e-5)
    shutil.copy(saved, exported)  # A loaded policy does not read its file again.
    np.testing.assert_allclose(onnx.act(seen), acted, atol=1e-5)


@pytest.mark.parametrize("vehicle", CLONES)
def test_the_clones_of_the_package_return_valid_actions(vehicle: str) -> None:
    actions = load_policy(CLONES[vehicle]).act(np.zeros((2, 120, 160, 3), np.uint8))
    assert actions.shape == (2, 2)
    assert np.abs(actions).max() <= 1.0


def test_predictions_hardly_depend_on_brightness() -> None:
    policy, dark = CameraPolicy.fresh(SMALL, 0), _PICTURES // 2
    predicted = policy.predict_many(dark)
    np.testing.assert_allclose(predicted, policy.predict_many(2 * dark), atol=0.02)


def test_missing_inputs_and_wrong_shapes_are_refused() -> None:
    policy = CameraPolicy.blank(_CARDS["both, several"], 0)
    with pytest.raises(DemosError, match="Images must be uint8"):
        policy.predict(np.zeros((50, 50), np.uint8), _STATES[0])
    with pytest.raises(DemosError, match="needs an image, and none was given"):
        policy.predict(None, _STATES[0])
    with pytest.raises(DemosError, match=r"needs the state speed, distance, bump"):
        policy.predict(_PICTURES[0], np.zeros(2))


def _changed(path: Path, weights: dict[str, Any] | None = None, **net: Any) -> None:
    """Rewrite a file with other weights or another card, and a matching hash."""
    card, old = read_tensors(path)
    fields = json.loads(msgspec.json.encode(card))
    fields["clone"] |= net
    path.write_bytes(tensor_bytes(old if weights is None else weights, json.dumps(fields).encode()))


def test_unsuitable_weights_are_refused(path: Path) -> None:
    state, bias = CameraPolicy.fresh(SMALL, 0).tensors(), "hands.bias"
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
            load_policy(path)


@pytest.mark.parametrize(
    "changes",
    [
        {"features": 10**6},
        {"framing": {"height": 10**7, "width": 10**7}},
        {"members": 33},
        {"nerves": [4]},
        {"classes": [[1.0]], "class_names": ["one"]},
        {"low": [0.0, 0.0]},
    ],
)
def test_an_invalid_card_is_refused(path: Path, changes: dict[str, Any]) -> None:
    _changed(path, **changes)
    with pytest.raises(PolicyError, match=r"corridor\.safetensors is not a policy"):
        load_policy(path)


def _model(operator: str = "Identity", domain: str = "", card: str = "", **more: str) -> bytes:
    make: Any = helper
    node = make.make_node(operator, ["x"], ["y"], domain=domain, **more)
    sides = [make.make_tensor_value_info(name, TensorProto.FLOAT, ["n", 2]) for name in "xy"]
    graph = make.make_graph([node], "other", sides[:1], sides[1:])
    domains = [make.make_opsetid("", 17), *([make.make_opsetid(domain, 1)] if domain else [])]
    model = make.make_model(graph, opset_imports=domains, ir_version=8)
    if card:
        make.set_model_props(model, {"shapechanger": card})
    return model.SerializeToString()


_PROVIDER = "TensorrtExecutionProvider"
# A network that was compiled for one of onnxruntime's execution providers.
_COMPILED = _model("EPContext", "com.microsoft", ep_cache_context="x", source=_PROVIDER)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"\x08\x08garbage", "protobuf parsing failed"),
        (_model(), "no card of Shapechanger"),
        (_model(card="{}"), "missing required field"),
        (_model(card=msgspec.json.encode(clone_card()).decode()), "its card states"),
        # An operator of an accelerator, which onnxruntime does not have.
        (_model("Turbo", domain="com.accelerator"), "com.accelerator:Turbo"),
        (_COMPILED, "not compatible with any execution provider"),
    ],
)
def test_other_onnx_files_are_refused(content: bytes, message: str, tmp_path: Path) -> None:
    file = tmp_path / "policy.onnx"
    file.write_bytes(content)
    with pytest.raises(PolicyError, match="is not a policy that") as refusal:
        load_policy(file)
    assert message in str(refusal.value)
    assert "\n" not in str(refusal.value)
