"""Moment arms and compliance from lengths, angles and tensions."""

import numpy as np
import pytest

from shapechanger.finger.identify.kinematics import (
    ARMS,
    fit_kinematics,
    interval_quantile,
    robust_covariance,
)
from shapechanger.finger.parameters import NOMINAL
from tests.finger.identify.logs import changed, swings, synthetic

LARGE_M = 2e-3


def test_synthetic_logs_give_their_parameters() -> None:
    """Arms, compliance and noise are found, and noise of the angles does not bias the arms."""
    arms, noise = 1.15 * NOMINAL.arms, np.radians(1.5)
    log = synthetic(arms, compliance=5e-5, joint_noise=noise, length_noise=2e-5)
    found = fit_kinematics(log)
    large = np.abs(arms) > LARGE_M
    np.testing.assert_allclose(found.arms[large], arms[large], rtol=0.03)
    assert (found.arms[~ARMS] == 0.0).all()
    assert found.compliance == pytest.approx(5e-5, rel=0.05)
    assert 1e-7 < found.compliance_sd < 2.5e-6
    np.testing.assert_allclose(found.joint_noise, noise, rtol=0.1)
    # The lengths give the angles too, which removes most of their noise.
    assert np.std(found.angles - swings(log.t)) < 0.5 * noise


def test_slack_and_the_start_of_a_log_are_outliers() -> None:
    """5 mm of slack for 0.5 s and errors in the first 0.2 s do not bias the arms.

    The remaining errors agree with their standard errors to a factor of 1.5.
    """
    log = synthetic(NOMINAL.arms, 0.0, np.radians(1.0), 2e-5)
    lengths = log.lengths.copy()
    lengths[:9] += 0.02
    lengths[100:125, 0] += 5e-3
    found = fit_kinematics(changed(log, lengths=lengths))
    large = np.abs(NOMINAL.arms) > LARGE_M
    np.testing.assert_allclose(found.arms[large], NOMINAL.arms[large], rtol=0.05)
    ratio = (found.arms - NOMINAL.arms)[ARMS] / found.arms_sd[ARMS]
    assert 1.0 / 1.5 < np.sqrt(np.mean(ratio**2)) < 1.5
    assert len(found.angles) == len(log)


def test_the_covariance_has_newey_west_weights() -> None:
    """Lag k of L steps has the weight 1 - k / (L + 1), with L half a second."""
    residual = np.array([[1.0], [2.0], [-1.0], [3.0]])
    # Two lags of 0.25 s: 1 + 4 + 1 + 9, + 2 (2/3) (2 - 2 - 3), + 2 (1/3) (-1 + 6); over 4 squared.
    expected = (15.0 - 2.0 * (2.0 / 3.0) * 3.0 + 2.0 * (1.0 / 3.0) * 5.0) / 16.0
    assert robust_covariance(np.ones((4, 1, 1)), residual, 0.25)[0, 0] == pytest.approx(expected)


def test_intervals_are_wider_for_short_logs() -> None:
    """The quantile is Kiefer and Vogelsang's cubic in the bandwidth."""
    assert interval_quantile(10**9, 0.02) == pytest.approx(1.96, abs=1e-4)
    assert interval_quantile(250, 0.02) == pytest.approx(1.96 + 0.29694 + 0.00416 - 0.0005324)
    assert interval_quantile(5, 0.02) == pytest.approx(1.96 + 2.9694 + 0.4160 - 0.5324)
