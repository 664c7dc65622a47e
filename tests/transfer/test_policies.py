"""One call loads a policy of any kind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shapechanger
from shapechanger.demos.cloning.card import CloneCard
from shapechanger.demos.cloning.onnx_policy import OnnxClone, export_clone
from shapechanger.demos.cloning.pictures import Framing
from shapechanger.demos.cloning.policy import CameraPolicy
from shapechanger.errors import CorruptStudy
from shapechanger.layout import Feature, Layout
from shapechanger.policy import load_policy
from shapechanger.transfer.export import export_onnx
from shapechanger.transfer.learners.policy_file import TrainedPolicy
from shapechanger.transfer.onnx_policy import OnnxPolicy
from shapechanger.transfer.references import reference_policy
from shapechanger.vehicles.envs.demonstrators import CLONES


@pytest.mark.parametrize("kind", [str, Path])
def test_trained_policies_and_clones_load_from_text_and_path(
    kind: type[str] | type[Path], tmp_path: Path
) -> None:
    trained = shapechanger.load_policy(kind(reference_policy("shapechanger/Ant-v1")))
    assert isinstance(trained, TrainedPolicy)
    seen = np.zeros((2, trained.card.observation.size))
    assert trained.act(seen).shape == (2, 8)
    shapechanger.save_policy(trained, kind(tmp_path / "again.safetensors"))
    assert load_policy(kind(tmp_path / "again.safetensors")).card == trained.card

    clone = shapechanger.load_policy(kind(CLONES["car"]))
    assert isinstance(clone, CameraPolicy)
    frames = np.zeros((2, 120, 160, 3), np.uint8)
    np.testing.assert_array_equal(clone.act(frames), clone.predict_many(frames))


def test_exported_policies_load_too(tmp_path: Path) -> None:
    """A policy as ONNX acts as what it was exported from, and has its identity."""
    pytest.importorskip("onnxruntime")
    trained = load_policy(reference_policy("shapechanger/InvertedPendulum-v1"))
    export_onnx(trained, tmp_path / "trained.onnx")
    loaded = shapechanger.load_policy(str(tmp_path / "trained.onnx"))
    assert isinstance(loaded, OnnxPolicy)
    assert loaded.card.identity == trained.card.identity != {}
    seen = np.full((3, 4), 0.1)
    np.testing.assert_allclose(loaded.act(seen), trained.act(seen), atol=1e-5)


@pytest.mark.slow
def test_exported_clones_load_too(tmp_path: Path) -> None:
    pytest.importorskip("onnxruntime")
    pytest.importorskip("onnxscript")
    clone = CameraPolicy.load(CLONES["car"])
    export_clone(clone, tmp_path / "clone.onnx")
    onboard = shapechanger.load_policy(tmp_path / "clone.onnx")
    assert isinstance(onboard, OnnxClone)
    frames = np.full((2, 120, 160, 3), 90, np.uint8)
    np.testing.assert_allclose(onboard.act(frames), clone.act(frames), atol=1e-3)


@pytest.mark.parametrize("eyes", ["none", "colours"])
def test_a_clone_with_a_state_acts_on_states(eyes: Any) -> None:
    """Without images an observation is the state; with both it is a mapping."""
    state_layout = Layout((Feature("speed", "m/s"), Feature("distance", "m")))
    card = CloneCard(
        framing=Framing(height=24, width=32),
        channels=(4, 6),
        features=8,
        eyes=eyes,
        nerves=(8,),
        state_layout=state_layout,
    )
    clone = CameraPolicy.blank(card, seed=1)
    states = np.array([[0.5, 1.0], [1.5, 0.2]])
    images = None if eyes == "none" else np.full((2, 60, 80, 3), 90, np.uint8)
    observations = states if images is None else {"image": images, "state": states}
    acted = clone.act(observations)
    np.testing.assert_array_equal(acted, clone.predict_many(images, states))
    assert not np.array_equal(acted[0], acted[1])


@pytest.mark.parametrize("name", ["no.safetensors", "no.onnx"])
def test_a_missing_file_is_named(name: str) -> None:
    with pytest.raises(CorruptStudy, match=r"no\."):
        shapechanger.load_policy(name)


@pytest.mark.parametrize("name", ["x.safetensors", "x.onnx"])
def test_something_else_is_refused(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(b"nothing")
    with pytest.raises(CorruptStudy, match="is not a policy"):
        shapechanger.load_policy(str(tmp_path / name))
