"""Settings of learners: changes, errors and presets."""

from __future__ import annotations

from pathlib import Path

import gymnasium as gym
import pytest

import shapechanger  # noqa: F401 - registers the envs.
from shapechanger.errors import StudyError
from shapechanger.transfer.learners.presets import (
    LEARNERS,
    learner_settings,
    resolve_learner,
    tuned_on,
    tuning_text,
)
from shapechanger.transfer.learners.settings import PpoSettings


def test_some_settings_change_and_others_stay() -> None:
    """Values are converted as from TOML: lists to tuples, integers to floats."""
    _, changed = resolve_learner("ppo-run", {"net_arch": [32], "learning_rate": 1})
    assert isinstance(changed, PpoSettings)
    assert (changed.net_arch, changed.learning_rate) == ((32,), 1.0)
    assert changed.n_steps == learner_settings("ppo-run").n_steps  # type: ignore[union-attr]
    assert resolve_learner("ppo-run", {}) == ("ppo-run", learner_settings("ppo-run"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('preset = "sac"\n\nlearning_rat = 1e-3\n', "line 3: No setting of sac matches"),
        ('preset = "sac"\ngamma = "much"\n', "line 2: The settings of sac are wrong"),
        ('# sak\npreset = "sak"\n', "line 2: No learner matches 'sak'. Did you mean 'sac'?"),
        ('preset = "sac"\nn_envs = 0\n', "mine.toml: The settings .* and one episode\\.$"),
    ],
)
def test_a_wrong_file_has_a_line(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(text)
    with pytest.raises(StudyError, match=message):
        resolve_learner(str(tmp_path / "mine.toml"), {})


def test_every_learner_says_what_it_was_tuned_on() -> None:
    """The envs exist, and the text states whether an env is one of them."""
    for learner in LEARNERS:
        for name in tuned_on(learner):
            assert f"shapechanger/{name}-v1" in gym.registry
    assert tuning_text("ppo-swim", "shapechanger/Swimmer-v1") == (
        "The settings were tuned on Swimmer."
    )
    assert tuning_text("ppo-run", "shapechanger/Hopper-v1").endswith("not on Hopper.")
    assert "It is not stated" in tuning_text("mine", "shapechanger/Ant-v1")
