"""Layouts and features."""

from __future__ import annotations

import ast
import math
import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shapechanger.errors import LayoutError, UnknownName
from shapechanger.layout import Element, Feature, Layout

HINGE = Feature("hinge/angle", "rad", -1.5, 1.0, Element("joint", "hinge"))
EYE = Feature("eye/image", "1", 0.0, 255.0, Element("camera", "eye"), shape=(2, 3))
SPEED = Feature("hinge/velocity", "rad/s", element=Element("joint", "hinge"))
MOTOR = Feature("hinge/motor", "1", -1.0, 1.0, gain=150.0, gain_unit="N·m")
LAYOUT = Layout((HINGE, EYE, SPEED, MOTOR))


def test_a_block_has_a_slice() -> None:
    """Sizes and slices count numbers; the length counts features."""
    assert [feature.size for feature in LAYOUT] == [1, 6, 1, 1]
    assert (len(LAYOUT), LAYOUT.size) == (4, 9)
    assert LAYOUT.slices == {
        "hinge/angle": slice(0, 1),
        "eye/image": slice(1, 7),
        "hinge/velocity": slice(7, 8),
        "hinge/motor": slice(8, 9),
    }


def test_bounds_are_expanded() -> None:
    """The bounds of a block apply to each of its numbers."""
    np.testing.assert_array_equal(LAYOUT.low, [-1.5, *[0.0] * 6, -np.inf, -1.0])
    np.testing.assert_array_equal(LAYOUT.high, [1.0, *[255.0] * 6, np.inf, 1.0])
    assert LAYOUT.low.dtype == LAYOUT.high.dtype == np.float64


def test_features_are_found() -> None:
    """Features are found by name, by index and by a glob."""
    assert LAYOUT["eye/image"] is LAYOUT[1] is EYE
    assert str(HINGE) == "hinge/angle [rad]"
    assert "eye/image" in LAYOUT
    assert "nose" not in LAYOUT
    assert LAYOUT.names == ("hinge/angle", "eye/image", "hinge/velocity", "hinge/motor")
    with pytest.raises(UnknownName, match=r"No feature matches 'hinge/angel'. Did you mean"):
        LAYOUT["hinge/angel"]
    assert LAYOUT.matching("hinge/*") == (HINGE, SPEED, MOTOR)
    with pytest.raises(UnknownName, match="No feature matches 'knee"):
        LAYOUT.matching("knee/*")


@pytest.mark.parametrize(
    ("low", "high", "middle"),
    [
        (-1.5, 1.0, -0.25),
        (-math.inf, math.inf, 0.0),
        (0.5, math.inf, 0.5),
        (-math.inf, -2.0, -2.0),
        (-1.0, math.inf, 0.0),
        (3.0, 3.0, 3.0),
    ],
)
def test_the_middle_lies_in_the_range(low: float, high: float, middle: float) -> None:
    """The middle of an unbounded range is its value nearest to zero."""
    assert Feature("x", "m", low, high).middle == middle


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"name": ""}, "needs a name"),
        ({"low": 1.0, "high": 0.0}, "x: the range 1.0 to 0.0 is empty"),
        ({"low": math.nan}, "range nan to inf is empty"),
        ({"low": math.inf}, "range inf to inf is empty"),
        ({"high": -math.inf}, "range -inf to -inf is empty"),
        ({"gain": 0.0}, "gain must be above zero, got 0.0"),
        ({"gain": math.inf}, "gain must be above zero"),
        ({"shape": (2, 0)}, r"shape \(2, 0\) has a number below one"),
    ],
)
def test_invalid_features_are_refused(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(LayoutError, match=message):
        Feature(**{"name": "x", "unit": "m", **wrong})


def test_names_must_be_unique() -> None:
    with pytest.raises(LayoutError, match="Two features have the name 'eye/image'"):
        Layout((HINGE, EYE, SPEED, EYE))


def test_a_layout_round_trips_through_json() -> None:
    """Blocks, elements, gains and infinite bounds are kept."""
    text = LAYOUT.to_json()
    assert Layout.from_json(text) == Layout.from_json(text.encode()) == LAYOUT
    assert "Infinity" not in text
    for infinity in (float("inf"), 1e308 * 10):  # Equal to the default, but another object.
        layout = Layout((Feature("a", "m", -infinity, infinity),))
        assert Layout.from_json(layout.to_json()) == layout
    assert Layout.from_json('{"features":[]}').size == 0


@pytest.mark.parametrize(
    "text",
    [
        *("", "[]", "null", '{"features":1}', '{"features":[{"name":"x"}]}', b"\xff{}"),
        '{"features":[{"name":"","unit":"m"}]}',
        '{"features":[{"name":"x","unit":"m","low":"deep"}]}',
        '{"features":[{"name":"x","unit":"m","element":{"kind":"leg","name":"y"}}]}',
        '{"features":[{"name":"x","unit":"m"},{"name":"x","unit":"m"}]}',
    ],
)
def test_invalid_json_is_refused(text: str | bytes) -> None:
    with pytest.raises(LayoutError, match="This is not a layout: "):
        Layout.from_json(text)


_NAMES = st.text("ab[]*?!0-", min_size=1, max_size=6)


@given(names=st.lists(_NAMES, min_size=1, max_size=5, unique=True), pattern=_NAMES)
def test_every_name_selects_its_feature(names: list[str], pattern: str) -> None:
    """A name with any characters selects its feature, and so does a name that an error suggests."""
    layout = Layout(tuple(Feature(name, "1") for name in names))
    for name in names:
        assert [feature.name for feature in layout.matching(name)] == [name]
    try:
        layout.matching(pattern)
    except UnknownName as error:
        hinted = re.search(r"Did you mean ('.*?'|\".*?\")\? There", str(error))
        assert hinted is None or layout.matching(ast.literal_eval(hinted[1]))
