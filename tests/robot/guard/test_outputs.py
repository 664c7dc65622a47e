"""Outputs: mixed from actions, estimated back from deviations, and made safe."""

from dataclasses import replace
from pathlib import Path

import pytest

from shapechanger.contract.plan import ActionPlan, GuardPlan, OutputPlan, output_values
from shapechanger.robot.guard.outputs import estimated, make_safe
from tests.robot.guard.plans import car
from tests.robot.guard.recording import Record, connect

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
    applied, why = estimated(_CAR, (0.5, -0.4), (-0.4, -0.05), has)
    assert applied == pytest.approx(actions)
    assert why == reason


def test_mixed_outputs_show_rest_only() -> None:
    assert estimated(_TANK, (0.2, 0.5), (0.7, 0.3), (0.0, 0.0))[0] == (0.0, 0.0)
    one = estimated(_TANK, (0.2, 0.5), (0.7, 0.3), (0.0, 0.3))
    assert one == ((0.2, 0.5), "Output left: it does not follow.")


def test_an_action_with_two_outputs_is_active_while_one_moves() -> None:
    boat = GuardPlan(
        "boat",
        (ActionPlan("throttle", propels=True),),
        tuple(OutputPlan(name, "esc", mix={"throttle": 1.0}) for name in ("left", "right")),
    )
    done = estimated(boat, (0.5,), (0.5, 0.5), (0.5, 0.0))
    assert done == ((0.5,), _WAITS.replace("drive", "right"))


_OFFSET = GuardPlan(
    "tank",
    (ActionPlan("steering"), ActionPlan("throttle", propels=True)),
    (
        OutputPlan("left", "hbridge", mix={"throttle": 1.0, "steering": 1.0}),
        OutputPlan("right", "hbridge", mix={"throttle": 1.0, "steering": -1.0}, offset=0.25),
    ),
)


def test_an_output_is_its_offset_plus_its_weighted_actions() -> None:
    assert output_values(_OFFSET, [0.25, 0.5]) == (0.75, 0.5)
    assert output_values(_OFFSET, [1.0, 1.0]) == (1.0, 0.25)


@pytest.mark.parametrize("actions", [[], [0.5], [0.0, 0.5, 0.0]])
def test_a_wrong_number_of_actions_is_refused(actions: list[float]) -> None:
    with pytest.raises(ValueError, match=r"tank has 2 actions \(steering, throttle\), got "):
        output_values(_OFFSET, actions)


def test_make_safe_continues_after_a_failed_output(tmp_path: Path) -> None:
    record = Record(tmp_path / "record")
    (tmp_path / "stuck-GPIO17").touch()
    plan = replace(car(), enable_pin=5)
    failures = make_safe(plan, connect(str(record.path)))
    assert len(failures) == 1
    assert failures[0].startswith("Output steer: ")
    assert {line["pin"] for line in record.pins()} >= {"GPIO22", "GPIO27", "GPIO5"}
    assert record.is_at_rest()
    (tmp_path / "stuck-GPIO17").unlink()
    assert not make_safe(plan, connect(str(record.path)))
    (tmp_path / "stuck-GPIO5").touch()
    assert "Enable pin 5" in make_safe(plan, connect(str(record.path)))[0]
