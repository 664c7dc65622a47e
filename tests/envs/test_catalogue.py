"""The catalogue of ids."""

from __future__ import annotations

import itertools
from typing import Any

import gymnasium as gym
import pytest

from shapechanger.envs import CATALOGUE, find
from shapechanger.errors import UnknownName
from shapechanger.morphology.certificate import fingerprint


def _model(env_id: str, **arguments: Any) -> Any:
    with gym.make(env_id, **arguments) as env:
        return env.unwrapped.model


def test_every_id_has_the_body_of_its_name_and_no_other_has_it() -> None:
    """An id gives the same model as the id of its family, such as `Ant`, with its body."""
    prints = {env_id: fingerprint(_model(env_id)) for env_id in CATALOGUE}
    passive = _model("shapechanger/Ant-v1", body="ExtendedAntPassive")
    prints["passive"] = fingerprint(passive)
    for (one, print_), (other, other_print) in itertools.combinations(prints.items(), 2):
        assert print_ != other_print, f"{one} and {other}"
    for env_id, entry in CATALOGUE.items():
        first = f"shapechanger/{entry.family}-v1"
        assert prints[env_id] == fingerprint(_model(first, body=entry.name))


@pytest.mark.parametrize(
    "name",
    ["BigAnt", "BigAnt-v1", "shapechanger/BigAnt-v1", "shapechanger:shapechanger/BigAnt-v1"],
)
def test_an_entry_is_found_by_any_form_of_its_name(name: str) -> None:
    """Short names, versions and module prefixes are accepted; errors suggest the nearest name."""
    assert find(name) is CATALOGUE["shapechanger/BigAnt-v1"]
    with pytest.raises(UnknownName, match=r"'BigAnd'. Did you mean 'BigAnt'\? There are: .*Ant"):
        find(name.replace("BigAnt", "BigAnd"))


@pytest.mark.parametrize("env_id", CATALOGUE)
def test_thresholds_and_limits_are_gymnasiums(env_id: str) -> None:
    """Reward thresholds and time limits equal Gymnasium's v5."""
    entry, spec = CATALOGUE[env_id], gym.spec(env_id)
    theirs = gym.spec(f"{entry.family}-v5")
    assert spec.reward_threshold == entry.reward_threshold == theirs.reward_threshold
    assert spec.max_episode_steps == theirs.max_episode_steps == 1000
