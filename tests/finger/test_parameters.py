"""Validation and JSON of finger parameters."""

import math
from typing import Any

import numpy as np
import pytest

from shapechanger.errors import FingerError
from shapechanger.finger.anatomy import MOMENT_ARMS
from shapechanger.finger.parameters import NOMINAL, FingerParameters
from tests.finger.commands import STRETCHED


@pytest.mark.parametrize("parameters", [NOMINAL, STRETCHED], ids=["nominal", "stretched"])
def test_parameters_round_trip_through_json(parameters: FingerParameters) -> None:
    text = parameters.to_json()
    assert FingerParameters.from_json(text) == parameters
    assert FingerParameters.from_json(text.encode()) == parameters


def test_omitted_parameters_are_nominal() -> None:
    """Python and JSON have the same defaults."""
    changed = NOMINAL.replace(tendon_friction=1.0)
    assert changed != NOMINAL
    assert FingerParameters(tendon_friction=1.0) == changed
    assert FingerParameters.from_json('{"tendon_friction": 1.0}') == changed
    changed.arms[:] = 0.0  # A copy.
    np.testing.assert_array_equal(changed.arms, MOMENT_ARMS)
    assert not changed.gives
    assert STRETCHED.gives


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"moment_arms": ((1.0,) * 4,) * 6}, r"moment_arms must be of shape \(7, 4\), finite, got"),
        ({"motor_lag": (1.0,)}, r"motor_lag must be of shape \(\)"),
        ({"joint_noise": math.nan}, "joint_noise must be of shape .* finite and not below zero"),
        ({"tendon_stiffness": math.inf}, "tendon_stiffness must be .* finite .* got inf"),
        ({"tendon_friction": -1.0}, "tendon_friction must be .* not below zero, got -1"),
        ({"motor_lag": 0.0}, "motor_lag must be above zero, got 0.0."),
        ({"motor_kg": "x"}, "motor_kg must be .*, got 'x'."),
        ({"most_tension": (0.5,) * 7}, "most_tension must be above least_tension, 0.5 N"),
        ({"backlash": 1e-3}, "backlash needs a tendon_stiffness: a stiff tendon has none."),
    ],
)
def test_invalid_numbers_are_refused(changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(FingerError, match=sentence):
        NOMINAL.replace(**changes)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("{", r"Invalid finger parameters: Input data was truncated\.$"),
        ('{"tendon_fricton": 1.0}', "unknown field `tendon_fricton`"),
        ('{"motor_lag": "slow"}', "Expected `float`, got `str`"),
        ('{"motor_lag": 0.0}', r"motor_lag must be above zero, got 0\.0\.$"),
    ],
)
def test_invalid_json_is_refused(text: str | bytes, sentence: str) -> None:
    with pytest.raises(FingerError, match=sentence):
        FingerParameters.from_json(text)
