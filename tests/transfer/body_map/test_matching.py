"""Rules of a body map: their arithmetic, matching of features, globs and TOML."""

from __future__ import annotations

import math
from typing import Any

import pytest

from shapechanger.errors import MapError, UnknownName
from shapechanger.layout import Feature, Layout
from shapechanger.transfer.body_map import BodyMap, Copy, Hold, Learn, Zero
from shapechanger.transfer.body_map.rules import Rule, RuleLike, expand_template
from tests.transfer.body_map.bodies import (
    ANT_FLIP,
    ANT_SWAP,
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


@pytest.mark.parametrize("scale", [0.0, math.nan, math.inf])
def test_an_invalid_scale_is_refused(scale: float) -> None:
    with pytest.raises(MapError, match="'hip/angle' must be finite and not zero"):
        Copy("hip/angle", scale)
    with pytest.raises(MapError, match="must be finite, got nan"):
        Hold(math.nan)


@pytest.mark.parametrize(
    ("template", "pattern", "name", "result"),
    [
        ("ankle_1/motor", "foot_*/motor", "foot_2/motor", "ankle_1/motor"),
        ("ankle_*/motor", "foot_*/motor", "foot_2/motor", "ankle_2/motor"),
        ("ankle_*/motor", "foot_?/motor", "foot_2/motor", "ankle_2/motor"),
        ("ankle_*/motor", "foot_[12]/motor", "foot_2/motor", "ankle_2/motor"),
        ("ankle_*/motor", "foot_[!34]/motor", "foot_2/motor", "ankle_2/motor"),
        ("*/a_*", "*_*", "b.c_d", "b.c/a_d"),
    ],
)
def test_stars_become_the_matched_text(template: str, pattern: str, name: str, result: str) -> None:
    assert expand_template(template, pattern, name) == result
    for wrong in ("foot_2/motor", "*_*/motor"):  # Fewer or more wildcards than stars.
        with pytest.raises(MapError, match="must have a star for each wildcard"):
            expand_template("ankle_*/motor", wrong, "foot_2/motor")


def _layout(*names: str) -> Layout:
    return Layout(tuple(Feature(name, "1", -1.0, 1.0) for name in names))


MOTOR = _layout("motor")


@pytest.mark.parametrize(
    ("source", "target", "rules", "expected"),
    [
        # `leg[12]` names one feature; `leg1` and `leg2` get the default rule.
        (
            ("leg[12]", "leg1", "leg2", "tail*", "tail_2", "same"),
            ("same",),
            {"leg[12]": Hold(0.5), "tail*": Hold(0.25)},
            (Hold(0.5), Zero(), Zero(), Hold(0.25), Zero(), Copy("same")),
        ),
        # A target feature named `eye*` is copied literally.
        (
            ("left/eye", "same"),
            ("eye*", "same"),
            {"left/*": "copy eye*"},
            (Copy("eye*"), Copy("same")),
        ),
        # As in `fnmatch`: `[]` and `[!]` are literal, `[]]` and `[!a]` match a character.
        (
            ("a[]_1", "b[!]_2", "c]_3", "d]_4", "same"),
            ("x1", "x2", "y]3", "y]4", "same"),
            {"a[]_*": "copy x*", "b[!]_*": "copy x*", "c[]]_*": "copy y**", "d[!a]_*": "copy y**"},
            (Copy("x1"), Copy("x2"), Copy("y]3"), Copy("y]4"), Copy("same")),
        ),
    ],
)
def test_an_exact_name_is_not_a_glob(
    source: tuple[str, ...], target: tuple[str, ...], rules: dict[str, object], expected: object
) -> None:
    built = BodyMap.between(_layout(*source), _layout(*target), MOTOR, MOTOR, rules=rules)
    assert tuple(entry.rule for entry in built.observation) == expected


def test_a_mirror_prefers_exact_names_to_globs() -> None:
    """`leg?` and `arm*` are elements; `legs` and `arms` stay in place."""
    layout = _layout("leg?/angle", "legs/angle", "arm*/angle", "arms/angle")
    found = BodyMap.mirror(layout, MOTOR, swap={"leg?": "arm*"}, flip=["leg?", "arm*"])
    assert [entry.rule for entry in found.observation] == [
        Copy("arm*/angle", -1.0),
        Copy("legs/angle"),
        Copy("leg?/angle", -1.0),
        Copy("arms/angle"),
    ]


def rules_of(built: BodyMap) -> dict[str, object]:
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
def test_exact_names_precede_partners_and_partners_precede_globs(
    rules: dict[str, RuleLike], expected: dict[str, Rule]
) -> None:
    assert rules_of(grown(rules=rules)).items() >= expected.items()


@pytest.mark.parametrize(
    ("options", "kind", "message"),
    [
        ({"rules": {"foot_*": Hold(3.0)}}, MapError, "'foot_4/motor' cannot hold 3: .* -1 to 1"),
        ({"otherwise": Hold(3.0)}, MapError, "cannot hold 3"),
        ({"otherwise": "copy hip_1/motor"}, MapError, "'hold' or 'learn', got 'copy hip_1/motor'"),
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
    with pytest.raises(UnknownName, match="No target action feature"):
        BodyMap.from_toml('[action]\n"hip_1/angle" = "zero"', *GROWN)


def test_unmatched_features_get_otherwise() -> None:
    assert rules_of(grown(otherwise="learn"))["foot_2/motor"] == Learn()
    assert rules_of(grown(otherwise=Hold(0.5)))["foot_2/motor"] == Hold(0.5)


def test_units_are_not_mixed() -> None:
    sides = pendulum_observation(), pendulum_observation(unit="deg")
    motors = pendulum_action(), pendulum_action()
    for unscaled in ({}, {"hinge/angle": Copy("hinge/angle", -1.0)}):
        with pytest.raises(MapError, match=r"angle \[rad\] cannot copy .* hinge/angle \[deg\]"):
            BodyMap.between(*sides, *motors, observation_rules=unscaled)
    for scale in (DEGREE, -2.0):
        scaled = {name: Copy(name, scale) for name in ("hinge/angle", "hinge/velocity")}
        built = BodyMap.between(*sides, *motors, observation_rules=scaled)
        sensed = built.adapt_observation([0.0, 180.0, 0.0, 90.0])
        assert sensed[1] == pytest.approx(180 * scale)


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


EXAMPLE = """
units = "same"
otherwise = { hold = 0.1 }

[observation]
"torso/vx" = { take = "torso/vx", scale = 0.5 }

[action]
"foot_1/motor" = { take = "ankle_1/motor", scale = -0.5 }
"foot_2/motor" = "learn"
"foot_[3]/motor" = "copy ankle_*/motor"
"""


def test_rules_are_read_from_toml() -> None:
    built = BodyMap.from_toml(EXAMPLE, *GROWN)
    rules = {entry.feature: entry.rule for entry in (*built.observation, *built.action)}
    assert rules["torso/vx"] == Copy("torso/vx", 0.5)
    assert rules["foot_1/motor"] == Copy("ankle_1/motor", -0.5)
    assert rules["foot_2/motor"] == Learn()
    assert rules["foot_3/motor"] == Copy("ankle_3/motor")
    assert rules["foot_4/motor"] == Hold(0.1)
    assert BodyMap.from_toml("", *GROWN) == BodyMap.between(*GROWN)
    built = BodyMap.from_toml('[action]\n"foot_1/motor" = { take = "ankle_1/motor" }', *GROWN)
    assert Copy("ankle_1/motor") in [entry.rule for entry in built.action]


def test_units_come_from_the_text() -> None:
    """`units = "exact"` accepts constants beyond the range."""
    sides = pendulum_observation(), pendulum_observation()
    built = BodyMap.from_toml(
        'units = "torque"', *sides, pendulum_action(100.0), pendulum_action(200.0)
    )
    assert built.action[0].rule == Copy("slide/motor", 0.5)
    text = 'units = "exact"\n[action]\n"foot_*/motor" = { hold = 3.0 }'
    built = BodyMap.from_toml(text, *GROWN)
    assert {e.rule for e in built.action if e.feature.startswith("foot")} == {Hold(3.0)}


@pytest.mark.parametrize(("of", "feet"), [("", (False, True)), ('of = "target"', (True, False))])
def test_a_text_can_ask_for_the_mirror_image(of: str, feet: tuple[bool, bool]) -> None:
    layouts = (*(ant_observation(feet=f) for f in feet), *(ant_action(feet=f) for f in feet))
    text = f'[symmetry]\n{of}\nswap = {{ "*_1" = "*_4", "*_2" = "*_3" }}\nflip = ["hip_*"]\n'
    image = BodyMap.mirror(ant_observation(), ant_action(), swap=ANT_SWAP, flip=ANT_FLIP)
    there, built = BodyMap.between(*layouts), BodyMap.from_toml(text, *layouts)
    assert built == (there.then(image) if of else image.then(there))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("units = ", "This is not TOML"),
        ("unit = 'same'", "No key matches 'unit'. Did you mean 'units'?"),
        ("\ufeffunits = 'torq'", "units: No word matches 'torq'. Did you mean 'torque'?"),
        ("units = 3", "'map' is wrong: Expected `str`, got `int` - at `$.units`"),
        ("otherwise = 'copy hip_1/motor'", "'zero', 'hold' or 'learn', got 'copy"),
        ("otherwise = 'lern'", "otherwise: No word matches 'lern'. Did you mean 'learn'?"),
        ("action = 3", "at `$.action`"),
        ("[action]\n'foot_1/motor' = 3", "'foot_1/motor' is wrong: Expected `object`"),
        ("[action]\n'foot_1/motor' = { tak = 'x' }", "No key of 'foot_1/motor' matches 'tak'"),
        ("[action]\n'foot_1/motor' = { scale = 2 }", "not a table of scale"),
        ("[action]\n'foot_1/motor' = {}", "not a table of nothing"),
        ("[action]\n'foot_1/motor' = { hold = true }", "'foot_1/motor' is wrong: Expected `float`"),
        ("[action]\n'foot_1/motor' = { take = 1 }", "'foot_1/motor' is wrong: Expected `str`"),
        (
            "[action]\n'foot_1/motor' = { take = 'x', scale = 'y' }",
            "'foot_1/motor' is wrong: Expected `float`",
        ),
        ("[action]\n'foot_1/motor' = { take = 'ankle_1/motor', scale = 0 }", "not zero"),
        ("[symmetry]\nof = 'both'", "of: No word matches 'both'"),
        ("[symmetry]\nflop = []", "No key of 'symmetry' matches 'flop'. Did you mean 'flip'?"),
        ("[symmetry]\nswap = ['hip_1']", "at `$.symmetry.swap`"),
    ],
)
def test_wrong_text_is_explained(text: str, message: str) -> None:
    """Most errors name the key, and a misspelt word gets a suggestion."""
    with pytest.raises(MapError) as caught:
        BodyMap.from_toml(text, *GROWN)
    assert message in str(caught.value)
