"""Named bodies, with the numbers of the 2017 release."""

from __future__ import annotations

import math

import numpy as np
import pytest

from shapechanger.envs.ant import ANT, LEGS
from shapechanger.envs.pendulum import PENDULUM
from shapechanger.morphology import from_json, to_json
from shapechanger.morphology.families import Family
from tests.morphology.models import ant, built, pendulum, posed

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


@pytest.mark.parametrize(
    ("name", "nq", "nu"),
    [
        *(("Ant", 15, 8), ("AmputatedAnt", 15, 8), ("BigAnt", 15, 8), ("ExtendedAnt", 19, 12)),
        ("ExtendedAntPassive", 19, 8),
    ],
)
def test_dimensions_of_the_ants(name: str, nq: int, nu: int) -> None:
    """Degrees of freedom and motors of the ants."""
    model = built(ant(), *ANT.body(name))
    assert (model.nq, model.nu) == (nq, nu)


@pytest.mark.parametrize(
    ("name", "length"),
    [("InvertedPendulum", 0.6), ("SmallInvertedPendulum", 0.3), ("BigInvertedPendulum", 1.2)],
)
def test_lengths_of_the_poles(name: str, length: float) -> None:
    """Poles have the release's lengths and lean."""
    model = built(pendulum(), *PENDULUM.body(name))
    assert 2.0 * model.geom("cpole").size[1] == pytest.approx(math.hypot(length, 0.001))
    assert (model.nq, model.nu) == (2, 1)
