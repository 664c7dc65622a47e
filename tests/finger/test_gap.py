"""Parameters of fingers, and distributions of random fingers."""

import math
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import msgspec
import numpy as np
import pytest

from shapechanger.errors import FingerError, UnknownName
from shapechanger.finger.anatomy import AN_1983_ARMS, MOMENT_ARMS
from shapechanger.finger.gap import GAPS, Gap, geared_around, resolve_gap
from shapechanger.finger.identify import FingerLog
from shapechanger.finger.parameters import NOMINAL, CommandPath, FingerParameters
from shapechanger.finger.reach import FingerReachEnv
from shapechanger.finger.tensions import spans_all_torques
from tests.finger.commands import STRETCHED

_REAL_LIKE = GAPS["real-like"]
_RANGES = ("tendon_friction", "backlash", "motor_lag", "command_delay", "joint_noise")
_RANGES += ("tension_noise", "tendon_stiffness", "motor_kg")


@pytest.mark.parametrize("name", GAPS)
def test_parameters_are_drawn_from_their_ranges(name: str) -> None:
    """Values stay within their ranges and cover them, and tendons cross the same joints."""
    gap, rng = GAPS[name], np.random.default_rng(0)
    drawn = [gap.draw(rng) for _ in range(100)]
    found = {field: np.array([getattr(f, field) for f in drawn]) for field in _RANGES}
    strengths = np.array([f.most_tension for f in drawn]) / NOMINAL.most_tension
    np.testing.assert_allclose(np.ptp(strengths, axis=1), 0.0, atol=1e-12)
    found["strength"] = strengths[:, 0]
    for field, values in found.items():
        low, high = getattr(gap, field)
        assert low - 1e-12 * high <= values.min() <= values.max() <= high * (1.0 + 1e-12)
        assert np.ptp(values) > 0.8 * (high - low) or high == low
    low, high = gap.joint_factor
    for field in ("joint_stiffness", "joint_damping", "joint_friction"):
        factors = np.array([getattr(f, field) for f in drawn]) / getattr(NOMINAL, field)
        assert low <= factors.min() <= factors.max() <= high
        assert abs(np.log(factors).mean()) < 0.1
    nominal, arms = NOMINAL.arms, np.array([f.arms for f in drawn])
    assert (arms[:, nominal == 0.0] == 0.0).all()
    errors = arms[:, nominal != 0.0] / nominal[nominal != 0.0] - 1.0
    assert 0.95 * gap.arm_error < np.abs(errors).max() <= gap.arm_error + 1e-12


