"""Numbers of a finger's observation and their features."""

from __future__ import annotations

import numpy as np

from shapechanger.finger.anatomy import JOINT_RANGE, MOST_TENSION_N
from shapechanger.finger.task import FingerSenses, features_of_senses


def test_numbers_match_their_features() -> None:
    senses = FingerSenses(
        angles=np.arange(0.0, 4.0),
        velocities=np.arange(10.0, 14.0),
        tensions=np.arange(20.0, 27.0),
        lengths=np.arange(30.0, 37.0),
        commands=np.arange(40.0, 47.0),
        fingertip=np.arange(50.0, 53.0),
    )
    features = features_of_senses()
    found = {f.name: n for f, n in zip(features, senses.numbers(), strict=True)}
    assert len(found) == 32
    assert found["PIP_flexion/angle"] == 2.0
    assert found["MCP_abduction/velocity"] == 11.0
    assert found["LUM/tension"] == 24.0
    assert found["FDP/length"] == 30.0
    assert found["PI/command"] == 46.0
    assert found["fingertip/z"] == 52.0


def test_features_have_units_and_bounds() -> None:
    """Angles, tensions, commands and positions have units, bounds and elements."""
    features = features_of_senses()
    by_name = {f.name: f for f in features}
    angle = by_name["PIP_flexion/angle"]
    assert (angle.unit, angle.low, angle.high) == ("rad", *JOINT_RANGE[2])
    tension = by_name["EIP/tension"]
    assert (tension.unit, tension.low, tension.high) == ("N", 0.0, MOST_TENSION_N[2])
    assert tension.element is not None
    assert (tension.element.kind, tension.element.name) == ("tendon", "EIP")
    assert (by_name["DI/command"].low, by_name["DI/command"].high) == (-1.0, 1.0)
    assert {by_name[f"fingertip/{axis}"].unit for axis in "xyz"} == {"m"}
