"""Who drives when a program is recorded: the env's expert, or a policy from a file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import DemosError

if TYPE_CHECKING:
    from shapechanger.demos.cloning.policy import CameraPolicy
    from shapechanger.demos.pilots import Act, Expert, Pilot

__all__ = ["EXPERT", "pilot_of"]

EXPERT: Final = "expert"

# A vehicle that hardly moves, or whose throttle is not above this, does not drive into anything.
_CRAWLS_MPS: Final = 0.05
_BRAKES: Final = 0.0


def pilot_of(env: gym.Env[Any, Any], driver: str, corrected_by: str, seed: int) -> Pilot:
    """Whoever is asked for.

    Args:
        env: Where.
        driver: "expert", or the file of a policy.
        corrected_by: "expert" to correct the policy; "" for nobody.
        seed: Of the expert's mistakes.

    Raises:
        DemosError: If there is no such driver, or the env has no expert.
        PolicyError: If the file is no policy.
    """
    from shapechanger.demos.gate import Gate, GateRule
    from shapechanger.demos.pilots import CorrectedPilot, ExpertPilot, PolicyPilot

    if corrected_by not in ("", EXPERT):
        raise DemosError(f"A policy is corrected by {EXPERT}, and not by {corrected_by!r}.")
    if driver == EXPERT:
        if corrected_by:
            raise DemosError("The expert needs no correction: give a policy as the driver.")
        return ExpertPilot(_expert(env, seed))
    if not Path(driver).is_file():
        raise DemosError(f"There is no driver {driver!r}: it is {EXPERT}, or the file of a policy.")
    from shapechanger.transfer.learners.ppo import use_one_thread

    use_one_thread()  # A policy of one picture at a time is slower on more.
    act = _policy(Path(driver), env)
    if not corrected_by:
        return PolicyPilot(act)
    rule = GateRule()
    period_s = 1.0 / float(env.metadata.get("render_fps") or 20.0)
    return CorrectedPilot(act, _expert(env, seed), Gate(rule, period_s), _Danger(env, rule.near_s))


def _expert(env: gym.Env[Any, Any], seed: int) -> Expert:
    give = getattr(env.unwrapped, "demonstrator", None)
    if give is None:
        name = env.spec.id if env.spec else type(env.unwrapped).__name__
        raise DemosError(
            f"{name} has no expert: let a policy drive with `--driver FILE`, or drive a robot "
            "yourself with `shapechanger robot drive`."
        )
    return cast("Expert", give(seed))


def _policy(path: Path, env: gym.Env[Any, Any]) -> Act:
    """A policy that takes the observations of this env, and whose actions fit it."""
    from shapechanger.transfer.learners.cloning import is_clone, load_clone

    box = cast("gym.spaces.Box", env.action_space)

    def fitting(actions: NDArray[Any]) -> NDArray[np.float32]:
        return np.clip(np.asarray(actions, np.float32)[0], box.low, box.high)

    if is_clone(path):
        clone = load_clone(path)
        part = _parts(clone, path, env)
        return lambda seen: fitting(clone.predict_many(part(seen, "image"), part(seen, "state")))
    from shapechanger.transfer.env_ref import layouts_of
    from shapechanger.transfer.learners.policy_file import load_policy

    policy = load_policy(path)
    if (policy.card.observation, policy.card.action) != layouts_of(env):
        raise DemosError(
            f"{path} was trained in {policy.card.env}, which senses or moves something else than "
            f"{_name(env)}."
        )
    return lambda seen: fitting(policy.act(np.asarray(seen)[np.newaxis]))


class _Danger:
    """What is about to go wrong, as far as the env's world tells.

    Args:
        env: The env; without a world there is never any danger.
        near_s: How much time before something is hit counts as near, s.
    """

    def __init__(self, env: gym.Env[Any, Any], near_s: float) -> None:
        self._env, self._near_s = env, near_s

    def __call__(self, action: NDArray[np.float32]) -> str:
        world = getattr(self._env.unwrapped, "world", None)
        if world is None:
            return ""
        if world.touches:
            return "it touches something"
        speed, ahead_m = world.inputs().speed, world.distance_m()
        drives_on = speed > _CRAWLS_MPS and action[-1] > _BRAKES
        if drives_on and ahead_m < speed * self._near_s:
            return f"{ahead_m:.1f} m to what is ahead"
        return ""


def _parts(
    clone: CameraPolicy, path: Path, env: gym.Env[Any, Any]
) -> Callable[[Any, str], NDArray[Any] | None]:
    """Gives of an observation the part that a clone takes, one row of it; None for none.

    Raises:
        DemosError: If the env shows no pictures and it drives by them.
        PolicyError: If it feels or moves something else.
    """
    from shapechanger.demos.recordable import Sight
    from shapechanger.demos.recording import QUALITY

    sight = Sight(env, QUALITY)
    needs = {"image": clone.card.eyes != "none", "state": clone.card.state_layout is not None}
    if needs["image"] and not sight.has_picture:
        raise DemosError(f"{path} drives by pictures, and {_name(env)} shows none.")
    clone.card.require_layouts(sight.action_layout, sight.state_layout)
    is_dict = isinstance(env.observation_space, gym.spaces.Dict)

    def part(seen: Any, name: str) -> NDArray[Any] | None:
        return np.asarray(seen[name] if is_dict else seen)[np.newaxis] if needs[name] else None

    return part


def _name(env: gym.Env[Any, Any]) -> str:
    return env.spec.id if env.spec else type(env.unwrapped).__name__
