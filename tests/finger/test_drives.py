"""Tendon drives of the modes of action."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from shapechanger.errors import UnknownName
from shapechanger.finger.anatomy import (
    JOINT_RANGE,
    JOINT_REST,
    LEAST_TENSION_N,
    MOMENT_ARMS,
    MOST_TENSION_N,
)
from shapechanger.finger.parameters import NOMINAL
from shapechanger.finger.tensions import DRIVES, drive_of
from tests.finger.commands import made

_STILL = np.zeros(7)
_REST = -MOMENT_ARMS @ JOINT_REST


@pytest.mark.parametrize("mode", DRIVES)
def test_command_inverts_tension(mode: str) -> None:
    rng = np.random.default_rng(0)
    drive = drive_of(mode, NOMINAL)
    command, length, speed = rng.uniform(-1, 1, (3, 7)) * [[1.0], [0.01], [0.2]]
    tension = drive.tension(command, length, speed)
    np.testing.assert_allclose(drive.command(tension, length, speed), command, atol=1e-12)
    assert (drive.tension(command + 0.1, length, speed) > tension).all()


@pytest.mark.parametrize("mode", ["tension", "impedance"])
def test_commands_span_the_tensions(mode: str) -> None:
    """At the resting length, -1 and 1 give the least and the largest tension."""
    drive = drive_of(mode, NOMINAL)
    np.testing.assert_allclose(drive.tension(-np.ones(7), _REST, _STILL), LEAST_TENSION_N)
    np.testing.assert_allclose(drive.tension(np.ones(7), _REST, _STILL), MOST_TENSION_N)


def test_impedance_stiffens_with_tension() -> None:
    """Stiffness and damping are proportional to tension; the mode "tension" has neither."""
    longer = _REST + 0.01
    muscle, plain = drive_of("impedance", NOMINAL), drive_of("tension", NOMINAL)
    more = muscle.tension(_STILL, longer, _STILL) - muscle.tension(_STILL, _REST, _STILL)
    np.testing.assert_allclose(more, 0.25 * muscle.tension(_STILL, _REST, _STILL))
    faster = muscle.tension(_STILL, _REST, _STILL + 0.1)
    np.testing.assert_allclose(faster, 1.1 * muscle.tension(_STILL, _REST, _STILL))
    np.testing.assert_array_equal(
        plain.tension(_STILL, longer, _STILL), plain.tension(_STILL, _REST, _STILL)
    )


@pytest.mark.parametrize("mode", DRIVES)
def test_the_model_pulls_as_the_drive(mode: str) -> None:
    """For any command, posture and speed, the forces of MuJoCo's actuators are its tensions."""
    model, drive = made(mode=mode), drive_of(mode, NOMINAL)
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    for _ in range(20):
        data.qpos[:] = JOINT_REST + rng.uniform(-0.2, 0.2, 4)
        data.qvel[:] = rng.uniform(-3.0, 3.0, 4)
        data.act[:] = rng.uniform(-1.0, 1.0, 7)
        mujoco.mj_forward(model, data)
        asked = drive.tension(data.act, -MOMENT_ARMS @ data.qpos, -MOMENT_ARMS @ data.qvel)
        expected = np.clip(asked, LEAST_TENSION_N, MOST_TENSION_N)
        np.testing.assert_allclose(-data.actuator_force, expected, atol=1e-9)


def test_length_commands_span_all_postures() -> None:
    """In any posture, -1 gives the least and 1 the largest tension."""
    drive = drive_of("length", NOMINAL)
    rng = np.random.default_rng(0)
    for angles in rng.uniform(JOINT_RANGE[:, 0], JOINT_RANGE[:, 1], (50, 4)):
        length = -MOMENT_ARMS @ angles
        assert (drive.tension(-np.ones(7), length, _STILL) <= LEAST_TENSION_N + 1e-9).all()
        assert (drive.tension(np.ones(7), length, _STILL) >= MOST_TENSION_N).all()


def test_an_unknown_mode_is_refused() -> None:
    """The error suggests the nearest name."""
    with pytest.raises(UnknownName, match=r"'tensions'. Did you mean 'tension'\? There are: imped"):
        drive_of("tensions", NOMINAL)
