"""Properties of all edits: values with an amount, validated when created."""

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
    """Edits compare by value, are hashable and frozen, and print without defaults."""
    edit = Stretch("thigh", 2.0)
    assert edit == Stretch("thigh", 2.0) != Stretch("shin", 2.0)
    assert len({edit, Stretch("thigh", 2.0)}) == 1
    assert repr(edit) == "Stretch(body='thigh', factor=2.0)"
    with pytest.raises(AttributeError):
        edit.factor = 3.0  # type: ignore[misc]


@pytest.mark.parametrize("amount", [-0.1, 1.1, math.nan, math.inf])
def test_amounts_are_fractions(amount: float) -> None:
    """Amounts outside 0 to 1 are refused."""
    with pytest.raises(MorphologyError, match="amount must be between 0 and 1, got"):
        Stretch("thigh", 2.0, amount=amount)


def test_amounts_multiply() -> None:
    """Half of half an edit has the amount 0.25."""
    assert Mass("*", scale=2.0).partly(0.5).partly(0.5) == Mass("*", scale=2.0, amount=0.25)


def test_the_base_class_is_abstract() -> None:
    """`Edit.apply` raises NotImplementedError."""
    with pytest.raises(NotImplementedError):
        Edit().apply(leg())


def test_interpolation_ends_exactly() -> None:
    assert part_of_the_way(0.1, 0.7, 1.0) == 0.7
    assert part_of_the_way(0.1, 0.7, 0.0) == 0.1
    assert part_of_the_way(2.0, 4.0, 0.25) == 2.5


@pytest.mark.parametrize("factor", [0.01, 1.0, 100.0])
def test_factors_are_limited_inclusively(factor: float) -> None:
    require_factor("The factor", factor)


@pytest.mark.parametrize("factor", [0.0, -1.0, math.nan, math.inf, -math.inf, 1e-3, 1e3])
def test_absurd_factors_are_refused(factor: float) -> None:
    with pytest.raises(MorphologyError, match=r"The factor must be a ratio between 0\.01 and 100"):
        require_factor("The factor", factor)


@pytest.mark.parametrize(
    "vector",
    [
        *((math.nan, 0.0, 1.0), (0.0, math.inf, 1.0), (1.0, 2.0), (1.0, 2.0, 3.0, 4.0), ()),
        [1.0, 2.0, 3.0],  # Lists are mutable, and would not equal the tuples from JSON.
    ],
)
def test_vectors_are_three_finite_numbers(vector: Any) -> None:
    """Other vectors are refused when the edit is created."""
    with pytest.raises(MorphologyError, match="Gravity must be a tuple of three finite numbers"):
        Gravity(vector)


def test_directions_are_not_zero() -> None:
    """A zero vector is refused as an axis and accepted as gravity."""
    with pytest.raises(MorphologyError, match="The axis must not be zero"):
        require_vector("The axis", (0.0, 0.0, 0.0))
    require_vector("Gravity", (0.0, 0.0, 0.0), nonzero=False)


def test_tags_are_the_names_of_the_kinds() -> None:
    """Tags are the snake-case class names, and unique."""
    tags = [cast("str", kind.__struct_config__.tag) for kind in EDITS]
    assert tags == [
        *("stretch", "radius", "cut", "remove", "split", "add_segment", "add_limb"),
        *("mass", "density", "gear", "damping", "stiffness", "friction"),
        *("joint_range", "lock", "gravity", "start_height"),
        *("place_body", "place_geom", "total_mass"),
        *("add_motor", "add_free_joint", "add_floor"),
    ]


def test_several_numbers_for_one_are_refused() -> None:
    """An array where a number belongs gets a sentence, not a TypeError."""
    with pytest.raises(MorphologyError, match=r"wrong type in Mass\(element='thigh'"):
        Mass("thigh", scale=np.array([1.0, 2.0]))  # type: ignore[arg-type]


def test_numpy_numbers_are_values() -> None:
    """NumPy scalars and arrays become floats and tuples."""
    stretch = Stretch("thigh", np.linspace(0.5, 2.0, 2)[0])
    assert stretch == Stretch("thigh", 0.5)
    assert to_json([stretch]) == to_json([Stretch("thigh", 0.5)])
    fall = Gravity(np.array([0.0, 0.0, -3.7]))  # type: ignore[arg-type]
    assert fall == Gravity((0.0, 0.0, -3.7))
    assert type(Mass("*", scale=np.float32(2.0)).scale) is float
    assert Stretch("thigh", np.int64(2)) == Stretch("thigh", 2.0)
    assert compile_body(leg(), [Stretch("thigh", np.float64(2.0))]).nbody == leg().compile().nbody
