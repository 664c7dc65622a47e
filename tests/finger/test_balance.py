"""Tensions that balance a torque."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog, lsq_linear

from shapechanger.finger.anatomy import (
    JOINTS,
    LEAST_TENSION_N,
    MOMENT_ARMS,
    MOST_TENSION_N,
    TENDONS,
)
from shapechanger.finger.tensions import (
    co_contraction,
    spans_all_torques,
    tensions_for_torque,
)

_MICRO = 1e-6


def test_the_nominal_finger_spans_all_torques() -> None:
    assert spans_all_torques(MOMENT_ARMS)
    for j in range(len(JOINTS)):
        for sign in (1.0, -1.0):
            torque = sign * 0.002 * np.eye(4)[j]
            assert tensions_for_torque(MOMENT_ARMS, torque, 0.0, 1e3)[1]


def test_co_contraction_has_no_torque() -> None:
    tensions = co_contraction(MOMENT_ARMS)
    assert tensions is not None
    assert tensions.min() == pytest.approx(1.0)
    np.testing.assert_allclose(MOMENT_ARMS.T @ tensions, 0.0, atol=1e-12)


def test_necessary_tendons() -> None:
    """Without FDP, FDS or PI, some torques are out of reach; the other tendons are redundant."""
    needed = [
        name
        for i, name in enumerate(TENDONS)
        if not spans_all_torques(np.delete(MOMENT_ARMS, i, axis=0))
    ]
    assert needed == ["FDP", "FDS", "PI"]


def test_arms_that_do_not_span_are_detected() -> None:
    """`spans_all_torques` is false, and there is no co-contraction."""
    assert not spans_all_torques(np.abs(MOMENT_ARMS))
    assert co_contraction(np.abs(MOMENT_ARMS)) is None
    numb = MOMENT_ARMS.copy()
    numb[:, 3] = 0.0
    assert co_contraction(numb) is not None
    assert not spans_all_torques(numb)
    assert not spans_all_torques(np.zeros((7, 4)))
    # Values often quoted: they extend the middle and last joints too strongly to be balanced.
    quoted = np.array(
        [
            (11.1, 1.1, 7.9, 4.1),
            (11.9, 1.7, 6.2, 0.0),
            (-9.0, -1.3, -2.6, -1.9),
            (-8.6, 0.2, -2.8, -2.2),
            (9.3, 4.8, -1.8, -0.7),
            (3.7, 6.1, 0.0, 0.0),
            (6.6, -5.8, -2.6, -1.6),
        ]
    )
    assert not spans_all_torques(quoted * 1e-3)


@given(seed=st.integers(0, 10_000))
def test_spanning_agrees_with_linear_programming(seed: int) -> None:
    """`spans_all_torques` agrees with solving for random torques."""
    rng = np.random.default_rng(seed)
    arms = MOMENT_ARMS * (1.0 + rng.uniform(-0.8, 0.8, MOMENT_ARMS.shape))
    directions = np.concatenate([np.eye(4), -np.eye(4)]) * 1e-3
    given_all = all(
        linprog(np.zeros(7), A_eq=1e3 * arms.T, b_eq=1e3 * torque, bounds=(0.0, None)).success
        for torque in directions
    )
    assert spans_all_torques(arms) == given_all


def _problem(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Draw arms, a torque and bounds; half of the torques are feasible."""
    rng = np.random.default_rng(seed)
    arms = MOMENT_ARMS * (1.0 + rng.uniform(-0.3, 0.3, MOMENT_ARMS.shape))
    low = rng.uniform(0.0, 2.0, 7)
    high = low + rng.uniform(0.5, 20.0, 7)
    torque = arms.T @ rng.uniform(low, high)
    if seed % 2:
        torque = torque * rng.uniform(1.0, 3.0) + rng.uniform(-0.1, 0.1, 4)
    return arms, torque, low, high


@pytest.mark.parametrize("seed", range(40))
def test_tensions_are_within_bounds(seed: int) -> None:
    """The flag states whether the tensions give the torque."""
    arms, torque, low, high = _problem(seed)
    tensions, is_enough = tensions_for_torque(arms, torque, low, high)
    assert (tensions >= low - 1e-9).all()
    assert (tensions <= high + 1e-6).all()
    off = float(np.abs(arms.T @ tensions - torque).max())
    assert is_enough == (off <= _MICRO)
    best = lsq_linear(1e3 * arms.T, 1e3 * torque, bounds=(low, high), method="bvls", tol=1e-14)
    nearest = float(np.linalg.norm(arms.T @ best.x - torque))
    assert np.linalg.norm(arms.T @ tensions - torque) <= nearest + _MICRO
    if seed % 2 == 0:
        assert is_enough


@pytest.mark.parametrize("seed", range(0, 40, 2))
def test_tensions_are_minimal(seed: int) -> None:
    """No other solution has less co-contraction."""
    arms, torque, low, high = _problem(seed)
    tensions, _ = tensions_for_torque(arms, torque, low, high)
    matrix = np.concatenate([1e5 * arms.T, 1e-2 * np.eye(7)])
    goal = np.concatenate([1e5 * (torque - arms.T @ low), np.zeros(7)])
    other = lsq_linear(matrix, goal, bounds=(np.zeros(7), high - low), method="bvls", tol=1e-14)
    assert np.abs(arms.T @ (low + other.x) - torque).max() < _MICRO
    assert np.linalg.norm(tensions - low) <= np.linalg.norm(other.x) * (1.0 + 1e-3)


def test_the_torque_of_the_least_tensions_gives_them() -> None:
    least = np.full(7, LEAST_TENSION_N)
    tensions, is_enough = tensions_for_torque(
        MOMENT_ARMS, MOMENT_ARMS.T @ least, LEAST_TENSION_N, MOST_TENSION_N
    )
    assert is_enough
    np.testing.assert_allclose(tensions, least, atol=1e-6)


def test_an_impossible_torque_is_reported() -> None:
    """The flag is false, and the tensions stay within bounds."""
    tensions, is_enough = tensions_for_torque(
        MOMENT_ARMS, [5.0, 0.0, 0.0, 0.0], LEAST_TENSION_N, MOST_TENSION_N
    )
    assert not is_enough
    assert (tensions <= MOST_TENSION_N + 1e-6).all()
