"""Drivers of recorded episodes: an expert, a policy, or a policy with corrections.

With corrections the policy drives, and an expert takes over when it goes wrong: M. Kelly et al.,
"HG-DAgger: Interactive Imitation Learning with Human Experts", ICRA 2019. There a person decides
when to intervene; here a rule with fixed thresholds does.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.contract.env_ref import TaskDemonstrator, layouts_of
from shapechanger.demos.episodes import Step
from shapechanger.demos.recording import ObservationEncoder, RecordEpisodes, name_of, row
from shapechanger.errors import DemosError
from shapechanger.policy import load_policy

EXPERT: Final = "expert"
"""Name of the expert of an env as a driver."""

Act = Callable[[Any], NDArray[np.float32]]  # A policy, from an observation to an action, (n,).

# The expert takes over if a value of the two actions, such as the steering, has differed by more
# than _APART for _APART_S without interruption, and at once in danger: if the vehicle touches
# something, would reach an obstacle ahead within _NEAR_S at the present speed while the policy does
# not brake, or has stood still for _STILL_S, because such steps would be useless. The policy drives
# on if no value has differed by more than _AGREE, without any danger, for _AGREE_S.
_APART, _APART_S = 0.6, 0.3
_NEAR_S: Final = 0.4
_STILL_S: Final = 2.0
_AGREE, _AGREE_S = 0.3, 1.0
_ROUNDING: Final = 1e-9
_RESTS: Final = {"throttle": 0.0, "waypoint/speed": -1.0}  # Values at which a vehicle is slowest.
_CRAWLS_MPS: Final = 0.05  # Below this speed a vehicle does not collide.

DriverDecision = tuple[NDArray[np.float32], Step, str]
"""Action to pass to the env, shape (n,); step with the action to record as decided, its driver, and
the action of a policy while the expert drives; and text of a mark to set, "" for no mark."""


class Pilot:
    """Driver of a recording: an expert, a policy, or a policy that an expert corrects.

    The intended action of an expert is recorded as decided. The expert errs on purpose now and
    then, so that a learner sees recoveries; the env executes the erroneous action. While it
    corrects a policy, the expert makes no mistakes.

    A policy that is only slower than the expert is not corrected: any throttle from rest to the
    expert's counts as agreement. Dangers are detected in the `world` of the env, if it has one.
    While a policy may be corrected, `steps` counts all decisions, `corrected` the decisions of the
    expert, and `takeovers` how often the expert took over.
    """

    def __init__(
        self, env: gym.Env[Any, Any], act: Act | None, expert: TaskDemonstrator | None
    ) -> None:
        self._act, self._expert = act, expert
        self._period_s = 1.0 / float(env.metadata.get("render_fps") or 20.0)
        self._world = getattr(env.unwrapped, "world", None)
        # Slowest value of each part of an action; NaN for parts without a speed, such as steering.
        rests = [_RESTS.get(name, math.nan) for name in layouts_of(env)[1].names]
        self._rests = np.array(rests, np.float32)
        self._corrects, self._lasted = False, 0
        self._placed, self._still_s = -1, 0.0
        self.steps = self.corrected = self.takeovers = 0

    def begin(self) -> None:
        """Start an episode, in which the policy drives first if there is one."""
        self._corrects, self._lasted = False, 0
        if self._expert is not None:
            self._expert.begin()

    def decide(self, observation: Any) -> DriverDecision:
        """Return the decision for an observation."""
        right = meant = None
        if self._expert is not None:
            meant, right = self._expert.act()
        if self._act is None:
            if right is None:
                raise DemosError("No driver was given: give a policy, an expert, or both.")
            return right, Step(action=row(meant), driver="expert"), ""
        wanted, remark = self._act(observation), ""
        if meant is not None:
            remark = self._change(wanted, meant)
            self.steps += 1
            if self._corrects:
                self.corrected += 1
                self.takeovers += bool(remark)
                return meant, Step(action=row(meant), driver="expert", wanted=row(wanted)), remark
        return wanted, Step(action=row(wanted), driver="policy"), remark

    def _change(self, wanted: NDArray[np.float32], right: NDArray[np.float32]) -> str:
        """Change the driver if it is time; return the reason, or "" without a change."""
        # The largest difference of the two actions that is not slowness.
        slowest = np.where(np.isnan(self._rests), right, self._rests)
        agreed = np.clip(wanted, np.minimum(slowest, right), np.maximum(slowest, right))
        gap, danger = float(np.abs(wanted - agreed).max()), self._danger(wanted)
        if self._corrects:
            is_time, least_s = gap <= _AGREE and not danger, _AGREE_S
        else:
            is_time, least_s = gap > _APART, _APART_S
        self._lasted = self._lasted + 1 if is_time else 0
        least = max(1, math.ceil(least_s / self._period_s - _ROUNDING))
        if self._lasted < least and (self._corrects or not danger):
            return ""
        self._corrects, self._lasted = not self._corrects, 0
        if not self._corrects:
            return "the policy drives on"
        return f"the expert takes over: {danger or f'the policy is off by {gap:.1f}'}"

    def _danger(self, action: NDArray[np.float32]) -> str:
        """Describe the danger of an action in the env's world; "" without danger."""
        world = self._world
        if world is None:
            return ""
        speed, ahead_m = world.inputs().speed, world.distance_m()
        if world.placed != self._placed or abs(speed) > _CRAWLS_MPS:
            self._placed, self._still_s = world.placed, 0.0
        self._still_s += self._period_s
        if world.touches:
            return "it touches something"
        drives_on = speed > _CRAWLS_MPS and action[-1] > np.nan_to_num(self._rests[-1])
        if drives_on and ahead_m < speed * _NEAR_S:
            return f"{ahead_m:.1f} m to what is ahead"
        return "it stands still" if self._still_s > _STILL_S else ""


