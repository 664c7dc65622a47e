"""Forward kinematics of the fingertip, the reward, and the order of an observation."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.errors import UnknownName
from shapechanger.finger import task
from shapechanger.finger.anatomy import JOINT_RANGE
from shapechanger.finger.model import FINGERTIP
from shapechanger.layout import Element
from tests.finger.commands import made

# Angles within and beyond the joint limits.
_ANGLES = st.tuples(*[st.floats(-2.0, 2.0)] * 4)


def test_fingertip_matches_the_simulator() -> None:
    model = made()
    data = mujoco.MjData(model)
    angles = np.random.default_rng(0).uniform(*JOINT_RANGE.T, (200, 4))
    places = []
    for q in angles:
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        places.append(data.site_xpos[model.site(FINGERTIP).id].copy())
    np.testing.assert_allclose(task.fingertip(angles), places, atol=1e-12)
    assert task.fingertip(angles.reshape(4, 50, 4)).shape == (4, 50, 3)


@given(angles=_ANGLES)
def test_jacobian_matches_finite_differences(angles: tuple[float, ...]) -> None:
    step = 1e-6
    moved = np.array(angles) + step * np.concatenate([np.eye(4), -np.eye(4)])
    there, back = task.fingertip(moved).reshape(2, 4, 3)
    expected = ((there - back) / (2.0 * step)).T
    np.testing.assert_allclose(task.fingertip_jacobian(angles), expected, atol=1e-9)
    np.testing.assert_allclose(task.fingertip_jacobian([[angles]]), [[expected]], atol=1e-9)


def test_nearness_grows_as_the_distance_shrinks() -> None:
    """Nearness grows fastest in the last millimetres, up to its weight per second."""
    distances = np.linspace(0.1, 0.0, 201)
    near = task.FingertipReward().terms(distances, 0.0, 0.0, 0.02)["reward_nearness"]
    gains = np.diff(near)
    assert (gains > 0.0).all()
    assert gains.argmax() == len(gains) - 1
    assert near[0] > 0.0
    assert task.FingertipReward().terms(0.0, 0.0, 0.0, 0.1)["reward_nearness"] == pytest.approx(5.0)


def test_effort_and_change_are_weighted() -> None:
    """Weights are costs per second, 0 for change by default; unknown weights are refused."""
    plain = task.FingertipReward().terms(0.01, 0.5, 1.0, 0.02)
    assert plain["reward_effort"] == pytest.approx(-0.01)
    assert plain["reward_change"] == 0.0
    other = task.FingertipReward.from_weights({"change": 5.0, "effort": 0})
    assert other.terms(0.01, 0.5, 1.0, 0.02)["reward_change"] == pytest.approx(-0.1)
    assert other.terms(0.01, 0.5, 1.0, 0.02)["reward_effort"] == 0.0
    assert other.nearness == task.FingertipReward().nearness
    with pytest.raises(UnknownName, match=r"'nearnes'. Did you mean 'nearness'"):
        task.FingertipReward.from_weights({"nearnes": 1.0})


def test_numbers_match_their_features() -> None:
    """Numbers have the order of their features, which name their elements."""
    parts = (4, 4, 7, 7, 7, 3)
    senses = task.FingerSenses(*(10.0 * i + np.arange(n) for i, n in enumerate(parts)))
    features = {f.name: f for f in task.features_of_senses()}
    found = dict(zip(features, senses.numbers(), strict=True))
    assert (found["PIP_flexion/angle"], found["MCP_abduction/velocity"]) == (2.0, 11.0)
    assert (found["EIP/tension"], found["FDP/length"], found["PI/command"]) == (22.0, 30.0, 46.0)
    assert found["fingertip/z"] == 52.0
    assert features["EIP/tension"].element == Element("tendon", "EIP")
