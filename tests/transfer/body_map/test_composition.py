"""Composition and inversion of body maps."""

from __future__ import annotations

import pytest

from shapechanger.errors import MapError
from shapechanger.layout import Feature, Layout
from shapechanger.transfer.body_map import BodyMap, Copy, Hold, Learn, Zero
from tests.transfer.body_map.bodies import (
    grown,
    motor,
    pendulum_action,
    pendulum_observation,
)


def copied() -> BodyMap:
    """Return a map in which two target motors copy one source motor."""
    return BodyMap.between(
        Layout((Feature("z", "m"), Feature("height", "m"))),
        Layout((Feature("z", "m"),)),
        Layout((motor("ankle"),)),
        Layout((motor("foot"), motor("ankle"), motor("toe"))),
        rules={
            "height": "copy z",
            "foot/motor": "copy ankle/motor",
            "toe/motor": Copy("ankle/motor", -0.5),
        },
    )


def test_composition_multiplies_scales_and_joins_reasons() -> None:
    """Scales multiply, and `why` names the rule of each map."""
    motors = pendulum_action()
    first = BodyMap.between(
        pendulum_observation("pole"),
        pendulum_observation(),
        motors,
        motors,
        rules={"pole/*": "copy hinge/*"},
    )
    second = BodyMap.between(
        pendulum_observation(),
        pendulum_observation(),
        motors,
        motors,
        rules={
            "hinge/angle": Copy("hinge/angle", -2.0),
            "hinge/velocity": Hold(3.0),
            "slider/velocity": "zero",
        },
    )
    both = first.then(second)
    assert [entry.rule for entry in both.observation] == [
        Copy("slider/position"),
        Copy("hinge/angle", -2.0),
        Zero(),
        Hold(3.0),
    ]
    assert both.observation[0].why == "same name"
    assert both.observation[1].why == "rule 'pole/*', then rule 'hinge/angle'"


@pytest.mark.parametrize(
    ("middle", "message"),
    [
        (Layout((Feature("z", "mm"), Feature("y", "m"))), r"z \[m\] and z \[mm\], whose unit"),
        (Layout((Feature("y", "m"), Feature("z", "m"))), "whose name is 'z' and 'y'"),
        (Layout((Feature("z", "m"),)), "one has 2 features and the other 1"),
    ],
)
def test_maps_of_different_middle_bodies_are_refused(middle: Layout, message: str) -> None:
    here = Layout((Feature("z", "m"), Feature("y", "m")))
    first = BodyMap.identity(here, pendulum_action())
    second = BodyMap.identity(middle, pendulum_action())
    with pytest.raises(MapError, match=message) as caught:
        first.then(second)
    assert "target observation of the first" in str(caught.value)


def test_maps_with_different_gains_are_refused() -> None:
    first = BodyMap.identity(pendulum_observation(), pendulum_action(100.0))
    second = BodyMap.identity(pendulum_observation(), pendulum_action(200.0))
    with pytest.raises(MapError, match=r"action of the first .* gain is 100\.0 and 200\.0"):
        first.then(second)


def test_the_inverse_prefers_the_copy_of_the_same_name() -> None:
    back = copied().inverse()
    assert [entry.rule for entry in back.action] == [Copy("ankle/motor")]
    assert [entry.rule for entry in back.observation] == [Copy("z")]


def test_ambiguous_copies_have_no_inverse() -> None:
    """Several copies without one of the same name have no unique inverse."""
    there = BodyMap.between(
        pendulum_observation(),
        pendulum_observation(),
        Layout((motor("ankle"),)),
        Layout((motor("foot"), motor("toe"))),
        rules={"*/motor": "copy ankle/motor"},
    )
    with pytest.raises(MapError, match="is copied to 'foot/motor' and 'toe/motor', none"):
        there.inverse()


def test_the_inverse_uses_otherwise() -> None:
    for otherwise, rule in (("learn", Learn()), ("zero", Zero())):
        rules = {e.feature: e.rule for e in grown().inverse(otherwise).observation}
        assert rules["foot_1/velocity"] == rule
    with pytest.raises(MapError, match=r"'foot_1/angle' cannot hold 0\.1: it reaches from 0\.52"):
        grown().inverse(Hold(0.1))
