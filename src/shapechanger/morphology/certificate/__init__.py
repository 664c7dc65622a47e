"""The certificate of a shift: the proven differences between two embodiments, or a refusal.

Some declared shifts have no effect: a friction below the floor's, a setting that no code reads. So
two environments are compared by their effective models and by their responses to the same commands.
A shift that changes neither is refused.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import Any, Final, cast

import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import EmptyShift, MorphologyError
from shapechanger.identity import modules_of_env, own_modules
from shapechanger.layout import Layout, value_names
from shapechanger.morphology.certificate.changes import Change, compare, fingerprint, grouped
from shapechanger.morphology.certificate.numbers import KINDS, TABLE, names_of

__all__ = [
    "Certificate",
    "Change",
    "Rollout",
    "certify",
    "compare",
    "fingerprint",
    "inconsistencies",
]

_Floats = NDArray[np.float64]
_Range = tuple[float, float]
# `mj_setConst` gives the same bits on an untouched model; the margin is for models that were
# compiled elsewhere and loaded from a file.
_STALE: Final = 1e-6
_LARGEST: Final = float(np.finfo(np.float64).max)
# Rollouts of models that differ by rounding diverge slowly. HalfCheetah-v1 with its masses written
# out differs from the original by 4e-16 kg, in its observations by at most 1e-11 after 10 steps and
# by 0.2 after 94. For six of Gymnasium's robots (15 seeds), no step multiplied the largest earlier
# difference by more than 230. Differences in sensors, actions or rewards have no such slow start.
_TOLERANCE: Final = 1e-8  # Absolute for numbers up to 1, relative for larger ones.
_GROWTH: Final = 1e4


class Rollout(msgspec.Struct, frozen=True):
    """Comparison of the responses of two environments to the same commands.

    It also shows differences that are not in the compiled model: noise and delay of sensors, the
    start and the reward.

    Attributes:
        steps: Number of steps that both took; fewer than requested if an episode ended.
        identical: Whether observations, rewards and ends are the same.
        differs_by_rounding: Whether rounding explains all differences; true without differences.
        sentences: Where the observations diverge, which numbers only one environment observes, and
            how rewards and ends differ.
    """

    steps: int
    identical: bool
    differs_by_rounding: bool
    sentences: tuple[str, ...]

    def __str__(self) -> str:
        """Return the comparison in a few sentences."""
        steps = f"{self.steps} steps from the same seed with the same commands:"
        return " ".join((steps, *self.sentences))


class Certificate(msgspec.Struct, frozen=True):
    """Certified differences between a target and its source.

    Attributes:
        source: Label of the source.
        target: Label of the target.
        source_fingerprint: Fingerprint of the source's effective model.
        target_fingerprint: Fingerprint of the target's effective model.
        changes: Differences of the effective models, and of the standing heights.
        rollout: Responses of both to the same commands.
        source_inconsistencies: Inconsistencies of the source's model.
        target_inconsistencies: Inconsistencies of the target's model, or between the two.
        source_files: Hashes of the user's own modules that the source needs, by file.
        target_files: Hashes of the user's own modules that the target needs, by file.
    """

    source: str
    target: str
    source_fingerprint: str
    target_fingerprint: str
    changes: tuple[Change, ...]
    rollout: Rollout
    source_inconsistencies: tuple[str, ...] = ()
    target_inconsistencies: tuple[str, ...] = ()
    source_files: dict[str, str] = {}
    target_files: dict[str, str] = {}

    @property
    def same_model(self) -> bool:
        """Return whether the two models are equal up to rounding."""
        return not self.changes

    @property
    def is_empty(self) -> bool:
        """Return whether models and rollouts differ by no more than rounding.

        Even equal models may round differently, because MuJoCo computes relative to the centre of
        mass of the whole model, which includes bodies that cannot move.
        """
        return self.same_model and self.rollout.differs_by_rounding

    @property
    def verdict(self) -> str:
        """Verdict in one sentence."""
        both, steps = f"{self.source} and {self.target}", f"{self.rollout.steps} steps"
        if self.is_empty:
            equal = self.source_fingerprint == self.target_fingerprint and self.rollout.identical
            how = "are equal" if equal else "differ by rounding"
            return f"{both} behave the same: their models and {steps} {how}."
        if self.same_model:
            return f"The models of {both} are the same; what is sensed, done or rewarded differs."
        if self.rollout.differs_by_rounding:
            return f"The models of {both} differ, but {steps} did not show it."
        return f"{self.target} behaves differently from {self.source}."

    def __str__(self) -> str:
        """Return the certificate as text; a change that several elements share is listed once."""
        source, target = self.source, self.target
        lines = [
            f"{source} [{self.source_fingerprint}] -> {target} [{self.target_fingerprint}]",
            self.verdict,
        ]
        for title, entries in (
            ("Changes", grouped(self.changes)),
            ("Rollout", [str(self.rollout)]),
            (f"Does not fit together in {source}", self.source_inconsistencies),
            (f"Does not fit together in {target}", self.target_inconsistencies),
            (f"Own files of {source}", [f"{n} [{d}]" for n, d in self.source_files.items()]),
            (f"Own files of {target}", [f"{n} [{d}]" for n, d in self.target_files.items()]),
        ):
            if entries:
                lines += [f"{title}:", *(f"  {entry}" for entry in entries)]
        return "\n".join(lines)


def certify(
    source: Any,
    target: Any,
    *,
    steps: int = 100,
    seed: int = 0,
    labels: tuple[str, str] | None = None,
    allow_empty: bool = False,
) -> Certificate:
    """Compare two environments and certify the shift between them.

    Both are reset and stepped, and not reset afterwards. Observations are read from the
    outermost wrapper. An environment must have `reset` and `step` as in Gymnasium, a `model`, an
    `observation_layout` and an `action_layout`, and may have a `standing_height`, m. Gymnasium
    itself is not needed.

    Args:
        source: The environment in which a policy is trained.
        target: The environment that it is transferred to.
        steps: Number of commands of the rollout.
        seed: Seed of the resets and of the commands.
        labels: Labels of the two; by default the `label`, id or class of each environment.
        allow_empty: Whether to certify a shift without differences.

    Raises:
        MorphologyError: If one of them has no model, such as a vehicle's env.
        EmptyShift: If there is no difference beyond rounding and `allow_empty` is false.
    """
    inner = [getattr(env, "unwrapped", env) for env in (source, target)]
    names = labels or tuple(map(_label, (source, target), inner))
    for each, name in zip(inner, names, strict=True):
        if not hasattr(each, "model"):
            raise MorphologyError(f"{name} has no model to compare.")
    one, two = (each.model for each in inner)
    heights = [getattr(each, "standing_height", None) for each in inner]
    certificate = Certificate(
        source=names[0],
        target=names[1],
        source_fingerprint=fingerprint(one),
        target_fingerprint=fingerprint(two),
        changes=compare(one, two, standing_height=(heights[0], heights[1])),
        rollout=compare_rollouts(source, target, steps=steps, seed=seed),
        source_inconsistencies=inconsistencies(one),
        target_inconsistencies=inconsistencies(two, one),
        source_files=own_modules(modules_of_env(source)),
        target_files=own_modules(modules_of_env(target)),
    )
    if certificate.is_empty and not allow_empty:
        raise EmptyShift(
            f"{certificate.verdict} There is nothing to transfer across. A setting may have no "
            "effect, such as the friction of a foot below that of the floor, or may never be read."
        )
    return certificate


def _label(env: Any, inner: Any) -> str:
    spec_id = getattr(getattr(env, "spec", None), "id", None)
    return str(getattr(inner, "label", None) or spec_id or type(inner).__name__)


def matched_commands(
    source: Layout, target: Layout, steps: int, seed: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Draw commands for two robots: the same for motors of the same name, zero for the others.

    Commands depend on the seed, the motor's name and the overlap of its ranges in the two robots,
    and are clipped to each range. Each array has the shape (steps, size of the action layout).
    """
    one, two = (dict(zip(value_names(s), _ranges(s), strict=True)) for s in (source, target))

    def draw(own: dict[str, _Range], other: dict[str, _Range]) -> NDArray[np.float32]:
        commands = np.zeros((steps, len(own)), np.float32)
        for place, (name, bounds) in enumerate(own.items()):
            values: Any = 0.0
            if name in other:
                lows, highs = zip(bounds, other[name], strict=True)
                share = np.random.default_rng([seed, *name.encode()]).random(steps)
                values = max(lows) + (min(highs) - max(lows)) * share
            commands[:, place] = np.clip(values, *bounds)
        return commands

    return draw(one, two), draw(two, one)


