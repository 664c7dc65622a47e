"""Matching of features to rules."""

from __future__ import annotations

from typing import Any

import pytest

from shapechanger.errors import MapError, UnknownName
from shapechanger.layout import Feature, Layout
from shapechanger.transfer.body_map import BodyMap, Copy, Hold, Learn, Zero
from shapechanger.transfer.body_map.rules import Rule, RuleLike
from tests.transfer.body_map.bodies import (
    DEGREE,
    GROWN,
    ant_action,
    ant_observation,
    carts,
    grown,
    motor,
    pendulum_action,
    pendulum_observation,
)


def rules_of(built: BodyMap) -> dict[str, object]:
    """Return the rule of each feature that is filled."""
    return {entry.feature: entry.rule for entry in (*built.observation, *built.action)}


def test_features_of_one_name_are_partners() -> None:
    built = grown()
    assert all(entry.rule == Copy(entry.feature) for entry in built.observation)
    assert {entry.why for entry in built.observation} == {"same name"}
    assert built.action[0].rule == Copy("hip_4/motor")
    assert (built.action[-1].rule, built.action[-1].why) == (Zero(), "default")


@pytest.mark.parametrize(
    ("like", "rule"),
    [
        ("zero", Zero()),
        ("learn", Learn()),
        ("hold", Hold(0.0)),
        (Hold(0.5), Hold(0.5)),
        ("copy ankle_2/motor", Copy("ankle_2/motor")),
        (Copy("ankle_2/motor", 0.5), Copy("ankle_2/motor", 0.5)),
    ],
)
def test_rules_have_a_short_form(like: RuleLike, rule: object) -> None:
    built = grown(rules={"foot_2/motor": like})
    assert rules_of(built)["foot_2/motor"] == rule
    assert {e.feature: e.why for e in built.action}["foot_2/motor"] == "rule 'foot_2/motor'"


def test_hold_is_the_middle_of_the_range() -> None:
    sees, seen, acts, acted = GROWN
    built = BodyMap.between(seen, sees, acted, acts, rules={"foot_*/angle": "hold"})
    held = rules_of(built)["foot_1/angle"]
    assert isinstance(held, Hold)
    assert held.value == pytest.approx(65 * DEGREE)


@pytest.mark.parametrize(
    ("rules", "expected"),
    [
        # The first glob that fits.
        (
            {"foot_[12]/*": "learn", "foot_*": "hold"},
            {"foot_1/motor": Learn(), "foot_2/motor": Learn(), "foot_3/motor": Hold(0.0)},
        ),
        ({"foot_*": "learn", "foot_3/motor": "zero"}, {"foot_3/motor": Zero()}),
        # Only an exact name overrides a partner of the same name.
        (
            {"*/motor": "learn", "hip_1/motor": "zero"},
            {"hip_1/motor": Zero(), "hip_2/motor": Copy("hip_2/motor"), "foot_2/motor": Learn()},
        ),
        ({"foot_*/motor": "copy ankle_*/motor"}, {"foot_3/motor": Copy("ankle_3/motor")}),
    ],
)
def test_exact_names_come_before_partners_and_these_before_globs(
    rules: dict[str, RuleLike], expected: dict[str, Rule]
) -> None:
    assert rules_of(grown(rules=rules)).items() >= expected.items()


@pytest.mark.parametrize(
    ("options", "kind", "message"),
    [
        ({"rules": {"foot_*": Hold(3.0)}}, MapError, "'foot_4/motor' cannot hold 3: .* -1 to 1"),
        ({"otherwise": Hold(3.0)}, MapError, "cannot hold 3"),
        ({"otherwise": "copy hip_1/motor"}, MapError, "'hold' or 'learn', not 'copy hip_1/motor'"),
        (
            {"rules": {"tail/*": "zero", "hip_1/motor": "zero"}},
            UnknownName,
            r"^No source observation feature or target action feature matches 'tail/\*'",
        ),
        (
            {"action_rules": {"foot_1/motor": "copy ankle_*/motor"}},
            MapError,
            "must have a star for each wildcard of 'foot_1/motor'",
        ),
        ({"rules": {"fot_1/motor": "learn"}}, UnknownName, "Did you mean 'foot_1/motor'"),
        ({"rules": {"hip_*": "learn"}}, MapError, r"The rule 'hip_\*' changes nothing"),
        ({"rules": {"foot_*": "lern"}}, MapError, "No rule matches 'lern'. Did you mean 'learn'"),
        (
            {"rules": {"foot_1/motor": "copy ankle_1/moter"}},
            UnknownName,
            "No source action feature .* Did you mean 'ankle_1/mot",
        ),
        *(
            ({"rules": {"foot_1/motor": rule}}, MapError, "The rule 'foot_1/motor' is .*: give 'z")
            for rule in ({"hold": 1.0}, {"take": "ankle_1/motor"}, 0.5, None)
        ),
    ],
)
def test_rules_that_do_not_fit_are_refused(
    options: dict[str, Any], kind: type[Exception], message: str
) -> None:
    with pytest.raises(kind, match=message):
        grown(**options)


