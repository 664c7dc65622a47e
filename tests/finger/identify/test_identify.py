"""Identification of a finger from a log."""

import dataclasses
import functools
import math
from html import unescape

import gymnasium as gym
import numpy as np
import pytest

from shapechanger.finger import report
from shapechanger.finger.anatomy import JOINTS, TENDONS
from shapechanger.finger.gap import GAPS, with_gears
from shapechanger.finger.identify import FingerLog, IdentifiedFinger, identify, result
from shapechanger.finger.identify.kinematics import ARMS, interval_quantile
from shapechanger.finger.identify.motion import FACTORS, Motors, cut_windows
from shapechanger.finger.identify.result import ParameterEstimate, replay
from shapechanger.finger.parameters import NOMINAL, CommandPath, FingerParameters
from tests.finger.identify.logs import kinematics, made_up, recorded


@functools.cache
def quick() -> tuple[FingerLog, FingerParameters, IdentifiedFinger, tuple[str, ...]]:
    """Return a log of four seconds, the true and the identified finger, and the progress."""
    parameters = NOMINAL.replace(
        moment_arms=tuple(tuple(1.08 * arm for arm in row) for row in NOMINAL.moment_arms),
        joint_stiffness=tuple(1.3 * v for v in NOMINAL.joint_stiffness),
        joint_damping=tuple(0.8 * v for v in NOMINAL.joint_damping),
        tendon_friction=0.3,
        command_delay=0.02,
    )
    log, truth = recorded(4.2, parameters=parameters)
    steps: list[str] = []
    return log, truth, identify(log, steps.append), tuple(steps)


def test_a_finger_is_identified() -> None:
    log, truth, found, steps = quick()
    np.testing.assert_allclose(found.parameters.arms, truth.arms, rtol=0.01)
    assert found.parameters.tendon_stiffness is None
    np.testing.assert_allclose(found.parameters.joint_stiffness, truth.joint_stiffness, rtol=0.1)
    np.testing.assert_allclose(found.parameters.joint_damping, truth.joint_damping, rtol=0.15)
    assert found.parameters.tendon_friction == pytest.approx(0.3, rel=0.2)
    assert found.parameters.command_delay == pytest.approx(0.02, abs=0.005)
    assert found.parameters.motor_lag == pytest.approx(truth.motor_lag, abs=0.002)
    assert found.parameters.joint_noise == 0.0
    off, nominal_off = found.held_out.off
    assert 5.0 * off < min(5.0 * np.radians(0.6), nominal_off)
    assert len(found.held_out.t) == len(found.held_out.measured) == round(0.2 * len(log))
    assert found.held_out.t[-1] == pytest.approx(found.seconds)
    assert (found.source, found.seconds) == (log.source, log.seconds)
    assert len(steps) == 4
    page = unescape(report.finger_html(found, "finger.npz"))
    assert page.count("<img") == 5
    assert dict(report.unknown(found)).keys() == {"tendon_stiffness"}
    assert all(why in page for _, why in (*report.unknown(found), *found.undetermined))
    for e in found.estimates:
        texts = report.label(e), report.interval(e), report.number(e, e.value)
        assert e in found.arms or all(text in page for text in texts)  # Arms are in the chart.
    assert report.summary_line(found).startswith("arms: 25 intervals, the widest")


def test_intervals_contain_the_truth() -> None:
    """Intervals of joints and friction contain the truth; intervals of arms exclude the nominal."""
    _, truth, found, _ = quick()
    by_name = {e.name: e for e in found.estimates}
    for j, joint in enumerate(JOINTS):
        for name in ("joint_stiffness", "joint_damping"):
            e = by_name[f"{name}/{joint}"]
            assert e.low < getattr(truth, name)[j] < e.high
            assert e.nominal == getattr(NOMINAL, name)[j]
    assert by_name["tendon_friction"].low < 0.3 < by_name["tendon_friction"].high
    assert by_name["command_delay"].low < 0.02 + 0.005
    assert len(found.arms) == int(ARMS.sum())
    assert all(e.differs for e in found.arms)
    ends = found.arm_intervals
    assert (ends[~ARMS] == 0.0).all()
    np.testing.assert_allclose(ends.mean(axis=2), found.parameters.arms, atol=1e-12)


MOTORS = Motors(0.03, 0.001, 0.9, (0.001, 0.002, 0.01), saturates=True, tension_noise=0.1)
DYNAMICS = {name: (2.0 * value, 0.1) for name, value in FACTORS.items()}


