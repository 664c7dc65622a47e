"""Computation, printing, validation, composition and inversion of body maps."""

from __future__ import annotations

import copy
import pickle

import msgspec
import numpy as np
import pytest

from shapechanger.errors import MapError, SpaceMismatch, UnknownName
from shapechanger.layout import Feature, Layout
from shapechanger.transfer.body_map import BodyMap, Copy, Hold, Learn, MapEntry, Zero
from shapechanger.transfer.body_map.map import MapRow
from tests.transfer.body_map.bodies import (
    carts,
    grown,
    motor,
    pendulum_action,
    pendulum_observation,
)


def small() -> BodyMap:
    return BodyMap.between(
        Layout((Feature("z", "m"), Feature("lost", "m"), Feature("rest", "rad"))),
        Layout((Feature("new", "m"), Feature("z", "m"))),
        Layout((motor("hip"), motor("ankle"))),
        Layout((motor("ankle"), motor("foot"), motor("toe"), motor("hip"))),
        observation_rules={"rest": Hold(0.25)},
        action_rules={
            "foot/motor": Copy("ankle/motor", -2.0),
            "toe/motor": "learn",
            "hip/motor": Copy("hip/motor", 0.5),
        },
    )


def test_values_are_reordered_by_name() -> None:
    np.testing.assert_array_equal(small().adapt_observation([7.0, 3.0]), [3.0, 0.0, 0.25])
    np.testing.assert_array_equal(small().adapt_action([0.4, 0.3]), [0.3, -0.6, 0.0, 0.2])


@pytest.mark.parametrize(
    ("given", "result"),
    [(np.float32, np.float32), (np.float64, np.float64), (np.int64, np.float64)],
)
def test_batches_of_floats_and_integers_keep_their_shape(given: type, result: type) -> None:
    values = np.random.default_rng(0).uniform(-9, 9, size=(4, 5, 2)).astype(given)
    adapted = small().adapt_observation(values)
    assert (adapted.shape, adapted.dtype) == ((4, 5, 3), result)
    np.testing.assert_array_equal(adapted[2, 3], small().adapt_observation(values[2, 3]))
    assert small().adapt_observation(np.zeros((0, 2), given)).shape == (0, 3)
    assert small().adapt_action(values).dtype == result


def test_blocks_keep_their_order() -> None:
    eye = Feature("eye", "1", 0.0, 1.0, shape=(2, 2))
    ear = Feature("ear", "1", 0.0, 1.0, shape=(2,))
    built = BodyMap.between(
        Layout((Feature("z", "m"), eye, ear)),
        Layout((eye, Feature("z", "m"))),
        pendulum_action(),
        pendulum_action(),
        rules={"ear": "hold"},
    )
    adapted = built.adapt_observation([1.0, 2.0, 3.0, 4.0, 9.0])
    np.testing.assert_array_equal(adapted, [9.0, 1.0, 2.0, 3.0, 4.0, 0.5, 0.5])


def test_the_affine_form_is_the_map() -> None:
    rng = np.random.default_rng(2)
    built = small()
    sensed, moved = rng.normal(size=2), rng.uniform(-0.3, 0.3, size=2)
    np.testing.assert_allclose(
        built.observation_matrix @ sensed + built.observation_offset,
        built.adapt_observation(sensed),
    )
    np.testing.assert_allclose(
        built.action_matrix @ moved + built.action_offset, built.adapt_action(moved)
    )
    assert built.observation_matrix is built.observation_matrix
    with pytest.raises(ValueError, match="read-only"):
        built.action_offset[0] = 1.0


def test_a_vector_of_another_body_is_refused() -> None:
    """The message names the expected and the given size."""
    with pytest.raises(SpaceMismatch, match=r"target observation features has 2 numbers.*\(3,\)"):
        small().adapt_observation(np.zeros(3))
    with pytest.raises(SpaceMismatch, match=r"source action feature.* shape is \(\)"):
        small().adapt_action(0.0)


