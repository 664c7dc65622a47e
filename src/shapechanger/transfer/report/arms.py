"""What each arm came to: its returns over seeds, and what they are made of."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapechanger.transfer.evaluation import Evaluation
from shapechanger.transfer.plan import EVERY_ARM, RunKind
from shapechanger.transfer.report.numbers import list_text, number
from shapechanger.transfer.report.spread import share_text, spread_text
from shapechanger.transfer.runs import RunResult
from shapechanger.transfer.study import Study

__all__ = ["GOOD", "ArmRow", "arm_rows", "finals", "successes"]

GOOD: Final = 0.9
"""Share of the way from the random policy to the best run that counts as having learnt."""

_KINDS: Final[tuple[RunKind, ...]] = ("source", "random", *EVERY_ARM)


class ArmRow(NamedTuple):
    """The runs of one kind in one line.

    Attributes:
        kind: The arm; or "random" for the random policy, or "source" for the source policies, in
            the source.
        seeds: How many runs.
        first_return: Mean return at the first evaluation, with its t-interval over seeds.
        final_return: Mean return at the end, with its t-interval over seeds.
        length: Mean length of the episodes at the end, in steps.
        success: Share of successful episodes at the end, with its t-interval over seeds; empty
            where the env says nothing of success.
        good: How many runs came to 90 % of the way from the random policy to the best run on the
            target; empty for source policies, and where no run is better than the random policy.
        per_seed: Return of each run at the end.
        terms: For each reward term its mean sum over an episode at the end.
    """

    kind: RunKind
    seeds: int
    first_return: str
    final_return: str
    length: str
    success: str
    good: str
    per_seed: str
    terms: dict[str, float]


def arm_rows(study: Study) -> tuple[ArmRow, ...]:
    """The kinds of run that the study has, those of the source and the random policy first.

    The end of a run is the mean of its last evaluations, as many as the plan says; of a source
    policy it is the last one, because the policy that it was measured on is the one that is moved.
    """
    return tuple(_row(study, kind) for kind in _KINDS if study.of(kind))


def successes(study: Study, kind: RunKind) -> NDArray[np.float64]:
    """Share of successful episodes of each run at the end, shape (n_seeds,); (0,) if unknown."""
    ends = [[e.success for e in _end(study, result)] for result in study.of(kind)]
    if any(share is None for end in ends for share in end):
        return np.empty(0)
    return np.array([float(np.mean(np.array(end, np.float64))) for end in ends])


def finals(study: Study, kind: RunKind) -> NDArray[np.float64]:
    """Return of each run at the end, shape (n_seeds,)."""
    ends = (_end(study, result) for result in study.of(kind))
    return np.array([float(np.mean([e.mean_return for e in end])) for end in ends])


def _row(study: Study, kind: RunKind) -> ArmRow:
    results = study.of(kind)
    ends = [evaluation for result in results for evaluation in _end(study, result)]
    at_the_end = finals(study, kind)
    return ArmRow(
        kind=kind,
        seeds=len(results),
        first_return=spread_text(np.array([r.curve[0].mean_return for r in results])),
        final_return=spread_text(at_the_end),
        length=number(float(np.mean([e.mean_length for e in ends]))),
        success=share_text(successes(study, kind)),
        good=_good(study, kind),
        per_seed=list_text([float(value) for value in at_the_end]),
        terms=_terms(ends),
    )


def _end(study: Study, result: RunResult) -> tuple[Evaluation, ...]:
    """The evaluations that count as the end of a run."""
    return result.curve[-1 if result.run.kind == "source" else -study.plan.last_k :]


def _good(study: Study, kind: RunKind) -> str:
    """How many runs ever came near the best one, as in `4 of 5`."""
    if kind == "source":
        return ""
    floor = float(finals(study, "random").mean())
    best = max(float(finals(study, arm).max()) for arm in study.plan.arms)
    if best <= floor:
        return ""
    height = floor + GOOD * (best - floor)
    results = study.of(kind)
    reached = sum(max(e.mean_return for e in result.curve) >= height for result in results)
    return f"{reached} of {len(results)}"


def _terms(ends: list[Evaluation]) -> dict[str, float]:
    """Mean of each reward term; an evaluation that does not report one has none of it."""
    names = {name: None for evaluation in ends for name in evaluation.terms}
    return {name: float(np.mean([e.terms.get(name, 0.0) for e in ends])) for name in names}
