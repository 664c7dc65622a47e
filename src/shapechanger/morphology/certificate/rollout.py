"""Compare two environments that start from one seed and get the same commands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Protocol, SupportsFloat, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from shapechanger.layout import Layout

_Floats = NDArray[np.float64]
_LARGEST: Final = float(np.finfo(np.float64).max)
# Models that differ by rounding part slowly: HalfCheetah-v1 with its masses written out differs
# from the original by 4e-16 kg, its observations by at most 1e-11 after 10 steps and by 0.2 after
# 94, and no step of six of Gymnasium's robots parts by more than 230 times as much as those before
# (15 seeds). A difference in what is sensed, done or rewarded is there at once, even if late.
_TOLERANCE: Final = 1e-8  # Of a number up to 1; of a larger one this part.
_GROWTH: Final = 1e4


class Certifiable(Protocol):
    """Protocol of an environment whose shifts can be certified, or of a wrapper around one.

    The environment has a `model`, an `observation_layout`, an `action_layout`, and, if it stands, a
    `standing_height`, m. Gymnasium is not needed.
    """

    def reset(self, *, seed: int | None = None) -> tuple[Any, dict[str, Any]]:
        """Start an episode, as in Gymnasium."""
        ...

    def step(self, action: Any, /) -> tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]:
        """Give a command, as in Gymnasium."""
        ...


class Rollout(msgspec.Struct, frozen=True):
    """Comparison of the responses of two environments to the same commands.

    It shows what a compiled model does not: noise and delay of sensors, another start, another
    reward. Step 0 is the reset; step n follows the n-th command.

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
        beyond_rounding: First step whose difference is more than rounding explains, or at which
            only one of the two ended without one; None if there is no such step.
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
    beyond_rounding: int | None = None

    @property
    def identical(self) -> bool:
        """Return whether both gave the same numbers, the same rewards and the same end."""
        apart = self.only_in_source or self.only_in_target or self.reward_difference
        return self.first_step is None and not apart and self.source_ended == self.target_ended

    @property
    def differs_by_rounding(self) -> bool:
        """Return whether the two differ by no more than rounding explains, or not at all."""
        return self.beyond_rounding is None and not self.only_in_source and not self.only_in_target

    def __str__(self) -> str:
        """Return the comparison in a few sentences."""
        sentences = [f"{self.steps} steps from the same seed with the same commands:"]
        if self.first_step is None:
            sentences.append(f"the {self.compared} numbers that both observe are equal throughout.")
        else:
            when = "at the reset" if self.first_step == 0 else f"at step {self.first_step}"
            sentences.append(
                f"observations part {when} in {self.first_feature}, and furthest at step "
                f"{self.largest_step} in {self.largest_feature}, by {self.largest_difference:.4g}."
            )
        for whose, names in (("source", self.only_in_source), ("target", self.only_in_target)):
            if names:
                sentences.append(
                    f"Only the {whose} observes {len(names)} more, such as {names[0]}."
                )
        if self.reward_difference > 0.0:
            sentences.append(f"Rewards differ by up to {self.reward_difference:.4g} a step.")
        if self.source_ended != self.target_ended:
            sentences.append(
                f"Only the {'source' if self.source_ended else 'target'} ended its episode."
            )
        return " ".join(sentences)


def attribute(env: Any, name: str, *default: Any) -> Any:
    """Return an attribute of an environment, or of the one inside its wrappers.

    Args:
        env: The environment.
        name: Name of the attribute.
        *default: The result if neither has it.

    Raises:
        AttributeError: If neither has it, and there is no default.
    """
    own = hasattr(env, name) or not hasattr(env, "unwrapped")
    return getattr(env if own else env.unwrapped, name, *default)