def estimates(
    compliance: float = 1e-4,
    compliance_sd: float = 1e-5,
    motors: Motors = MOTORS,
    rig: FingerParameters | None = None,
) -> dict[str, ParameterEstimate]:
    """Return the estimates of a synthetic fit over a log of 300 rows, keyed by name."""
    log = dataclasses.replace(made_up(), motors=rig)
    found = result._estimates(kinematics(compliance, compliance_sd), motors, DYNAMICS, log)
    return {e.name: e for e in found}


def test_intervals_follow_from_standard_errors() -> None:
    """Half widths are a quantile times the standard errors, most of which include model errors."""
    found, reach = estimates(), interval_quantile(300, 0.02)
    # On a rig, the model error of friction is smaller, and arms have a model error too.
    rig = estimates(rig=NOMINAL.replace(path=CommandPath()))
    arm = "moment_arms/FDP/MCP_flexion"
    for e, error in (
        *((found[f"moment_arms/{TENDONS[i]}/{JOINTS[j]}"], 1e-4) for i, j in np.argwhere(ARMS)),
        (rig[arm], math.hypot(1e-4, 0.04e-3)),
        (found["motor_lag"], math.hypot(0.001, 0.0005)),
        (found["strength"], 0.01),
    ):
        assert 0.5 * (e.high - e.low) == pytest.approx(reach * error)
    assert (found[arm].value, found[arm].unit) == (NOMINAL.arms[0, 0], "m")
    for name, unit, error in (
        ("joint_stiffness/PIP_flexion", "N·m/rad", 0.15),
        ("joint_damping/PIP_flexion", "N·m·s/rad", 0.20),
        ("tendon_friction", "N", 1.15),
    ):
        e, by = found[name], math.exp(1.96 * math.hypot(0.1, error))
        assert (e.value, e.unit) == (2.0 * FACTORS[name], unit)
        assert (e.low, e.high) == pytest.approx((e.value / by, e.value * by))
    delay, friction = found["command_delay"], rig["tendon_friction"]
    assert (delay.low, delay.value) == (0.0, 0.001)  # Clipped at zero.
    assert delay.high == pytest.approx(0.001 + reach * math.hypot(0.002, 0.002))
    by = math.exp(1.96 * math.hypot(0.1, 0.15))
    assert friction.high == pytest.approx(friction.value * by)
    assert "strength" not in estimates(motors=dataclasses.replace(MOTORS, saturates=False))


def test_stiffness_has_the_interval_of_its_inverse() -> None:
    """The upper end is infinite if the compliance is not clearly above zero."""
    reach = interval_quantile(300, 0.02)
    e = estimates()["tendon_stiffness"]
    assert e.value == pytest.approx(1e4)
    half = reach * math.hypot(1e-5, 0.02 * 1e-4)  # The model error is 2 %.
    assert e.low == pytest.approx(1.0 / (1e-4 + half))
    assert e.high == pytest.approx(1.0 / (1e-4 - half))
    assert e.differs
    unclear = estimates(1e-5, 1e-5)["tendon_stiffness"]
    assert (unclear.value, unclear.high) == (math.inf, math.inf)
    assert not unclear.differs
    assert estimates(-1e-4, 1e-6)["tendon_stiffness"].low == math.inf
    # The stiffness is finite if the compliance is above 1.96 standard errors and 1 / (250 kN/m).
    for compliance, sd, stiffness in (
        (1e-4, 0.5e-4, 1e4),
        (1e-4, 0.52e-4, None),
        (4.1e-6, 1e-9, 1.0 / 4.1e-6),
        (3.9e-6, 1e-9, None),
        (-1e-4, 1e-6, None),
    ):
        found = result._parameters(kinematics(compliance, sd), MOTORS, DYNAMICS, None)
        assert found.tendon_stiffness == pytest.approx(stiffness)


def test_fitted_values_become_parameters() -> None:
    """Joints, tendon friction, lag, delay and noise are fitted; joint friction stays nominal."""
    found = result._parameters(kinematics(0.0, 1e-6, 0.02), MOTORS, DYNAMICS, None)
    assert found.moment_arms == NOMINAL.moment_arms
    assert found.joint_stiffness == tuple(2.0 * v for v in NOMINAL.joint_stiffness)
    assert found.joint_damping == tuple(2.0 * v for v in NOMINAL.joint_damping)
    assert found.tendon_friction == 1.0
    assert (found.motor_lag, found.command_delay) == (0.03, 0.001)
    assert found.joint_noise == pytest.approx(0.02)
    assert found.tension_noise == 0.1
    assert found.joint_friction == NOMINAL.joint_friction
    assert result._parameters(kinematics(0.0, 1e-6), MOTORS, DYNAMICS, None).joint_noise == 0.0


