"""The catalogue of ids."""

from __future__ import annotations

import itertools
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from shapechanger.envs import CATALOGUE, find
from shapechanger.errors import UnknownName
from shapechanger.morphology.certificate import fingerprint


def _model(env_id: str, **arguments: Any) -> Any:
    with gym.make(env_id, **arguments) as env:
        return env.unwrapped.model


def test_no_two_ids_have_the_same_body() -> None:
    """All ids have different fingerprints."""
    prints = {env_id: fingerprint(_model(env_id)) for env_id in CATALOGUE}
    prints["passive"] = fingerprint(_model("shapechanger/ExtendedAnt-v1", actuated_extension=False))
    for (one, print_), (other, other_print) in itertools.combinations(prints.items(), 2):
        assert print_ != other_print, f"{one} and {other}"


def test_ids_have_the_bodies_of_their_names() -> None:
    """An id gives the same model as its family's first id with that body."""
    for env_id, entry in CATALOGUE.items():
        first = f"shapechanger/{entry.family}-v1"
        assert fingerprint(_model(env_id)) == fingerprint(_model(first, body=entry.name))


@pytest.mark.parametrize(
    "name",
    ["BigAnt", "BigAnt-v1", "shapechanger/BigAnt-v1", "shapechanger:shapechanger/BigAnt-v1"],
)
def test_an_entry_is_found_by_any_form_of_its_name(name: str) -> None:
    """Short names, versions and module prefixes are accepted."""
    assert find(name) is CATALOGUE["shapechanger/BigAnt-v1"]


def test_an_unknown_name_is_refused() -> None:
    """The error suggests the nearest name."""
    with pytest.raises(UnknownName, match=r"'BigAnd'. Did you mean 'BigAnt'\? There are: .*Ant"):
        find("shapechanger/BigAnd-v1")


@pytest.mark.parametrize("env_id", CATALOGUE)
def test_thresholds_and_limits_are_gymnasiums(env_id: str) -> None:
    """Reward thresholds and time limits equal Gymnasium's v5."""
    entry, spec = CATALOGUE[env_id], gym.spec(env_id)
    theirs = gym.spec(f"{entry.family}-v5")
    assert spec.reward_threshold == entry.reward_threshold == theirs.reward_threshold
    assert spec.max_episode_steps == theirs.max_episode_steps == 1000


def test_an_episode_is_truncated_at_its_limit() -> None:
    """The time limit truncates and does not terminate."""
    with gym.make("shapechanger/InvertedPendulum-v1", max_episode_steps=3) as env:
        env.reset(seed=0)
        ends = [env.step(np.zeros(1, np.float32))[2:4] for _ in range(3)]
    assert ends == [(False, False), (False, False), (False, True)]


@pytest.mark.parametrize(
    ("env_id", "factor"),
    [("InvertedPendulum", 1.0), ("SmallInvertedPendulum", 0.5), ("BigInvertedPendulum", 2.0)],
)
def test_poles_have_their_lengths(env_id: str, factor: float) -> None:
    """Poles are 0.6 m times the factor, with a lean of 1 mm."""
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
def test_shanks_have_their_lengths(env_id: str, lengths: dict[str, float]) -> None:
    """Shanks are 0.4 m along x and along y, times the factor."""
    model = _model(f"shapechanger/{env_id}-v1")
    for name, factor in lengths.items():
        (geom,) = (g for g in range(model.ngeom) if model.geom_bodyid[g] == model.body(name).id)
        assert 2.0 * model.geom_size[geom, 1] == pytest.approx(factor * 0.4 * np.sqrt(2.0))
        assert model.geom_size[geom, 0] == 0.08
