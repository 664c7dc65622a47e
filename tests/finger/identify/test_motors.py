"""Command signals, and motors that follow them."""

import numpy as np
import pytest

from shapechanger.finger.identify.log import FingerLog
from shapechanger.finger.identify.motion import CommandSignal, fit_motors
from shapechanger.finger.parameters import NOMINAL, FingerParameters
from shapechanger.finger.tensions import drive_of
from tests.finger.identify.logs import changed, made_up, recorded


def stepped() -> CommandSignal:
    """Return commands that step from 0 to 1 in the period that ends at 1 s."""
    log = made_up()
    return CommandSignal(changed(log, commands=np.repeat((log.t > 0.99)[:, None], 7, axis=1) * 1.0))


def test_a_command_acts_in_the_period_that_ends_with_its_row() -> None:
    """A command acts from 0.98 s plus the delay on, and partly in the step in between."""
    late = stepped().delayed(0.96, 0.01, 6, 0.0)
    np.testing.assert_allclose(late[:, 0], [0, 0, 1, 1, 1, 1], atol=1e-9)
    late = stepped().delayed(0.96, 0.01, 6, 0.025)
    np.testing.assert_allclose(late[:, 0], [0, 0, 0, 0, 0.5, 1], atol=1e-9)


def test_motors_follow_with_their_lag() -> None:
    """After one lag, 1/e of a step is left; before the log, the first command acts."""
    made = stepped().activations(0.0, 0.001, 1100, 0.0, 0.030)
    assert made[979, 3] == pytest.approx(0.0, abs=1e-9)
    assert made[1009, 3] == pytest.approx(1.0 - np.exp(-1.0), abs=1e-9)
    held = CommandSignal(changed(made_up(), commands=np.full((300, 7), 0.4)))
    np.testing.assert_allclose(held.activations(0.0, 0.001, 50, 0.02, 0.03), 0.4)


def followed(
    lag: float, delay: float, strength: float, noise: float, most_command: float = 1.0
) -> FingerLog:
    """Return a log of motors at fixed lengths, with random commands of 0.2 s, in steps of 1 ms."""
    rng = np.random.default_rng(3)
    rows, per_row = 300, 20
    t = 0.02 * np.arange(rows)
    drawn = np.clip(rng.uniform(-1.5, 1.5, (rows // 10, 7)), -1.0, 1.0)
    commands = most_command * np.repeat(drawn, 10, axis=0)
    drive, most = drive_of("tension", NOMINAL), np.array(NOMINAL.most_tension)
    activation = commands[0].copy()
    tensions = np.empty((rows, 7))
    for step in range(per_row * (rows - 1) + 1):  # Measured after `step` steps.
        if step % per_row == 0:
            wanted = drive.offset + drive.gain * activation
            tensions[step // per_row] = np.clip(wanted, NOMINAL.least_tension, strength * most)
        # The period that ends with row i starts at step 20 (i - 1).
        row = (step - round(delay / 0.001)) // per_row + 1
        acting = commands[min(max(row, 0), rows - 1)]
        activation = activation + (1.0 - np.exp(-0.001 / lag)) * (acting - activation)
    tensions += noise * rng.standard_normal(tensions.shape)
    return changed(made_up(), t=t, commands=commands, tensions=tensions, actions="tension")


def scaled(strength: float) -> FingerParameters:
    """Return the nominal finger with scaled tension limits."""
    return NOMINAL.replace(most_tension=tuple(strength * v for v in NOMINAL.most_tension))


def test_synthetic_logs_give_the_motors() -> None:
    """Lag, delay, noise and the strength relative to known motors are found."""
    log = changed(followed(0.045, 0.037, 0.8, 0.1), motors=scaled(0.7))
    found = fit_motors(log)
    assert found.lag == pytest.approx(0.045, abs=0.001)
    assert found.delay == pytest.approx(0.037, abs=0.001)
    assert found.saturates
    assert found.strength == pytest.approx(0.8 / 0.7, abs=0.01)
    assert found.tension_noise == pytest.approx(0.1, rel=0.1)
    assert all(0.0 < sd < limit for sd, limit in zip(found.sd, (1e-3, 1e-3, 0.01), strict=True))


def test_strength_needs_saturation() -> None:
    """Without saturation the strength is that assumed; exact tensions have no noise."""
    found = fit_motors(followed(0.03, 0.02, 1.0, 0.0, most_command=0.5))
    assert not found.saturates
    assert found.strength == 1.0
    assert found.tension_noise == 0.0


@pytest.mark.parametrize("actions", ["impedance", "tension", "length"])
def test_lag_and_delay_are_found(actions: str) -> None:
    """Lag, delay and the strength of saturated motors are found in every action mode."""
    most = tuple(0.9 * tension for tension in NOMINAL.most_tension)
    parameters = NOMINAL.replace(
        motor_lag=0.030, command_delay=0.024, most_tension=most, tension_noise=0.2
    )
    log, _ = recorded(5.0, actions=actions, parameters=parameters)
    found = fit_motors(log)
    assert found.lag == pytest.approx(0.030, abs=0.002)
    assert found.delay == pytest.approx(0.024, abs=0.005)  # Measured one or two steps late.
    assert found.saturates
    assert found.strength == pytest.approx(0.9, abs=0.02)
    assert found.tension_noise == pytest.approx(0.2, rel=0.2)
