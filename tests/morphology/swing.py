"""A small environment with wrappers, for tests of certificates."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

from shapechanger.layout import Feature, Layout

_XML = """
<mujoco>
  <worldbody>
    <body name="arm"><joint name="hinge" axis="0 1 0" damping="0.1"/>
      <geom name="arm" type="capsule" fromto="0 0 0 0 0 -{length}" size=".02" mass="{mass}"/>
      {more}
    </body>
  </worldbody>
  <actuator><motor name="motor" joint="hinge" gear="{gear}"/>{motors}</actuator>
</mujoco>
"""
_WRIST = """
<body name="hand" pos="0 0 -.5"><joint name="wrist" axis="0 1 0"/>
  <geom name="hand" type="capsule" fromto="0 0 0 0 0 -.2" size=".02" mass=".3"/></body>
"""


class Swing:
    """Pendulum with a motor, and optionally a wrist with a second motor."""

    def __init__(
        self,
        *,
        length: float = 0.5,
        mass: float = 1.0,
        gear: float = 1.0,
        wrist: bool = False,
        limit: int = 1000,
        bonus: float = 0.0,
        standing_height: float | None = None,
    ) -> None:
        motors = "<motor name='wrist' joint='wrist'/>" if wrist else ""
        self.model = mujoco.MjModel.from_xml_string(
            _XML.format(
                length=length, mass=mass, gear=gear, more=_WRIST if wrist else "", motors=motors
            )
        )
        self.standing_height = standing_height
        joints = ("hinge", "wrist") if wrist else ("hinge",)
        self.observation_layout = Layout(
            tuple(Feature(f"{joint}/angle", "rad") for joint in joints)
            + tuple(Feature(f"{joint}/velocity", "rad/s") for joint in joints)
        )
        names = ("motor", "wrist") if wrist else ("motor",)
        self.action_layout = Layout(tuple(Feature(name, "1", -1.0, 1.0) for name in names))
        self.commands: list[np.ndarray] = []
        self._limit = limit
        self._bonus = bonus
        self._data = mujoco.MjData(self.model)

    def reset(self, *, seed: int | None = None) -> tuple[np.ndarray, dict[str, Any]]:
        mujoco.mj_resetData(self.model, self._data)
        self._data.qpos[0] = np.random.default_rng(seed).uniform(-0.1, 0.1)
        self.commands = []
        return self._observation(), {}

    def step(self, action: Any, /) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        self.commands.append(action)
        self._data.ctrl[:] = action
        mujoco.mj_step(self.model, self._data, nstep=10)
        reward = self._bonus - float(self._data.qpos[0] ** 2)
        return self._observation(), reward, False, len(self.commands) >= self._limit, {}

    def _observation(self) -> np.ndarray:
        return np.concatenate([self._data.qpos, self._data.qvel])


class Wrapper:
    """Minimal wrapper in the style of Gymnasium, which changes the observation."""

    def __init__(self, env: Any, sensed: Callable[[Any], Any] = lambda seen: seen) -> None:
        self.env, self._sensed = env, sensed

    @property
    def unwrapped(self) -> Any:
        return getattr(self.env, "unwrapped", self.env)

    def reset(self, *, seed: int | None = None) -> tuple[Any, dict[str, Any]]:
        observation, info = self.env.reset(seed=seed)
        return self._sensed(observation), info

    def step(self, action: Any, /) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        observation, *rest = self.env.step(action)
        return (self._sensed(observation), *rest)


def noisy(env: Any) -> Wrapper:
    random = np.random.default_rng(7)
    return Wrapper(env, lambda seen: seen + random.normal(scale=0.01, size=np.shape(seen)))


def dictionary(env: Any) -> Wrapper:
    return Wrapper(env, lambda seen: {"velocity": seen[1:], "angle": seen[:1]})


def longer(env: Any) -> Wrapper:
    """Return an env with one more number, without a layout for it."""
    return Wrapper(env, lambda seen: np.append(seen, 1.0))


def broken(env: Any) -> Wrapper:
    return Wrapper(env, lambda seen: np.concatenate([[np.nan], seen[1:]]))


def late(env: Any, after: int, offset: float) -> Wrapper:
    """Return an env that adds `offset` to its observations after the first `after` of them."""
    count = itertools.count()
    return Wrapper(env, lambda seen: seen + (offset if next(count) >= after else 0.0))
