"""A finger from a log, as a whole."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

from shapechanger.bodies.finger import JOINTS, NOMINAL
from shapechanger.envs.finger.gap import GAPS, with_gears
from shapechanger.errors import MissingExtra
from shapechanger.identify import identify
from shapechanger.identify import motion as toolbox
from shapechanger.reports.finger import finger_html, interval, label, number, summary_line
from tests.identify.logs import recorded


@pytest.mark.slow
def test_without_noise_everything_that_can_be_told_is_found() -> None:
    """Arms to a hundredth, stiff tendons, joints and motors; and the finger goes the same way."""
    changes = {"joint_stiffness": 1.3, "joint_damping": 0.8}
    parameters = NOMINAL.replace(
        moment_arms=tuple(tuple(1.08 * arm for arm in row) for row in NOMINAL.moment_arms),
        command_delay=0.02,
        **{k: tuple(f * v for v in getattr(NOMINAL, k)) for k, f in changes.items()},
    )
    log, truth = recorded(8.0, parameters=parameters)
    heard: list[str] = []
    found = identify(log, heard.append)
    np.testing.assert_allclose(found.parameters.arms, truth.arms, rtol=0.01)
    assert found.parameters.tendon_stiffness is None
    np.testing.assert_allclose(found.parameters.joint_stiffness, truth.joint_stiffness, rtol=0.1)
    np.testing.assert_allclose(found.parameters.joint_damping, truth.joint_damping, rtol=0.15)
    assert found.parameters.command_delay == pytest.approx(0.02, abs=0.005)
    off, nominal_off = found.held_out.off
    assert off < np.radians(2.0)
    assert nominal_off > 2.0 * off
    assert heard == [
        "arms and stretch, from lengths",
        "motors, from tensions",
        "joints and friction, from motion",
        "the last fifth, simulated",
    ]


@pytest.mark.slow
def test_a_noisy_finger_becomes_an_env_and_a_page() -> None:
    """What comes out is a finger to make an env of, and a page that shows all of it."""
    log, truth = recorded(10.0, seed=2, gap="real-like", finger_seed=5)
    found = identify(log)
    ends = found.arm_intervals
    passed = truth.arms != 0.0
    held = (ends[..., 0] <= truth.arms) & (truth.arms <= ends[..., 1])
    assert held[passed].mean() >= 0.9
    assert (ends[~passed] == 0.0).all()
    off, nominal_off = found.held_out.off
    assert off < 0.5 * nominal_off
    intervals = {e.name: (e.low, e.high) for e in found.estimates}
    for j, joint in enumerate(JOINTS):
        low, high = intervals[f"joint_stiffness/{joint}"]
        assert low < truth.joint_stiffness[j] < high
    page = finger_html(found, "finger.npz")
    for e in found.estimates:
        assert label(e) in page
        assert interval(e) in page
        assert number(e, e.value) in page
    for name, why in found.untold:
        assert name in page
        assert why in page
    assert page.count("<img") == 4
    assert summary_line(found).startswith("arms: 25 intervals, the widest of those above 2 mm ±")
    with gym.make("shapechanger/Finger-v1", parameters=found.parameters.to_json()) as env:
        env.reset(seed=0)
        observation, *_ = env.step(np.zeros(7, np.float32))
        assert np.isfinite(observation).all()


def test_without_the_toolbox_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo's toolbox is there without what it needs, and empty then."""
    monkeypatch.setattr(toolbox.importlib, "import_module", lambda name: object())
    with pytest.raises(MissingExtra, match=r"shapechanger\[identify\]"):
        toolbox.sysid_toolbox()


@pytest.mark.slow
def test_motors_that_are_known_hide_no_joint() -> None:
    """With gears, and with a current limit that is not in the proportion of muscles."""
    weak = (15.0, 15.0, 7.0, 15.0, 6.4, 15.0, 15.0)
    drawn = GAPS["real-like"].draw(np.random.default_rng(3))
    log, truth = recorded(8.0, parameters=with_gears(drawn.replace(most_tension=weak)))
    found = identify(log, known=with_gears(NOMINAL.replace(most_tension=weak)))
    assert found.parameters.most_tension == weak
    assert found.parameters.motor_kg == truth.motor_kg
    assert "most_tension" not in dict(found.untold)
    np.testing.assert_allclose(found.parameters.joint_stiffness, truth.joint_stiffness, rtol=0.3)
    np.testing.assert_allclose(found.parameters.joint_damping, truth.joint_damping, rtol=0.3)
