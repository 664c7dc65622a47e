"""Settings of learners: changes, errors and presets."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import pytest

import shapechanger  # noqa: F401 - registers the envs.
from shapechanger.errors import StudyError, UnknownName
from shapechanger.transfer.learners.settings import (
    LEARNERS,
    TUNED_ON,
    PpoSettings,
    learner_settings,
    resolve_learner,
    tuning_text,
)


def test_some_settings_change_and_others_stay() -> None:
    """Values are converted as from TOML: lists to tuples, integers to floats."""
    _, changed = resolve_learner("ppo-run", {"net_arch": [32], "learning_rate": 1})
    assert isinstance(changed, PpoSettings)
    assert (changed.net_arch, changed.learning_rate) == ((32,), 1.0)
    assert changed.n_steps == learner_settings("ppo-run").n_steps  # type: ignore[union-attr]
    assert resolve_learner("ppo-run", {}) == ("ppo-run", learner_settings("ppo-run"))


@pytest.mark.parametrize(
    ("changed", "kind", "words"),
    [
        ({"learning_rat": 1.0}, UnknownName, "'learning_rate'"),
        ({"learning_rate": "fast"}, StudyError, "learning_rate"),
        ({"n_envs": 0}, StudyError, "at least one env"),
    ],
)
def test_wrong_settings_are_refused(
    changed: dict[str, Any], kind: type[Exception], words: str
) -> None:
    """The message names the setting."""
    with pytest.raises(kind, match=words):
        resolve_learner("ppo-run", changed)


def test_every_learner_states_its_tuning_envs() -> None:
    """The envs exist, and the text states whether an env is one of them."""
    assert set(TUNED_ON) == set(LEARNERS)
    for names in TUNED_ON.values():
        for name in names:
            assert f"shapechanger/{name}-v1" in gym.registry
    assert tuning_text("ppo-swim", "shapechanger/Swimmer-v1") == (
        "The settings were tuned on Swimmer."
    )
    assert tuning_text("ppo-run", "shapechanger/Hopper-v1").endswith("not on Hopper.")
    assert "It is not stated" in tuning_text("mine", "shapechanger/Ant-v1")
