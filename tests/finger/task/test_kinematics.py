"""Fingertip position, compared with the simulator, finite differences and values by hand."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.finger.anatomy import JOINT_RANGE, PHALANX_LENGTH_M
from shapechanger.finger.model import FINGERTIP
from shapechanger.finger.task import fingertip, fingertip_jacobian
from tests.finger.commands import made

_RIGHT = np.pi / 2
# Any posture, joint limits exceeded.
_ANGLES = st.tuples(*[st.floats(-2.0, 2.0)] * 4)


def test_fingertip_by_hand(monkeypatch: pytest.MonkeyPatch) -> None:
    """Straight, each joint flexed to a right angle, and full abduction."""
    monkeypatch.setattr("shapechanger.finger.task.PHALANX_LENGTH_M", (4.0, 2.0, 1.0))
    expected = {
        (0.0, 0.0, 0.0, 0.0): (7.0, 0.0, 0.0),
        (_RIGHT, 0.0, 0.0, 0.0): (0.0, 0.0, -7.0),
        (0.0, _RIGHT, 0.0, 0.0): (0.0, 7.0, 0.0),
        (0.0, 0.0, _RIGHT, 0.0): (4.0, 0.0, -3.0),
        (0.0, 0.0, 0.0, _RIGHT): (6.0, 0.0, -1.0),
        (0.0, 0.0, _RIGHT, _RIGHT): (3.0, 0.0, -2.0),
    }
    for angles, place in expected.items():
        np.testing.assert_allclose(fingertip(angles), place, atol=1e-12)


def test_fingertip_matches_the_simulator() -> None:
    """The position equals the site's in MuJoCo, one by one and batched."""
    model = made()
    data = mujoco.MjData(model)
    angles = np.random.default_rng(0).uniform(*JOINT_RANGE.T, (200, 4))
    places = []
    for q in angles:
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        places.append(data.site_xpos[model.site(FINGERTIP).id].copy())
    np.testing.assert_allclose(fingertip(angles), places, atol=1e-12)
    one_by_one = [fingertip(q) for q in angles]
    np.testing.assert_allclose(fingertip(angles), one_by_one, atol=1e-15)
    shaped = fingertip(angles.reshape(4, 50, 4))
    assert shaped.shape == (4, 50, 3)


@given(angles=_ANGLES)
def test_jacobian_matches_finite_differences(angles: tuple[float, ...]) -> None:
    """The Jacobian equals central differences at any angles."""
    step = 1e-6
    moved = np.array(angles) + step * np.concatenate([np.eye(4), -np.eye(4)])
    there, back = fingertip(moved).reshape(2, 4, 3)
    expected = ((there - back) / (2.0 * step)).T
    found = fingertip_jacobian(angles)
    np.testing.assert_allclose(found, expected, atol=1e-9)


@given(angles=_ANGLES)
def test_no_posture_reaches_beyond_the_finger(angles: tuple[float, ...]) -> None:
    """The distance is at most the finger's length, and flexing the knuckle does not change it."""
    place = fingertip(angles)
    assert np.linalg.norm(place) <= sum(PHALANX_LENGTH_M) + 1e-12
    straight = fingertip((0.0, *angles[1:]))
    assert np.linalg.norm(place) == pytest.approx(np.linalg.norm(straight))
    assert place[1] == straight[1]


def test_jacobian_is_batched() -> None:
    """Angles of shape (..., 4) give Jacobians of shape (..., 3, 4)."""
    angles = np.random.default_rng(0).uniform(-1.0, 1.0, (2, 3, 4))
    found = fingertip_jacobian(angles)
    assert found.shape == (2, 3, 3, 4)
    np.testing.assert_allclose(found[1, 2], fingertip_jacobian(angles[1, 2]))
