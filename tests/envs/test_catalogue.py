"""The ids: that they are found, differ, and are what they say."""

from __future__ import annotations

import itertools
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from shapechanger.envs import CATALOGUE, find
from shapechanger.errors import UnknownName
from shapechanger.morphology.effective import fingerprint


def _model(env_id: str, **arguments: Any) -> Any:
    with gym.make(env_id, **arguments) as env:
        return env.unwrapped.model


def test_no_two_ids_are_the_same_body() -> None:
    """A transfer between any two crosses something."""
    prints = {env_id: fingerprint(_model(env_id)) for env_id in CATALOGUE}
    prints["passive"] = fingerprint(_model("shapechanger/ExtendedAnt-v1", actuated_extension=False))
    for (one, print_), (other, other_print) in itertools.combinations(prints.items(), 2):
        assert print_ != other_print, f"{one} and {other}"


def test_a_body_has_the_same_fingerprint_each_time() -> None:
    """Nothing random goes into a model, and an id is the body of its name."""
    for env_id, entry in CATALOGUE.items():
        first = f"shapechanger/{entry.family}-v1"
        assert fingerprint(_model(env_id)) == fingerprint(_model(first, body=entry.name))


@pytest.mark.parametrize(
    "name",
    ["BigAnt", "BigAnt-v1", "shapechanger/BigAnt-v1", "shapechanger:shapechanger/BigAnt-v1"],
)
def test_an_entry_is_found_by_what_one_types(name: str) -> None:
    """The short name will do."""
    assert find(name) is CATALOGUE["shapechanger/BigAnt-v1"]


def test_a_misspelt_name_is_told_what_there_is() -> None:
    """With the nearest spelling first."""
    with pytest.raises(UnknownName, match=r"'BigAnd'. Did you mean 'BigAnt'\? There are: .*Ant"):
        find("shapechanger/BigAnd-v1")


@pytest.mark.parametrize("env_id", CATALOGUE)
def test_thresholds_and_clocks_are_gymnasiums(env_id: str) -> None:
    """An episode of 1,000 steps, solved at the return that counts there."""
    entry, spec = CATALOGUE[env_id], gym.spec(env_id)
    theirs = gym.spec(f"{entry.family}-v5")
    assert spec.reward_threshold == entry.reward_threshold == theirs.reward_threshold
    assert spec.max_episode_steps == theirs.max_episode_steps == 1000


def test_an_episode_ends_with_the_clock() -> None:
    """Truncated, not terminated: the task itself goes on."""
    with gym.make("shapechanger/InvertedPendulum-v1", max_episode_steps=3) as env:
        env.reset(seed=0)
        ends = [env.step(np.zeros(1, np.float32))[2:4] for _ in range(3)]
    assert ends == [(False, False), (False, False), (False, True)]


@pytest.mark.parametrize(
    ("env_id", "factor"),
    [("InvertedPendulum", 1.0), ("SmallInvertedPendulum", 0.5), ("BigInvertedPendulum", 2.0)],
)
def test_poles_are_as_long_as_they_say(env_id: str, factor: float) -> None:
    """0.6 m, half of it, twice of it; the lean of 1 mm is the same for all."""
    model = _model(f"shapechanger/{env_id}-v1")
    (pole,) = (g for g in range(model.ngeom) if model.body(model.geom_bodyid[g]).name == "pole")
    length = 2.0 * model.geom_size[pole, 1]
    assert length == pytest.approx(np.hypot(factor * 0.6, 0.001), rel=1e-12)
    centre = model.body("pole").ipos
    np.testing.assert_allclose(centre, [0.0005, 0.0, factor * 0.3], atol=1e-12)


@pytest.mark.parametrize(
    ("env_id", "lengths"),
    [
        ("Ant", {"shank_4": 1.0, "shank_1": 1.0, "shank_2": 1.0, "shank_3": 1.0}),
        ("BigAnt", {"shank_4": 2.0, "shank_1": 2.0, "shank_2": 2.0, "shank_3": 2.0}),
        ("AmputatedAnt", {"shank_4": 0.25, "shank_1": 1.0, "shank_2": 1.0, "shank_3": 1.0}),
    ],
)
def test_shanks_are_as_long_as_they_say(env_id: str, lengths: dict[str, float]) -> None:
    """A shank of the ant is 0.4 m along x and along y."""
    model = _model(f"shapechanger/{env_id}-v1")
    for name, factor in lengths.items():
        (geom,) = (g for g in range(model.ngeom) if model.geom_bodyid[g] == model.body(name).id)
        assert 2.0 * model.geom_size[geom, 1] == pytest.approx(factor * 0.4 * np.sqrt(2.0))
        assert model.geom_size[geom, 0] == 0.08
