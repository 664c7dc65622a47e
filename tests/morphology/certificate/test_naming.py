"""Names of unnamed elements."""

from __future__ import annotations

import mujoco
import pytest

from shapechanger.morphology.certificate import fingerprint
from shapechanger.morphology.certificate.numbers import names_of
from shapechanger.morphology.spec.elements import name_elements
from tests.morphology.scenes import asset, asset_spec


@pytest.mark.parametrize("name", ["ant", "hopper", "humanoid", "inverted_pendulum", "walker2d_v5"])
def test_names_equal_those_of_name_elements(name: str) -> None:
    spec = asset_spec(name)
    name_elements(spec)
    named = spec.compile()
    assert names_of(named) == names_of(asset(name))
    assert fingerprint(named) == fingerprint(asset(name))


def test_the_ants_shanks_are_named_after_their_joints() -> None:
    names = names_of(asset("ant"))
    assert names["bodies"][4] == "ankle_1"
    assert names["actuators"][:2] == ["hip_4", "ankle_4"]


def test_names_that_repeat_are_numbered() -> None:
    """Names of a kind are unique."""
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body name='a'>"
        "<joint/><joint axis='1 0 0'/><geom size='1'/><geom size='2'/>"
        "<geom name='a_geom_2' size='1'/><site/>"
        "<body><geom size='1'/></body><body/></body></worldbody>"
        "<equality><connect body1='a' anchor='0 0 0'/></equality></mujoco>"
    )
    names = names_of(model)
    assert names["bodies"] == ["world", "a", "a_part", "a_part_2"]
    assert names["joints"] == ["a_joint", "a_joint_2"]
    assert names["geoms"] == ["a_geom", "a_geom_3", "a_geom_2", "a_part_geom"]
    assert names["sites"] == ["a_site"]
    assert names["equalities"] == ["equality"]
