"""The finger as an MJCF file."""

import mujoco
import numpy as np
import pytest

from shapechanger.finger.gap import GAPS
from shapechanger.finger.model import build_finger, finger_mjcf
from shapechanger.finger.parameters import NOMINAL, FingerParameters
from shapechanger.finger.tensions import drive_of

DRIVE = drive_of("impedance", NOMINAL)
FINGERS = {"nominal": NOMINAL} | {
    name: gap.draw(np.random.default_rng(3)) for name, gap in GAPS.items()
}


def motion(model: mujoco.MjModel) -> np.ndarray:
    """Return states over one second of random commands, from a bent posture."""
    data = mujoco.MjData(model)
    data.qpos[:4] = 0.4, 0.1, 0.5, 0.2
    rng = np.random.default_rng(0)
    states = []
    for _ in range(50):
        data.ctrl[:] = rng.uniform(-1.0, 1.0, 7)
        mujoco.mj_step(model, data, round(0.02 / model.opt.timestep))
        states.append(np.concatenate([data.qpos, data.qvel, data.actuator_force]))
    return np.array(states)


@pytest.mark.parametrize("name", FINGERS)
def test_the_file_moves_as_the_finger_of_the_env(name: str) -> None:
    """One second under the same commands ends in the same states, in plain MuJoCo."""
    parameters = FINGERS[name]
    loaded = mujoco.MjModel.from_xml_string(finger_mjcf(parameters, DRIVE))
    own = motion(build_finger(parameters, DRIVE).compile())
    assert np.ptp(own[:, 0]) > 0.1
    np.testing.assert_allclose(motion(loaded), own, rtol=0.0, atol=1e-9)


def numbers(parameters: FingerParameters) -> dict[str, list[float]]:
    """Return the numbers in the file, keyed by name."""
    model = mujoco.MjModel.from_xml_string(finger_mjcf(parameters, DRIVE))
    names = [model.numeric(i).name for i in range(model.nnumeric)]
    return {name: model.numeric(name).data.tolist() for name in names}


def test_the_file_holds_the_parameters_with_units() -> None:
    """Numbers are exact, each has a unit, and a comment lists everything that is not simulated."""
    parameters = FINGERS["real-like"]
    found = numbers(parameters)
    assert found["moment_arms"] == parameters.arms.ravel().tolist()
    assert found["slew_per_s"] == [20.0]
    assert found["tendon_stiffness"] == [parameters.tendon_stiffness]
    assert "tendon_stiffness" not in numbers(NOMINAL)
    text = finger_mjcf(parameters, DRIVE)
    assert 'name="motor_kg/unit" data="kg"' in text
    assert all(f'name="{name}/unit"' in text for name in found)
    assert "computed at 50 Hz, sent at 100 Hz, with a slew of 20 up and 20 down" in text
    assert "path of a command" not in finger_mjcf(NOMINAL, DRIVE)
