"""Edits make the bodies of the 2017 Shapechanger release, equal bit for bit.

The release had a model file for each body. Here the same files are made from Gymnasium's by text
replacement, and compiled by MuJoCo without edits.
"""

from __future__ import annotations

import re
from pathlib import Path

import mujoco
import pytest

from shapechanger.envs.ant import ANT
from shapechanger.envs.pendulum import PENDULUM
from shapechanger.morphology import compile_body
from tests.morphology.models import differing
from tests.morphology.scenes import ASSETS

_ANT = (Path(ASSETS) / "ant.xml").read_text()
_PENDULUM = (Path(ASSETS) / "inverted_pendulum.xml").read_text()

# Directions of the legs: signs of x and y.
_SIDES = {1: ("", ""), 2: ("-", ""), 3: ("-", "-"), 4: ("", "-")}


def _replaced(text: str, old: str, new: str, times: int) -> str:
    """Replace a pattern in a text, which must occur a given number of times."""
    result, count = re.subn(old, new, text)
    assert count == times
    return result


def _extended_ant(*, motors: bool) -> str:
    """Return the release's extended_ant.xml, with or without motors for the third segments."""
    text = _replaced(_ANT, 'name="torso" pos="0 0 0.75"', 'name="torso" pos="0 0 1.25"', 1)
    text = _replaced(text, 'range="30 70"', 'range="30 50"', 2)
    text = _replaced(text, 'range="-70 -30"', 'range="-50 -30"', 2)
    for leg, (x, y) in _SIDES.items():
        axis = "-1 1 0" if leg in (1, 3) else "1 1 0"
        limits = "30 70" if leg in (1, 4) else "-70 -30"
        foot = f"""
            <body name="foot_{leg}" pos="{x}0.4 {y}0.4 0">
              <joint axis="{axis}" name="foot_{leg}" pos="0 0 0" range="{limits}" type="hinge"/>
              <geom fromto="0 0 0 {x}0.6 {y}0.6 0" size="0.08" type="capsule"/>
            </body>"""
        shank = rf'(<geom fromto="0.0 0.0 0.0 {x}0.4 {y}0.4 0.0"[^>]*/>)'
        text = _replaced(text, shank, rf"\1{foot}", 1)
    if motors:
        motor = '<motor ctrllimited="true" ctrlrange="-1.0 1.0" joint="foot_{}" gear="150"/>'
        more = "".join(motor.format(leg) for leg in (4, 1, 2, 3))
        text = _replaced(text, "</actuator>", f"{more}</actuator>", 1)
    return text


_SHANK = r'fromto="0.0 0.0 0.0 (-?)0\.4 (-?)0\.4 0\.0"'
_POLE = r'(?<=0 0 0 )0\.001 0 0\.6(?=" name="cpole")'

_RELEASED = {
    "BigAnt": _replaced(_ANT, _SHANK, r'fromto="0 0 0 \g<1>0.8 \g<2>0.8 0"', 4),
    "AmputatedAnt": _replaced(
        _ANT,
        r'fromto="0.0 0.0 0.0 0.4 -0.4 0.0" name="fourth_ankle_geom"',
        'fromto="0 0 0 0.1 -0.1 0" name="fourth_ankle_geom"',
        1,
    ),
    "ExtendedAnt": _extended_ant(motors=True),
    "ExtendedAntPassive": _extended_ant(motors=False),
    "BigInvertedPendulum": _replaced(_PENDULUM, _POLE, "0.001 0 1.2", 1),
    "SmallInvertedPendulum": _replaced(_PENDULUM, _POLE, "0.001 0 0.3", 1),
    "Ant": _ANT,
    "InvertedPendulum": _PENDULUM,
}


def _edited(name: str) -> mujoco.MjModel:
    family = PENDULUM if "Pendulum" in name else ANT
    source = "inverted_pendulum.xml" if "Pendulum" in name else "ant.xml"
    return compile_body(family.load(Path(ASSETS) / source), family.bodies[name])


@pytest.mark.parametrize("name", [*ANT.bodies, *PENDULUM.bodies])
def test_edits_make_the_bodies_of_the_release(name: str) -> None:
    assert differing(mujoco.MjModel.from_xml_string(_RELEASED[name]), _edited(name)) == []
