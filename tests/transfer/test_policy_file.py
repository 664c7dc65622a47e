"""Policy files and exports: round trips, and damaged and malicious files that are refused."""

from __future__ import annotations

import json
import os
import pickle
import random
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import onnx
import pytest
from safetensors import numpy as safetensors

from shapechanger.errors import PolicyError
from shapechanger.finger.task import POLICIES
from shapechanger.policy import OnnxPolicy, load_policy, read_tensors, save_policy, tensor_bytes
from shapechanger.transfer.export import export_onnx
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.learners.policy_file import TrainedPolicy
from shapechanger.transfer.learners.sb3 import Sb3Learner
from shapechanger.transfer.learners.settings import PpoSettings
from tests.demos.cloning.data import clone_card
from tests.transfer.studies import SMALL, TINY, TINY_NORMALISED


def trained(settings: PpoSettings, seed: int = 0) -> tuple[TrainedPolicy, list[Evaluation]]:
    curve: list[Evaluation] = []
    policy = Sb3Learner("tiny", settings).train(SMALL, 64, seed, on_evaluation=curve.append)
    return policy, curve


@pytest.mark.parametrize("settings", [TINY, TINY_NORMALISED], ids=["plain", "normalised"])
def test_a_policy_round_trips(settings: PpoSettings, tmp_path: Path) -> None:
    policy, curve = trained(settings)
    save_policy(policy, tmp_path / "policy.safetensors")
    again = load_policy(tmp_path / "policy.safetensors")
    observations = np.random.default_rng(0).normal(size=(20, 4))
    np.testing.assert_array_equal(again.act(observations), policy.act(observations))
    assert again.card == policy.card
    assert (again.normalisation is None) == (settings is TINY)
    assert [e.steps for e in curve] == [0, 32, 64]
    assert again.card.steps == 64


def test_actions_equal_the_model() -> None:
    policy, _ = trained(TINY)
    network: Any = policy.model.policy
    observations = np.random.default_rng(0).normal(size=(50, 4))
    for factor, clipped in ((1.0, False), (1000.0, True)):
        network.action_net.weight.data *= factor
        expected, _ = policy.model.predict(observations, deterministic=True)
        assert (np.abs(expected) == 1.0).any() == clipped
        # The pendulum's motor takes -3 to 3 N.
        np.testing.assert_array_equal(policy.act(observations), 3.0 * expected)


def test_loading_leaves_random_numbers_alone() -> None:
    random.seed(5)
    before = random.getstate()
    load_policy(POLICIES["reach"])
    assert random.getstate() == before


def _refusal(path: Path) -> str:
    with pytest.raises(PolicyError, match=f"{path.name} is not a policy that") as refusal:
        load_policy(path)
    text = str(refusal.value)
    assert text.isprintable()
    return text


def _refused(tmp_path: Path, change: Callable[[Any], object] = lambda _: None, **card: Any) -> str:
    """Change tensors and the card of a finger's policy, with a valid hash; return the refusal."""
    content = POLICIES["reach"].read_bytes()
    length = int.from_bytes(content[:8], "little")
    metadata = json.loads(content[8 : 8 + length])["__metadata__"]
    tensors = safetensors.load(content)
    change(tensors)
    path = tmp_path / "other.safetensors"
    path.write_bytes(
        tensor_bytes(tensors, json.dumps({**json.loads(metadata["card"]), **card}).encode())
    )
    return _refusal(path)


def test_a_card_of_another_body_is_refused(tmp_path: Path) -> None:
    layout = msgspec.to_builtins(load_policy(POLICIES["track"]).card.observation)
    assert "its observation has 38 numbers, and its layout" in _refused(
        tmp_path, observation=layout
    )


_BIAS = "policy.action_net.bias"
_MEAN = "normalisation.observation.mean"
_LOW = "spaces.observation.low"


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda t: t.update({_BIAS: t[_BIAS] * np.float32(np.nan)}), "must be finite"),
        (lambda t: t.update({_MEAN: t[_MEAN] * np.inf}), "must be finite"),
        (lambda t: t.update({_LOW: t[_LOW] * np.float32(np.nan)}), "must be finite"),
        (lambda t: t.update({_BIAS: t[_BIAS].astype(np.float64)}), "float64, not torch.float32"),
        (lambda t: t.update({_BIAS: t[_BIAS].astype(np.int32)}), "int32, not torch.float32"),
        (lambda t: t.update({_LOW: np.zeros(38, np.int8)}), "bounds of the observation are int8"),
        (lambda t: t.update({_MEAN: np.zeros(3)}), "statistics of the observation"),
        (lambda t: t.pop(_MEAN), "it lacks 'normalisation.observation.mean'"),
        (lambda t: t.pop(_LOW), "it lacks 'spaces.observation.low'"),
        (
            lambda t: [t.pop(name) for name in [*t] if name.startswith("normalisation")],
            "it has no statistics",
        ),
    ],
)
def test_unsuitable_numbers_are_refused(
    change: Callable[[dict[str, Any]], None], text: str, tmp_path: Path
) -> None:
    """A policy with NaN, other types or no normalisation would act, but wrongly."""
    assert text in _refused(tmp_path, change)


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"net_arch": [100_000, 100_000]}, "its card needs at least 10003800000 weights"),
        ({"net_arch": [-1]}, "negative dimension"),
        ({"net_arch": [8]}, "Error(s) in loading state_dict"),
        ({"n_envs": 10**6, "eval_every": 10**9}, "1000000 envs, more than 4096"),
        ({"batch_size": -5}, "`batch_size` must be greater than 1"),
        ({"algorithm": "os:system", "type": "imported"}, "is a function"),
        (
            {"algorithm": "stable_baselines3:SAC", "type": "imported"}
            | {"arguments": {"buffer_size": 10**15}},
            "llocat",
        ),
    ],
)
def test_harmful_settings_are_refused(settings: dict[str, Any], text: str, tmp_path: Path) -> None:
    """Settings that need too much memory, name a function or do not fit are refused."""
    known = json.loads(msgspec.json.encode(load_policy(POLICIES["reach"]).card.settings))
    assert text in _refused(tmp_path, settings=known | settings)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("onnx")
    policy = Sb3Learner("ppo", TINY_NORMALISED).train(SMALL, 32, 0)
    save_policy(policy, folder / "policy.safetensors")
    export_onnx(policy, folder / "policy.onnx")
    return folder / "policy.safetensors", folder / "policy.onnx"


