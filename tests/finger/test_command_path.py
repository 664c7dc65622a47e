"""The simulated finger, and the path from the commands of a rig to its tensions."""

import math
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from shapechanger.contract.limits import slewed as slewed_by_guard
from shapechanger.contract.plan import ActionPlan
from shapechanger.errors import FingerError, UnknownName
from shapechanger.finger.parameters import NOMINAL, CommandPath, FingerParameters
from shapechanger.finger.plant import FingerPlant, JointVelocities, slewed, slews
from shapechanger.finger.tensions import drive_of

_RIG = NOMINAL.replace(tendon_stiffness=10e3, motor_kg=1.4, motor_lag=0.001)
_MOST = np.array(NOMINAL.most_tension)


def _tensions(
    parameters: FingerParameters, commands: list[float], actions: str = "tension"
) -> NDArray[np.float64]:
    """Return the tensions of the first tendon, N, after each millisecond of some commands."""
    plant = FingerPlant(parameters, drive_of(actions, NOMINAL))
    rng = np.random.default_rng(0)
    plant.place(np.array([0.4, 0.0, 0.6, 0.2]), rng)
    seen: list[float] = []
    real: Any = mujoco.mj_step

    def step(model: mujoco.MjModel, data: mujoco.MjData, nstep: int = 1) -> None:
        for _ in range(nstep):
            real(model, data)
            seen.append(float(np.abs(data.actuator_force[0])))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mujoco, "mj_step", step)
        for command in commands:
            plant.act(np.full(7, command), rng)
    return np.array(seen)


@pytest.mark.parametrize(("step", "lag_ms"), [(None, 9), (0.4, 20)])
def test_a_tension_follows_within_the_lag(step: float | None, lag_ms: int) -> None:
    """Tensions are rounded down to their resolution, as a servo rounds its current."""
    path = CommandPath() if step is None else CommandPath(tension_step=step)
    asked = NOMINAL.least_tension + 0.75 * (_MOST[0] - NOMINAL.least_tension)
    expected = asked if step is None else step * np.floor(asked / step)
    seen = _tensions(_RIG.replace(path=path), [0.5])
    np.testing.assert_allclose(seen[lag_ms - 1 :], expected, rtol=1e-3)


def test_a_delay_shifts_the_response() -> None:
    rig = _RIG.replace(path={"slew_per_s": 20.0})
    assert FingerParameters.from_json(rig.to_json()) == rig
    prompt, late = (
        _tensions(rig.replace(command_delay=delay), [0.5, -0.5, 0.8]) for delay in (0.0, 0.012)
    )
    np.testing.assert_allclose(late[12:], prompt[:-12], atol=1e-9)
    np.testing.assert_allclose(late[:12], NOMINAL.least_tension, atol=1e-9)


def test_tensions_are_held_between_computations() -> None:
    """On a command path, an impedance does not react to motion before the next computation."""
    held = _tensions(_RIG.replace(path=CommandPath()), [0.5, -0.5, 0.5, -0.5], "impedance")
    prompt = _tensions(_RIG, [0.5, -0.5, 0.5, -0.5], "impedance")
    ends = np.array([19, 39, 59, 79])
    assert np.abs(held[ends] - held[ends - 9]).max() < 0.01
    assert np.abs(prompt[ends] - prompt[ends - 9]).max() > 0.1


_slews = st.none() | st.sampled_from([2.0, 20.0])
_shares = st.floats(0.0, 1.0)


@given(up=_slews, down=_slews, now=_shares, aim=_shares)
def test_the_slew_equals_the_guards(
    up: float | None, down: float | None, now: float, aim: float
) -> None:
    rates = {"slew_per_s": up or math.inf, "slew_down_per_s": down or math.inf}
    action = ActionPlan("FDP", 0.0, **rates, one_sided=True)
    path = CommandPath(slew_per_s=up, slew_down_per_s=down)
    ours = float(slewed(np.array([now]), np.array([aim]), *slews(path))[0])
    assert ours == pytest.approx(slewed_by_guard(action, now, aim, 0.01), abs=1e-12)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"slew_per_s": 0.0}, "slew_per_s of a path must be above zero and finite, got 0.0"),
        ({"control_hz": -1.0}, "control_hz of a path must be above zero"),
        ({"tick_hz": 75.0}, "tick_hz of a path must be a multiple of control_hz, got 75 and 50"),
        ({"tension_step": -0.1}, "tension_step of a path must be above zero"),
        ({"slew_per_s": "fast"}, "A command path is malformed: Expected"),
        ({"slew_pr_s": 2.0}, "Did you mean 'slew_per_s'"),
        # Computations must fit into a command, and simulation steps into a tick.
        ({"control_hz": 25.0}, "control_hz of a path must be a multiple of 50"),
        ({"control_hz": 50.0, "tick_hz": 300.0}, "tick_hz of a path must divide 1000"),
    ],
)
def test_invalid_paths_are_refused(values: dict[str, Any], text: str) -> None:
    with pytest.raises((FingerError, UnknownName), match=text):
        FingerPlant(_RIG.replace(path=values), drive_of("tension", NOMINAL))


def test_velocities_have_a_lag_of_40_ms() -> None:
    velocities, angles = JointVelocities(), np.zeros(2)
    found = []
    for _ in range(4):
        found.append(velocities.of(angles))
        angles += (0.02, -0.04)  # The estimator has copied the array.
    left = [math.exp(-i / 2) for i in range(4)]
    np.testing.assert_allclose(found, [[1.0 - x, -2.0 * (1.0 - x)] for x in left], atol=1e-12)
    velocities.forget()
    np.testing.assert_array_equal(velocities.of(np.array([9.0, 9.0])), np.zeros(2))