def pilot_of(env: gym.Env[Any, Any], driver: str, corrected_by: str, seed: int) -> Pilot:
    """Return the driver of an env: `EXPERT`, or the file of a policy, which `EXPERT` may correct.

    The seed is of the expert's mistakes.
    """
    inner: Any = env.unwrapped
    if corrected_by not in ("", EXPERT) or (corrected_by and driver == EXPERT):
        raise DemosError(
            f"Only a policy can be corrected by {EXPERT}, not {driver} by {corrected_by}."
        )
    if driver != EXPERT and not Path(driver).is_file():
        raise DemosError(f"There is no driver {driver!r}: it is {EXPERT}, or the file of a policy.")
    if EXPERT in (driver, corrected_by) and not hasattr(inner, "demonstrator"):
        raise DemosError(
            f"{name_of(env)} has no expert: let a policy drive with `--driver FILE`, or drive a "
            "robot yourself with `shapechanger robot drive`."
        )
    act = None if driver == EXPERT else _policy(Path(driver), env)
    return Pilot(env, act, inner.demonstrator(seed) if act is None or corrected_by else None)


def _policy(path: Path, env: gym.Env[Any, Any]) -> Act:
    """Load a policy and check that its observations and actions fit the env."""
    box = cast("gym.spaces.Box", env.action_space)

    def fitting(actions: Any) -> NDArray[np.float32]:
        return np.clip(np.asarray(actions, np.float32)[0], box.low, box.high)

    policy = load_policy(path)
    card, name = policy.card, name_of(env)
    if card.clone is None:
        if (card.observation, card.action) != layouts_of(env):
            raise DemosError(
                f"{path} was trained in {card.env}, whose observations or actions differ from "
                f"{name}."
            )
        return lambda seen: fitting(policy.act(np.asarray(seen)[np.newaxis]))
    encoder = ObservationEncoder(env)
    needs = {"image": card.clone.eyes != "none", "state": card.observation is not None}
    if needs["image"] and not encoder.has_picture:
        raise DemosError(f"{path} drives by images, and {name} shows none.")
    card.require_layouts(encoder.action_layout, encoder.state_layout)

    def act(seen: Any) -> NDArray[np.float32]:
        parts = encoder.parts(seen)
        image, state = (np.asarray(parts[n])[np.newaxis] if needs[n] else None for n in needs)
        return fitting(policy.predict_many(image, state))

    return act


def record_steps(
    env: RecordEpisodes,
    pilot: Pilot,
    steps: int,
    seed: int,
    on_step: Callable[[int], object] = lambda steps: None,
) -> None:
    """Record a number of steps in episodes with consecutive seeds; always close the last episode.

    `on_step` is called after each step with the number of steps so far.
    """
    first = env.steps
    try:
        for episode in itertools.count(seed):
            observation, _ = env.reset(seed=episode)
            pilot.begin()
            over = False
            while not over:
                action, decided, remark = pilot.decide(observation)
                env.decide(decided)
                observation, _, terminated, truncated, _ = env.step(action)
                over = bool(terminated or truncated)
                if remark and not over:
                    env.mark(remark)
                on_step(env.steps - first)
                if env.steps - first == steps:
                    return
    except KeyboardInterrupt:
        env.end("stopped")
        raise
    finally:
        env.end()
