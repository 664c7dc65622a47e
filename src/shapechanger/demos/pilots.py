"""Who drives while it is recorded: an expert, a policy, or a policy that an expert corrects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.episodes import Driver
from shapechanger.demos.gate import Gate
from shapechanger.demos.recording import RecordEpisodes

__all__ = [
    "Act",
    "CorrectedPilot",
    "Decision",
    "Expert",
    "ExpertPilot",
    "Pilot",
    "PolicyPilot",
    "record_steps",
]

Act = Callable[[Any], NDArray[np.float32]]
"""A policy: from an observation to an action, (n,)."""


class Expert(Protocol):
    """Somebody who can do the task of an env; `env.unwrapped.demonstrator(seed)` gives one."""

    def begin(self) -> None:
        """An episode has begun."""
        ...

    def act(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """What they mean to do now, which is learned, and what they do, which is carried out."""
        ...


@dataclass(frozen=True, slots=True)
class Decision:
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


class Pilot(Protocol):
    """Whoever drives."""

    def begin(self) -> None:
        """An episode has begun."""
        ...

    def decide(self, observation: Any) -> Decision:
        """What to do on seeing this."""
        ...


class ExpertPilot:
    """An expert shows how.

    What it means to do is what is recorded as decided. It makes mistakes now and then, so that a
    learner sees how they are put right; what was carried out then is what the outputs did.
    """

    def __init__(self, expert: Expert) -> None:
        self._expert = expert

    def begin(self) -> None:
        """An episode has begun."""
        self._expert.begin()

    def decide(self, observation: Any) -> Decision:
        """What to do; the observation is not looked at."""
        meant, done = self._expert.act()
        return Decision(done, meant, "expert")


class PolicyPilot:
    """A policy drives."""

    def __init__(self, act: Act) -> None:
        self._act = act

    def begin(self) -> None:
        """An episode has begun."""

    def decide(self, observation: Any) -> Decision:
        """What to do on seeing this."""
        action = self._act(observation)
        return Decision(action, action, "policy")


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
        expert: Expert,
        gate: Gate,
        danger: Callable[[NDArray[np.float32]], str] = lambda action: "",
    ) -> None:
        self._act, self._expert, self._gate, self._danger = act, expert, gate, danger

    def begin(self) -> None:
        """An episode has begun: the policy drives."""
        self._expert.begin()
        self._gate.begin()

    def decide(self, observation: Any) -> Decision:
        """What to do on seeing this."""
        wanted, right = self._act(observation), self._expert.act()[0]
        remark = self._gate.watch(wanted, right, self._danger(wanted))
        if self._gate.corrects:
            return Decision(right, right, "expert", wanted, remark)
        return Decision(wanted, wanted, "policy", None, remark)


def record_steps(
    env: RecordEpisodes,
    pilot: Pilot,
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
