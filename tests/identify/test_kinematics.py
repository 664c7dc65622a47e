"""Arms and stretch, from lengths, angles and tensions."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.bodies.finger import NOMINAL
from shapechanger.identify.kinematics import ARMS, covariance, fit_kinematics, quantile
from tests.identify.logs import recorded

LARGE_M = 2e-3


def test_without_noise_the_arms_are_exact() -> None:
    """To a hundredth of each, for a finger whose arms are not the nominal ones."""
    rng = np.random.default_rng(5)
    arms = NOMINAL.arms * (1.0 + rng.uniform(-0.1, 0.1, NOMINAL.arms.shape))
    parameters = NOMINAL.replace(moment_arms=tuple(map(tuple, arms.tolist())))
    log, _ = recorded(6.0, parameters=parameters)
    found = fit_kinematics(log)
    np.testing.assert_allclose(found.arms, arms, rtol=0.01)
    assert abs(found.compliance) < 1e-7


@pytest.mark.slow
@pytest.mark.parametrize("finger_seed", [0, 3])
def test_noisy_fingers_that_stretch_and_rub_are_found(finger_seed: int) -> None:
    """Arms above 2 mm to 5 %, nine of ten intervals hold the truth, and so does the stretch."""
    log, truth = recorded(10.0, seed=1, gap="real-like", finger_seed=finger_seed)
    found = fit_kinematics(log)
    off = np.abs(found.arms - truth.arms)
    large = np.abs(truth.arms) > LARGE_M
    assert (off[large] < 0.05 * np.abs(truth.arms[large])).all()
    held = off <= quantile(len(log), log.control_dt) * found.arms_sd
    assert held[ARMS].mean() >= 0.9
    assert truth.tendon_stiffness is not None
    assert found.compliance * truth.tendon_stiffness == pytest.approx(1.0, abs=0.05)
    np.testing.assert_allclose(found.joint_noise.min(), truth.joint_noise, rtol=0.15)


def test_standard_errors_grow_where_errors_go_on() -> None:
    """A mean of errors that repeat ten times is known as badly as of a tenth as many."""
    rng = np.random.default_rng(0)
    ones = np.ones((2000, 1, 1))
    fresh = rng.standard_normal((2000, 1))
    stale = np.repeat(rng.standard_normal((200, 1)), 10, axis=0)
    known, unknown = (float(covariance(ones, r, 0.02)[0, 0]) for r in (fresh, stale))
    assert known == pytest.approx(1.0 / 2000, rel=0.5)
    assert 4.0 < unknown / known < 16.0
    assert 1.96 < quantile(2000, 0.02) < quantile(200, 0.02) < 2.6
