"""Drivers of recorded episodes: an expert, a policy, or a policy with corrections.

With corrections the policy drives, and an expert takes over where it goes wrong: M. Kelly et al.,
"HG-DAgger: Interactive Imitation Learning with Human Experts", ICRA 2019. There a person decides
when to intervene; here a rule with fixed thresholds does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.episodes import Driver
from shapechanger.demos.recording import RecordEpisodes
from shapechanger.errors import DemosError

EXPERT: Final = "expert"
"""Name of the expert of an env as a driver."""

_ROUNDING: Final = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class GateRule:
    """When the expert takes over, and when it hands back.

    A policy is corrected where it is dangerous, not where it is slow: of a value such as the
    throttle, everything from rest to the expert's value counts as agreement.

    Attributes:
        apart: Take over when any value of the two actions, such as the steering, has differed by
            more than this,
        apart_s: for this long without interruption, s; at least one step.
        near_s: Take over at once when an obstacle ahead would be reached within this time at the
            present speed, s, and the policy does not brake.
        still_s: Take over when the vehicle has stood still for this long, s, because nothing is
            learned from that.
        agree: Hand back when no value has differed by more than this,
        agree_s: for this long without interruption, s, with no obstacle near; at least one step.
    """

    apart: float = 0.6
    apart_s: float = 0.3
    near_s: float = 0.4
    still_s: float = 2.0
    agree: float = 0.3
    agree_s: float = 1.0

    def __post_init__(self) -> None:
        """Refuse contradictory thresholds."""
        if not 0.0 < self.agree <= self.apart:
            raise DemosError(
                f"agree must be positive and at most apart, got {self.agree} and {self.apart}."
            )
        if min(self.apart_s, self.near_s, self.still_s, self.agree_s) < 0.0:
            raise DemosError("apart_s, near_s, still_s and agree_s must not be negative.")


class Gate:
    """State machine that decides at each step who drives.

    Args:
        rule: The thresholds.
        period_s: Time between steps, s.
        rests: For each value of an action, the value at which it is slowest; None for those, such
            as the steering, that are not slow. Empty for none.

    Attributes:
        corrects: Whether the expert drives.
    """

    def __init__(self, rule: GateRule, period_s: float, rests: Sequence[float | None] = ()) -> None:
        self._rule = rule
        self._rests = tuple(rests)
        self._steps_apart = _steps(rule.apart_s, period_s)
        self._steps_agreed = _steps(rule.agree_s, period_s)
        self.begin()

    def begin(self) -> None:
        """Start an episode: the policy drives."""
        self.corrects = False
        self._lasted = 0

    def watch(self, wanted: NDArray[np.float32], right: NDArray[np.float32], danger: str) -> str:
        """Process one step.

        Args:
            wanted: Action of the policy, shape (n,).
            right: Action of the expert, shape (n,).
            danger: Imminent danger, in words; "" for none.

        Returns:
            Why the driver changes at this step, in words; "" if it does not change.
        """
        rule, gap = self._rule, self._gap(wanted, right)
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

    def _gap(self, wanted: NDArray[np.float32], right: NDArray[np.float32]) -> float:
        """Return the largest difference of two actions that is not slowness."""
        slowest = right.copy()
        for i, rest in enumerate(self._rests):
            slowest[i] = right[i] if rest is None else rest
        agreed = np.clip(wanted, np.minimum(slowest, right), np.maximum(slowest, right))
        return float(np.abs(wanted - agreed).max())


def _steps(seconds: float, period_s: float) -> int:
    """Return how many steps a duration takes, at least one; robust to rounding."""
    return max(1, math.ceil(seconds / period_s - _ROUNDING))


Act = Callable[[Any], NDArray[np.float32]]
"""A policy: maps an observation to an action, shape (n,)."""


class TaskExpert(Protocol):
    """An expert for the task of an env, as `env.unwrapped.demonstrator(seed)` returns one."""

    def begin(self) -> None:
        """Start an episode."""
        ...

    def act(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the intended action, which is learned, and the action to carry out."""
        ...


@dataclass(frozen=True, slots=True)
class DriverDecision:
    """The decision for one step.

    Attributes:
        carried_out: Action to pass to the env, shape (n,).
        meant: Action to record as decided, shape (n,); differs where a demonstrator errs on
            purpose.
        driver: Who decided.
        wanted: Action of a policy while somebody else drives.
        remark: Text of a mark to set; "" for none.
    """

    carried_out: NDArray[np.float32]
    meant: NDArray[np.float32]
    driver: Driver
    wanted: NDArray[np.float32] | None = None
    remark: str = ""


class ExpertPilot:
    """An expert drives.

    The intended action is recorded as decided. The expert errs on purpose now and then, so that a
    learner sees recoveries; the erroneous action is what the outputs carry out.
    """

    def __init__(self, expert: TaskExpert) -> None:
        self._expert = expert

    def begin(self) -> None:
        """Start an episode."""
        self._expert.begin()

    def decide(self, observation: Any) -> DriverDecision:
        """Return the expert's decision; the observation is ignored."""
        meant, done = self._expert.act()
        return DriverDecision(done, meant, "expert")


class PolicyPilot:
    """A policy drives."""

    def __init__(self, act: Act) -> None:
        self._act = act

    def begin(self) -> None:
        """Start an episode."""

    def decide(self, observation: Any) -> DriverDecision:
        """Return the policy's decision for an observation."""
        action = self._act(observation)
        return DriverDecision(action, action, "policy")


class CorrectedPilot:
    """A policy drives, and an expert takes over where it would go wrong.

    Args:
        act: The policy.
        expert: The expert; its intended actions, without mistakes, are carried out.
        gate: Decides who drives.
        danger: Returns the imminent danger of an action, in words; "" for none.

    Attributes:
        steps: Number of decisions.
        corrected: Number of those that were the expert's.
        takeovers: How often the expert took over.
    """

    def __init__(
        self,
        act: Act,
        expert: TaskExpert,
        gate: Gate,
        danger: Callable[[NDArray[np.float32]], str] = lambda action: "",
    ) -> None:
        self._act, self._expert, self._gate, self._danger = act, expert, gate, danger
        self.steps = self.corrected = self.takeovers = 0

    def begin(self) -> None:
        """Start an episode: the policy drives."""
        self._expert.begin()
        self._gate.begin()

    def decide(self, observation: Any) -> DriverDecision:
        """Return the decision for an observation."""
        wanted, right = self._act(observation), self._expert.act()[0]
        drove = self._gate.corrects
        remark = self._gate.watch(wanted, right, self._danger(wanted))
        self.steps += 1
        if self._gate.corrects:
            self.corrected += 1
            self.takeovers += not drove
            return DriverDecision(right, right, "expert", wanted, remark)
        return DriverDecision(wanted, wanted, "policy", None, remark)


EpisodeDriver = ExpertPilot | PolicyPilot | CorrectedPilot
"""Who drives while recording."""


def record_steps(
    env: RecordEpisodes,
    pilot: EpisodeDriver,
    steps: int,
    seed: int,
    on_step: Callable[[int], object] = lambda steps: None,
) -> None:
    """Record a number of steps; the last episode is closed in any case.

    Args:
        env: The recording env.
        pilot: Who drives.
        steps: Number of steps over all episodes.
        seed: Seed of the first episode; later episodes use consecutive seeds.
        on_step: Called after each step with the number of steps so far.

    Raises:
        OutputError: If a step cannot be written.
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
