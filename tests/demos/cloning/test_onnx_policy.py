"""Cloned policies as ONNX files: equal actions without PyTorch, and rejection of anything else."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from shapechanger.demos.cloning.card import CloneCard, OnnxClone
from shapechanger.demos.cloning.pictures import CloningError, Framing, PolicyError
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.layout import Feature, Layout
from shapechanger.policy import load_policy
from shapechanger.vehicles.envs.demonstrators import CLONES

_FRAMING = Framing(height=24, width=32)
_STATE = Layout((Feature("speed", "m/s"), Feature("distance", "m"), Feature("bump", "1")))
_RNG = np.random.default_rng(0)
_PICTURE = _RNG.integers(0, 256, (60, 80, 3), dtype=np.uint8)
_CARDS = {
    "edges": {"eyes": "edges", "low": (-0.5, 0.0), "high": (0.5, 1.0)},
    "both, several": {"nerves": (8, 4), "state_layout": _STATE, "members": 3},
    "state, classes": {
        "eyes": "none",
        "nerves": (8,),
        "state_layout": _STATE,
        "unseen": ("bump",),
        "head": "class",
        "classes": ((-1.0, 0.5), (0.0, 1.0), (1.0, 0.5)),
        "class_names": ("left", "forward", "right"),
    },
}


def _policy(**card: Any) -> CameraPolicy:
    return CameraPolicy.blank(
        CloneCard(framing=_FRAMING, channels=(4, 6), features=8, **card), seed=1
    )


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """An exported policy of each kind."""
    folder = tmp_path_factory.mktemp("exported")
    for kind, card in _CARDS.items():
        _policy(**card).export(folder / f"{kind}.onnx", body="car", control_hz=20.0)
    return {kind: folder / f"{kind}.onnx" for kind in _CARDS}


@pytest.mark.parametrize("kind", _CARDS)
def test_actions_are_those_of_the_network(kind: str, files: dict[str, Path]) -> None:
    policy, exported = _policy(**_CARDS[kind]), load_policy(files[kind])
    assert isinstance(exported, OnnxClone)
    assert exported.card == msgspec.structs.replace(policy.card, body="car", control_hz=20.0)
    state = np.array([1.5, np.nan, 1.0], np.float32) if policy.card.state_size else None
    picture = None if policy.card.eyes == "none" else _PICTURE
    np.testing.assert_allclose(
        exported.predict(picture, state), policy.predict(picture, state), atol=1e-5
    )


def test_a_shipped_policy_acts_alike(tmp_path: Path) -> None:
    policy, file = CameraPolicy.load(CLONES["car"]), tmp_path / "car.onnx"
    policy.export(file)
    exported = OnnxClone(file)
    for picture in _RNG.integers(0, 256, (20, 120, 160, 3), dtype=np.uint8):
        np.testing.assert_allclose(exported.predict(picture), policy.predict(picture), atol=1e-5)


def test_missing_inputs_are_refused(files: dict[str, Path]) -> None:
    exported = OnnxClone(files["both, several"])
    with pytest.raises(CloningError, match="needs an image"):
        exported.predict(None, np.zeros(3))
    with pytest.raises(CloningError, match=r"needs the state speed, distance, bump"):
        exported.predict(_PICTURE, np.zeros(2))


def test_a_change_of_the_file_changes_nothing(files: dict[str, Path], tmp_path: Path) -> None:
    file = Path(shutil.copy(files["edges"], tmp_path))
    exported = OnnxClone(file)
    before = exported.predict(_PICTURE)
    file.write_bytes(b"something else")
    np.testing.assert_array_equal(exported.predict(_PICTURE), before)


def _model(
    operator: str = "Identity", domain: str = "", card: str = "", **attributes: str
) -> bytes:
    make: Any = helper
    node = make.make_node(operator, ["x"], ["y"], domain=domain, **attributes)
    sides = [make.make_tensor_value_info(name, TensorProto.FLOAT, ["n", 2]) for name in "xy"]
    graph = make.make_graph([node], "other", sides[:1], sides[1:])
    domains = [make.make_opsetid("", 17), *([make.make_opsetid(domain, 1)] if domain else [])]
    model = make.make_model(graph, opset_imports=domains, ir_version=8)
    if card:
        make.set_model_props(model, {"shapechanger-clone": card})
    return model.SerializeToString()


# A network that was compiled for a provider.
_COMPILED = _model(
    "EPContext",
    "com.microsoft",
    ep_cache_context="x",
    source="TensorrtExecutionProvider",
)


def _card(**changes: Any) -> str:
    return msgspec.json.encode(_policy(**changes).card).decode()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "it is damaged, or is not an ONNX file"),
        (b"\x08\x08garbage", "it is damaged, or is not an ONNX file"),
        (_model(), "no card of Shapechanger"),
        (_model(card="{}"), "missing required field"),
        (_model(card=_card()), "its card says"),
        # An operator that only the provider of somebody's accelerator has.
        (_model("Turbo", domain="com.accelerator"), "its operator com.accelerator:Turbo is not"),
        (_COMPILED, "CPUExecutionProvider"),
    ],
)
def test_other_files_are_refused(content: bytes, words: str, tmp_path: Path) -> None:
    file = tmp_path / "policy.onnx"
    file.write_bytes(content)
    with pytest.raises(PolicyError, match="is not a policy that") as refusal:
        OnnxClone(file)
    assert words in str(refusal.value)
    assert "\n" not in str(refusal.value)
    assert "ONNXRuntimeError" not in str(refusal.value)


def test_a_pipe_is_not_read_and_a_missing_file_is_named(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.onnx")
    for name, words in (("pipe", "it is not a file"), ("none", "There is no policy file")):
        with pytest.raises(PolicyError, match=words):
            OnnxClone(tmp_path / f"{name}.onnx")


def test_a_valid_file_passes_the_checker(files: dict[str, Path]) -> None:
    model: Any = onnx.load(str(files["edges"]))
    checker: Any = onnx
    checker.checker.check_model(model)
    assert [side.name for side in (*model.graph.input, *model.graph.output)] == [
        "picture",
        "output",
    ]