def test_the_table_states_each_rule() -> None:
    assert small().table() == (
        MapRow("observation", "z", "z", "same name"),
        MapRow("observation", "lost", "zero", "default"),
        MapRow("observation", "rest", "hold 0.25", "rule 'rest'"),
        MapRow("action", "ankle/motor", "ankle/motor", "same name"),
        MapRow("action", "foot/motor", "ankle/motor times -2", "rule 'foot/motor'"),
        MapRow("action", "toe/motor", "learn", "rule 'toe/motor'"),
        MapRow("action", "hip/motor", "hip/motor times 0.5", "rule 'hip/motor'"),
    )
    lines = str(small()).splitlines()
    assert lines[0].split() == ["side", "entry", "rule", "why"]
    assert lines[2] == "observation  lost         zero                  default"
    assert len(lines) == 8
    # The short form counts the rules.
    assert repr(small()) == (
        "BodyMap(observation: {'Copy': 1, 'Zero': 1, 'Hold': 1}; action: {'Copy': 3, 'Learn': 1})"
    )


def test_each_feature_needs_its_rule_in_order() -> None:
    good = small()
    with pytest.raises(MapError, match=r"in the order of the layout: z, lost, rest; .* lost, z"):
        msgspec.structs.replace(
            good, observation=(good.observation[1], good.observation[0], good.observation[2])
        )
    with pytest.raises(MapError, match="the rules given are for none"):
        msgspec.structs.replace(good, action=())
    with pytest.raises(UnknownName, match="No target observation feature matches 'y'"):
        msgspec.structs.replace(good, observation=(MapEntry("z", Copy("y")), *good.observation[1:]))


def test_entries_are_equal_if_they_do_the_same() -> None:
    one, same = MapEntry("a", Zero(), "default"), MapEntry("a", Zero(), "rule 'a'")
    assert one == same != MapEntry("a", Learn())
    assert hash(one) == hash(same)


def test_a_map_can_be_pickled() -> None:
    built = small()
    assert built.action_matrix.shape == (4, 2)
    for twin in (pickle.loads(pickle.dumps(built)), copy.deepcopy(built)):
        assert twin == built
        np.testing.assert_array_equal(twin.action_matrix, built.action_matrix)


@pytest.mark.parametrize("text", ["{", "{}", small().to_json().replace("0.25", "null")])
def test_invalid_json_is_refused(text: str) -> None:
    with pytest.raises(MapError, match="This is not a body map"):
        BodyMap.from_json(text)


def test_actions_are_clipped_at_both_ends() -> None:
    built = grown(rules={"foot_*/motor": Copy("ankle_1/motor", 3.0)})
    for end in (-1.0, 1.0):
        moved = built.adapt_action(np.full(8, 9.0 * end, np.float32))
        np.testing.assert_array_equal(moved, np.full(12, end, np.float32))


def test_an_inverse_keeps_the_origin_of_its_rules() -> None:
    back = grown(rules={"foot_1/motor": Copy("ankle_1/motor")}).inverse()
    assert {row.why for row in back.table()} == {"same name", "default"}


def copied() -> BodyMap:
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
    gains = (BodyMap.identity(here, pendulum_action(gain)) for gain in (100.0, 200.0))
    first, second = gains
    with pytest.raises(MapError, match=r"action of the first .* gain is 100\.0 and 200\.0"):
        first.then(second)


def test_the_inverse_prefers_the_copy_of_the_same_name() -> None:
    """Several copies without one of the same name have no unique inverse."""
    back = copied().inverse()
    assert [entry.rule for entry in back.action] == [Copy("ankle/motor")]
    assert [entry.rule for entry in back.observation] == [Copy("z")]
    feet = Layout((motor("foot"), motor("toe")))
    there = carts(Layout((motor("ankle"),)), feet, rules={"*/motor": "copy ankle/motor"})
    with pytest.raises(MapError, match="is copied to 'foot/motor' and 'toe/motor', and none"):
        there.inverse()


def test_the_inverse_uses_otherwise() -> None:
    for otherwise, rule in (("learn", Learn()), ("zero", Zero())):
        rules = {e.feature: e.rule for e in grown().inverse(otherwise).observation}
        assert rules["foot_1/velocity"] == rule
    with pytest.raises(MapError, match=r"'foot_1/angle' cannot hold 0\.1: it reaches from 0\.52"):
        grown().inverse(Hold(0.1))
