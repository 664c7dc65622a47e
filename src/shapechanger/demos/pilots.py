"""Drivers of a recording: an expert, a policy, or a policy that the expert corrects."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.env_ref import layouts_of
from shapechanger.demos.drivers import (
    EXPERT,
    Act,
    CorrectedPilot,
    EpisodeDriver,
    ExpertPilot,
    Gate,
    GateRule,
    PolicyPilot,
    TaskExpert,
)
from shapechanger.demos.recording import QUALITY, ObservationEncoder
from shapechanger.errors import DemosError
from shapechanger.layout import Layout
from shapechanger.policy import kind_of, load_policy

# Values of the actions of vehicles at which they are slowest.
_RESTS: Final = {"throttle": 0.0, "waypoint/speed": -1.0}
_CRAWLS_MPS: Final = 0.05  # Below this speed a vehicle does not collide.


def pilot_of(env: gym.Env[Any, Any], driver: str, corrected_by: str, seed: int) -> EpisodeDriver:
    """Return the requested driver."""
    if corrected_by not in ("", EXPERT):
        raise DemosError(f"A policy is corrected by {EXPERT}, and not by {corrected_by!r}.")
    if driver == EXPERT:
        if corrected_by:
            raise DemosError("The expert needs no correction: give a policy as the driver.")
        return ExpertPilot(_expert(env, seed))
    if not Path(driver).is_file():
        raise DemosError(f"There is no driver {driver!r}: it is {EXPERT}, or the file of a policy.")
    act = _policy(Path(driver), env)
    if not corrected_by:
        return PolicyPilot(act)
    return corrected_pilot(env, act, _expert(env, seed))


def corrected_pilot(env: gym.Env[Any, Any], act: Act, expert: TaskExpert) -> CorrectedPilot:
    """Return a policy that an expert corrects where it is dangerous."""
    rule = GateRule()
    period_s = 1.0 / float(env.metadata.get("render_fps") or 20.0)
    layout: Layout | None = getattr(env.unwrapped, "action_layout", None)
    rests = [] if layout is None else [_RESTS.get(name) for name in layout.names]
    dangers = _Dangers(env, rests[-1] if rests else None, rule, period_s)
    return CorrectedPilot(act, expert, Gate(rule, period_s, rests), dangers)


def _expert(env: gym.Env[Any, Any], seed: int) -> TaskExpert:
    give = getattr(env.unwrapped, "demonstrator", None)
    if give is None:
        raise DemosError(
            f"{_name_of(env)} has no expert: let a policy drive with `--driver FILE`, or drive a "
            "robot yourself with `shapechanger robot drive`."
        )
    return cast("TaskExpert", give(seed))


def _policy(path: Path, env: gym.Env[Any, Any]) -> Act:
    """Load a policy and check that its observations and actions fit the env."""
    box = cast("gym.spaces.Box", env.action_space)

    def fitting(actions: NDArray[Any]) -> NDArray[np.float32]:
        return np.clip(np.asarray(actions, np.float32)[0], box.low, box.high)

    if kind_of(path) == "clone":
        clone = _clone(path, env)
        return lambda seen: fitting(clone(seen))
    policy = load_policy(path)
    if (policy.card.observation, policy.card.action) != layouts_of(env):
        raise DemosError(
            f"{path} was trained in {policy.card.env}, which senses or moves something else than "
            f"{_name_of(env)}."
        )
    return lambda seen: fitting(policy.act(np.asarray(seen)[np.newaxis]))


def _name_of(env: gym.Env[Any, Any]) -> str:
    return env.spec.id if env.spec else type(env.unwrapped).__name__


class _Dangers:
    """Describes the danger in the env's world, if it has one."""

    def __init__(
        self, env: gym.Env[Any, Any], rest: float | None, rule: GateRule, period_s: float
    ) -> None:
        self._world = getattr(env.unwrapped, "world", None)
        self._rest, self._rule, self._period_s = rest or 0.0, rule, period_s
        self._placed, self._still_s = -1, 0.0

    def __call__(self, action: NDArray[np.float32]) -> str:
        """Return the danger of an action, in words; "" for none. Call it once per step."""
        world = self._world
        if world is None:
            return ""
        speed, ahead_m = world.inputs().speed, world.distance_m()
        if world.placed != self._placed or abs(speed) > _CRAWLS_MPS:
            self._placed, self._still_s = world.placed, 0.0
        self._still_s += self._period_s
        if world.touches:
            return "it touches something"
        drives_on = speed > _CRAWLS_MPS and action[-1] > self._rest
        if drives_on and ahead_m < speed * self._rule.near_s:
            return f"{ahead_m:.1f} m to what is ahead"
        return "it stands still" if self._still_s > self._rule.still_s else ""


def _clone(path: Path, env: gym.Env[Any, Any]) -> Callable[[Any], NDArray[Any]]:
    """Load a clone, and check that it fits the env's frames, state and actions."""
    from shapechanger.demos.cloning.policy import CameraPolicy  # PyTorch.

    clone = CameraPolicy.load(path)
    encoder = ObservationEncoder(env, QUALITY)
    needs = {"image": clone.card.eyes != "none", "state": clone.card.state_layout is not None}
    if needs["image"] and not encoder.has_picture:
        raise DemosError(f"{path} drives by images, and {_name_of(env)} shows none.")
    clone.card.require_layouts(encoder.action_layout, encoder.state_layout)
    is_dict = isinstance(env.observation_space, gym.spaces.Dict)

    def part(seen: Any, name: str) -> NDArray[Any] | None:
        return np.asarray(seen[name] if is_dict else seen)[np.newaxis] if needs[name] else None

    return lambda seen: clone.predict_many(part(seen, "image"), part(seen, "state"))
