"""A change without effect is an empty shift, whatever it changes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import gymnasium
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import shapechanger
from shapechanger.errors import EmptyShift
from shapechanger.morphology.certificate.certify import certify
from tests.morphology.swing import Swing, Wrapper

# Two arms on a base that cannot move; the welded wrist, the sign and the lamp do not move either.
_XML = """
<mujoco>
  <asset><material name="paint" rgba="1 0 0 1"/></asset>
  <worldbody>
    <light name="lamp" pos="0 0 3"/>
    <camera name="eye" pos="0 -2 1" fovy="45"/>
    <geom name="floor" type="plane" size="5 5 .1" contype="0" conaffinity="0"/>
    <body name="base" pos="0 0 1" gravcomp="0">
      <inertial mass="5" pos="0 0 0" diaginertia=".02 .02 .02"/>
      <geom name="hull" type="sphere" size=".1"/>
      <body name="left"><joint name="hip_left" axis="0 1 0" range="-60 60" damping=".5"/>
        <geom name="thigh_left" type="capsule" fromto="0 0 0 .25 0 0" size=".03" friction="1"
          contype="0" conaffinity="0"/>
        <geom name="badge" type="box" size=".02 .02 .02" mass="0" contype="0" conaffinity="0"
          material="paint"/>
        <site name="tip" pos=".25 0 0"/>
      </body>
      <body name="right"><joint name="hip_right" axis="0 1 0" damping=".5"/>
        <geom name="thigh_right" type="capsule" fromto="0 0 0 -.25 0 0" size=".03"/>
      </body>
    </body>
    <body name="sign" pos="3 0 1"><geom name="board" type="box" size=".1 .1 .1" mass="2"/></body>
  </worldbody>
  <actuator>
    <motor name="left" joint="hip_left" gear="10" ctrlrange="-1 1"/>
    <motor name="right" joint="hip_right" gear="10" ctrlrange="-1 1"/>
  </actuator>
  <custom><numeric name="seven" data="7"/></custom>
  <keyframe><key name="other" qpos=".1 .1"/></keyframe>
