"""Policies in files: what was saved acts as what was trained."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from shapechanger.errors import CorruptStudy
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
