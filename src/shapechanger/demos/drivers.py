"""When somebody who can drive takes over from a policy, and gives back.

The policy drives and is watched; only while it is corrected is there something to learn: M. Kelly
et al., "HG-DAgger: Interactive Imitation Learning with Human Experts", ICRA 2019. There a person
decides by feeling; here a rule in plain numbers does.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.episodes import Driver
from shapechanger.demos.recording import RecordEpisodes
from shapechanger.errors import DemosError

__all__ = [
    "Act",
    "CorrectedPilot",
    "DriverDecision",
    "EpisodeDriver",
    "ExpertPilot",
    "Gate",
    "GateRule",
    "PolicyPilot",
    "TaskExpert",
    "record_steps",
]

_ROUNDING: Final = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class GateRule:
    """When to take over, and when to give back.

    Attributes:
        apart: The expert takes over when any number of the two actions, such as the steering, has
            differed by more than this,
        apart_s: for so long without a break, s; at least one step.
        near_s: It takes over at once when, at the present speed, what is ahead is so near, s, and
            the policy does not brake.
        agree: It gives back when no number has differed by more than this,
        agree_s: for so long without a break, s, and nothing was near; at least one step.
    """

    apart: float = 0.6
    apart_s: float = 0.3
    near_s: float = 0.4
    agree: float = 0.3
    agree_s: float = 1.0

    def __post_init__(self) -> None:
        """Refuse a rule by which nobody could drive."""
        if not 0.0 < self.agree <= self.apart:
            raise DemosError(
                f"The expert gives back below the difference at which it takes over, which is above"
                f" 0: got {self.agree} and {self.apart}."
            )
        if min(self.apart_s, self.near_s, self.agree_s) < 0.0:
            raise DemosError("The times of a rule for taking over are not below 0 s.")


class Gate:
    """Says at each step who drives.

    Args:
        rule: When.
        period_s: Time from one step to the next, s.

    Attributes:
        corrects: Whether the expert drives.
    """

    def __init__(self, rule: GateRule, period_s: float) -> None:
        self._rule = rule
        self._steps_apart = _steps(rule.apart_s, period_s)
        self._steps_agreed = _steps(rule.agree_s, period_s)
        self.begin()

    def begin(self) -> None:
        """An episode has begun: the policy drives."""
        self.corrects = False
        self._lasted = 0

    def watch(self, wanted: NDArray[np.float32], right: NDArray[np.float32], danger: str) -> str:
        """Take in one step.

        Args:
            wanted: What the policy would do, (n,).
            right: What the expert would do, (n,).
            danger: What is about to go wrong, in words; empty for nothing.

        Returns:
            Why the driver changes now, in words; empty if it does not.
        """
        rule, gap = self._rule, float(np.abs(wanted - right).max())
        if self.corrects:
            fine = gap <= rule.agree and not danger
            self._lasted = self._lasted + 1 if fine else 0
            if self._lasted >= self._steps_agreed:
                self.corrects, self._lasted = False, 0
                return "the policy drives on"
            return ""
        self._lasted = self._lasted + 1 if gap > rule.apart else 0
        why = danger
        if not why and self._lasted >= self._steps_apart:
            why = f"the policy is off by {gap:.1f}"
        if not why:
            return ""
        self.corrects, self._lasted = True, 0
        return f"the expert takes over: {why}"


def _steps(seconds: float, period_s: float) -> int:
    """How many steps last so long; a sum of periods is never quite what it should be."""
    return max(1, math.ceil(seconds / period_s - _ROUNDING))


Act = Callable[[Any], NDArray[np.float32]]
"""A policy: from an observation to an action, (n,)."""


class TaskExpert(Protocol):
    """Somebody who can do the task of an env; `env.unwrapped.demonstrator(seed)` gives one."""

    def begin(self) -> None:
        """An episode has begun."""
        ...

    def act(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """What they mean to do now, which is learned, and what they do, which is carried out."""
        ...


@dataclass(frozen=True, slots=True)
class DriverDecision:
    """What is done in one step.

    Attributes:
        carried_out: What is passed to the env, (n,).
        meant: What was decided, (n,): the same, but for a demonstrator that makes mistakes.
        driver: Who decided it.
        wanted: What a policy wanted while somebody else drives.
        remark: What is worth a mark; empty for nothing.
    """

    carried_out: NDArray[np.float32]
    meant: NDArray[np.float32]
    driver: Driver
    wanted: NDArray[np.float32] | None = None
    remark: str = ""


class EpisodeDriver(Protocol):
    """Whoever drives."""

    def begin(self) -> None:
        """An episode has begun."""
        ...

    def decide(self, observation: Any) -> DriverDecision:
        """What to do on seeing this."""
        ...


class ExpertPilot:
    """An expert shows how.

    What it means to do is what is recorded as decided. It makes mistakes now and then, so that a
    learner sees how they are put right; what was carried out then is what the outputs did.
    """

    def __init__(self, expert: TaskExpert) -> None:
        self._expert = expert

    def begin(self) -> None:
        """An episode has begun."""
        self._expert.begin()

    def decide(self, observation: Any) -> DriverDecision:
        """What to do; the observation is not looked at."""
        meant, done = self._expert.act()
        return DriverDecision(done, meant, "expert")


class PolicyPilot:
    """A policy drives."""

    def __init__(self, act: Act) -> None:
        self._act = act

    def begin(self) -> None:
        """An episode has begun."""

    def decide(self, observation: Any) -> DriverDecision:
        """What to do on seeing this."""
        action = self._act(observation)
        return DriverDecision(action, action, "policy")


class CorrectedPilot:
    """A policy drives, and an expert takes over where it would go wrong.

    Args:
        act: The policy.
        expert: Who corrects; it makes no mistakes then.
        gate: When.
        danger: What is about to go wrong if this action is done, in words; empty for nothing.
    """

    def __init__(
        self,
        act: Act,
        expert: TaskExpert,
        gate: Gate,
        danger: Callable[[NDArray[np.float32]], str] = lambda action: "",
    ) -> None:
        self._act, self._expert, self._gate, self._danger = act, expert, gate, danger

    def begin(self) -> None:
        """An episode has begun: the policy drives."""
        self._expert.begin()
        self._gate.begin()

    def decide(self, observation: Any) -> DriverDecision:
        """What to do on seeing this."""
        wanted, right = self._act(observation), self._expert.act()[0]
        remark = self._gate.watch(wanted, right, self._danger(wanted))
        if self._gate.corrects:
            return DriverDecision(right, right, "expert", wanted, remark)
        return DriverDecision(wanted, wanted, "policy", None, remark)


def record_steps(
    env: RecordEpisodes,
    pilot: EpisodeDriver,
    steps: int,
    seed: int,
    on_step: Callable[[int], object] = lambda steps: None,
) -> None:
    """Let somebody drive and record it; the last episode is closed, whatever happens.

    Args:
        env: What records.
        pilot: Who drives.
        steps: How many steps, over all episodes.
        seed: Of the first episode; each later one has the next whole number.
        on_step: Called with the number of steps so far, after each.

    Raises:
        OutputError: If it cannot be written.
    """
    last = env.steps + steps
    first, episode = env.steps, seed
    try:
        while env.steps < last:
            observation, _ = env.reset(seed=episode)
            pilot.begin()
            episode += 1
            over = False
            while not over and env.steps < last:
                decision = pilot.decide(observation)
                env.decide(decision.meant, decision.driver, decision.wanted)
                observation, _, terminated, truncated, _ = env.step(decision.carried_out)
                over = bool(terminated or truncated)
                if decision.remark and not over:
                    env.mark(decision.remark)
                on_step(env.steps - first)
    except KeyboardInterrupt:
        env.end("stopped")
        raise
    finally:
        env.end()
