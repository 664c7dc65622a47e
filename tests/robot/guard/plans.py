"""Robot plans for the tests of the guard."""

from dataclasses import replace

from shapechanger.contract.plan import ActionPlan, GuardPlan, LimitPlan, SensorPlan, StopPlan
from shapechanger.robot.guard.channel import Order
from tests.robot.twin.robots import hbridge

MS = 1_000_000
"""Nanoseconds of a millisecond."""


def car(limits: LimitPlan | None = None, stop: StopPlan | None = None) -> GuardPlan:
    """A car with two motors: steering leaves rest by at most 4 per second, throttle by 2."""
    return GuardPlan(
        name="test car",
        actions=(
            ActionPlan("steering", -0.8, 0.8, slew_per_s=4.0),
            ActionPlan("throttle", -0.4, 0.6, slew_per_s=2.0, propels=True),
        ),
        outputs=(
            hbridge("steer", "steering", (17, 4), {"steering": 1.0}),
            hbridge("drive", "wheels", (22, 27), {"throttle": 1.0}),
        ),
        sensors=(
            SensorPlan("bumper", "switch", "bump"),
            SensorPlan("wheel", "encoder", "speed"),
            SensorPlan("eye", "hcsr04", "distance"),
            SensorPlan("meter", "ina219", "battery"),
            SensorPlan("chip", "cpu_temperature", "temperature"),
        ),
        limits=limits or LimitPlan(),
        stop=stop or StopPlan(),
    )


def quick_car(limits: LimitPlan | None = None, stop: StopPlan | None = None) -> GuardPlan:
    """The car of `car`, without slew limits."""
    plan = car(limits, stop)
    actions = tuple(replace(action, slew_per_s=float("inf")) for action in plan.actions)
    return replace(plan, actions=actions)


def arm(now_ns: int, emergency: int = 0, *, person: bool = True) -> Order:
    """An order to arm, issued now."""
    return Order("arm", issued_ns=now_ns, emergency=emergency, person=person)


def command(
    seq: int,
    now_ns: int,
    values: tuple[float, ...] = (0.5, 0.5),
    *,
    session: int = 1,
    ttl_ms: int = 1_000,
    frame_ns: int | None = None,
) -> Order:
    return Order("command", session, seq, now_ns, ttl_ms, frame_ns, values)
