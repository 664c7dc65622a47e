"""A mechanism in which elements name each other in every way, generated from a few numbers."""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np

_TEXT = """
<mujoco model="mechanism">
  <compiler angle="{angle}" boundmass="{boundmass}"/>
  <option gravity="0 0 -9.81"/>
  <default><geom density="800"/></default>
  <asset><mesh name="shell" vertex="-.01 -.01 0 .01 -.01 0 0 .02 0 0 0 .15"/></asset>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 1" pos="0 0 -2"/>
    <site name="ceiling" pos="0 0 2"/>
    <body name="base" pos="0 0 1">{root}
      <geom name="base" type="box" size=".03 .03 .03"/>
      <site name="origin" pos="0 .04 0"/>
      <body name="crank" euler="0 {turn} 0">
        <joint name="crank" axis="0 1 0" range="{wide}"/>
        <geom name="crank" type="capsule" fromto="0 0 0 {crank}" size=".01"/>
        <geom name="drum" type="sphere" size=".02" pos="{drum}" contype="0" conaffinity="0"/>
        <site name="side" pos="{side}"/>
        <site name="rim" pos="{drum}"/>
        <body name="coupler" pos="{crank}">
          <joint name="coupler" axis="0 1 0" range="{wide}" damping=".1"/>
          <geom name="housing" type="box" size=".02 .01 .01" pos="{housing}" quat="{along}"/>
          <geom name="coupler" type="capsule" fromto="0 0 0 {coupler}" size=".01"/>
          <site name="pin on coupler" pos="{pin}"/>
          <site name="eye" pos="{pin}"/>
          <site name="lamp" pos="{housing}"/>
          <site name="pull" pos="{tool}"/>
          <camera name="eye" pos="{pin}" mode="targetbody" target="left"/>
          <light name="lamp" pos="{housing}"/>
          <body name="tool" pos="{tool}">
            <joint name="tool" axis="0 1 0" range="{narrow}"/>
            <geom name="tool" type="capsule" fromto="0 0 0 0 .1 .1" size=".01"/>
            <site name="tip" pos="0 .1 .1"/>
          </body>
        </body>
      </body>
      <body name="rocker" pos="{rocker_at}">
        <joint name="rocker" axis="0 1 0" range="{wide}"/>
        <geom name="rocker" type="cylinder" fromto="0 0 0 {rocker}" size=".01"/>
        <geom name="shell" type="capsule" mesh="shell" mass=".1" contype="0" conaffinity="0"/>
        <site name="pin on rocker" pos="{rocker}"/>
      </body>
      <body name="left" pos="0 .2 0">
        <joint name="left" axis="1 0 0" range="{narrow}"/>
        <geom name="left" type="capsule" fromto="0 0 0 0 0 .2" size=".01"/>
        <site name="left" pos="0 0 .2"/>
      </body>
      <body name="right" pos="0 -.2 0">
        <joint name="right" axis="1 0 0" range="{wide}"/>
        <geom name="right" type="capsule" fromto="0 0 0 0 0 .2" size=".01"/>
      </body>
    </body>
  </worldbody>
  <deformable>
    <skin name="cover" vertex="0 0 0 1 0 0 0 1 0" face="0 1 2">
      <bone body="left" bindpos="0 0 0" bindquat="1 0 0 0" vertid="0 1" vertweight="1 1"/>
      <bone body="right" bindpos="0 0 0" bindquat="1 0 0 0" vertid="2" vertweight="1"/>
    </skin>
  </deformable>
  <contact>
    <exclude name="apart" body1="coupler" body2="left"/>
    <pair name="floor and coupler" geom1="floor" geom2="coupler"/>
  </contact>
  <tendon>
    <spatial name="rope" range="0 9" limited="true">
      <site site="origin"/><geom geom="drum" sidesite="side"/><site site="pull"/>
    </spatial>
    <fixed name="sum"><joint joint="left" coef="1"/></fixed>
  </tendon>
  <equality>
    {pin_text}
    <joint name="mimic" joint1="right" joint2="left" polycoef="0 {slope} {curve} 0 0"/>
    <weld name="grasp" body1="tool" body2="left" active="false"/>
  </equality>
  <actuator>
    <position name="servo" joint="crank" kp="20" kv="1" ctrlrange="-1 1" forcerange="-9 9"/>
    <velocity name="speed" joint="tool" kv="2" ctrlrange="-1 1"/>
    <motor name="sum" tendon="sum" gear="3" ctrlrange="-1 1"/>
    <muscle name="muscle" tendon="rope" lengthrange=".1 2"/>
    <motor name="jet" site="tip" refsite="origin" gear="0 0 1 0 0 0"/>
    <general name="rod" cranksite="rim" slidersite="ceiling" cranklength="5"/>
  </actuator>
  <sensor>
    <framepos name="tip" objtype="site" objname="tip" reftype="site" refname="origin"/>
    <jointpos name="coupler" joint="coupler"/>
    <tendonpos name="rope" tendon="rope"/>
    <actuatorfrc name="servo" actuator="servo"/>
    <camprojection name="seen" site="left" camera="eye"/>
  </sensor>
  <custom><tuple name="group"><element objtype="body" objname="tool"/></tuple></custom>
  <keyframe>
    <key name="home" qpos="{free}.1 .2 .3 .4 .5 .6" ctrl=".1 .2 .3 .4 .5 .6"/>
  </keyframe>
</mujoco>
"""


