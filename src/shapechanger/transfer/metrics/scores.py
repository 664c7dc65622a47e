"""Scores: returns on a scale where 0 is the random policy and 1 is what scratch reaches."""

from __future__ import annotations

import dataclasses
import math
from typing import Final

import msgspec
import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.errors import StudyError
from shapechanger.transfer.metrics.curves import LearningCurves

__all__ = ["Reference"]

# Two returns closer than this, relative to the larger of them and 1, are one number with rounding.
_SAME: Final = 1e-9


class Reference(msgspec.Struct, frozen=True):
    """The two returns that fix the scale of scores, both measured on the target itself.

    score = (J - random) / (final - random)

    The formula is that of D4RL (arXiv 2004.07219). Both ends belong to the target, because the
    return of an expert on the source says nothing about a body of another shape. The reference is
    taken as given: intervals of scores do not contain its own uncertainty.

    Attributes:
        random: Mean return of the random policy.
        final: Mean return of scratch over its last evaluations.

    Raises:
        StudyError: If one of them is not finite.
    """

    random: float
    final: float

    def __post_init__(self) -> None:
        """Refuse what cannot be the end of a scale."""
        if not (math.isfinite(self.random) and math.isfinite(self.final)):
            raise StudyError(
                f"A reference needs finite returns, got {self.random} and {self.final}."
            )

    @classmethod
    def of(cls, scratch: LearningCurves, random_returns: ArrayLike, last_k: int) -> Reference:
        """Measure the reference of a target.

        Args:
            scratch: Curves of the runs from scratch, in units of return.
            random_returns: Returns of the random policy, any shape.
            last_k: How many of the last evaluations count as final, >= 1.

        Raises:
            StudyError: If there are not that many evaluations, or no finite random returns.
        """
        final = scratch.at(scratch.last_steps(last_k)).mean()
        returns = np.asarray(random_returns, dtype=np.float64)
        if returns.size == 0:
            raise StudyError("A reference needs at least one return of the random policy.")
        return cls(random=float(returns.mean()), final=float(final))

    @property
    def defined(self) -> bool:
        """Whether scores exist: scratch ended above the random policy, by more than rounding."""
        size = max(1.0, abs(self.random), abs(self.final))
        return self.final - self.random > _SAME * size

    def scores(self, curves: LearningCurves, *, clip: bool = False) -> LearningCurves:
        """The same curves as scores; their floor too.

        Args:
            curves: Curves in units of return.
            clip: Cut scores off at 0 and 1, as `forward_transfer` needs, whose formula takes 1 for
                the most that can be reached. Each evaluation is clipped, then the line is drawn.
                Everything else wants scores as they are: beating scratch is the point of transfer.

        Raises:
            StudyError: If scratch did not learn, so that there is no scale.
        """
        if not self.defined:
            raise StudyError(
                f"Scratch ended at {self.final:g} and the random policy is worth {self.random:g}: "
                "scratch did not learn, so there are no scores. Compare returns instead."
            )
        low, high = (0.0, 1.0) if clip else (-math.inf, math.inf)

        def score(returns: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.clip((returns - self.random) / (self.final - self.random), low, high)

        return dataclasses.replace(
            curves,
            returns=score(curves.returns),
            floor=float(score(np.asarray(curves.floor, dtype=np.float64))),
        )