def _ranges(layout: Layout) -> list[_Range]:
    """Return finite ranges: a missing bound is -1 or 1, or 1 beyond the other if farther out."""
    low, high = layout.low, layout.high
    bottom = np.where(np.isfinite(low), low, np.minimum(-1.0, high - 1.0))
    top = np.where(np.isfinite(high), high, np.maximum(1.0, low + 1.0))
    return list(zip(bottom.tolist(), top.tolist(), strict=True))


def compare_rollouts(source: Any, target: Any, *, steps: int = 100, seed: int = 0) -> Rollout:
    """Reset two environments with one seed, give them the same commands and compare the responses.

    A command is drawn per motor name, so a motor that both have gets the same number whatever
    other motors there are; a motor that only one of them has gets zero. The source runs first and
    the target after it, so one object may be both. Neither is reset afterwards. The rollout
    stops after fewer than `steps` steps if an episode ends.
    """
    commands = matched_commands(_layout(source, "action"), _layout(target, "action"), steps, seed)
    before, over = _drive(source, commands[0], seed)
    after, new_over = _drive(target, commands[1], seed)
    rows = min(len(before), len(after))
    ended = over and len(before) == rows, new_over and len(after) == rows
    old, new = (value_names(_layout(env, "observation")) for env in (source, target))
    sizes = before.shape[1] - 1, after.shape[1] - 1
    if (len(old), len(new)) != sizes:  # A wrapper has changed the observation.
        old, new = ([f"observation[{place}]" for place in range(size)] for size in sizes)
    shared = [name for name in old if name in frozenset(new)]
    gaps, excess = _gaps(
        before[:rows, [*map(old.index, shared), -1]], after[:rows, [*map(new.index, shared), -1]]
    )
    observed, reward = gaps[:, :-1], float(gaps[:, -1].max())
    sentences = [f"the {len(shared)} numbers that both observe are equal throughout."]
    if observed.any():
        first = int(np.argmax(observed.any(axis=1)))
        step, most = np.unravel_index(int(np.argmax(observed)), observed.shape)
        sentences = [
            f"observations part at {f'step {first}' if first else 'the reset'} in "
            f"{shared[int(np.argmax(observed[first]))]}, and furthest at step {step} in "
            f"{shared[most]}, by {observed.max():.4g}."
        ]
    only = [[n for n in old if n not in shared], [n for n in new if n not in shared]]
    for whose, names in zip(("source", "target"), only, strict=True):
        if names:
            sentences += [f"Only the {whose} observes {len(names)} more, such as {names[0]}."]
    if reward > 0.0:
        sentences += [f"Rewards differ by up to {reward:.4g} a step."]
    if ended[0] != ended[1]:
        sentences += [f"Only the {'source' if ended[0] else 'target'} ended its episode."]
    # Rounding explains neither a sudden difference nor a different end that no difference precedes.
    largest_before = np.append(0.0, np.maximum.accumulate(excess)[:-1])
    sudden = bool(np.any((excess > 1.0) & (excess > _GROWTH * largest_before)))
    sudden |= ended[0] != ended[1] and bool(excess.max() <= 1.0)
    apart = any(only) or ended[0] != ended[1]
    return Rollout(rows - 1, not gaps.any() and not apart, not (sudden or any(only)), (*sentences,))


