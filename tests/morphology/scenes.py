"""A model with nearly all kinds of elements, and Gymnasium's models, for tests."""

from __future__ import annotations

import copy
import functools
import os

import gymnasium.envs.mujoco
import mujoco

ASSETS = os.path.join(os.path.dirname(gymnasium.envs.mujoco.__file__), "assets")

# Nearly every kind of element that affects the motion.
EVERYTHING = """
<mujoco model="everything">
  <compiler angle="radian"/>
  <option timestep="0.005" density="1.2" viscosity="0.1" wind="1 0 0"/>
  <asset>
    <mesh name="wedge" vertex="0 0 0  0.1 0 0  0 0.1 0  0 0 0.1"/>
    <hfield name="hills" nrow="3" ncol="3" size="1 1 0.1 0.1"
            elevation="0 1 0 1 0 1 0 1 0"/>
    <texture name="sky" type="skybox" builtin="flat" rgb1="1 1 1" width="4" height="24"/>
    <material name="red" rgba="1 0 0 1"/>
  </asset>
  <worldbody>
    <light name="sun" pos="0 0 3"/>
    <geom name="floor" type="plane" size="5 5 1"/>
    <geom name="ground" type="hfield" hfield="hills" pos="9 9 0"/>
    <geom name="paint" type="box" size=".1 .1 .1" contype="0" conaffinity="0" material="red"/>
    <site name="anchor" pos="0 0 1"/>
    <camera name="eye" pos="0 -2 1"/>
    <body name="target" mocap="true" pos="1 1 1"/>
    <body name="stand" pos="0 0 .2"><geom name="stand" size=".1" conaffinity="0"/></body>
    <body name="trunk" pos="0 0 1" gravcomp=".1">
      <freejoint name="root"/>
      <geom name="trunk" type="box" size=".2 .1 .05" fluidshape="ellipsoid"/>
      <geom name="wedge" type="mesh" mesh="wedge" pos=".5 0 0"/>
      <site name="shoulder" pos="0 .1 0"/>
      <site name="decor" pos="0 0 .1"/>
      <body name="arm" pos="0 .2 0">
        <joint name="shoulder" type="ball" damping=".1" stiffness=".2" limited="true"
               range="0 1.5"/>
        <geom name="arm" type="capsule" fromto="0 0 0 0 .3 0" size=".03"/>
        <geom name="bone" type="cylinder" fromto="-.05 .1 0 .05 .1 0" size=".02" contype="0"
              conaffinity="0"/>
        <site name="bypass" pos="0 .1 .1"/>
        <body name="hand" pos="0 .3 0">
          <joint name="wrist" axis="1 0 0" range="-1 1" stiffness="1" springref=".2"
                 damping=".3" armature=".01" frictionloss=".05" ref=".1"
                 actuatorfrcrange="-5 5"/>
          <geom name="hand" type="cylinder" size=".04 .02" priority="1" contype="0"/>
          <site name="palm" pos="0 .05 0" euler=".1 0 0"/>
        </body>
      </body>
      <body name="leg" pos="0 -.2 0">
        <joint name="knee" axis="0 1 0" range="-1 1"/>
        <joint name="slide" type="slide" axis="0 0 1" range="-.1 .1"/>
        <geom name="leg" type="ellipsoid" size=".05 .05 .1"/>
        <site name="sole" pos="0 0 -.1"/>
        <body name="mount" pos="0 0 -.1"><site name="glued"/></body>
      </body>
      <body name="wheel" pos="0 0 -.2">
        <joint name="axle" axis="0 1 0"/>
        <geom name="wheel" size=".05" contype="0" conaffinity="0"/>
        <site name="rim" pos=".05 0 0"/>
      </body>
    </body>
  </worldbody>
  <contact>
    <pair name="sole" geom1="floor" geom2="leg" friction=".7 .6 .1 .01 .01"/>
    <exclude body1="arm" body2="leg"/>
  </contact>
  <tendon>
    <spatial name="string" range="0 2" limited="true" stiffness="3" damping=".2"
             frictionloss=".1" springlength=".1">
      <site site="shoulder"/>
      <geom geom="bone" sidesite="bypass"/>
      <site site="palm"/>
      <pulley divisor="2"/>
      <site site="anchor"/>
      <geom geom="wheel"/>
      <site site="sole"/>
    </spatial>
    <fixed name="couple"><joint joint="knee" coef="1"/><joint joint="axle" coef="-2"/></fixed>
  </tendon>
  <equality>
    <connect name="pin" body1="stand" body2="wheel" anchor="0 0 0" active="false"/>
    <weld name="glue" site1="glued" site2="anchor" active="false"/>
    <joint name="mirror" joint1="knee" joint2="wrist" polycoef="0 1 0 0 0"/>
    <joint name="lock" joint1="axle"/>
    <tendon name="even" tendon1="couple" polycoef="0 1 0 0 0"/>
  </equality>
  <actuator>
    <motor name="motor" joint="wrist" gear="5" ctrlrange="-1 1" ctrllimited="true"
           forcerange="-9 9" forcelimited="true"/>
    <position name="servo" joint="knee" kp="3" kv=".1"/>
    <muscle name="muscle" tendon="string" lengthrange=".1 2"/>
    <general name="lag" joint="slide" dyntype="filter" dynprm=".1" actrange="-1 1"
             actlimited="true" gainprm="2"/>
    <motor name="jet" site="sole" refsite="shoulder" gear="0 0 1 0 0 0"/>
    <motor name="ball" joint="shoulder" gear="1 2 3"/>
    <motor name="push" joint="root" gear="0 0 1 0 0 0"/>
    <general name="crank" cranksite="rim" slidersite="sole" cranklength=".4" gear="2"/>
    <adhesion name="suction" body="hand" gain="2" ctrlrange="0 1"/>
    <orientation name="pose" joint="shoulder" kp="1" kv=".1"/>
    <orientation name="aim" site="palm" refsite="anchor" kp="1" kv=".1"/>
  </actuator>
</mujoco>
"""


@functools.cache
def _compiled(name: str) -> mujoco.MjModel:
    if name == "everything":
        return mujoco.MjModel.from_xml_string(EVERYTHING)
    return mujoco.MjModel.from_xml_path(os.path.join(ASSETS, f"{name}.xml"))


def everything() -> mujoco.MjModel:
    return copy.copy(_compiled("everything"))


def asset(name: str) -> mujoco.MjModel:
    return copy.copy(_compiled(name))


def asset_spec(name: str) -> mujoco.MjSpec:
    return mujoco.MjSpec.from_file(os.path.join(ASSETS, f"{name}.xml"))
