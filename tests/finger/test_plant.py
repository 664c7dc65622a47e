"""The simulated plant of a finger, and velocities from measured joint angles."""

import math

import numpy as np
import pytest

from shapechanger.finger.anatomy import JOINT_REST
from shapechanger.finger.parameters import NOMINAL
from shapechanger.finger.plant import FingerPlant, JointVelocities
from shapechanger.finger.tensions import drive_of


def test_velocities_have_a_lag_of_40_ms() -> None:
    velocities, angles = JointVelocities(), np.zeros(2)
    found = []
    for _ in range(4):
        found.append(velocities.of(angles))
        angles += (0.02, -0.04)  # A copy was taken.
    left = [math.exp(-i / 2) for i in range(4)]
    np.testing.assert_allclose(found, [[1.0 - x, -2.0 * (1.0 - x)] for x in left], atol=1e-12)
    velocities.forget()
    np.testing.assert_array_equal(velocities.of(np.array([9.0, 9.0])), np.zeros(2))


def test_noisy_joints_have_filtered_velocities() -> None:
    """Simulated fingers with joint noise use the filter of rigs."""
    noisy = NOMINAL.replace(joint_noise=0.01)
    plant = FingerPlant(noisy, drive_of("tension", noisy))
    velocities, rng = JointVelocities(), np.random.default_rng(0)
    senses = plant.place(JOINT_REST, rng)
    for _ in range(5):
        np.testing.assert_array_equal(senses.velocities, velocities.of(senses.angles))
        senses = plant.act(np.full(7, -0.5), rng)


def test_tensions_are_at_least_the_pretension() -> None:
    """The pretension holds from the first moment on."""
    parameters = NOMINAL.replace(least_tension=1.5)
    plant = FingerPlant(parameters, drive_of("tension", NOMINAL))
    rng = np.random.default_rng(0)
    senses = plant.place(JOINT_REST, rng)
    assert senses.tensions.min() == pytest.approx(1.5)
    for _ in range(10):
        senses = plant.act(np.full(7, -1.0), rng)
    assert senses.tensions.min() == pytest.approx(1.5)