def _layout(env: Any, side: str) -> Layout:
    name = f"{side}_layout"
    return getattr(env if hasattr(env, name) else env.unwrapped, name)


def _gaps(before: _Floats, after: _Floats) -> tuple[_Floats, _Floats]:
    """Return absolute differences, (n, numbers), and the largest ratio per step, (n,).

    The ratio is a relative difference divided by `_TOLERANCE`. If numbers differ and one is not
    finite, their difference is the largest finite number.
    """
    same = (before == after) | (np.isnan(before) & np.isnan(after))
    with np.errstate(invalid="ignore"):
        gaps = np.where(same, 0.0, np.abs(before - after))
    gaps = np.nan_to_num(gaps, nan=_LARGEST)  # It makes infinity the largest number, too.
    known = np.nan_to_num(np.maximum(np.abs(before), np.abs(after)), posinf=1.0)
    scale = np.maximum(known.max(axis=0), 1.0)
    return gaps, (np.minimum(gaps / scale, 1.0) / _TOLERANCE).max(axis=1)


def _drive(env: Any, commands: NDArray[np.float32], seed: int) -> tuple[_Floats, bool]:
    """Return observations and rewards, (steps + 1, size + 1), and whether the episode ended."""
    observation, _ = env.reset(seed=seed)
    rows, ended = [np.append(_flat(observation), 0.0)], False
    for command in commands:
        observation, reward, terminated, truncated, _ = env.step(command)
        rows.append(np.append(_flat(observation), float(reward)))
        if ended := bool(terminated or truncated):
            break
    return np.stack(rows), ended