def test_rules_can_be_for_one_side_only() -> None:
    """Rules of one side take precedence over shared ones."""
    layout = Layout((Feature("a", "1"), Feature("b", "1")))
    built = BodyMap.between(
        layout,
        Layout((Feature("a", "1"),)),
        Layout((Feature("a", "1"),)),
        layout,
        rules={"b": "learn"},
        observation_rules={"b": Hold(0.5)},
    )
    assert built.observation[1].rule == Hold(0.5)
    assert built.action[1].rule == Learn()
    with pytest.raises(UnknownName, match="No source observation feature matches 'c'"):
        BodyMap.between(layout, layout, layout, layout, observation_rules={"c": "zero"})
    with pytest.raises(UnknownName, match="No target action feature matches 'c'"):
        BodyMap.between(layout, layout, layout, layout, action_rules={"c": "zero"})


def test_unmatched_features_get_otherwise() -> None:
    assert rules_of(grown(otherwise="learn"))["foot_2/motor"] == Learn()
    assert rules_of(grown(otherwise=Hold(0.5)))["foot_2/motor"] == Hold(0.5)


def test_units_are_not_mixed() -> None:
    sides = pendulum_observation(), pendulum_observation(unit="deg")
    motors = pendulum_action(), pendulum_action()
    with pytest.raises(MapError, match=r"hinge/angle \[rad\] cannot copy .* hinge/angle \[deg\]"):
        BodyMap.between(*sides, *motors)
    built = BodyMap.between(
        *sides,
        *motors,
        observation_rules={
            "hinge/angle": Copy("hinge/angle", DEGREE),
            "hinge/velocity": Copy("hinge/velocity", DEGREE),
        },
    )
    sensed = built.adapt_observation([0.0, 180.0, 0.0, 90.0])
    assert sensed[1] == pytest.approx(180 * DEGREE)


def test_blocks_of_different_shapes_do_not_match() -> None:
    small = Layout((Feature("eye", "1", 0.0, 1.0, shape=(2, 3)),))
    large = Layout((Feature("eye", "1", 0.0, 1.0, shape=(4, 3)),))
    with pytest.raises(MapError, match=r"'eye' has the shape \(2, 3\) and cannot copy"):
        BodyMap.between(small, large, pendulum_action(), pendulum_action())


def test_bodies_with_nothing_in_common_are_refused() -> None:
    """The message lists the features of both bodies and an example of a rule."""
    with pytest.raises(MapError, match="These observation spaces cannot be mapped") as caught:
        BodyMap.between(pendulum_observation(), ant_observation(), pendulum_action(), ant_action())
    message = str(caught.value)
    assert "slider/position, hinge/angle" in message
    assert "torso/z, torso/qw" in message
    assert "and 43 more" in message
    assert "rules={'slider/position': 'copy torso/z'}" in message


def test_unrelated_bodies_can_be_mapped_by_rules() -> None:
    built = carts(pendulum_action(), ant_action(), rules={"*/motor": "learn"})
    assert {entry.rule for entry in built.action} == {Learn()}
    with pytest.raises(MapError, match=r"source action features are .*: 'hold'"):
        carts(Layout(()), pendulum_action())


def test_equal_torque_is_a_scale() -> None:
    """A motor of twice the gain gets half the action; unknown gains are not scaled."""
    motors = pendulum_action(100.0), pendulum_action(200.0)
    flipped = {"slide/motor": Copy("slide/motor", -1.0)}
    assert carts(*motors).action[0].rule == Copy("slide/motor")
    assert carts(*motors, units="torque").action[0].rule == Copy("slide/motor", 0.5)
    built = carts(*motors, units="torque", rules=flipped)
    assert built.action[0].rule == Copy("slide/motor", -0.5)
    silent = Layout((motor("slide", 1.0, ""),))
    assert carts(silent, silent, units="torque").action[0].rule == Copy("slide/motor")
    with pytest.raises(MapError, match="gives 100 N and one of 'slide/motor' 100 N·m"):
        carts(pendulum_action(), pendulum_action(unit="N·m"), units="torque")
