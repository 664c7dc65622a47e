"""`shapechanger demos record`: record an expert or a policy in an env."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, cast

import gymnasium as gym
import numpy as np
from gymnasium.wrappers import TimeLimit
from numpy.typing import NDArray

from shapechanger.cli.console import Interrupted, StudyProgress, command_line, counted, say
from shapechanger.cli.env_arguments import (
    Body,
    EnvId,
    driven,
    env_ref,
    name_of,
    options_of,
    require_seed,
)
from shapechanger.contract.env_ref import EnvRef, layouts_of
from shapechanger.envs.catalogue import VEHICLE_ENVS
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

if TYPE_CHECKING:
    from shapechanger.demos.drivers import (
        Act,
        CorrectedPilot,
        EpisodeDriver,
        GateRule,
        TaskExpert,
    )

_EXPERT: Final = "expert"

# Values of the actions of vehicles at which they are slowest.
_RESTS: Final = {"throttle": 0.0, "waypoint/speed": -1.0}
_CRAWLS_MPS: Final = 0.05  # Below this speed a vehicle does not collide.


def pilot_of(env: gym.Env[Any, Any], driver: str, corrected_by: str, seed: int) -> EpisodeDriver:
    """Return the requested driver.

    Args:
        env: The env.
        driver: "expert", or a policy file.
        corrected_by: "expert" to correct the policy, or "".
        seed: Seed of the expert's errors.

    Raises:
        DemosError: If the driver is unknown, or the env has no expert.
        PolicyError: If the file is not a policy.
    """
    from shapechanger.demos.drivers import ExpertPilot, PolicyPilot

    if corrected_by not in ("", _EXPERT):
        raise DemosError(f"A policy is corrected by {_EXPERT}, and not by {corrected_by!r}.")
    if driver == _EXPERT:
        if corrected_by:
            raise DemosError("The expert needs no correction: give a policy as the driver.")
        return ExpertPilot(_expert(env, seed))
    if not Path(driver).is_file():
        raise DemosError(
            f"There is no driver {driver!r}: it is {_EXPERT}, or the file of a policy."
        )
    from shapechanger.transfer.learners.sb3 import use_one_thread

    use_one_thread()  # Inference on single frames is slower with more threads.
    act = _policy(Path(driver), env)
    if not corrected_by:
        return PolicyPilot(act)
    return corrected_pilot(env, act, _expert(env, seed))


def corrected_pilot(env: gym.Env[Any, Any], act: Act, expert: TaskExpert) -> CorrectedPilot:
    """Return a policy that an expert corrects where it is dangerous.

    Args:
        env: The env.
        act: The policy.
        expert: The expert of the env.
    """
    from shapechanger.demos.drivers import CorrectedPilot, Gate, GateRule

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
            f"{name_of(env)} has no expert: let a policy drive with `--driver FILE`, or drive a "
            "robot yourself with `shapechanger robot drive`."
        )
    return cast("TaskExpert", give(seed))


def _policy(path: Path, env: gym.Env[Any, Any]) -> Act:
    """Load a policy and check that its observations and actions fit the env."""
    from shapechanger.policy import kind_of, load_policy

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
            f"{name_of(env)}."
        )
    return lambda seen: fitting(policy.act(np.asarray(seen)[np.newaxis]))


class _Dangers:
    """Describes the danger in the env's world, if it has one.

    Args:
        env: The env.
        rest: Value of the last action at which a vehicle brakes or rolls to rest; None for 0.
        rule: Thresholds of the gate.
        period_s: Time between steps, s.
    """

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
    from shapechanger.demos.cloning.policy import CameraPolicy
    from shapechanger.demos.recording import QUALITY, ObservationEncoder

    clone = CameraPolicy.load(path)
    encoder = ObservationEncoder(env, QUALITY)
    needs = {"image": clone.card.eyes != "none", "state": clone.card.state_layout is not None}
    if needs["image"] and not encoder.has_picture:
        raise DemosError(f"{path} drives by pictures, and {name_of(env)} shows none.")
    clone.card.require_layouts(encoder.action_layout, encoder.state_layout)
    is_dict = isinstance(env.observation_space, gym.spaces.Dict)

    def part(seen: Any, name: str) -> NDArray[Any] | None:
        return np.asarray(seen[name] if is_dict else seen)[np.newaxis] if needs[name] else None

    return lambda seen: clone.predict_many(part(seen, "image"), part(seen, "state"))


@dataclass(frozen=True)
class RecordDemonstrations:
    """Record an expert or a policy in an env."""

    env: EnvId
    """Id of the env, such as Car."""
    out: Path
    """Folder of the recording; new episodes are added to those there."""
    minutes: float = 10.0
    """Duration, minutes of the env's time."""
    driver: str = _EXPERT
    """"expert", or the file of a policy."""
    corrected_by: str = ""
    """"expert" to let it take over where the policy would fail. Only the expert's steps are then
    learned from."""
    episode_s: float = 50.0
    """Longest episode, s; a collision ends it earlier."""
    body: Body = ""
    lenses: tuple[str, ...] = ()
    """Disturbances of a vehicle's camera, such as night."""
    put_back: bool = False
    """Put a vehicle back on its lane after a collision, in place of ending the episode."""
    options: str = ""
    """More arguments of the env as JSON, such as '{"courses": "held-out"}'."""
    seed: int = 0
    """Seed of the first episode; each later one has the next whole number."""

    def run(self) -> None:
        """Record and print a summary."""
        from shapechanger.demos.drivers import CorrectedPilot, record_steps
        from shapechanger.demos.recording import RecordEpisodes

        require_seed(self.seed)
        for name, value in (("minutes", self.minutes), ("episode-s", self.episode_s)):
            if not 0.0 < value < float("inf"):
                raise DemosError(f"--{name} is more than 0, got {value}.")
        ref = self._ref()
        try:
            made = ref.make(max_episode_steps=-1)
        except TypeError as error:
            reason = str(error).partition(" was raised from")[0]
            raise DemosError(f"{ref.id} cannot be made with these --options: {reason}.") from error
        try:
            hz = float(made.metadata.get("render_fps") or 20.0)
            longest = max(1, round(self.episode_s * hz))
            steps = max(1, round(self.minutes * 60.0 * hz))
            pilot = pilot_of(made, self.driver, self.corrected_by, self.seed)
            env = RecordEpisodes(
                TimeLimit(made, longest), self.out, driver="program", about=self._about(made)
            )
            with StudyProgress({ref.id: steps}) as progress:
                record_steps(
                    env, pilot, steps, self.seed, lambda done: progress(ref.id, done, done == steps)
                )
        except KeyboardInterrupt:
            raise Interrupted(
                f"Stopped; the recording so far is in {self.out}, complete."
            ) from None
        finally:
            made.close()
        if isinstance(pilot, CorrectedPilot):
            say(
                f"the expert corrected {pilot.corrected / max(pilot.steps, 1):.0%} of the steps, "
                f"{pilot.corrected} of {pilot.steps}, and took over "
                f"{counted(pilot.takeovers, 'time')}"
            )
        say(
            f"wrote {env.steps} steps, {env.seconds / 60.0:.1f} minutes, in "
            f"{counted(env.episodes, 'episode')} to {self.out}\n"
            f"look at them: shapechanger demos show {shlex.quote(str(self.out))} --out page.html"
        )

    def _ref(self) -> EnvRef:
        """Return the env with the requested options."""
        ref = env_ref(self.env, self.body)
        more: dict[str, Any] = {}
        if ref.id in VEHICLE_ENVS:
            more["state"] = True
            if self.lenses:
                driven(ref, self.lenses)
                more["lenses"] = list(self.lenses)
            if self.put_back:
                more["put_back"] = True
        elif self.lenses or self.put_back:
            raise DemosError(
                f"--put-back and --lenses are for vehicles, and {ref.id} is not one of them: "
                f"{', '.join(VEHICLE_ENVS)}."
            )
        return EnvRef(ref.id, {**ref.kwargs, **more, **options_of(self.options, "--options")})

    def _about(self, env: gym.Env[Any, Any]) -> dict[str, Any]:
        """Return further fields of the header."""
        world = getattr(env.unwrapped, "world", None)
        who = self.driver if self.driver == _EXPERT else Path(self.driver).name
        notes: dict[str, Any] = {"driver": self.driver}
        if self.corrected_by:
            who += f", corrected by {self.corrected_by}"
            notes["corrected_by"] = self.corrected_by
        body = {} if world is None else {"body": world.vehicle.name}
        return {
            **body,
            "driver": who,
            "source": command_line(),
            "notes": notes,
        }
