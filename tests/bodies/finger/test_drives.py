"""Tendon drives of the modes of action."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.bodies.finger import DRIVES, NOMINAL, drive_of
from shapechanger.bodies.finger.anatomy import (
    JOINT_RANGE,
    JOINT_REST,
    LEAST_TENSION_N,
    MOMENT_ARMS,
    MOST_TENSION_N,
)
from shapechanger.errors import UnknownName

_STILL = np.zeros(7)
_REST = -MOMENT_ARMS @ JOINT_REST


@pytest.mark.parametrize("mode", DRIVES)
def test_a_command_asks_for_the_tension_that_asked_for_it(mode: str) -> None:
    """`command` inverts `tension`, and tension grows with the command."""
    rng = np.random.default_rng(0)
    drive = drive_of(mode, NOMINAL)
    command, length, speed = rng.uniform(-1, 1, (3, 7)) * [[1.0], [0.01], [0.2]]
    tension = drive.tension(command, length, speed)
    np.testing.assert_allclose(drive.command(tension, length, speed), command, atol=1e-12)
    assert (drive.tension(command + 0.1, length, speed) > tension).all()


@pytest.mark.parametrize("mode", ["tension", "impedance"])
def test_a_tension_goes_from_its_least_to_its_most(mode: str) -> None:
    """At rest length, commands span the range of tensions."""
    drive = drive_of(mode, NOMINAL)
    np.testing.assert_allclose(drive.tension(-np.ones(7), _REST, _STILL), LEAST_TENSION_N)
    np.testing.assert_allclose(drive.tension(np.ones(7), _REST, _STILL), MOST_TENSION_N)


def test_a_muscle_resists_being_stretched() -> None:
    """Impedance adds stiffness and damping; tension does not."""
    longer = _REST + 0.01
    muscle, plain = drive_of("impedance", NOMINAL), drive_of("tension", NOMINAL)
    more = muscle.tension(_STILL, longer, _STILL) - muscle.tension(_STILL, _REST, _STILL)
    np.testing.assert_allclose(more, 3.0)
    assert (muscle.tension(_STILL, _REST, _STILL + 0.1) > muscle.offset + 300.0 * _REST).all()
    np.testing.assert_array_equal(
        plain.tension(_STILL, longer, _STILL), plain.tension(_STILL, _REST, _STILL)
    )


def test_lengths_go_from_the_longest_to_the_shortest() -> None:
    """Length commands span all postures."""
    drive = drive_of("length", NOMINAL)
    rng = np.random.default_rng(0)
    for angles in rng.uniform(JOINT_RANGE[:, 0], JOINT_RANGE[:, 1], (50, 4)):
        length = -MOMENT_ARMS @ angles
        assert (drive.tension(-np.ones(7), length, _STILL) <= LEAST_TENSION_N + 1e-9).all()
        assert (drive.tension(np.ones(7), length, _STILL) >= MOST_TENSION_N).all()


def test_a_mode_that_there_is_not_is_named() -> None:
    """The error suggests the nearest name."""
    with pytest.raises(UnknownName, match=r"'tensions'. Did you mean 'tension'\? There are: imped"):
        drive_of("tensions", NOMINAL)
