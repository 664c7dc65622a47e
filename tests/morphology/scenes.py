"""A model with nearly all kinds of elements, and Gymnasium's models, for tests."""

from __future__ import annotations

import copy
import functools
import os

import gymnasium.envs.mujoco
import mujoco

from tests.models import xml

ASSETS = os.path.join(os.path.dirname(gymnasium.envs.mujoco.__file__), "assets")

# Nearly every kind of element that affects the motion.
EVERYTHING = xml("everything")


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
