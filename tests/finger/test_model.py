"""The MuJoCo model of the finger."""

import mujoco
import numpy as np
import pytest

from shapechanger.finger import anatomy
from shapechanger.finger.gap import GAPS
from shapechanger.finger.model import HOOD, SIM_DT
from shapechanger.finger.parameters import NOMINAL, FingerParameters
from shapechanger.finger.tensions import DRIVES
from tests.finger.commands import STRETCHED, at_rest, harsh_commands, made

# Tolerated overshoot of each joint beyond its range, degrees. 4.8, 1.6, 5.9 and 15.3 were measured;
# the last phalanx weighs 3 g and hits its stop at 39 rad/s.
_MOST_BEYOND = np.array([7.0, 3.0, 8.0, 18.0])
_FASTEST = 50.0  # Tolerated speed, rad/s; 40 were measured.

# Direction in which each tendon alone moves the joints.
_ANATOMY = {
    "FDP": {"MCP_flexion": 1, "PIP_flexion": 1, "DIP_flexion": 1},
    "FDS": {"MCP_flexion": 1, "PIP_flexion": 1},
    "EIP": {"MCP_flexion": -1, "PIP_flexion": -1, "DIP_flexion": -1},
    "EDC": {"MCP_flexion": -1, "PIP_flexion": -1, "DIP_flexion": -1},
    "LUM": {"MCP_flexion": 1, "MCP_abduction": 1, "PIP_flexion": -1, "DIP_flexion": -1},
    "DI": {"MCP_flexion": 1, "MCP_abduction": 1},
    "PI": {"MCP_flexion": 1, "MCP_abduction": -1, "PIP_flexion": -1, "DIP_flexion": -1},
}


@pytest.mark.parametrize("tendon", anatomy.TENDONS)
@pytest.mark.parametrize("parameters", [NOMINAL, STRETCHED], ids=["stiff", "stretched"])
def test_each_tendon_moves_its_joints(parameters: FingerParameters, tendon: str) -> None:
    model = made(parameters)
    model.opt.gravity[:] = 0.0
    ends: list[np.ndarray] = []
    for pulled in (-1.0, 1.0):
        data = at_rest(model, parameters)
        data.ctrl[anatomy.TENDONS.index(tendon)] = pulled
        mujoco.mj_step(model, data, round((0.08 + parameters.command_delay) / model.opt.timestep))
        ends.append(np.degrees(data.qpos[:4]))
    moved: dict[str, float] = dict(zip(anatomy.JOINTS, ends[1] - ends[0], strict=True))
    assert all(sign * moved[joint] > 1.0 for joint, sign in _ANATOMY[tendon].items()), moved


@pytest.mark.parametrize("mode", DRIVES)
@pytest.mark.parametrize("finger", ["nominal", "stretched", *GAPS])
def test_extreme_commands_are_stable(finger: str, mode: str) -> None:
    parameters = {"nominal": NOMINAL, "stretched": STRETCHED}.get(finger)
    if parameters is None:
        parameters = GAPS[finger].draw(np.random.default_rng(3))
    model = made(parameters, mode)
    assert (model.opt.timestep == SIM_DT) == (not parameters.gives)
    steps = round(0.02 / model.opt.timestep)
    most = np.array(parameters.most_tension)
    low, high = anatomy.JOINT_RANGE.T
    for name, commands in harsh_commands(np.random.default_rng(0)):
        data = at_rest(model, parameters)
        for command in commands:
            data.ctrl[:] = command
            for _ in range(steps):
                mujoco.mj_step(model, data)
                angles = data.qpos[:4]
                beyond = np.degrees(np.maximum(low - angles, angles - high))
                assert (beyond < _MOST_BEYOND).all(), name
                assert np.abs(data.qvel[:4]).max() < _FASTEST, name
                # Actuator forces are negative for stiff tendons and positive for spools.
                tensions = data.actuator_force * (1.0 if parameters.gives else -1.0)
                assert (tensions >= anatomy.LEAST_TENSION_N - 1e-12).all(), name
                assert (tensions <= most + 1e-12).all(), name
        assert not any(warning.number for warning in data.warning), name


def test_tendons_are_slack_within_the_backlash() -> None:
    parameters = STRETCHED.replace(backlash=2e-3)
    model = made(parameters)
    data = at_rest(model, parameters)
    data.qpos[4:] -= 1e-3
    mujoco.mj_forward(model, data)
    stretch = [model.tendon(f"{name}/stretch").id for name in anatomy.TENDONS]
    assert (data.ten_length[stretch] < parameters.backlash).all()
    np.testing.assert_array_equal(data.qfrc_spring[4:], 0.0)
    data.qpos[4:] += 2e-3
    mujoco.mj_forward(model, data)
    np.testing.assert_allclose(data.qfrc_spring[4:], -10e3 * 1e-3)


def test_joints_stiffen_towards_the_ends_of_their_ranges() -> None:
    """A joint is four times as stiff at the farther end of its range as at rest."""
    model, data = made(), mujoco.MjData(made())
    model.tendon_stiffness[model.tendon(HOOD).id] = 0.0
    for j, (low, high) in enumerate(anatomy.JOINT_RANGE):
        farther = max((low, high), key=lambda end: abs(end - anatomy.JOINT_REST[j]))
        stiffness = []
        for angle in (anatomy.JOINT_REST[j], farther):
            torques = []
            for side in (-1e-4, 1e-4):
                data.qpos[:] = anatomy.JOINT_REST
                data.qpos[j] = angle + side
                mujoco.mj_forward(model, data)
                torques.append(data.qfrc_spring[j])
            stiffness.append((torques[0] - torques[1]) / 2e-4)
        assert stiffness[0] == pytest.approx(NOMINAL.joint_stiffness[j], rel=1e-6)
        assert stiffness[1] == pytest.approx(anatomy.END_STIFFNESS * stiffness[0], rel=1e-6)


def test_the_hood_couples_the_end_joint() -> None:
    """After 2 s of a constant command, the end joint is within 16 degrees of its coupled angle."""
    model, rng = made(NOMINAL, "impedance"), np.random.default_rng(0)
    off = []
    for _ in range(60):
        data = at_rest(model)
        data.ctrl[:] = rng.uniform(-1.0, 1.0, 7)
        mujoco.mj_step(model, data, round(2.0 / SIM_DT))
        off.append(abs(data.qpos[3] - anatomy.DIP_BY_PIP * data.qpos[2]))
    assert np.degrees(max(off)) < 16.0
    assert np.degrees(np.median(off)) < 11.0
