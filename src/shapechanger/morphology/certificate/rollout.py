"""Two environments started from one seed and driven by the same commands: where do they part?

What a compiled model does not show, a rollout does: noise and delay of sensors, another start,
another reward. Nothing here knows Gymnasium; any object with its methods will do.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from shapechanger.morphology.certificate.certifiable import Certifiable, Wrapped, attribute

if TYPE_CHECKING:
    from shapechanger.layout import Layout

Commands = NDArray[np.float32]
"""Commands of an episode, shape (steps, motors)."""


def matched_commands(
    source: Layout, target: Layout, steps: int, seed: int
) -> tuple[Commands, Commands]:
    """Commands for two robots: the same for motors of the same name, zero for the others.

    The numbers of a motor depend on the seed and its name alone. They lie where the ranges of the
    two overlap.

    Args:
        source: What the motors of the one take.
        target: What the motors of the other take.
        steps: How many commands to draw.
        seed: Seed of the draw.
    """
    old, new = _ranges(source), _ranges(target)
    drawn: dict[str, NDArray[np.float64]] = {}
    for name in old:
        if name in new:
            low, high = max(old[name][0], new[name][0]), min(old[name][1], new[name][1])
            share = np.random.default_rng([seed, *name.encode()]).random(steps)
            drawn[name] = low + (high - low) * share
    return _as_commands(old, drawn, steps), _as_commands(new, drawn, steps)


def _as_commands(
    ranges: dict[str, tuple[float, float]], drawn: dict[str, NDArray[np.float64]], steps: int
) -> Commands:
    """Commands in single precision, which spaces of single and of double precision both take."""
    commands = np.zeros((steps, len(ranges)), np.float32)
    for place, (name, bounds) in enumerate(ranges.items()):
        low, high = np.asarray(bounds, np.float32)
        commands[:, place] = np.clip(drawn.get(name, np.zeros(steps)), low, high)
    return commands


def _ranges(layout: Layout) -> dict[str, tuple[float, float]]:
    """For each number of an action a finite range: to -1 or 1, or beyond, where it has no bound."""
    found: dict[str, tuple[float, float]] = {}
    for name, low, high in zip(number_names(layout), layout.low, layout.high, strict=True):
        bottom = low if np.isfinite(low) else min(-1.0, high - 1.0)
        top = high if np.isfinite(high) else max(1.0, low + 1.0)
        found[name] = (float(bottom), float(top))
    return found


def number_names(layout: Layout) -> list[str]:
    """One name per number of a vector: `camera[0]`, `camera[1]` for a block."""
    names: list[str] = []
    for feature in layout:
        blocks = [f"{feature.name}[{i}]" for i in range(feature.size)]
        names += blocks if feature.shape else [feature.name]
    return names


_Floats = NDArray[np.float64]

_LARGEST: Final = float(np.finfo(np.float64).max)

# Two models that differ by rounding part slowly: HalfCheetah-v1 with its masses written out differs
# from the original by 4e-16 kg, its observations by at most 1e-11 after 10 steps and by 0.2 after
# 94 (30 and 3 seeds). So rounding is judged by the first steps only.
_EARLY_STEPS: Final = 10
_EARLY_TOLERANCE: Final = 1e-8


class Rollout(msgspec.Struct, frozen=True):
    """Responses of two environments to the same commands.

    Step 0 is the reset; step n is the answer to the n-th command.

    Attributes:
        steps: Commands given before the first of the two ended its episode.
        source_ended: Whether the source's episode was over by then.
        target_ended: Whether the target's was.
        compared: How many numbers of an observation were compared, being of the same name.
        only_in_source: Numbers of an observation that only the source has.
        only_in_target: Numbers of an observation that only the target has.
        first_step: Step at which observations first differed; None if they never did.
        first_feature: What differed most at that step.
        largest_difference: Largest difference of all, in the feature's unit.
        largest_feature: What differed by that much; empty if nothing did.
        largest_step: Step at which it did.
        reward_difference: Largest difference between the rewards of a step.
        early_difference: Largest difference of an observation or a reward within the first 10
            steps.
    """

    steps: int
    source_ended: bool
    target_ended: bool
    compared: int
    only_in_source: tuple[str, ...]
    only_in_target: tuple[str, ...]
    first_step: int | None
    first_feature: str
    largest_difference: float
    largest_feature: str
    largest_step: int | None
    reward_difference: float
    early_difference: float = 0.0

    @property
    def identical(self) -> bool:
        """Return whether both gave the same numbers, the same rewards and the same end."""
        return (
            self.first_step is None
            and not self.only_in_source
            and not self.only_in_target
            and self.reward_difference == 0.0
            and self.source_ended == self.target_ended
        )

    @property
    def differs_by_rounding(self) -> bool:
        """Return whether the first steps differ by no more than rounding explains."""
        return (
            self.early_difference <= _EARLY_TOLERANCE
            and not self.only_in_source
            and not self.only_in_target
        )

    def __str__(self) -> str:
        """The facts, in a few sentences."""
        told = [f"{self.steps} steps from the same seed with the same commands:"]
        if self.first_step is None:
            told.append(f"the {self.compared} numbers that both observe are equal throughout.")
        else:
            when = "at the reset" if self.first_step == 0 else f"at step {self.first_step}"
            told.append(
                f"observations part {when} in {self.first_feature}, and furthest at step "
                f"{self.largest_step} in {self.largest_feature}, by {self.largest_difference:.4g}."
            )
        for whose, names in (("source", self.only_in_source), ("target", self.only_in_target)):
            if names:
                told.append(f"Only the {whose} observes {len(names)} more, such as {names[0]}.")
        if self.reward_difference > 0.0:
            told.append(f"Rewards differ by up to {self.reward_difference:.4g} a step.")
        if self.source_ended != self.target_ended:
            told.append(
                f"Only the {'source' if self.source_ended else 'target'} ended its episode."
            )
        return " ".join(told)


def compare_rollouts(
    source: Certifiable | Wrapped, target: Certifiable | Wrapped, *, steps: int = 100, seed: int = 0
) -> Rollout:
    """Reset both with one seed, drive both with the same commands, and compare what they observe.

    A command is drawn per motor name, so a motor that both have gets the same number whatever
    stands beside it; a motor that one lacks gets zero. The source runs first and the target after
    it, so one machine may serve as both. Each is left in the midst of an episode.

    Args:
        source: Where a skill is learned.
        target: Where it moves to.
        steps: How many commands to give; fewer if an episode ends.
        seed: Seed of the resets and of the commands.
    """
    layouts = attribute(source, "action_layout"), attribute(target, "action_layout")
    for_source, for_target = matched_commands(*layouts, steps, seed)
    one, two = _drive(source, for_source, seed), _drive(target, for_target, seed)
    old = _names(attribute(source, "observation_layout"), one.observations[0])
    new = _names(attribute(target, "observation_layout"), two.observations[0])
    if old is None or new is None:  # A wrapper made other numbers of them: go by their places.
        old, new = _places(one.observations[0]), _places(two.observations[0])
    tally = _Tally(old, new)
    for step, seen in enumerate(zip(one.observations, two.observations, strict=False)):
        tally.observe(step, *seen)
    done = min(len(one.rewards), len(two.rewards))
    rewards = np.asarray(one.rewards[:done]), np.asarray(two.rewards[:done])
    return Rollout(
        steps=done,
        source_ended=one.ended and len(one.rewards) == done,
        target_ended=two.ended and len(two.rewards) == done,
        compared=len(tally.shared),
        only_in_source=tuple(name for name in old if name not in tally.shared),
        only_in_target=tuple(name for name in new if name not in tally.shared),
        first_step=tally.first_step,
        first_feature=tally.first_feature,
        largest_difference=tally.largest,
        largest_feature=tally.largest_feature,
        largest_step=tally.largest_step,
        reward_difference=float(_gap(*rewards).max(initial=0.0)),
        early_difference=max(tally.early, float(_gap(*rewards)[:_EARLY_STEPS].max(initial=0.0))),
    )


@dataclass(frozen=True, slots=True)
class _Episode:
    """Responses of one environment."""

    observations: list[_Floats]
    rewards: list[float]
    ended: bool


def _drive(env: Certifiable | Wrapped, commands: Commands, seed: int) -> _Episode:
    """Reset an environment and give it commands until they, or the episode, are over."""
    observation, _ = env.reset(seed=seed)
    episode = _Episode([_flat(observation)], [], ended=False)
    for command in commands:
        observation, reward, terminated, truncated, _ = env.step(command)
        episode.observations.append(_flat(observation))
        episode.rewards.append(float(reward))
        if terminated or truncated:
            return replace(episode, ended=True)
    return episode


@dataclass(slots=True)
class _Tally:
    """Keeps the first and the largest difference between two streams of observations."""

    old: dict[str, int]
    new: dict[str, int]
    shared: dict[str, None] = field(init=False)
    first_step: int | None = None
    first_feature: str = ""
    largest: float = 0.0
    largest_feature: str = ""
    largest_step: int | None = None
    early: float = 0.0

    def __post_init__(self) -> None:
        self.shared = dict.fromkeys(name for name in self.old if name in self.new)

    def observe(self, step: int, source: _Floats, target: _Floats) -> None:
        """Compare what both observed at a step."""
        if not self.shared:
            return
        names = list(self.shared)
        gaps = _gap(
            source[[self.old[name] for name in names]], target[[self.new[name] for name in names]]
        )
        worst = int(np.argmax(gaps))
        if gaps[worst] > 0.0 and self.first_step is None:
            self.first_step, self.first_feature = step, names[worst]
        if step <= _EARLY_STEPS:
            self.early = max(self.early, float(gaps[worst]))
        if gaps[worst] > self.largest:
            self.largest, self.largest_feature = float(gaps[worst]), names[worst]
            self.largest_step = step


def _names(layout: Layout, observation: _Floats) -> dict[str, int] | None:
    """For each name its place; None if the layout does not describe the observation."""
    if layout.size != observation.size:
        return None
    return {name: place for place, name in enumerate(number_names(layout))}


def _places(observation: _Floats) -> dict[str, int]:
    """Names for the numbers of an observation that no layout describes."""
    return {f"observation[{place}]": place for place in range(observation.size)}


def _flat(observation: Any) -> _Floats:
    """An observation as one vector; the parts of a dictionary in alphabetical order."""
    if isinstance(observation, Mapping):
        parts = cast("Mapping[str, Any]", observation)
        return np.concatenate([_flat(parts[key]) for key in sorted(parts)])
    return np.array(observation, np.float64).ravel()  # A copy, should the env reuse its memory.


def _gap(one: _Floats, two: _Floats) -> _Floats:
    """Absolute differences; the largest number there is where one is not finite."""
    same = (one == two) | (np.isnan(one) & np.isnan(two))
    with np.errstate(invalid="ignore"):
        gap = np.where(same, 0.0, np.abs(one - two))
    return np.nan_to_num(gap, nan=_LARGEST, posinf=_LARGEST)
