"""Pendulums with other bodies."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

from shapechanger.contract.testing import examine
from shapechanger.errors import MorphologyError
from shapechanger.morphology import Lock, Remove, Split


def test_a_split_pole_has_two_hinges() -> None:
    """Both hinges are observed, and the env keeps all promises of the exam."""
    body = Split("pole", "upper_pole")
    env = gym.make("shapechanger/InvertedPendulum-v1", body=body)
    assert env.observation_space.shape == (6,)
    observation, _ = env.reset(seed=0)
    assert observation.shape == (6,)
    names = env.get_wrapper_attr("observation_layout").names
    assert names[:3] == ("slider/position", "hinge/angle", "upper_pole/angle")
    assert np.isfinite(observation).all()
    assert len(list(examine(lambda: gym.make("shapechanger/InvertedPendulum-v1", body=body)))) == 7


@pytest.mark.parametrize("edit", [Lock("hinge"), Remove("pole"), Lock("slider")])
def test_a_pendulum_without_cart_or_pole_is_refused(edit: Lock | Remove) -> None:
    """The slide and the hinge are needed for the task."""
    with pytest.raises(MorphologyError, match="needs a cart on a slide and a pole on a hinge"):
        gym.make("shapechanger/InvertedPendulum-v1", body=edit)