def test_draws_span_all_torques(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drawn arms give every torque; if hardly any arms do, the error names the range to reduce."""
    gap, rng = msgspec.structs.replace(_REAL_LIKE, arm_error=0.6), np.random.default_rng(0)
    assert all(spans_all_torques(gap.draw(rng).arms) for _ in range(40))
    raw = NOMINAL.arms * (1.0 + rng.uniform(-0.6, 0.6, (200, 7, 4)))
    assert 0.02 < np.mean([spans_all_torques(arms) for arms in raw]) < 0.9
    monkeypatch.setattr("shapechanger.finger.gap.spans_all_torques", lambda _: False)
    with pytest.raises(FingerError, match=r"off by 60%, tendons .* make arm_error smaller"):
        gap.draw(rng)


def test_only_a_finger_seed_fixes_the_finger() -> None:
    """Without a finger seed, each reset draws a finger, which the seed of the reset determines."""
    fixed, drawn = FingerReachEnv(gap="real-like", finger_seed=3), FingerReachEnv(gap="wide")
    found = []
    for seed in (1, 2, None, 1):
        fixed.reset(seed=seed)
        assert fixed.parameters == _REAL_LIKE.draw(np.random.default_rng(3))
        drawn.reset(seed=seed)
        found.append(drawn.parameters.to_json())
    assert found[0] == found[3]
    assert len(set(found)) == 3


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"arm_error": math.nan}, "arm_error must be 0 to below 1, got nan."),
        ({"motor_lag": (0.03, 0.01)}, r"motor_lag: a range must be .* got \(0.03, 0.01\)"),
        ({"joint_noise": (-0.1, 0.1)}, r"joint_noise: a range must be .* got \(-0.1, 0.1\)"),
        ({"backlash": (0.0, math.inf)}, r"backlash: a range must be .* got \(0.0, inf\)"),
        ({"motor_kg": (0.0, 1.0)}, "motor_kg: the range .* must begin above zero"),
    ],
)
def test_invalid_ranges_are_refused(changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(FingerError, match=sentence):
        Gap(**{**msgspec.structs.asdict(_REAL_LIKE), **changes})
    with pytest.raises(FingerError, match=sentence):
        resolve_gap({**msgspec.to_builtins(_REAL_LIKE), **changes})


def test_invalid_gaps_are_refused() -> None:
    for given in ("real-like", _REAL_LIKE, msgspec.to_builtins(_REAL_LIKE)):
        assert resolve_gap(given) == _REAL_LIKE
    with pytest.raises(UnknownName, match=r"'reallike'. Did you mean 'real-like'"):
        resolve_gap("reallike")
    with pytest.raises(FingerError, match="missing required field `joint_factor`"):
        resolve_gap({"arm_error": 0.1})
    with pytest.raises(FingerError, match="unknown field `fricton`"):
        resolve_gap({**msgspec.to_builtins(_REAL_LIKE), "fricton": (0.0, 1.0)})
    with pytest.raises(FingerError, match="Expected `object`, got `int`"):
        resolve_gap(3)  # pyright: ignore[reportArgumentType]


def test_arms_that_cannot_balance_are_refused() -> None:
    coupled, one_way = NOMINAL.arms, NOMINAL.arms
    coupled[:, 3] = coupled[:, 2]  # PIP and DIP only together.
    one_way[:, 0] = abs(one_way[:, 0])
    for arms in (coupled, one_way):
        with pytest.raises(FingerError, match="The tendons cannot balance the joints"):
            FingerReachEnv(parameters={"moment_arms": arms.tolist()})


def test_the_named_arms_need_not_balance() -> None:
    """The set "an-1983" is accepted by name; almost equal arms as numbers are refused."""
    env = FingerReachEnv(parameters="an-1983")
    env.reset(seed=0)
    assert env.step(np.zeros(7, np.float32))[4]["distance"] > 0.0
    np.testing.assert_array_equal(env.plant.parameters.arms, AN_1983_ARMS)
    with pytest.raises(FingerError, match="cannot balance the joints"):
        FingerReachEnv(parameters={"moment_arms": (AN_1983_ARMS * 1.0001).tolist()})
    with pytest.raises(UnknownName, match=r"'an-1938'. Did you mean 'an-1983'"):
        FingerReachEnv(parameters="an-1938")


@pytest.mark.parametrize("on_rig", [False, True])
def test_an_identified_source_has_the_found_parameters(
    monkeypatch: pytest.MonkeyPatch, on_rig: bool
) -> None:
    """Ten seconds of motion are identified; for a command path, the source is a gap."""
    found = NOMINAL.replace(tendon_friction=0.25, path=CommandPath() if on_rig else None)
    taken: list[FingerLog] = []

    def identified(log: FingerLog) -> SimpleNamespace:
        taken.append(log)
        return SimpleNamespace(parameters=found)

    monkeypatch.setattr("shapechanger.finger.identify.identify", identified)
    with gym.make("shapechanger/Finger-v1", max_episode_steps=-1, actions="tension") as env:
        source = env.unwrapped.identified_source(0)  # pyright: ignore[reportAttributeAccessIssue]
    assert [(log.seconds, log.actions) for log in taken] == [(pytest.approx(10.0), "tension")]
    if on_rig:
        assert source["reward"] == {"change": 5.0}
        assert resolve_gap(source["gap"]) == geared_around(found)
    else:
        assert source == {"parameters": msgspec.to_builtins(found)}


def test_parameters_round_trip_through_json() -> None:
    """Python and JSON have the same defaults."""
    for parameters in (NOMINAL, STRETCHED):
        text = parameters.to_json()
        assert FingerParameters.from_json(text) == parameters
        assert FingerParameters.from_json(text.encode()) == parameters
    changed = NOMINAL.replace(tendon_friction=1.0)
    assert changed != NOMINAL
    assert FingerParameters(tendon_friction=1.0) == changed
    assert FingerParameters.from_json('{"tendon_friction": 1.0}') == changed
    changed.arms[:] = 0.0  # `arms` is a copy.
    np.testing.assert_array_equal(changed.arms, MOMENT_ARMS)
    assert not changed.gives
    assert STRETCHED.gives


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"moment_arms": ((1.0,) * 4,) * 6}, r"moment_arms must be of shape \(7, 4\), finite, got"),
        ({"motor_lag": (1.0,)}, r"motor_lag must be of shape \(\)"),
        ({"joint_noise": math.nan}, "joint_noise must be of shape .* finite and not below zero"),
        ({"tendon_stiffness": math.inf}, "tendon_stiffness must be .* finite .* got inf"),
        ({"tendon_friction": -1.0}, "tendon_friction must be .* not below zero, got -1"),
        ({"motor_lag": 0.0}, "motor_lag must be above zero, got 0.0."),
        ({"motor_kg": "x"}, "motor_kg must be .*, got 'x'."),
        ({"most_tension": (0.5,) * 7}, "most_tension must be above least_tension, 0.5 N"),
        ({"backlash": 1e-3}, "backlash needs a tendon_stiffness: a stiff tendon has none."),
    ],
)
def test_invalid_numbers_are_refused(changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(FingerError, match=sentence):
        NOMINAL.replace(**changes)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("{", r"Invalid finger parameters: Input data was truncated\.$"),
        ('{"tendon_fricton": 1.0}', "unknown field `tendon_fricton`"),
        ('{"motor_lag": "slow"}', "Expected `float`, got `str`"),
        ('{"motor_lag": 0.0}', r"motor_lag must be above zero, got 0\.0\.$"),
    ],
)
def test_invalid_json_is_refused(text: str | bytes, sentence: str) -> None:
    with pytest.raises(FingerError, match=sentence):
        FingerParameters.from_json(text)
