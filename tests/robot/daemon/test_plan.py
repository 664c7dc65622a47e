"""Settings of the daemon."""

from __future__ import annotations

import msgspec
import pytest

from shapechanger.robot.daemon.plan import DaemonPlan
from tests.robot.daemon.plans import car_plan


def test_a_plan_round_trips() -> None:
    plan = car_plan(reward={"speed": 1.0}, reset=(((0.0, -0.3), 1.5), ((0.0, 0.0), 0.5)))
    assert msgspec.convert(msgspec.to_builtins(plan), DaemonPlan) == plan


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"control_hz": 0.0}, "control_hz"),
        ({"port": 65536}, "port"),
        ({"arming": "nobody"}, "arming"),
        ({"deadline_ms": "250"}, "deadline_ms"),
        ({"robott": "car"}, "robott"),
        ({"robot": ""}, "robot"),
        ({"camera": {"driver": "pattern", "size": [160]}}, "camera"),
    ],
)
def test_an_invalid_field_is_named(change: dict[str, object], text: str) -> None:
    fields = msgspec.to_builtins(car_plan())
    name = next(iter(change))
    (fields["card"] if name in fields["card"] else fields).update(change)
    with pytest.raises(msgspec.ValidationError, match=text):
        msgspec.convert(fields, DaemonPlan)
