"""Propulsion and motion reflexes, at the edges of their ranges."""

import pytest

from shapechanger.contract.limits import Duty, MotionReflexes, Propulsion, Stall
from shapechanger.contract.plan import ActionPlan, GuardPlan, LimitPlan, SensorPlan

_ACTIONS = (
    ActionPlan("steering", propels=True),
    ActionPlan("left", propels=True, unit="m/s", gain=2.0),
    ActionPlan("right", propels=True, unit="m/s", gain=3.0),
    ActionPlan("lamp", rest=0.5),
)
_TOUCH = "Not forward: the bumper touched something."
_NEAR = "Not forward: something is near."
_BACK = "Not backward: it pushes and does not move."


def test_no_duty_is_no_value() -> None:
    assert Duty(start=0.2).size_at(0.0) == 0.0 < Duty(start=0.2).size_at(0.01)


def test_push_and_speed_are_means() -> None:
    propulsion, turning = Propulsion(_ACTIONS), Propulsion(_ACTIONS[:1])
    assert propulsion.push((1.0, 0.5, 0.75, 1.0)) == pytest.approx((0.5 + 0.75) / 2)
    assert propulsion.speed((1.0, 0.5, 0.75, 1.0)) == pytest.approx((2.0 * 0.5 + 3.0 * 0.75) / 2)
    assert (turning.push((1.0,)), turning.speed((1.0,))) == (0.0, None)


@pytest.mark.parametrize(
    ("after_s", "push", "speed", "way"),
    [(1.0, -0.31, -0.009, -1), (1.0, -0.3, 0.0, 0), (1.0, 0.31, 0.01, 0), (1e-9, 0.31, 0.0, 1)],
)
def test_a_stall_needs_a_push_without_motion(
    after_s: float, push: float, speed: float, way: int
) -> None:
    stall, disabled = Stall(after_s, 0.3), Stall(0.0, 0.3)
    assert stall.watches is False
    for now_ns in (5, 1_000_000_005):
        stall.sense({"speed": speed}, push, now_ns)
        disabled.sense({"speed": speed}, push, now_ns)
    assert (stall.way, stall.watches, disabled.way, disabled.watches) == (way, True, 0, False)


def test_each_action_is_held_back_separately() -> None:
    """An action at rest stays at rest; all reasons are given, each once."""
    limits = LimitPlan(stop_distance_m=0.3, stall_s=0.1, stall_throttle=0.3)
    reflexes = MotionReflexes(GuardPlan("cart", _ACTIONS, (), limits=limits))
    for now_ns in (0, 100_000_000):
        reflexes.sense({"bump": 1.0, "speed": 0.0, "distance": 0.2}, False, -0.5, now_ns)
    for aims, allowed, reasons in (
        ((1.0, 0.2, -0.5, 1.0), (1.0, 0.0, 0.0, 1.0), f"{_TOUCH} {_NEAR} {_BACK}"),
        ((1.0, 0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 1.0), ""),
        ((1.0, -0.1, 0.2, 1.0), (1.0, -0.1, 0.0, 1.0), f"{_TOUCH} {_NEAR}"),  # Stall is over.
    ):
        assert reflexes.hold_back(aims, 100_000_000) == (allowed, reasons)


@pytest.mark.parametrize(("measures", "allowed"), [("distance", 0.0), ("bump", 0.4)])
def test_an_unknown_distance_forbids_to_drive_forward(measures: str, allowed: float) -> None:
    """Only a robot that has a sensor of distance waits for its first reading."""
    sensors = (SensorPlan("eye", "simulated", measures),)
    reflexes = MotionReflexes(
        GuardPlan("cart", _ACTIONS, (), sensors, limits=LimitPlan(stop_distance_m=0.3))
    )
    reflexes.sense({}, False, 0.0, 0)
    assert reflexes.hold_back((0.0, 0.4, -0.4, 0.0), 0)[0] == (0.0, allowed, -0.4, 0.0)
