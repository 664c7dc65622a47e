"""Policies in files: what was saved acts as what was trained."""

from __future__ import annotations

import base64
import io
import json
import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import shapechanger
from shapechanger.errors import CorruptStudy
from shapechanger.transfer.learners.cloning import load_clone
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.learners.policy_file import TrainedPolicy, load_policy, save_policy
from shapechanger.transfer.learners.ppo import train
from shapechanger.transfer.learners.settings import PpoSettings
from tests.transfer.studies import SMALL, TINY, TINY_NORMALISED


def trained(settings: PpoSettings, seed: int = 0) -> tuple[TrainedPolicy, list[Evaluation]]:
    """A policy that has learned for a second."""
    curve: list[Evaluation] = []
    policy = train(SMALL, "tiny", settings, 64, seed, on_evaluation=curve.append)
    return policy, curve


@pytest.mark.parametrize("settings", [TINY, TINY_NORMALISED], ids=["plain", "normalised"])
def test_a_policy_goes_round(settings: PpoSettings, tmp_path: Path) -> None:
    """Actions, statistics and card read back as they were."""
    policy, curve = trained(settings)
    save_policy(policy, tmp_path / "policy.zip")
    again = load_policy(tmp_path / "policy.zip")
    observations = np.random.default_rng(0).normal(size=(20, 4))
    np.testing.assert_array_equal(again.act(observations), policy.act(observations))
    assert again.card == policy.card
    assert (again.normalisation is None) == (settings is TINY)
    assert [e.steps for e in curve] == [0, 32, 64]
    assert again.card.steps == 64


def test_normalised_policies_take_plain_observations(tmp_path: Path) -> None:
    """The statistics are part of the policy: numbers far away act otherwise."""
    policy, _ = trained(TINY_NORMALISED)
    assert policy.normalisation is not None
    near, far = policy.act(np.zeros((1, 4))), policy.act(np.full((1, 4), 0.05))
    assert not np.array_equal(near, far)


def test_the_seed_decides_the_training() -> None:
    """The same seed gives the same weights, another seed others."""
    observations = np.random.default_rng(0).normal(size=(5, 4))
    first, again, other = (trained(TINY, seed)[0].act(observations) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("kind", ["missing", "text", "zip"])
def test_what_is_no_policy_is_refused(tmp_path: Path, kind: str) -> None:
    """A missing file, a text, and a zip of something else."""
    path = tmp_path / "policy.zip"
    if kind == "text":
        path.write_text("not a policy")
    if kind == "zip":
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("thesis.tex", "precious")
    with pytest.raises(CorruptStudy, match=r"policy\.zip"):
        load_policy(path)


SHIPPED = Path(shapechanger.__file__).parent / "envs"


@pytest.mark.parametrize(
    "path", sorted(SHIPPED.glob("finger/policies/*.zip")), ids=lambda p: p.stem
)
def test_shipped_policies_load_without_trust(path: Path) -> None:
    """They act the same either way."""
    safe, trusted = load_policy(path), load_policy(path, trust=True)
    seen = np.random.default_rng(0).normal(size=(3, safe.card.observation.size))
    np.testing.assert_array_equal(safe.act(seen), trusted.act(seen))


@pytest.mark.parametrize("path", sorted(SHIPPED.glob("vehicle/clones/*.zip")), ids=lambda p: p.stem)
def test_shipped_clones_load(path: Path) -> None:
    """Their weights are read without unpickling."""
    assert load_clone(path).card.framing.width > 0


class Malicious:
    """Leaves a file behind when it is unpickled."""

    def __init__(self, trace: Path) -> None:
        self._trace = trace

    def __reduce__(self) -> tuple[object, ...]:
        """Call `Path.touch` on unpickling."""
        return Path.touch, (self._trace,)


def rewritten(policy: Path, out: Path, change: Callable[[dict[str, bytes]], None]) -> None:
    """Copy a policy file with changed entries of the model's own zip."""
    with zipfile.ZipFile(policy) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(io.BytesIO(entries["model.zip"])) as archive:
        model = {name: archive.read(name) for name in archive.namelist()}
    change(model)
    inner = io.BytesIO()
    with zipfile.ZipFile(inner, "w") as archive:
        for name, content in model.items():
            archive.writestr(name, content)
    with zipfile.ZipFile(out, "w") as archive:
        for name, content in {**entries, "model.zip": inner.getvalue()}.items():
            archive.writestr(name, content)


def test_a_policy_that_would_run_code_is_refused(tmp_path: Path) -> None:
    """Nothing of it is unpickled, unless the user trusts it."""
    trace, bad = tmp_path / "trace", tmp_path / "bad.zip"

    def infect(model: dict[str, bytes]) -> None:
        data = json.loads(model["data"])
        pickled = base64.b64encode(pickle.dumps(Malicious(trace))).decode()
        data["ep_info_buffer"] = {":type:": "x", ":serialized:": pickled}
        model["data"] = json.dumps(data).encode()

    rewritten(SHIPPED / "finger" / "policies" / "reach.zip", bad, infect)
    with pytest.raises(CorruptStudy, match=r"bad\.zip contains a pickled reference to .*--trust"):
        load_policy(bad)
    assert not trace.exists()
    load_policy(bad, trust=True)
    assert trace.exists()


def test_an_unknown_entry_is_refused(tmp_path: Path) -> None:
    """Stable-Baselines3 would load any entry that ends in .pth."""
    bad = tmp_path / "bad.zip"
    rewritten(
        SHIPPED / "finger" / "policies" / "reach.zip", bad, lambda m: m.update({"more.pth": b""})
    )
    with pytest.raises(CorruptStudy, match=r"contains the entry 'more\.pth'"):
        load_policy(bad)


def test_a_damaged_pickle_is_refused(tmp_path: Path) -> None:
    """In one sentence."""
    bad = tmp_path / "bad.zip"

    def damage(model: dict[str, bytes]) -> None:
        data = json.loads(model["data"])
        data["ep_info_buffer"][":serialized:"] = base64.b64encode(b"\x80\x04x").decode()
        model["data"] = json.dumps(data).encode()

    rewritten(SHIPPED / "finger" / "policies" / "reach.zip", bad, damage)
    with pytest.raises(CorruptStudy, match="'ep_info_buffer' cannot be unpickled"):
        load_policy(bad)
