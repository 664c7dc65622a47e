"""Joint ranges and locked joints."""

from __future__ import annotations

import math

import mujoco
import numpy as np
import pytest

from shapechanger.errors import MorphologyError
from shapechanger.morphology import JointRange, Lock
from tests.morphology.models import built, gantry, leg, limb, posed, tip, uncoupled_gantry
from tests.morphology.scenes import asset_spec


def _range(model: mujoco.MjModel, joint: str) -> list[float]:
    return model.joint(joint).range.tolist()


def test_limits_are_given_in_radians() -> None:
    """Units do not depend on the model; a limit that is not given stays."""
    assert _range(built(leg(), JointRange("knee", -1.0, 0.5)), "knee") == pytest.approx([-1.0, 0.5])
    assert _range(built(leg(), JointRange("knee", lower=-1.0)), "knee") == pytest.approx([-1.0, 0])
    model = built(gantry(), JointRange("swing", upper=0.25))
    assert _range(model, "swing") == [-2.0, 0.25]


@pytest.mark.parametrize("degrees", range(-180, 181, 6))
def test_degrees_are_exact(degrees: int) -> None:
    """Limits of whole degrees equal bitwise those of a file in degrees."""
    spec = limb('<geom size=".1"/>')
    spec.joint("link").range = [degrees, 200.0]
    edited = built(limb('<geom size=".1"/>'), JointRange("link", math.radians(degrees), 3.5))
    assert edited.joint("link").range[0] == built(spec).joint("link").range[0]


def test_a_slide_without_limits_needs_both() -> None:
    """Partial edits interpolate from far away."""
    for edit in (JointRange("y", lower=-1.0), JointRange("y", upper=1.0)):
        with pytest.raises(MorphologyError, match="'y' slides without limits: give both of them"):
            built(gantry(), edit)
    edit = JointRange("y", -1.0, 2.0)
    assert _range(built(gantry(), edit), "y") == [-1.0, 2.0]
    assert _range(built(gantry(), edit.partly(0.5)), "y") == [-4.0, 5.0]
    lower, upper = _range(built(gantry(), edit.partly(1e-6)), "y")
    assert lower < -1e5
    assert upper > 1e5


def test_joints_are_locked_in_the_middle() -> None:
    free = built(leg())
    for edit, angle in (
        (Lock("knee"), math.radians(-45.0)),
        (Lock("knee", 0.0), 0.0),
        (Lock("knee", -1.2), -1.2),
    ):
        locked = built(leg(), edit)
        np.testing.assert_allclose(tip(locked, "toe"), tip(free, "toe", {"knee": angle}))
    model = built(limb('<geom size=".1"/>'), Lock("link"))
    np.testing.assert_allclose(model.body("link").quat, [1.0, 0.0, 0.0, 0.0])


def test_a_slide_without_limits_has_no_middle() -> None:
    with pytest.raises(MorphologyError, match="'y' slides without limits, so it has no middle"):
        built(gantry(), Lock("y"))
    assert built(gantry(), Lock("y", 0.3)).njnt == 4
    half = built(gantry(), Lock("y", 0.3).partly(0.5))
    assert _range(half, "y") == pytest.approx([0.3 - 1.0, 0.3 + 1.0])


def test_a_partial_lock_narrows_the_range() -> None:
    """The range narrows around the position, to no less than 0.001."""
    for amount in (0.25, 0.5, 1.0 - 1e-9):
        model = built(leg(), Lock("knee", -0.5).partly(amount))
        lower, upper = _range(model, "knee")
        assert (model.nu, model.njnt) == (2, 3)
        assert lower < -0.5 < upper
        assert upper - lower == pytest.approx(max((1.0 - amount) * math.pi / 2.0, 1e-3))


def test_several_joints_of_a_body_are_locked_together() -> None:
    """The order of the locks does not matter."""
    positions = {"x": 0.7, "yaw": -0.3, "y": 0.2, "pitch": 1.1}
    free = posed(built(uncoupled_gantry()), {**positions, "swing": 0.4})
    for order in (list(positions), list(reversed(positions))):
        locked = posed(
            built(uncoupled_gantry(), *(Lock(j, positions[j]) for j in order)), {"swing": 0.4}
        )
        np.testing.assert_allclose(locked.geom_xpos, free.geom_xpos, atol=1e-12)
        np.testing.assert_allclose(locked.site_xpos, free.site_xpos, atol=1e-12)
    all_hinges = built(asset_spec("humanoid"), Lock("abdomen_*"))
    assert all_hinges.body("lwaist").jntnum == 0