class Mechanism(NamedTuple):
    """Parameters of the mechanism."""

    crank: tuple[float, float]  # End of the crank in the plane of motion, x and z, m.
    coupler: tuple[float, float]  # End of the coupler relative to the end of the crank, x and z, m.
    rocker: tuple[float, float]  # End of the rocker relative to its hinge, x and z, m.
    pin: float  # Place of the pin on the coupler as a share of its length.
    tool: float  # Place of the tool on the coupler as a share of its length.
    turn: float  # Turn of the crank's frame, rad.
    slope: float  # Slope of the coupling of both fingers.
    curve: float  # Quadratic coefficient of this coupling.
    form: str  # How the pin is written: "anchor", "reversed", "sites" or "weld".
    floats: bool  # Whether the base is free.
    in_degrees: bool  # Whether angles are written in degrees.
    boundmass: float  # The compiler's least mass, kg.

    def spec(self) -> mujoco.MjSpec:
        cos, sin = np.cos(self.turn), np.sin(self.turn)

        def local(x: float, z: float) -> np.ndarray:
            """Return a vector of the world in the frame of the crank and the coupler."""
            return np.array([cos * x - sin * z, 0.0, sin * x + cos * z])

        crank, coupler = local(*self.crank), local(*self.coupler)
        rocker = np.array([self.rocker[0], 0.0, self.rocker[1]])
        pin = self.pin * coupler
        closed = np.array([self.crank[0], 0.0, self.crank[1]])
        closed += self.pin * np.array([self.coupler[0], 0.0, self.coupler[1]])
        across = np.cross(coupler, [0.0, 1.0, 0.0])
        along = np.empty(4)
        # A box with its first axis along the coupler.
        mujoco.mju_mat2Quat(
            along,
            np.column_stack(
                [coupler / np.linalg.norm(coupler), [0, 1, 0], across / np.linalg.norm(across)]
            ).ravel(),
        )
        pins = {
            "anchor": f'<connect name="pin" body1="coupler" body2="rocker" anchor="{_text(pin)}"/>',
            "reversed": '<connect name="pin" body1="rocker" body2="coupler" '
            f'anchor="{_text(rocker)}"/>',
            "sites": '<connect name="pin" site1="pin on coupler" site2="pin on rocker"/>',
            "weld": f'<weld name="pin" body1="rocker" body2="coupler" anchor="{_text(pin)}"/>',
        }

        def angles(*values: float) -> str:
            return _text(np.degrees(values) if self.in_degrees else np.array(values))

        return mujoco.MjSpec.from_string(
            _TEXT.format(
                angle="degree" if self.in_degrees else "radian",
                boundmass=self.boundmass,
                root='<freejoint name="root"/>' if self.floats else "",
                free="0 0 .5 1 0 0 0 " if self.floats else "",
                turn=angles(self.turn),
                wide=angles(-2.5, 2.5),
                narrow=angles(-0.5, 0.5),
                crank=_text(crank),
                coupler=_text(coupler),
                rocker=_text(rocker),
                rocker_at=_text(closed - rocker),
                pin=_text(pin),
                tool=_text(self.tool * coupler),
                drum=_text(0.5 * crank),
                side=_text(0.5 * crank + np.array([0.0, 0.05, 0.0])),
                housing=_text(0.15 * coupler),
                along=_text(along),
                pin_text=pins[self.form],
                slope=self.slope,
                curve=self.curve,
            )
        )


def _text(values: np.ndarray) -> str:
    return " ".join(map(repr, np.asarray(values, float).tolist()))
