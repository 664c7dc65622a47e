"""Elements that are removed with a joint."""

from __future__ import annotations

import numpy as np
import pytest

from shapechanger.errors import MorphologyError
from shapechanger.morphology import Lock
from tests.morphology.models import built, gantry, spec_of
from tests.morphology.scenes import asset_spec

_TIED = """
<mujoco>
  <worldbody>
    <body name="a"><joint name="a"/><geom size=".1" pos=".2 0 0"/>
      <body name="b" pos=".4 0 0"><joint name="b"/><geom size=".1" pos=".2 0 0"/>
        <site name="s"/></body>
    </body>
    <site name="w"/>
  </worldbody>
  <tendon>
    <fixed {tendon}><joint joint="a" coef="1"/><joint joint="b" coef="-1"/></fixed>
    <spatial name="rope"><site site="s"/><site site="w"/></spatial>
  </tendon>
  {rest}
</mujoco>
"""


def test_references_to_a_locked_joint() -> None:
    """Its motor and the sensors of both go; its follower is held; a keyframe loses its number."""
    model = built(gantry(), Lock("yaw"))
    assert (model.nu, model.nkey) == (0, 1)
    assert [model.sensor(i).name for i in range(model.nsensor)] == ["swing_angle", "hook"]
    assert [int(i) for i in model.eq_obj1id] == [model.joint(j).id for j in ("pitch", "y")]
    assert [int(i) for i in model.eq_obj2id] == [-1, model.joint("swing").id]
    # `yaw` is 0.45 rad from its reference, and `pitch` follows it by the same angle.
    pitch = model.joint("pitch").qposadr[0]
    assert model.qpos0[pitch] == pytest.approx(-0.45)
    np.testing.assert_allclose(model.key_qpos[0], [0.4, 0.0, 0.0, 0.1])


def test_a_tendon_without_effect_is_removed() -> None:
    """The humanoid's tendons have neither force nor sensor."""
    assert built(asset_spec("humanoid")).ntendon == 2
    model = built(asset_spec("humanoid"), Lock("right_knee"))
    assert model.ntendon == 1
    assert model.tendon(0).name == "left_hipknee"
    coupled = _TIED.format(tendon="", rest='<equality><joint joint1="a"/></equality>')
    model = built(spec_of(coupled), Lock("b", 0.1))
    assert (model.ntendon, model.neq) == (1, 1)


@pytest.mark.parametrize(
    ("tendon", "rest"),
    [
        *(('stiffness="1"', ""), ('damping="1"', ""), ('frictionloss="1"', "")),
        *(('armature="1"', ""), ('range="0 1"', ""), ('limited="true" range="-1 0"', "")),
        ("", '<actuator><motor tendon="tie"/></actuator>'),
        ("", '<sensor><tendonpos tendon="tie"/></sensor>'),
        ("", '<equality><tendon tendon1="tie"/></equality>'),
    ],
)
def test_a_tendon_with_effect_prevents_the_lock(tendon: str, rest: str) -> None:
    """Removing one of its joints would change its force on the other."""
    spec = spec_of(_TIED.format(tendon=f'name="tie" {tendon}', rest=rest))
    with pytest.raises(MorphologyError, match="'b' is tied to other joints by the tendon 'tie'"):
        built(spec, Lock("b", 0.1))


def test_tendons_over_sites_do_not_tie_joints() -> None:
    rest = '<actuator><motor tendon="rope"/></actuator><sensor><tendonpos tendon="rope"/></sensor>'
    model = built(spec_of(_TIED.format(tendon="", rest=rest)), Lock("b", 0.1))
    assert (model.ntendon, model.nu, model.nsensor) == (1, 1, 1)
