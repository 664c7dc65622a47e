"""Selection and naming of elements."""

from __future__ import annotations

import pytest

from shapechanger.errors import MorphologyError, UnknownName
from shapechanger.morphology import name_elements
from shapechanger.morphology.spec.elements import (
    limbs_and_trunks,
    require_free_name,
    require_limb,
    select,
)
from tests.morphology.models import ant, leg, spec_of

_NAMELESS = """
<mujoco>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body>
      <freejoint/>
      <geom size=".1"/><geom size=".1"/><geom name="body_part_geom" size=".1"/>
      <site/><camera/>
      <body pos="1 0 0"><joint name="knee"/><geom size=".1"/></body>
      <body pos="2 0 0"><joint name="knee_3"/><joint axis="1 0 0"/><geom size=".1"/></body>
      <body name="knee" pos="3 0 0"><geom size=".1"/></body>
      <body pos="4 0 0"><geom size=".1"/></body>
    </body>
  </worldbody>
  <actuator><motor joint="knee"/><motor joint="knee"/><motor name="m" joint="knee_3"/></actuator>
</mujoco>
"""


def test_a_name_is_preferred_to_a_pattern() -> None:
    spec = spec_of(
        "<mujoco><worldbody><body name='a*'><geom size='.1'/></body>"
        "<body name='ab'><geom size='.1'/></body></worldbody></mujoco>"
    )
    assert [b.name for b in select("body", "a*", limbs_and_trunks(spec))] == ["a*"]
    assert [b.name for b in select("body", "a?", limbs_and_trunks(spec))] == ["a*", "ab"]


def test_globs_select_in_model_order() -> None:
    """Matching is case-sensitive."""
    found = select("body", "shank_[14]", limbs_and_trunks(ant()))
    assert [body.name for body in found] == ["shank_1", "shank_4"]
    with pytest.raises(UnknownName, match=r"No body matches 'Shank_1'\. Did you mean 'shank_1'"):
        select("body", "Shank_1", limbs_and_trunks(ant()))


def test_trunks_are_no_limbs() -> None:
    spec = leg()
    require_limb(spec.body("thigh"), "cut")
    with pytest.raises(MorphologyError, match=r"'trunk' is the trunk .* its limbs can: thigh\."):
        require_limb(spec.body("trunk"), "cut")
    lone = spec_of("<mujoco><worldbody><body name='ball'/></worldbody></mujoco>")
    with pytest.raises(MorphologyError, match="its limbs can: it has none"):
        require_limb(lone.body("ball"), "removed")


@pytest.mark.parametrize(
    ("kind", "name"),
    [("body", "thigh"), ("joint", "hip"), ("geom", "floor"), ("actuator", "knee"), ("body", "")],
)
def test_new_names_must_be_unused(kind: str, name: str) -> None:
    with pytest.raises(MorphologyError, match=f"A new {kind} needs an unused name, got '{name}'"):
        require_free_name(leg(), kind, name)


def test_all_elements_get_unique_names() -> None:
    """Names follow from given names, joints and parents."""
    spec = spec_of(_NAMELESS)
    name_elements(spec, {"knee_3": "shin"})
    assert [body.name for body in spec.bodies] == [
        *("world", "world_part", "knee_2", "shin", "knee", "world_part_part")
    ]
    assert [joint.name for joint in spec.joints] == [
        *("world_part_joint", "knee", "knee_3", "shin_joint")
    ]
    assert [geom.name for geom in spec.geoms] == [
        *("world_geom", "world_part_geom", "world_part_geom_2", "body_part_geom"),
        *("knee_2_geom", "shin_geom", "knee_geom", "world_part_part_geom"),
    ]
    assert [site.name for site in spec.sites] == ["world_part_site"]
    assert [camera.name for camera in spec.cameras] == ["world_part_camera"]
    assert [actuator.name for actuator in spec.actuators] == ["knee", "knee_2", "m"]
