"""Properties of all edits: values with an amount, validated when created."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.morphology import (
    Gravity,
    Mass,
    Stretch,
    compile_body,
    to_json,
)
from tests.morphology.models import leg


def test_edits_are_values() -> None:
    """Edits compare by value, are hashable and frozen, and print without defaults."""
    edit = Stretch("thigh", 2.0)
    assert edit == Stretch("thigh", 2.0) != Stretch("shin", 2.0)
    assert len({edit, Stretch("thigh", 2.0)}) == 1
    assert repr(edit) == "Stretch(body='thigh', factor=2.0)"
    with pytest.raises(AttributeError):
        edit.factor = 3.0  # type: ignore[misc]


def test_numpy_numbers_are_values() -> None:
    stretch = Stretch("thigh", np.linspace(0.5, 2.0, 2)[0])
    assert stretch == Stretch("thigh", 0.5)
    assert to_json([stretch]) == to_json([Stretch("thigh", 0.5)])
    fall = Gravity(np.array([0.0, 0.0, -3.7]))  # type: ignore[arg-type]
    assert fall == Gravity((0.0, 0.0, -3.7))
    assert type(Mass("*", scale=np.float32(2.0)).scale) is float
    assert Stretch("thigh", np.int64(2)) == Stretch("thigh", 2.0)
    assert compile_body(leg(), [Stretch("thigh", np.float64(2.0))]).nbody == leg().compile().nbody