def matched_commands(
    source: Layout, target: Layout, steps: int, seed: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Draw commands for two robots: the same for motors of the same name, zero for the others.

    The numbers of a motor depend on the seed and its name alone. They lie where the ranges of the
    two overlap.

    Args:
        source: Layout of the actions of the one.
        target: Layout of the actions of the other.
        steps: How many commands to draw.
        seed: Seed of the draw.

    Returns:
        The commands of each, shape (steps, size of its layout).
    """
    ranges = _ranges(source), _ranges(target)
    drawn: dict[str, _Floats] = {}
    for name in ranges[0].keys() & ranges[1].keys():
        (low, high), (new_low, new_high) = ranges[0][name], ranges[1][name]
        low, high = max(low, new_low), min(high, new_high)
        share = np.random.default_rng([seed, *name.encode()]).random(steps)
        drawn[name] = low + (high - low) * share
    one, two = (np.zeros((steps, len(own)), np.float32) for own in ranges)
    for commands, own in ((one, ranges[0]), (two, ranges[1])):
        for place, (name, bounds) in enumerate(own.items()):
            low, high = np.asarray(bounds, np.float32)
            commands[:, place] = np.clip(drawn.get(name, np.zeros(steps)), low, high)
    return one, two  # Spaces of double precision accept single precision too.


def _ranges(layout: Layout) -> dict[str, tuple[float, float]]:
    """Return a finite range for each number: to -1 or 1, or beyond, where it has no bound."""
    found: dict[str, tuple[float, float]] = {}
    for name, low, high in zip(_number_names(layout), layout.low, layout.high, strict=True):
        bottom = low if np.isfinite(low) else min(-1.0, high - 1.0)
        top = high if np.isfinite(high) else max(1.0, low + 1.0)
        found[name] = (float(bottom), float(top))
    return found


def _number_names(layout: Layout) -> list[str]:
    """Return one name per number of a vector: `camera[0]`, `camera[1]` for a block."""
    names: list[str] = []
    for feature in layout:
        blocks = [f"{feature.name}[{i}]" for i in range(feature.size)]
        names += blocks if feature.shape else [feature.name]
    return names


def compare_rollouts(
    source: Certifiable,
    target: Certifiable,
    *,
    steps: int = 100,
    seed: int = 0,
    renamed: bool = False,
) -> Rollout:
    """Reset two environments with one seed, give them the same commands, and compare the responses.

    A command is drawn per motor name, so a motor that both have gets the same number whatever
    other motors there are; a motor that one lacks gets zero. The source runs first and the target
    after it, so one object may be both. Each is left in the middle of an episode.

    Args:
        source: The environment in which a policy is trained.
        target: The environment that it is transferred to.
        steps: How many commands to give; fewer if an episode ends.
        seed: Seed of the resets and of the commands.
        renamed: Whether the two are one robot under other names, so that numbers of layouts which
            differ in names alone are matched by their places.
    """
    actions, seen = (_layouts(source, target, side, renamed) for side in ("action", "observation"))
    for_source, for_target = matched_commands(*actions, steps, seed)
    one, two = _drive(source, for_source, seed), _drive(target, for_target, seed)
    old, new = (_number_names(layout) for layout in seen)
    sizes = one.observations.shape[1], two.observations.shape[1]
    if (len(old), len(new)) != sizes:  # A wrapper has changed the numbers: use their places.
        old, new = ([f"observation[{place}]" for place in range(size)] for size in sizes)
    in_new = frozenset(new)
    shared = [name for name in old if name in in_new]
    done = min(len(one.rewards), len(two.rewards))
    before = one.observations[: done + 1, [old.index(name) for name in shared]]
    after = two.observations[: done + 1, [new.index(name) for name in shared]]
    gaps, excess = _gaps(before, after)
    # The first reward belongs to the first step.
    rewards, reward_excess = _gaps(one.rewards[:done, None], two.rewards[:done, None])
    ended = one.ended and len(one.rewards) == done, two.ended and len(two.rewards) == done
    parted = np.flatnonzero(gaps.any(axis=1)).tolist()
    first = parted[0] if parted else None
    # The first of equal differences.
    largest, feature = np.unravel_index(int(np.argmax(gaps)), gaps.shape) if parted else (0, 0)
    return Rollout(
        steps=done,
        source_ended=ended[0],
        target_ended=ended[1],
        compared=len(shared),
        only_in_source=tuple(name for name in old if name not in shared),
        only_in_target=tuple(name for name in new if name not in shared),
        first_step=first,
        first_feature="" if first is None else shared[int(np.argmax(gaps[first]))],
        largest_difference=float(gaps.max(initial=0.0)),
        largest_feature=shared[feature] if parted else "",
        largest_step=int(largest) if parted else None,
        reward_difference=float(rewards.max(initial=0.0)),
        beyond_rounding=_beyond_rounding(
            np.maximum(excess, np.append(0.0, reward_excess)), ended[0] != ended[1]
        ),
    )


def _layouts(
    source: Certifiable, target: Certifiable, side: str, renamed: bool
) -> tuple[Layout, Layout]:
    """Return the layouts of actions or observations; twice the source's if names alone differ."""
    one: Layout = attribute(source, f"{side}_layout")
    two: Layout = attribute(target, f"{side}_layout")
    kinds = [
        [(each.unit, each.low, each.high, each.shape, each.gain) for each in layout]
        for layout in (one, two)
    ]
    return one, one if renamed and kinds[0] == kinds[1] else two


def _gaps(before: _Floats, after: _Floats) -> tuple[_Floats, _Floats]:
    """Return absolute differences, (n, numbers), and the largest of each step in tolerances, (n,).

    Of numbers that are not finite, and differ, it is the largest finite number.
    """
    same = (before == after) | (np.isnan(before) & np.isnan(after))
    with np.errstate(invalid="ignore"):
        gaps = np.where(same, 0.0, np.abs(before - after))
    gaps = np.nan_to_num(gaps, nan=_LARGEST, posinf=_LARGEST)
    known = np.nan_to_num(np.maximum(np.abs(before), np.abs(after)), nan=1.0, posinf=1.0)
    scale = np.maximum(known.max(axis=0, initial=0.0), 1.0)
    return gaps, (np.minimum(gaps / scale, 1.0) / _TOLERANCE).max(axis=1, initial=0.0)


def _beyond_rounding(excess: _Floats, one_ended: bool) -> int | None:
    """Return the first step whose difference does not grow from rounding; None without one.

    Args:
        excess: Difference of each step in multiples of the tolerance, shape (n,), the reset first.
        one_ended: Whether only one of the two ended its episode at the last step.
    """
    largest_before = np.append(0.0, np.maximum.accumulate(excess)[:-1])
    sudden = np.flatnonzero((excess > 1.0) & (excess > _GROWTH * largest_before)).tolist()
    if one_ended and excess.max() <= 1.0:
        sudden.append(len(excess) - 1)
    return sudden[0] if sudden else None


class _Episode(NamedTuple):
    """Responses of one environment: observations (steps + 1, size) and rewards (steps,)."""

    observations: _Floats
    rewards: _Floats
    ended: bool


def _drive(env: Certifiable, commands: NDArray[np.float32], seed: int) -> _Episode:
    """Reset an environment and give it commands until they, or the episode, are over."""
    observation, _ = env.reset(seed=seed)
    observations, rewards, ended = [_flat(observation)], list[float](), False
    for command in commands:
        observation, reward, terminated, truncated, _ = env.step(command)
        observations.append(_flat(observation))
        rewards.append(float(reward))
        ended = bool(terminated or truncated)
        if ended:
            break
    return _Episode(np.stack(observations), np.asarray(rewards), ended)


def _flat(observation: Any) -> _Floats:
    """Return an observation as one vector; the parts of a dictionary in alphabetical order."""
    if isinstance(observation, Mapping):
        parts = cast("Mapping[str, Any]", observation)
        return np.concatenate([_flat(parts[key]) for key in sorted(parts)])
    return np.array(observation, np.float64).ravel()  # A copy, should the env reuse its memory.
