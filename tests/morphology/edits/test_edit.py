"""What every edit is: a value with an amount, whose numbers are checked when it is written down."""

from __future__ import annotations

import math
from typing import Any, cast

import numpy as np
import pytest

from shapechanger.errors import MorphologyError
from shapechanger.morphology import (
    EDITS,
    Edit,
    Gravity,
    Mass,
    Stretch,
    compile_body,
    to_json,
)
from shapechanger.morphology.edits.edit import part_of_the_way, require_factor, require_vector
from tests.morphology.models import leg


def test_edits_are_values() -> None:
    """Equal when their fields are, fit for a set, printed without defaults, never changed."""
    edit = Stretch("thigh", 2.0)
    assert edit == Stretch("thigh", 2.0) != Stretch("shin", 2.0)
    assert len({edit, Stretch("thigh", 2.0)}) == 1
    assert repr(edit) == "Stretch(body='thigh', factor=2.0)"
    with pytest.raises(AttributeError):
        edit.factor = 3.0  # type: ignore[misc]


@pytest.mark.parametrize("amount", [-0.1, 1.1, math.nan, math.inf])
def test_amounts_are_parts(amount: float) -> None:
    """Neither less than nothing nor more than all of a change can be made."""
    with pytest.raises(MorphologyError, match="amount must be between 0 and 1, got"):
        Stretch("thigh", 2.0, amount=amount)


def test_parts_of_parts_multiply() -> None:
    """Half of half a change is a quarter of it."""
    assert Mass("*", scale=2.0).partly(0.5).partly(0.5) == Mass("*", scale=2.0, amount=0.25)


def test_an_edit_says_how_it_is_applied() -> None:
    """The base knows no change."""
    with pytest.raises(NotImplementedError):
        Edit().apply(leg())


def test_the_way_ends_exactly() -> None:
    """No rounding is left at the end, however odd the numbers."""
    assert part_of_the_way(0.1, 0.7, 1.0) == 0.7
    assert part_of_the_way(0.1, 0.7, 0.0) == 0.1
    assert part_of_the_way(2.0, 4.0, 0.25) == 2.5


@pytest.mark.parametrize("factor", [0.01, 1.0, 100.0])
def test_factors_may_be_large_or_small(factor: float) -> None:
    """A hundred times is the limit, and within it."""
    require_factor("The factor", factor)


@pytest.mark.parametrize("factor", [0.0, -1.0, math.nan, math.inf, -math.inf, 1e-3, 1e3])
def test_absurd_factors_are_refused(factor: float) -> None:
    """A limb a thousand times longer is a typing mistake."""
    with pytest.raises(MorphologyError, match=r"The factor must be a ratio between 0\.01 and 100"):
        require_factor("The factor", factor)


@pytest.mark.parametrize(
    "vector",
    [
        *((math.nan, 0.0, 1.0), (0.0, math.inf, 1.0), (1.0, 2.0), (1.0, 2.0, 3.0, 4.0), ()),
        [1.0, 2.0, 3.0],  # A list could change, and would not equal what JSON gives back.
    ],
)
def test_vectors_are_three_finite_numbers(vector: Any) -> None:
    """Anything else is refused before it meets a model."""
    with pytest.raises(MorphologyError, match="Gravity must be a tuple of three finite numbers"):
        Gravity(vector)


def test_directions_are_not_zero() -> None:
    """A vector of no length points nowhere, but can be a gravity."""
    with pytest.raises(MorphologyError, match="The axis must not be zero"):
        require_vector("The axis", (0.0, 0.0, 0.0))
    require_vector("Gravity", (0.0, 0.0, 0.0), nonzero=False)


def test_tags_are_the_names_of_the_kinds() -> None:
    """`AddSegment` is written as `add_segment`, and no two kinds share a tag."""
    tags = [cast("str", kind.__struct_config__.tag) for kind in EDITS]
    assert tags == [
        *("stretch", "radius", "cut", "remove", "split", "add_segment", "add_limb"),
        *("mass", "density", "gear", "damping", "stiffness", "friction"),
        *("joint_range", "lock", "gravity", "start_height"),
    ]


def test_several_numbers_for_one_are_refused() -> None:
    """An array where a number belongs gets a sentence, not a TypeError."""
    with pytest.raises(MorphologyError, match=r"wrong type in Mass\(element='thigh'"):
        Mass("thigh", scale=np.array([1.0, 2.0]))  # type: ignore[arg-type]


def test_numpy_numbers_are_values() -> None:
    """Scalars and arrays of NumPy become plain numbers and tuples, which JSON can hold."""
    stretch = Stretch("thigh", np.linspace(0.5, 2.0, 2)[0])
    assert stretch == Stretch("thigh", 0.5)
    assert to_json([stretch]) == to_json([Stretch("thigh", 0.5)])
    fall = Gravity(np.array([0.0, 0.0, -3.7]))  # type: ignore[arg-type]
    assert fall == Gravity((0.0, 0.0, -3.7))
    assert type(Mass("*", scale=np.float32(2.0)).scale) is float
    assert Stretch("thigh", np.int64(2)) == Stretch("thigh", 2.0)
    assert compile_body(leg(), [Stretch("thigh", np.float64(2.0))]).nbody == leg().compile().nbody
