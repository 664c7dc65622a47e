"""Finding elements by name, and naming those that have none."""

from __future__ import annotations

import pytest

from shapechanger.errors import MorphologyError, UnknownName
from shapechanger.morphology import name_elements
from shapechanger.morphology.spec.elements import (
    limbs_and_trunks,
    require_free_name,
    require_limb,
    select,
    subtree,
)
from tests.morphology.models import ant, differing, leg, spec_of
from tests.morphology.scenes import asset_spec

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
    """A name finds its element even where it would fit others as a glob."""
    spec = spec_of(
        "<mujoco><worldbody><body name='a*'><geom size='.1'/></body>"
        "<body name='ab'><geom size='.1'/></body></worldbody></mujoco>"
    )
    assert [b.name for b in select("body", "a*", limbs_and_trunks(spec))] == ["a*"]
    assert [b.name for b in select("body", "a?", limbs_and_trunks(spec))] == ["a*", "ab"]


def test_patterns_find_in_the_order_of_the_model() -> None:
    """A glob finds all that fit, and letters count as they are written."""
    found = select("body", "shank_[14]", limbs_and_trunks(ant()))
    assert [body.name for body in found] == ["shank_1", "shank_4"]
    with pytest.raises(UnknownName, match=r"No body matches 'Shank_1'\. Did you mean 'shank_1'"):
        select("body", "Shank_1", limbs_and_trunks(ant()))


def test_the_world_is_no_body_to_edit() -> None:
    """It is neither limb nor trunk."""
    assert [body.name for body in limbs_and_trunks(leg())] == ["trunk", "thigh", "shin"]
    with pytest.raises(UnknownName, match="There are: trunk, thigh, shin"):
        select("body", "world", limbs_and_trunks(leg()))


def test_trunks_are_no_limbs() -> None:
    """The message says what could be cut instead."""
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
def test_new_names_must_be_free(kind: str, name: str) -> None:
    """Two elements of one name could not be told apart, and one of none not be found."""
    with pytest.raises(MorphologyError, match=f"A new {kind} needs an unused name, got '{name}'"):
        require_free_name(leg(), kind, name)


def test_names_are_free_per_kind() -> None:
    """A joint may be called as a body is."""
    require_free_name(leg(), "joint", "thigh")


def test_a_subtree_begins_with_its_body() -> None:
    """Parents come before what hangs on them."""
    assert [body.name for body in subtree(leg().body("trunk"))] == ["trunk", "thigh", "shin"]


def test_everything_gets_a_name() -> None:
    """After what is chosen for the joint, after the joint, after the parent; never one twice."""
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


def test_names_change_no_physics() -> None:
    """A model with names is the model without, and naming twice is naming once."""
    spec = spec_of(_NAMELESS)
    before = spec.copy().compile()
    name_elements(spec)
    names = [geom.name for geom in spec.geoms]
    assert differing(before, spec.copy().compile()) == []
    name_elements(spec)
    assert [geom.name for geom in spec.geoms] == names


def test_the_ant_has_the_names_that_its_family_gives() -> None:
    """The release's shanks have no names in Gymnasium's file."""
    shanks = [body.name for body in ant().bodies if body.name.startswith("shank")]
    assert shanks == ["shank_1", "shank_2", "shank_3", "shank_4"]
    unnamed = asset_spec("ant")
    assert sum(not body.name for body in unnamed.bodies) == 4