</mujoco>
"""
# Each takes a positive factor, and writes something that decides nothing.
_HARMLESS: dict[str, Callable[[str, float], str]] = {
    "mass of a fixed base": lambda t, x: t.replace('mass="5"', f'mass="{5 * x:.17g}"'),
    "inertia of a fixed base": lambda t, x: t.replace(
        'diaginertia=".02 .02 .02"', f'diaginertia="{0.02 + 0.001 * x:.17g} .02 .02"'
    ),
    "centre of mass of a fixed base": lambda t, x: t.replace(
        'mass="5" pos="0 0 0"', f'mass="5" pos="{0.1 * x:.17g} 0 0"'
    ),
    "gravity compensation of a fixed base": lambda t, x: t.replace(
        'gravcomp="0"', f'gravcomp="{x:.17g}"'
    ),
    "mass of a fixed thing": lambda t, x: t.replace('mass="2"', f'mass="{2 * x:.17g}"'),
    "friction of a geom that touches nothing": lambda t, x: t.replace(
        'friction="1"', f'friction="{x:.17g}"'
    ),
    "size of a drawn geom": lambda t, x: t.replace('size=".02 .02 .02"', f'size="{x:.9g} .1 .1"'),
    "another drawn geom": lambda t, x: t.replace(
        "<site ",
        f'<geom type="box" size="{x:.9g} .1 .1" mass="0" contype="0" conaffinity="0"/><site ',
    ),
    "camera": lambda t, x: t.replace('fovy="45"', f'fovy="{30 * min(x, 3):.9g}"'),
    "light": lambda t, x: t.replace('pos="0 0 3"', f'pos="0 0 {x:.9g}"'),
    "colour": lambda t, x: t.replace("1 0 0 1", f"{min(x, 1):.9g} 0 0 1"),
    "site": lambda t, x: t.replace('name="tip" pos=".25', f'name="tip" pos="{x:.9g}'),
    "custom number": lambda t, x: t.replace('data="7"', f'data="{x:.9g}"'),
    "keyframe": lambda t, x: t.replace('qpos=".1 .1"', f'qpos="{min(x, 1):.9g} .1"'),
    "wind without air": lambda t, x: t.replace("<asset>", f'<option wind="{x:.9g} 0 0"/><asset>'),
    "sensor": lambda t, x: t.replace(
        "<custom>", f'<sensor><jointpos joint="hip_left" noise="{x:.9g}"/></sensor><custom>'
    ),
}
_EFFECTIVE: dict[str, Callable[[str], str]] = {
    "damping": lambda t: t.replace('range="-60 60" damping=".5"', 'range="-60 60" damping=".4"'),
    "gear": lambda t: t.replace('"hip_left" gear="10"', '"hip_left" gear="11"'),
    "mass of a drawn geom": lambda t: t.replace('mass="0"', 'mass=".1"'),
    "gravity compensation of an arm": lambda t: t.replace(
        '<body name="left">', '<body name="left" gravcomp="1">'
    ),
}


def _still(robot: object) -> dict[str, float]:
    del robot
    return {"still": 0.0}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("robots")


def _made(folder: Path, text: str) -> gymnasium.Env[object, object]:
    file = folder / "arms.xml"
    file.write_text(text, encoding="utf-8")
    return shapechanger.from_mjcf(file, _still)


@settings(max_examples=15, deadline=None)
@given(
    st.lists(st.sampled_from(sorted(_HARMLESS)), min_size=1, max_size=4, unique=True),
    st.floats(0.05, 20.0),
)
def test_changes_without_effect_are_refused(folder: Path, names: list[str], factor: float) -> None:
    """One or several of them are an empty shift, to the last of a hundred steps."""
    text = _XML
    for name in names:
        changed = _HARMLESS[name](text, factor)
        assume(changed != text)
        text = changed
    with pytest.raises(EmptyShift, match="behave the same"):
        certify(_made(folder, _XML), _made(folder, text))


@pytest.mark.parametrize("name", _EFFECTIVE)
def test_a_change_with_an_effect_is_certified_among_others(folder: Path, name: str) -> None:
    """It is found although masses and colours that do not count differ, too."""
    text = _EFFECTIVE[name](_XML)
    assert text != _XML
    for other in ("mass of a fixed base", "camera", "colour"):
        text = _HARMLESS[other](text, 2.0)
    certificate = certify(_made(folder, _XML), _made(folder, text))
    assert not certificate.is_empty
    assert not certificate.rollout.differs_by_rounding


class _Late(Wrapper):
    """Wrapper that adds to the observation after some steps."""

    def __init__(self, env: object, after: int, offset: float) -> None:
        super().__init__(env)
        self._left, self._offset = after, offset

    def sensed(self, observation: object) -> object:
        """Add the offset once the steps are over."""
        self._left -= 1
        return observation + (self._offset if self._left < 0 else 0.0)  # type: ignore[operator]


@pytest.mark.parametrize("after", [0, 1, 50, 100])
def test_a_late_shift_is_no_rounding(after: int) -> None:
    """What is sensed may differ late, by little, and between models that round differently."""
    heavy = Swing(mass=1.0 + 1e-15)
    assert not certify(heavy, _Late(Swing(), after, 1e-6)).is_empty
    assert certify(Swing(), _Late(Swing(), after, 1e-12), allow_empty=True).is_empty


def test_another_end_of_the_episode_is_no_rounding() -> None:
    """Equal numbers with another end differ in what the episode is."""

    class _Ends(Wrapper):
        def step(self, action: object, /) -> object:  # type: ignore[override]
            observation, reward, _, *rest = self.env.step(action)
            return (observation, reward, len(self.env.commands) > 30, *rest)

    certificate = certify(Swing(), _Ends(Swing()))
    assert certificate.same_model
    assert not certificate.is_empty
    assert certificate.verdict.endswith("are the same; what is sensed, done or rewarded differs.")
