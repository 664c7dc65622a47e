"""Output values mixed from the actions of a robot."""

from __future__ import annotations

import pytest

from shapechanger.contract.plan import ActionPlan, GuardPlan, OutputPlan, output_values

_PLAN = GuardPlan(
    "tank",
    (ActionPlan("steering"), ActionPlan("throttle", propels=True)),
    (
        OutputPlan("left", "hbridge", mix={"throttle": 1.0, "steering": 1.0}),
        OutputPlan("right", "hbridge", mix={"throttle": 1.0, "steering": -1.0}, offset=0.25),
    ),
)


def test_an_output_is_its_offset_plus_its_weighted_actions() -> None:
    assert output_values(_PLAN, [0.25, 0.5]) == (0.75, 0.5)
    assert output_values(_PLAN, [1.0, 1.0]) == (1.0, 0.25)


@pytest.mark.parametrize("actions", [[], [0.5], [0.0, 0.5, 0.0]])
def test_a_wrong_number_of_actions_is_refused(actions: list[float]) -> None:
    with pytest.raises(ValueError, match=r"tank has 2 actions \(steering, throttle\), got "):
        output_values(_PLAN, actions)