def test_onnx_actions_equal_pytorch(files: tuple[Path, Path]) -> None:
    """They agree to 1e-5 and are within the bounds."""
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


def test_an_onnx_file_names_its_features(files: tuple[Path, Path]) -> None:
    facts = {entry.key: entry.value for entry in onnx.load(str(files[1])).metadata_props}
    for side, layout in zip(
        ("observation", "action"), load_policy(files[0]).card.layouts, strict=True
    ):
        assert json.loads(facts[f"{side}_names"]) == list(layout.names)


def test_an_onnx_file_runs_without_pytorch(files: tuple[Path, Path]) -> None:
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
    for name, text in (("mine.onnx", "its card states"), ("none.onnx", "There is no policy file")):
        with pytest.raises(PolicyError, match=text):
            load_policy(tmp_path / name)


_GIB = 1 << 30
_ARRAYS = {"first": np.arange(4, dtype=np.float32), "second": np.ones((2, 2), np.float32)}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    made = tmp_path / "policy.safetensors"
    made.write_bytes(tensor_bytes(_ARRAYS, msgspec.json.encode(clone_card())))
    return made


def test_arrays_and_card_are_read(path: Path) -> None:
    card, arrays = read_tensors(path)
    assert card == clone_card()
    assert arrays.keys() == _ARRAYS.keys()
    for name, array in arrays.items():
        np.testing.assert_array_equal(array, _ARRAYS[name])


Header = dict[str, Any]


def _with(**fields: object) -> Callable[[Header], object]:
    return lambda header: header["first"].update(fields)


def _metadata(**fields: object) -> Callable[[Header], object]:
    return lambda header: header["__metadata__"].update(fields)


HEADERS: dict[str, Callable[[Header], object]] = {
    "overlapping arrays": _with(data_offsets=[16, 32]),
    "offsets beyond the file": _with(data_offsets=[0, 2**62]),
    "a shape of 2^64 numbers": _with(shape=[2**62, 4]),
    "numbers of eight bytes": _with(dtype="F64"),
    "a card without its hash": _metadata(card="not JSON"),
    "a wrong hash": _metadata(sha256="0" * 64),
    "no card": lambda header: header["__metadata__"].pop("card"),
    "a card with a line and a colour": _metadata(card="a\nb\x1b[31m"),
    "metadata that are a list": lambda header: header.update(__metadata__=[1]),
    "no metadata": lambda header: header.pop("__metadata__"),
}


class _Trap:
    """Ends the test run when it is unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return (os._exit, (1,))


FILES: dict[str, Callable[[bytes], bytes]] = {
    "half a header": lambda content: content[:60],
    "a byte more": lambda content: content + b"x",
    "a length beyond the file": lambda content: (2**40).to_bytes(8, "little") + content[8:],
    "a header that is a list": lambda _: (2).to_bytes(8, "little") + b"[]",
    "a header nested deeply": lambda _: (10**5).to_bytes(8, "little") + b"[" * 10**5,
    "a pickle": lambda _: pickle.dumps({"hands.bias": _Trap()}),
    "a header of 5 MB": lambda _: (5 << 20).to_bytes(8, "little") + b" " * (5 << 20),
}


@pytest.mark.parametrize("name", [*HEADERS, *FILES])
def test_a_damaged_file_is_refused(path: Path, name: str) -> None:
    content = path.read_bytes()
    path.write_bytes(FILES[name](content) if name in FILES else _forged(content, HEADERS[name]))
    _refusal(path)


def _forged(content: bytes, change: Callable[[Header], object]) -> bytes:
    length = int.from_bytes(content[:8], "little")
    header = json.loads(content[8 : 8 + length])
    change(header)
    text = json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + content[8 + length :]


def test_huge_files_pipes_and_devices_are_not_read(path: Path) -> None:
    """The file has 8 GiB, the pipe has no writer, and the device never ends."""
    with path.open("wb") as file:
        file.truncate(8 * _GIB)
    assert "more than the limit of 268435456" in _refusal(path)
    path.unlink()
    os.mkfifo(path)
    assert "not a regular file" in _refusal(path)
    path.unlink()
    path.symlink_to("/dev/zero")
    assert "not a regular file" in _refusal(path)
