"""Edits of one number, given as a ratio or as a value."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest

from shapechanger.errors import MorphologyError
from shapechanger.morphology import (
    Damping,
    Friction,
    Gear,
    Mass,
    Stiffness,
)
from tests.morphology.models import arm, built, leg, limb, mass, spec_of

_MOTORS = """
<mujoco>
<worldbody><body name="b"><freejoint name="root"/><geom name="g" size=".1"/></body></worldbody>
<actuator>
  <motor name="jet" joint="root" gear="1 0 -4 0 2 0"/>
  <motor name="idle" joint="root" gear="0 0 0 0 0 0"/>
</actuator></mujoco>
"""


@pytest.mark.parametrize(
    "content",
    [
        '<geom type="capsule" size=".1 .2"/><geom size=".1" pos="0 0 .3" mass="2"/>',
        '<inertial pos=".1 0 0" mass="2" diaginertia=".1 .2 .25"/><geom size=".1"/>',
    ],
)
def test_a_mass_can_be_set_for_any_form(content: str) -> None:
    before, after = built(limb(content)), built(limb(content), Mass("link", to=0.7))
    assert mass(after, "link") == pytest.approx(0.7)
    np.testing.assert_allclose(
        after.body("link").inertia, 0.7 / mass(before, "link") * before.body("link").inertia
    )
    np.testing.assert_allclose(after.body("link").ipos, before.body("link").ipos, atol=1e-12)


def test_a_gear_keeps_its_direction() -> None:
    """`to` sets the strongest axis; the others stay in proportion."""
    for edit, gear in (
        (Gear("jet", scale=2.0), [2.0, 0.0, -8.0, 0.0, 4.0, 0.0]),
        (Gear("jet", to=2.0), [-0.5, 0.0, 2.0, 0.0, -1.0, 0.0]),
        (Gear("jet", to=-2.0), [0.5, 0.0, -2.0, 0.0, 1.0, 0.0]),
    ):
        np.testing.assert_allclose(built(spec_of(_MOTORS), edit).actuator("jet").gear, gear)
    with pytest.raises(MorphologyError, match="'idle' is no motor or has a gear of zero"):
        built(spec_of(_MOTORS), Gear("*", scale=2.0))


def test_polynomial_coefficients() -> None:
    """`scale` scales the whole polynomial, `to` sets the linear part."""
    spec = limb('<geom size=".1"/>')
    spec.joint("link").damping = [1.0, 0.5, 0.25]
    spec.joint("link").stiffness = [2.0, 0.5, 0.25]
    scaled = built(spec, Damping("link", scale=2.0), Stiffness("link", to=8.0))
    plain = built(spec)
    assert np.any(plain.dof_dampingpoly)
    for name in ("dof_damping", "dof_dampingpoly"):
        np.testing.assert_allclose(getattr(scaled, name), 2.0 * getattr(plain, name))
    assert scaled.jnt_stiffness[0] == 8.0
    np.testing.assert_array_equal(scaled.jnt_stiffnesspoly, plain.jnt_stiffnesspoly)


@pytest.mark.parametrize(("component", "place"), [("sliding", 0), ("torsional", 1), ("rolling", 2)])
def test_friction_has_three_coefficients(component: Any, place: int) -> None:
    before, after = built(leg()), built(leg(), Friction("sole", to=0.3, component=component))
    expected = np.array(before.geom("sole").friction)
    expected[place] = 0.3
    np.testing.assert_array_equal(after.geom("sole").friction, expected)
    np.testing.assert_array_equal(after.geom("floor").friction, before.geom("floor").friction)


@pytest.mark.parametrize(
    "actuator",
    [
        *('<position name="a" joint="lower" kp="3" kv=".2" forcerange="-2 4"/>',),
        *('<velocity name="a" joint="lower" kv="3"/>', '<motor name="a" joint="lower" gear="3"/>'),
        *('<intvelocity name="a" joint="lower" kp="3" kv="1" actrange="-1 1"/>',),
        *('<damper name="a" joint="lower" kv="3" ctrlrange="0 1"/>',),
        *('<cylinder name="a" joint="lower" area="3" bias="1 2 3" timeconst=".1"/>',),
        *('<muscle name="a" joint="lower" lengthrange="-1 1" force="3"/>',),
        *('<muscle name="a" joint="lower" lengthrange="-1 1" scale="3"/>',),
        *('<general name="a" joint="lower" gainprm="3" biastype="affine" biasprm="1 2 3"/>',),
    ],
)
def test_gear_scales_the_force_of_any_actuator(actuator: str) -> None:
    """In any state and for any control, so a servo keeps its targets."""
    spec = arm(f"<actuator>{actuator}</actuator>")
    old, new = built(spec), built(spec, Gear("a", scale=0.4))
    for seed in range(3):
        forces: list[Any] = []
        for model in (old, new):
            rng, data = np.random.default_rng(seed), mujoco.MjData(model)
            data.qpos[:], data.qvel[:] = rng.uniform(-1.0, 1.0, (2, model.nv))
            data.ctrl[:] = rng.uniform(0.0, 1.0, model.nu)
            data.act[:] = rng.uniform(0.0, 1.0, model.na)
            mujoco.mj_forward(model, data)
            forces.append(data.qfrc_actuator.copy())
        np.testing.assert_allclose(forces[1], 0.4 * forces[0], rtol=1e-9, atol=1e-12)
        assert np.any(forces[0])


def test_a_largest_force_scales_with_all_of_its_motors() -> None:
    """Else a stronger motor would change nothing; one of two does not change it."""
    motors = '<actuator><motor name="a" joint="upper"/><motor name="b" joint="upper"/></actuator>'
    spec = arm(motors, joint='actuatorfrcrange="-2 2"')
    for pattern, largest in (("*", 6.0), ("a", 2.0)):
        model = built(spec, Gear(pattern, scale=3.0))
        limits = model.jnt_actfrcrange[model.joint("upper").id]
        np.testing.assert_array_equal(limits, [-largest, largest])
