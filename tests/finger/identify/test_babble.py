"""Babbling of a finger's joints."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import shapechanger  # noqa: F401 - Registers the ids.
from shapechanger.errors import FingerError, LayoutError, UnknownName
from shapechanger.finger.anatomy import JOINT_RANGE, JOINTS
from shapechanger.finger.controller import FingerBabble
from shapechanger.finger.identify.log import record_babble
from shapechanger.layout import Feature, Layout
from tests.finger.identify.logs import recorded


@pytest.mark.parametrize("actions", ["impedance", "tension", "length"])
@pytest.mark.parametrize("finger_seed", [0, 7])
def test_every_joint_moves_far_and_on_its_own(actions: str, finger_seed: int) -> None:
    """Joints cover half of their range, and move as independently as the hood allows.

    A rig extends the knuckle with 14 N against flexors and stiff tissue: it covers a third.
    """
    log, _ = recorded(10.0, gap="real-like", finger_seed=finger_seed, actions=actions)
    low, high = np.percentile(log.angles, [5.0, 95.0], axis=0)
    share = (high - low) / (JOINT_RANGE[:, 1] - JOINT_RANGE[:, 0])
    assert (share > [0.33, 0.5, 0.5, 0.5]).all()
    correlation = np.corrcoef(log.angles.T) - np.eye(4)
    assert abs(correlation[2, 3]) < 0.97  # Middle and end joint.
    correlation[2, 3] = correlation[3, 2] = 0.0
    assert np.abs(correlation).max() < 0.8
    assert (log.tensions > 1.0).mean() > 0.88  # Tendons are rarely slack.


def test_the_seed_determines_the_motion() -> None:
    layout = Layout(tuple(Feature(f"{name}/angle", "rad") for name in JOINTS))
    first, same, other = (FingerBabble(layout, seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first(np.zeros(4)), same(np.zeros(4)))
    assert np.abs(first.posture(1.0) - other.posture(1.0)).max() > 0.01
    postures = np.array([first.posture(t) for t in np.linspace(0.0, 10.0, 50)])
    assert (postures > JOINT_RANGE[:, 0]).all()
    assert (postures < JOINT_RANGE[:, 1]).all()
    with pytest.raises(UnknownName, match="MCP_flexion/angle"):
        FingerBabble(Layout((Feature("thigh/angle", "rad"),)))


@pytest.mark.parametrize(
    ("env", "error", "text"),
    [
        (("shapechanger/Finger-v1", {"goal": True}), FingerError, "omit `goal`"),
        (("Pendulum-v1", {}), LayoutError, "Pendulum-v1 publishes no observation_layout"),
        (("shapechanger/Finger-v1", {}), FingerError, r"ended after 2\.0 s of 3 s\.$"),
    ],
)
def test_envs_that_give_no_log_are_refused(
    env: tuple[str, dict[str, Any]], error: type[Exception], text: str
) -> None:
    """Goals, an env without names and one that ends too early are refused with the reason."""
    with gym.make(env[0], **env[1]) as made, pytest.raises(error, match=text):
        record_babble(made, 3.0)