def test_undetermined_parameters_are_listed() -> None:
    still = dataclasses.replace(MOTORS, saturates=False)
    rig = NOMINAL.replace(path=CommandPath(), motor_lag=0.003, motor_kg=1.5, tendon_damping=70.0)
    always = {"joint_friction", "tendon_damping", "motor_kg", "backlash"}
    assert dict(result._undetermined(MOTORS, None)).keys() == always
    assert dict(result._undetermined(still, None)).keys() == always | {"most_tension"}
    known = dict(result._undetermined(still, rig))
    assert known.keys() == always | {"motor_lag"}
    for name, value in (("motor_kg", "1500 g"), ("tendon_damping", "70 N"), ("motor_lag", "3 ms")):
        assert f"assumed {value}" in known[name]


@pytest.mark.parametrize("stiffness", [None, 2e4])
def test_replay_of_the_true_finger_repeats_the_motion(stiffness: float | None) -> None:
    """A replay of one second is off by less than a degree RMS, with stiff and elastic tendons."""
    true = NOMINAL.replace(tendon_stiffness=stiffness, command_delay=0.02)
    log, _ = recorded(2.0, parameters=true)
    motors = Motors(true.motor_lag, true.command_delay, 1.0, (0.0, 0.0, 0.0), False, 0.0)
    window = cut_windows(log, kinematics(angles=log.angles), motors)[0]
    weak = true.replace(joint_damping=tuple(3.0 * v for v in true.joint_damping))
    same, other = (replay(log, finger, window) - window.angles for finger in (true, weak))
    np.testing.assert_array_equal(same[0], np.zeros(4))
    assert np.sqrt(np.mean(same**2)) < np.radians(1.0)
    assert np.sqrt(np.mean(other**2)) > np.radians(5.0)


def test_unbounded_intervals_are_unknown() -> None:
    """An interval that is infinite, or wider than its limit, is shown as "unknown"."""
    found, stretch = estimates(1e-5, 1e-5), "tendon_stiffness"
    stiffness, arm = found["joint_stiffness/PIP_flexion"], found["moment_arms/FDP/MCP_flexion"]
    for e, why in (
        (found[stretch], "above 31.1 N/mm"),
        (estimates(-1e-4, 1e-6)[stretch], "no stretch"),
        (found["tendon_friction"], "wider than 3 N counts as unknown"),
        (dataclasses.replace(stiffness, high=1.0), "60 mN·m/rad"),
    ):
        assert report.interval(e) == "unknown"
        assert why in report.unbounded(e)
    assert report.unbounded(stiffness) == ""
    assert report.interval(estimates()[stretch]) == "8.16 to 12.9"
    assert report.arm_cell(arm) == "8.60 ±0.22"
    assert report.arm_cell(dataclasses.replace(arm, nominal=0.0)) == "8.60 ±0.22*"
    assert report.arm_cell(dataclasses.replace(arm, high=0.03)) == "unknown"


@pytest.mark.slow
def test_a_noisy_finger_is_identified() -> None:
    """Intervals contain most true values, and an env accepts the parameters."""
    log, truth = recorded(10.0, seed=2, gap="real-like", finger_seed=5)
    found = identify(log)
    ends, passed = found.arm_intervals, truth.arms != 0.0
    held = (ends[..., 0] <= truth.arms) & (truth.arms <= ends[..., 1])
    assert held[passed].mean() >= 0.9
    assert (ends[~passed] == 0.0).all()
    off, nominal_off = found.held_out.off
    assert off < 0.5 * nominal_off
    intervals = {e.name: (e.low, e.high) for e in found.estimates}
    for j, joint in enumerate(JOINTS):
        low, high = intervals[f"joint_stiffness/{joint}"]
        assert low < truth.joint_stiffness[j] < high
    with gym.make("shapechanger/Finger-v1", parameters=found.parameters.to_json()) as env:
        env.reset(seed=0)
        observation, *_ = env.step(np.zeros(7, np.float32))
        assert np.isfinite(observation).all()


def test_a_delay_below_a_period_is_identified() -> None:
    """Only the motion shows this delay of a rig, whose motors and command path are in the log."""
    path = CommandPath(slew_per_s=20.0, slew_down_per_s=20.0)
    drawn = with_gears(GAPS["real-like"].draw(np.random.default_rng(1)))
    late = drawn.replace(path=path, command_delay=0.008, joint_noise=0.0)
    log, truth = recorded(4.0, parameters=late)
    known = {"most_tension": truth.most_tension, "least_tension": truth.least_tension}
    assert log.motors == with_gears(NOMINAL.replace(path=path, **known))
    found = identify(log)
    assert found.parameters.path == path
    assert found.parameters.command_delay == pytest.approx(0.008, abs=0.007)
    names = {e.name for e in found.estimates}
    assert names & {"command_delay", "motor_lag"} == {"command_delay"}
    assert "motor_lag" in dict(found.undetermined)
