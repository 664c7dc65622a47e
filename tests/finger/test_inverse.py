"""Inverse kinematics of the fingertip."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.finger.anatomy import JOINT_RANGE, PHALANX_LENGTH_M
from shapechanger.finger.postures import angles_for, draw_posture
from shapechanger.finger.task import fingertip

_LOW, _HIGH = JOINT_RANGE.T


def _is_within(angles: np.ndarray) -> bool:
    return bool(((angles >= _LOW) & (angles <= _HIGH)).all())


def test_fingertips_of_balanced_postures_are_reached() -> None:
    """Each point is reached within 0.01 mm, from the resting posture and from nearby ones."""
    rng = np.random.default_rng(0)
    for _ in range(150):
        posture = draw_posture(rng)
        place = fingertip(posture)
        near = np.clip(posture + rng.uniform(-0.2, 0.2, 4), _LOW, _HIGH)
        for start in (None, near):
            angles, off = angles_for(place, start)
            assert _is_within(angles)
            assert off < 1e-5
            found = fingertip(angles)
            assert off == pytest.approx(np.linalg.norm(place - found), abs=1e-12)


def test_points_of_any_posture_are_reached() -> None:
    """Fingertips of all postures within the joint limits are reached."""
    rng = np.random.default_rng(1)
    postures = rng.uniform(_LOW, _HIGH, (80, 4))
    postures[::4] = np.where(rng.random((20, 4)) < 0.5, _LOW, _HIGH)
    for posture in postures:
        angles, off = angles_for(fingertip(posture))
        assert _is_within(angles)
        assert off < 1e-5


@pytest.mark.parametrize(
    ("place", "least_mm"),
    [
        ((sum(PHALANX_LENGTH_M) + 0.001, 0.0, 0.0), 1.0),
        ((0.5, 0.0, 0.0), 408.4),
        ((0.05, 0.08, 0.0), 5.0),
        ((-0.08, 0.0, 0.0), 5.0),
        ((0.0, 0.0, 0.09), 100.0),
    ],
    ids=["just beyond", "far beyond", "to the side", "behind", "above"],
)
def test_the_error_of_unreachable_points_is_correct(
    place: tuple[float, float, float], least_mm: float
) -> None:
    """The reported distance is the angles', and at least the true minimum."""
    angles, off = angles_for(np.array(place))
    assert _is_within(angles)
    assert off == pytest.approx(np.linalg.norm(fingertip(angles) - place), abs=1e-12)
    assert off >= 1e-3 * least_mm - 1e-9


def test_angles_are_continuous() -> None:
    """A displacement of 0.1 mm changes the angles by less than 3 degrees."""
    rng = np.random.default_rng(1)
    for _ in range(30):
        posture = draw_posture(rng)
        place = fingertip(posture)
        angles, _ = angles_for(place + rng.uniform(-1e-4, 1e-4, 3), posture)
        assert np.degrees(np.abs(angles - posture)).max() < 3.0
