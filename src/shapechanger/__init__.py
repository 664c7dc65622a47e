"""Environments, robots and measurements for transfer learning in robotics.

Importing this registers the ids with Gymnasium and loads no simulator:

>>> import gymnasium as gym
>>> import shapechanger
>>> env = gym.make("shapechanger/BigAnt-v1")
>>> env.unwrapped.observation_layout.names[0]
'torso/z'
"""

from __future__ import annotations

from importlib.metadata import version
from typing import Final

from shapechanger.envs.catalogue import register_all
from shapechanger.envs.vector.make import make_vec
from shapechanger.errors import ShapechangerError
from shapechanger.layout import Element, Feature, Layout

__all__ = ["Element", "Feature", "Layout", "ShapechangerError", "__version__", "make_vec"]

__version__: Final = version("shapechanger")

register_all()
