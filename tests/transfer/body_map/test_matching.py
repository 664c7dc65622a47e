"""Matching of features to rules."""

from __future__ import annotations

from typing import Any

import pytest

from shapechanger.errors import MapError, UnknownName
from shapechanger.layout import Feature, Layout
from shapechanger.transfer.body_map import BodyMap, Copy, Hold, Learn, RuleLike, Zero
from tests.transfer.body_map.bodies import (
    DEGREE,
    ant_action,
    ant_observation,
    motor,
    pendulum_action,
    pendulum_observation,
)


def grown(**options: object) -> BodyMap:
    """Return the map from the ant to the ant with feet."""
    return BodyMap.between(
        ant_observation(),
        ant_observation(feet=True),
        ant_action(),
        ant_action(feet=True),
        **options,  # type: ignore[arg-type]
    )


def shrunk(**options: object) -> BodyMap:
    """Return the map from the ant with feet to the ant."""
    return BodyMap.between(
        ant_observation(feet=True),
        ant_observation(),
        ant_action(feet=True),
        ant_action(),
        **options,  # type: ignore[arg-type]
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
    held = rules_of(shrunk(rules={"foot_*/angle": "hold"}))["foot_1/angle"]
    assert isinstance(held, Hold)
    assert held.value == pytest.approx(65 * DEGREE)


def test_the_first_glob_that_fits_counts() -> None:
    rules = rules_of(grown(rules={"foot_[12]/*": "learn", "foot_*": "hold"}))
    assert [rules[f"foot_{leg}/motor"] for leg in (1, 2, 3)] == [Learn(), Learn(), Hold(0.0)]


def test_an_exact_name_comes_before_a_glob() -> None:
    rules = rules_of(grown(rules={"foot_*": "learn", "foot_3/motor": "zero"}))
    assert rules["foot_3/motor"] == Zero()


def test_only_an_exact_name_overrides_an_equal_name() -> None:
    rules = rules_of(grown(rules={"*/motor": "learn", "hip_1/motor": "zero"}))
    assert rules["hip_1/motor"] == Zero()
    assert rules["hip_2/motor"] == Copy("hip_2/motor")
    assert rules["foot_2/motor"] == Learn()


def test_stars_are_substituted() -> None:
    """Each foot copies the ankle of its own leg."""
    rules = rules_of(grown(rules={"foot_*/motor": "copy ankle_*/motor"}))
    assert rules["foot_3/motor"] == Copy("ankle_3/motor")


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
    with pytest.raises(MapError, match=r"'zero', 'hold' or 'learn', not 'copy hip_1/motor'"):
        grown(otherwise="copy hip_1/motor")


def test_a_constant_outside_the_range_is_refused() -> None:
    with pytest.raises(MapError, match=r"'foot_4/motor' cannot hold 3: it reaches from -1 to 1"):
        grown(rules={"foot_*": Hold(3.0)})
    with pytest.raises(MapError, match="cannot hold 3"):
        grown(otherwise=Hold(3.0))


def test_a_pattern_without_matches_is_refused() -> None:
    with pytest.raises(UnknownName, match=r"matches 'fot_1/motor'\. Did you mean 'foot_1/motor'"):
        grown(rules={"fot_1/motor": "learn"})


def test_a_pattern_that_changes_nothing_is_refused() -> None:
    with pytest.raises(MapError, match=r"The rule 'hip_\*' changes nothing"):
        grown(rules={"hip_*": "learn"})


def test_an_unknown_rule_is_refused() -> None:
    with pytest.raises(MapError, match=r"No rule matches 'lern'. Did you mean 'learn'"):
        grown(rules={"foot_*": "lern"})


def test_an_unknown_partner_is_refused() -> None:
    with pytest.raises(UnknownName, match=r"No source action feature .* Did you mean 'ankle_1/mot"):
        grown(rules={"foot_1/motor": "copy ankle_1/moter"})


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


def test_a_body_without_motors_is_refused_too() -> None:
    with pytest.raises(MapError, match=r"source action features are .*: 'hold'"):
        BodyMap.between(
            pendulum_observation(), pendulum_observation(), Layout(()), pendulum_action()
        )


def test_unrelated_bodies_can_be_mapped_by_rules() -> None:
    built = BodyMap.between(
        pendulum_observation(),
        pendulum_observation(),
        pendulum_action(),
        ant_action(),
        rules={"*/motor": "learn"},
    )
    assert {entry.rule for entry in built.action} == {Learn()}


def test_equal_torque_is_a_scale() -> None:
    """A motor of twice the gain gets half the action."""
    weak, strong = pendulum_action(100.0), pendulum_action(200.0)
    sides = pendulum_observation(), pendulum_observation()
    assert BodyMap.between(*sides, weak, strong).action[0].rule == Copy("slide/motor")
    built = BodyMap.between(*sides, weak, strong, units="torque")
    assert built.action[0].rule == Copy("slide/motor", 0.5)
    built = BodyMap.between(
        *sides, weak, strong, units="torque", rules={"slide/motor": Copy("slide/motor", -1.0)}
    )
    assert built.action[0].rule == Copy("slide/motor", -0.5)


def test_forces_and_torques_are_not_converted() -> None:
    sides = pendulum_observation(), pendulum_observation()
    with pytest.raises(MapError, match="gives 100 N and one of 'slide/motor' 100 N·m"):
        BodyMap.between(*sides, pendulum_action(), pendulum_action(unit="N·m"), units="torque")


def test_unknown_gains_are_not_scaled() -> None:
    silent = Layout((motor("slide", 1.0, ""),))
    sides = pendulum_observation(), pendulum_observation()
    built = BodyMap.between(*sides, silent, silent, units="torque")
    assert built.action[0].rule == Copy("slide/motor")


@pytest.mark.parametrize("rule", [{"hold": 1.0}, {"take": "ankle_1/motor"}, 0.5, None])
def test_a_rule_of_another_type_is_refused(rule: Any) -> None:
    with pytest.raises(MapError, match=r"The rule 'foot_1/motor' is .*: give 'zero', 'hold'"):
        BodyMap.between(
            ant_observation(),
            ant_observation(feet=True),
            ant_action(),
            ant_action(feet=True),
            rules={"foot_1/motor": rule},
        )
