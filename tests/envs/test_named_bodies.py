"""Named bodies, with the numbers of the 2017 release."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.envs.ant import ANT, LEGS
from shapechanger.envs.pendulum import PENDULUM
from shapechanger.morphology import from_json, to_json
from shapechanger.morphology.families import Family
from tests.morphology.models import ant, built, posed

_BODIES = [(family, name) for family in (ANT, PENDULUM) for name in family.bodies]


@pytest.mark.parametrize("family", [ANT, PENDULUM], ids=lambda family: family.name)
def test_a_family_has_the_name_of_its_first_body(family: Family) -> None:
    assert next(iter(family.bodies)) == family.name
    assert family.body(family.name) == ()


@pytest.mark.parametrize(("family", "name"), _BODIES)
def test_named_bodies_are_values(family: Family, name: str) -> None:
    """Bodies are hashable and round-trip through JSON."""
    body = family.body(name)
    assert from_json(to_json(body)) == body
    assert hash(body) == hash(from_json(to_json(body)))


def test_legs_are_in_the_order_of_the_motors() -> None:
    """Legs follow the motors, with the given directions."""
    model = built(ant())
    motors = [model.actuator(i).name for i in range(model.nu)]
    assert motors == [f"{joint}_{leg}" for leg in LEGS for joint in ("hip", "ankle")]
    data = posed(model)
    for leg, (x, y) in LEGS.items():
        place = data.body(f"shank_{leg}").xpos
        assert (np.sign(place[0]), np.sign(place[1])) == (x, y)
    extended = built(ant(), *ANT.body("ExtendedAnt"))
    assert [extended.actuator(i).name for i in range(8, 12)] == [f"foot_{leg}" for leg in LEGS]
