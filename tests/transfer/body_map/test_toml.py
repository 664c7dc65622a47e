"""Body maps as TOML."""

from __future__ import annotations

import pytest

from shapechanger.errors import MapError, UnknownName
from shapechanger.transfer.body_map import BodyMap, Copy, Hold, Learn
from tests.transfer.body_map.bodies import (
    ANT_FLIP,
    ANT_SWAP,
    GROWN,
    ant_action,
    ant_observation,
    pendulum_action,
    pendulum_observation,
)

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


def test_a_person_can_write_a_map() -> None:
    built = BodyMap.from_toml(EXAMPLE, *GROWN)
    rules = {entry.feature: entry.rule for entry in (*built.observation, *built.action)}
    assert rules["torso/vx"] == Copy("torso/vx", 0.5)
    assert rules["foot_1/motor"] == Copy("ankle_1/motor", -0.5)
    assert rules["foot_2/motor"] == Learn()
    assert rules["foot_3/motor"] == Copy("ankle_3/motor")
    assert rules["foot_4/motor"] == Hold(0.1)


def test_an_empty_text_matches_by_name() -> None:
    assert BodyMap.from_toml("", *GROWN) == BodyMap.between(*GROWN)


def test_units_come_from_the_text() -> None:
    sides = pendulum_observation(), pendulum_observation()
    built = BodyMap.from_toml(
        'units = "torque"', *sides, pendulum_action(100.0), pendulum_action(200.0)
    )
    assert built.action[0].rule == Copy("slide/motor", 0.5)


def test_exact_rules_are_not_checked() -> None:
    """`units = "exact"` accepts scales of 1 between units and constants beyond the range."""
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
        ("otherwise = 'copy hip_1/motor'", "'zero', 'hold' or 'learn', not 'copy"),
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
    """Errors name the key, and suggest the nearest spelling."""
    with pytest.raises(MapError) as caught:
        BodyMap.from_toml(text, *GROWN)
    assert message in str(caught.value)


def test_a_copy_needs_no_scale() -> None:
    built = BodyMap.from_toml('[action]\n"foot_1/motor" = { take = "ankle_1/motor" }', *GROWN)
    assert Copy("ankle_1/motor") in [entry.rule for entry in built.action]


def test_unknown_names_are_refused() -> None:
    with pytest.raises(UnknownName, match="Did you mean 'foot_1/motor'"):
        BodyMap.from_toml('[action]\n"fot_1/motor" = "zero"', *GROWN)
    with pytest.raises(UnknownName, match="No target action feature"):
        BodyMap.from_toml('[action]\n"hip_1/angle" = "zero"', *GROWN)
