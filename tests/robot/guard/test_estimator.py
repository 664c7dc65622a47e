"""Estimated actions and reasons when outputs deviate from their commands."""

import pytest

from shapechanger.contract.plan import ActionPlan, GuardPlan, OutputPlan
from shapechanger.robot.guard.outputs import ActionEstimator

_CAR = GuardPlan(
    "car",
    (ActionPlan("steering", rest=0.1), ActionPlan("throttle", propels=True)),
    (
        OutputPlan("drive", "esc", mix={"throttle": 1.0}),
        OutputPlan("steer", "servo", mix={"steering": -0.5}, offset=0.2),
    ),
)
_TANK = GuardPlan(
    "tank",
    (ActionPlan("steering", propels=True), ActionPlan("throttle", propels=True)),
    (
        OutputPlan("left", "hbridge", mix={"throttle": 1.0, "steering": 1.0}),
        OutputPlan("right", "hbridge", mix={"throttle": 1.0, "steering": -1.0}),
    ),
)
_WAITS = "Output drive: its controller waits, brakes or changes direction."
_SLOW = "Output steer: it turns no faster than its profile allows."


@pytest.mark.parametrize(
    ("has", "actions", "reason"),
    [
        ((-0.4, -0.05), (0.5, -0.4), ""),
        ((-0.41, -0.04), (0.5, -0.4), ""),
        ((0.0, -0.05), (0.5, 0.0), _WAITS),
        ((-0.4, 0.15), (0.1, -0.4), _SLOW),
        ((-0.4, 0.05), (0.3, -0.4), _SLOW),
        ((0.0, 0.05), (0.3, 0.0), f"{_WAITS} {_SLOW}"),
    ],
)
def test_an_action_is_estimated_from_its_output(
    has: tuple[float, float], actions: tuple[float, float], reason: str
) -> None:
    done = ActionEstimator(_CAR).estimate((0.5, -0.4), (-0.4, -0.05), has)
    assert done.actions == pytest.approx(actions)
    assert done.reason == reason


def test_mixed_outputs_show_rest_only() -> None:
    estimator = ActionEstimator(_TANK)
    assert estimator.estimate((0.2, 0.5), (0.7, 0.3), (0.0, 0.0)).actions == (0.0, 0.0)
    one = estimator.estimate((0.2, 0.5), (0.7, 0.3), (0.0, 0.3))
    assert one.actions == (0.2, 0.5)
    assert one.reason == "Output left: it does not follow."


def test_an_action_with_two_outputs_is_active_while_one_moves() -> None:
    boat = GuardPlan(
        "boat",
        (ActionPlan("throttle", propels=True),),
        tuple(OutputPlan(name, "esc", mix={"throttle": 1.0}) for name in ("left", "right")),
    )
    done = ActionEstimator(boat).estimate((0.5,), (0.5, 0.5), (0.5, 0.0))
    assert done.actions == (0.5,)
    assert done.reason.startswith("Output right: its controller waits")