def _flat(observation: Any) -> _Floats:
    """Return an observation as one vector; the parts of a dictionary in alphabetical order."""
    if isinstance(observation, Mapping):
        parts = cast("Mapping[str, Any]", observation)
        return np.concatenate([_flat(parts[key]) for key in sorted(parts)])
    return np.array(observation, np.float64).ravel()  # A copy: the env may reuse its memory.


def inconsistencies(model: mujoco.MjModel, source: mujoco.MjModel | None = None) -> tuple[str, ...]:
    """Return the inconsistencies of a compiled model that was written to, one sentence each.

    Writing mass without inertia, or either without calling `mujoco.mj_setConst`, leaves an
    inconsistent model: MuJoCo softens contacts and limits by inverse weights that no longer hold,
    treats moved frames as coincident, and ignores gravity compensation, adhesion or an
    actuator's damping if there was none when the model was compiled.

    Args:
        model: The model.
        source: Another model with the same bodies; where a mass differs, the inertia must differ.
    """
    names, owner, found = names_of(model), model.geom_bodyid, list[str]()
    before = names_of(source)["bodies"] if source else []
    for i in np.flatnonzero((model.body_treeid >= 0) & (model.body_mass > 0.0)).tolist():
        body, mass = names["bodies"][i], float(model.body_mass[i])
        small, middle, large = sorted(model.body_inertia[i].tolist())
        has_none = large == 0.0 and model.body_dofnum[i] > 0
        if small < 0.0 or has_none or small + middle < large * (1.0 - _STALE):
            found.append(
                f"{body}: mass {mass:.4g} kg comes with principal moments {small:.3g}, "
                f"{middle:.3g}, {large:.3g} kg·m², which must be positive, and none of them more "
                "than the other two together."
            )
        if source is not None and body in before and large:
            j = before.index(body)
            old = float(source.body_mass[j])
            if old != mass and np.array_equal(source.body_inertia[j], model.body_inertia[i]):
                found.append(
                    f"{body}: mass goes from {old:.4g} to {mass:.4g} kg, but its inertia stays "
                    f"{large:.3g} kg·m²: scale both."
                )
    late = model.geom_contype & ~model.body_contype[owner]
    late |= model.geom_conaffinity & ~model.body_conaffinity[owner]
    for i in np.flatnonzero(late).tolist():
        found.append(
            f"{names['geoms'][i]}: geom_contype or geom_conaffinity has bits that its body was "
            "compiled without, so they are ignored. Compile the model again."
        )
    fresh = copy.deepcopy(model)
    try:
        mujoco.mj_setConst(fresh, mujoco.MjData(fresh))
    except mujoco.FatalError as error:
        return (*found, f"MuJoCo cannot derive its constants from the model: {error}.")
    owners = {prefix: names[section] for section, (_, prefix, _) in KINDS.items()}
    owners["dof"] = [names["joints"][joint] for joint in model.dof_jntid.tolist()]
    for array, consequence in TABLE["constants"].items():
        old, new = (np.atleast_1d(np.asarray(getattr(m, array), float)) for m in (model, fresh))
        scale = np.maximum(np.abs(old), np.abs(new))
        gap = np.abs(old - new) / np.where(scale > 0.0, scale, 1.0)
        if gap.max(initial=0.0) > _STALE:  # The element that changes most is named.
            at = np.unravel_index(int(np.argmax(gap)), gap.shape)
            whose = owners.get(array.partition("_")[0])
            found.append(
                f"{f'{whose[at[0]]}: ' if whose else ''}{array} is {old[at]:.4g}, but the model "
                f"makes it {new[at]:.4g}, so {consequence}. Call mujoco.mj_setConst after writing "
                "to a compiled model."
            )
    return tuple(found)
