"""Names for elements that have none."""

from __future__ import annotations

import mujoco
import pytest

from shapechanger.morphology.effective import fingerprint
from shapechanger.morphology.effective.elements import names_of
from shapechanger.morphology.spec.elements import name_elements
from tests.morphology.scenes import asset, asset_spec, everything


@pytest.mark.parametrize("name", ["ant", "hopper", "humanoid", "inverted_pendulum", "walker2d_v5"])
def test_a_model_named_by_rule_is_the_same_model(name: str) -> None:
    """The names given to unnamed elements are those that editing gives them."""
    spec = asset_spec(name)
    name_elements(spec)
    named = spec.compile()
    assert names_of(named) == names_of(asset(name))
    assert fingerprint(named) == fingerprint(asset(name))


def test_the_ants_shanks_are_called_after_their_joints() -> None:
    """The ant's four shanks and eight motors have no names in the file."""
    names = names_of(asset("ant"))
    assert names.bodies[4] == "ankle_1"
    assert names.actuators[:2] == ("hip_4", "ankle_4")


def test_names_that_repeat_are_numbered() -> None:
    """No two elements of a kind bear the same name, whatever was given."""
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body name='a'>"
        "<joint/><joint axis='1 0 0'/><geom size='1'/><geom size='2'/>"
        "<geom name='a_geom_2' size='1'/><site/>"
        "<body><geom size='1'/></body><body/></body></worldbody>"
        "<equality><connect body1='a' anchor='0 0 0'/></equality></mujoco>"
    )
    names = names_of(model)
    assert names.bodies == ("world", "a", "a_part", "a_part_2")
    assert names.joints == ("a_joint", "a_joint_2")
    assert names.geoms == ("a_geom", "a_geom_3", "a_geom_2", "a_part_geom")
    assert names.sites == ("a_site",)
    assert names.equalities == ("equality",)


def test_every_actuator_names_what_it_drives() -> None:
    """Joints, tendons, sites and bodies are all driven by something."""
    names = names_of(everything())
    assert dict(zip(names.actuators, names.targets, strict=True)) == {
        "motor": "wrist",
        "servo": "knee",
        "muscle": "string",
        "lag": "slide",
        "jet": "sole",
        "ball": "shoulder",
        "push": "root",
        "crank": "rim",
        "suction": "hand",
        "pose": "shoulder",
        "aim": "palm",
    }
