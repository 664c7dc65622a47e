"""Commands as they act, and motors that follow them."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.bodies.finger import NOMINAL
from shapechanger.identify.motors import CommandSignal, fit_motors
from tests.identify.logs import changed, made_up, recorded


def stepped() -> CommandSignal:
    """All commands are 0, and 1 from the period that ends at 1 s."""
    log = made_up()
    return CommandSignal(changed(log, commands=np.repeat((log.t > 0.99)[:, None], 7, axis=1) * 1.0))


def test_a_command_acts_in_the_period_that_ends_with_its_row() -> None:
    """From 0.98 s on, and later by the delay; in the step in between by its share."""
    late = stepped().late(0.96, 0.01, 6, 0.0)
    np.testing.assert_allclose(late[:, 0], [0, 0, 1, 1, 1, 1], atol=1e-9)
    late = stepped().late(0.96, 0.01, 6, 0.025)
    np.testing.assert_allclose(late[:, 0], [0, 0, 0, 0, 0.5, 1], atol=1e-9)


def test_motors_follow_with_their_lag() -> None:
    """A lag after the step, all but a part in e is done; before the log the first command acted."""
    made = stepped().followed(0.0, 0.001, 1100, 0.0, 0.030)
    assert made[979, 3] == pytest.approx(0.0, abs=1e-9)
    assert made[1009, 3] == pytest.approx(1.0 - np.exp(-1.0), abs=1e-9)
    held = CommandSignal(changed(made_up(), commands=np.full((300, 7), 0.4)))
    np.testing.assert_allclose(held.followed(0.0, 0.001, 50, 0.02, 0.03), 0.4)


@pytest.mark.parametrize("actions", ["impedance", "tension", "length"])
def test_lag_and_delay_are_found(actions: str) -> None:
    """Whatever a command means, and how strong motors are where one could not do more."""
    most = tuple(0.9 * tension for tension in NOMINAL.most_tension)
    parameters = NOMINAL.replace(
        motor_lag=0.030, command_delay=0.024, most_tension=most, tension_noise=0.2
    )
    log, _ = recorded(5.0, actions=actions, parameters=parameters)
    found = fit_motors(log)
    assert found.lag == pytest.approx(0.030, abs=0.002)
    assert found.delay == pytest.approx(0.024, abs=0.005)  # Read a step or two late.
    assert found.saturates
    assert found.strength == pytest.approx(0.9, abs=0.02)
    assert found.tension_noise == pytest.approx(0.2, rel=0.2)
