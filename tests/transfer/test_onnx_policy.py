"""Policies as ONNX: equal actions without PyTorch, and names in the metadata."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import msgspec
import numpy as np
import onnx
import pytest

from shapechanger.errors import PolicyError
from shapechanger.policy import OnnxPolicy, load_policy, save_policy
from shapechanger.transfer.export import export_onnx
from shapechanger.transfer.learners.sb3 import Sb3Learner
from tests.transfer.studies import SMALL, TINY_NORMALISED


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A normalised policy and its ONNX file."""
    folder = tmp_path_factory.mktemp("onnx")
    learner = Sb3Learner("ppo", TINY_NORMALISED)
    policy = learner.train(SMALL, 32, 0, on_evaluation=lambda evaluation: None)
    save_policy(policy, folder / "policy.safetensors")
    export_onnx(policy, folder / "policy.onnx")
    return folder / "policy.safetensors", folder / "policy.onnx"


def test_actions_are_those_of_pytorch(files: tuple[Path, Path]) -> None:
    """Actions agree to 1e-5 and are within the bounds."""
    policy, exported = load_policy(files[0]), load_policy(files[1])
    assert isinstance(exported, OnnxPolicy)
    assert exported.card == msgspec.structs.replace(policy.card, settings=None)
    rng = np.random.default_rng(0)
    for scale in (0.01, 1.0, 100.0):
        seen = rng.normal(0.0, scale, (50, 4))
        actions = exported.act(seen)
        np.testing.assert_allclose(actions, policy.act(seen), atol=1e-5, rtol=1e-5)
        assert actions.dtype == np.float32
        assert (np.abs(actions) <= 3.0).all()


def test_names_are_in_the_file(files: tuple[Path, Path]) -> None:
    model = onnx.load(str(files[1]))
    facts = {entry.key: entry.value for entry in model.metadata_props}
    card = load_policy(files[0]).card
    assert json.loads(facts["observation_names"]) == list(card.observation.names)
    assert json.loads(facts["action_names"]) == list(card.action.names)


def test_it_runs_without_pytorch(files: tuple[Path, Path]) -> None:
    """OnnxPolicy works where torch cannot be imported."""
    code = (
        "import sys; sys.modules['torch'] = None; import numpy as np; from pathlib import Path; "
        "from shapechanger.policy import load_policy; "
        f"print(load_policy(Path({str(files[1])!r})).act(np.zeros((1, 4))).shape)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.stdout.strip() == "(1, 1)", done.stderr


def test_a_card_of_another_size_is_refused(files: tuple[Path, Path], tmp_path: Path) -> None:
    model = onnx.load(str(files[1]))
    for entry in model.metadata_props:
        if entry.key == "shapechanger":
            card = json.loads(entry.value)
            card["action"] = card["observation"]
            entry.value = json.dumps(card)
    (tmp_path / "mine.onnx").write_bytes(model.SerializeToString())
    for name, text in (("mine.onnx", "its card says"), ("none.onnx", "There is no policy file")):
        with pytest.raises(PolicyError, match=text):
            load_policy(tmp_path / name)
