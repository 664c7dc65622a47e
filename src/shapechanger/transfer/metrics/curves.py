"""Learning curves and scores.

Every measure interpolates a curve linearly between evaluations, so areas, crossings and values are
consistent. A score of 0 means no skill, and 1 is the target's reference, or else the best arm.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.errors import StudyError

# Larger numbers would overflow in the statistics.
_LARGEST_RETURN: Final = 1e30


@dataclass(frozen=True, slots=True, eq=False)
class LearningCurves:
    """Returns of the training runs of one arm at each evaluation, one row for each seed.

    The arrays are copied, and the copies are read-only.

    Attributes:
        steps: Environment steps of the target at each evaluation, shape (n_evals,), strictly
            increasing from 0. The last one is the horizon H.
        returns: Mean undiscounted return of each seed at each evaluation, shape (n_seeds, n_evals),
            finite; in units of return, or of score after `Reference.scores`.
        source_steps: Environment steps of the source that count before the first evaluation: the
            curves at step T are `returns` at T - source_steps. 0 if only target steps count;
            `in_total_steps` sets it.
        floor: Value of the curves until `source_steps` have passed, in units of `returns`.

    Raises:
        StudyError: If the arrays do not have these shapes or these values.
    """

    steps: NDArray[np.float64]
    returns: NDArray[np.float64]
    source_steps: float = 0.0
    floor: float = 0.0

    def __post_init__(self) -> None:
        """Copy the arrays and check them."""
        steps = _frozen_copy("steps", self.steps)
        returns = _frozen_copy("returns", self.returns)
        if steps.ndim != 1 or steps.size == 0:
            raise StudyError(f"steps must have shape (n_evals,), n_evals >= 1, got {steps.shape}.")
        if steps[0] != 0.0 or not np.all(np.diff(steps) > 0.0):
            raise StudyError("steps must start at 0, before any training, and strictly increase.")
        if returns.ndim != 2 or returns.shape[0] == 0 or returns.shape[1] != steps.size:
            raise StudyError(
                f"returns must have shape (n_seeds, {steps.size}), n_seeds >= 1, "
                f"got {returns.shape}."
            )
        if not 0.0 <= self.source_steps < math.inf:  # Also refuses NaN.
            raise StudyError(f"source_steps must be finite and >= 0, got {self.source_steps}.")
        if not abs(self.floor) <= _LARGEST_RETURN:  # Also refuses NaN.
            raise StudyError(f"floor must be finite, got {self.floor}.")
        object.__setattr__(self, "steps", steps)
        object.__setattr__(self, "returns", returns)

    @property
    def n_seeds(self) -> int:
        """Number of training runs."""
        return self.returns.shape[0]

    @property
    def n_evals(self) -> int:
        """Number of evaluations per run; 1 for an arm that is not trained on the target."""
        return self.steps.size

    @property
    def horizon(self) -> float:
        """H, the last step that counts: the last of `steps`, even if source steps count too."""
        return float(self.steps[-1])

    def at(self, steps: ArrayLike) -> NDArray[np.float64]:
        """Interpolate the curves at `steps`; returns shape (n_seeds, n_steps).

        The value is `floor` until `source_steps` have passed, linear between two evaluations, and
        the last evaluation after that.

        Args:
            steps: Steps, including `source_steps`, shape (n_steps,), >= 0.
        """
        learning = np.atleast_1d(np.asarray(steps, dtype=np.float64)) - self.source_steps
        return np.where(learning < 0.0, self.floor, self._after_training(learning))

    def auc(self) -> NDArray[np.float64]:
        """Area under each curve from 0 to H, divided by H, shape (n_seeds,).

        The result is the mean height of the curve, in units of `returns`. The area before the jump
        at `source_steps` is a rectangle. The area after the jump is a trapezoidal sum up to H.

        Raises:
            StudyError: If the arm was evaluated only once.
        """
        if self.n_evals == 1:
            raise StudyError("One evaluation spans no area; a learning curve needs at least two.")
        waiting = min(self.source_steps, self.horizon)
        learning = self.horizon - waiting
        knots = np.append(self.steps[self.steps < learning], learning)
        area = np.asarray(np.trapezoid(self._after_training(knots), knots, axis=1))
        return (self.floor * waiting + area) / self.horizon

    def _after_training(self, steps: NDArray[np.float64]) -> NDArray[np.float64]:
        """Interpolate the curves after `steps` of training on the target."""
        rows: list[NDArray[np.float64]] = list(self.returns)
        return np.stack([np.interp(steps, self.steps, row) for row in rows])


def in_total_steps(curves: LearningCurves, source_steps: float, floor: float) -> LearningCurves:
    """Return the same curves with the steps on the source counted too.

    Taylor & Stone (JMLR 10, 2009, section 2) call this the total time scenario. The budget stays
    H = `curves.horizon`: with S steps on the source, H - S are left for the target.
    With p the arm's curve in target steps, the curve is `floor` for T < S and p(T - S) from there.

    Args:
        curves: The arm's curves in target steps.
        source_steps: S, environment steps spent on the source, >= 0.
        floor: Value of the arm on the target while it still trains on the source: the value
            without skill, or 0 if the curves are scores.

    Returns:
        Curves on the same grid of evaluations.

    Raises:
        StudyError: If the source steps are already counted, or are negative or not finite.
    """
    if curves.source_steps > 0.0:
        raise StudyError(f"The curves already count {curves.source_steps:g} source steps.")
    return dataclasses.replace(curves, source_steps=float(source_steps), floor=float(floor))


def check_comparable(arm: LearningCurves, scratch: LearningCurves) -> None:
    """Refuse two sets of curves that cannot be compared point by point."""
    if scratch.source_steps > 0.0:
        raise StudyError("Scratch learns on the target only, so it cannot count source steps.")
    if arm.n_evals > 1 and not np.array_equal(arm.steps, scratch.steps):
        raise StudyError(
            f"The arm was evaluated {arm.n_evals} times up to step {arm.horizon:g} and scratch "
            f"{scratch.n_evals} times up to step {scratch.horizon:g}; the steps must be the same."
        )


def _frozen_copy(name: str, numbers: ArrayLike) -> NDArray[np.float64]:
    """Return a read-only float copy of finite numbers."""
    copy = np.array(numbers, dtype=np.float64)
    if not np.all(np.abs(copy) <= _LARGEST_RETURN):  # Also refuses NaN.
        raise StudyError(f"{name} must be finite numbers, at most {_LARGEST_RETURN:g}.")
    copy.setflags(write=False)
    return copy


# Two values closer than this, relative to the larger of them and 1, are equal up to rounding.
_SAME: Final = 1e-9


class Reference(msgspec.Struct, frozen=True):
    """The two values that define the scale of scores, both measured on the target.

    score = (J - zero) / (one - zero)

    The formula follows D4RL (arXiv 2004.07219). `zero` is the best value without skill: an ant that
    stands still earns 1,000, so random actions alone would be too low. Both values are measured on
    the target, because an expert on the source is not comparable on another body. Intervals of
    scores do not include the uncertainty of the reference.

    Attributes:
        zero: Value without skill.
        one: Value of the target's reference, or at the end of the best arm if it has no reference.
        zero_of: Name of the policy with the value zero, such as "random actions".
        one_of: Name of the reference or the arm with the value one.
        shipped: Whether `one` is the value of a reference that ships with Shapechanger.

    Raises:
        StudyError: If one of the values is not finite.
    """

    zero: float
    one: float
    zero_of: str = ""
    one_of: str = ""
    shipped: bool = False

    def __post_init__(self) -> None:
        """Check that both values are finite."""
        if not (math.isfinite(self.zero) and math.isfinite(self.one)):
            raise StudyError(f"A reference needs finite values, got {self.zero} and {self.one}.")

    @classmethod
    def of(
        cls,
        floors: Mapping[str, float],
        ends: Mapping[str, float],
        shipped: tuple[str, float] | None = None,
    ) -> Reference:
        """Compute the reference of a target.

        Args:
            floors: Mean values of the policies without skill, keyed by name; at least one.
            ends: Mean values at the end of each arm, keyed by name; at least one.
            shipped: Name and value of the target's shipped reference; None without one.
        """
        zero_of, one_of = max(floors, key=floors.__getitem__), max(ends, key=ends.__getitem__)
        name, value = shipped or (one_of, ends[one_of])
        return cls(floors[zero_of], value, zero_of, name, shipped is not None)

    @property
    def defined(self) -> bool:
        """Return whether scores exist: `one` must be above `zero` by more than rounding."""
        size = max(1.0, abs(self.zero), abs(self.one))
        return self.one - self.zero > _SAME * size

    def scores(self, curves: LearningCurves, *, clip: bool = False) -> LearningCurves:
        """Convert curves and their floor to scores.

        Args:
            curves: Curves in units of return.
            clip: Clip each evaluation to 0 and 1, because 1 is the maximum in the formula of
                `forward_transfer`. The other measures need unclipped scores, because a run can beat
                the mean of the best arm.

        Raises:
            StudyError: If scores do not exist, see `defined`.
        """
        if not self.defined:
            raise StudyError(
                f"The best arm ended at {self.one:g}, and {self.zero:g} needs no skill: no arm "
                "learned, so there are no scores. Compare values instead."
            )
        low, high = (0.0, 1.0) if clip else (-math.inf, math.inf)

        def score(returns: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.clip((returns - self.zero) / (self.one - self.zero), low, high)

        return dataclasses.replace(
            curves,
            returns=score(curves.returns),
            floor=float(score(np.asarray(curves.floor, dtype=np.float64))),
        )
