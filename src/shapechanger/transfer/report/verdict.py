"""The findings of a study as text: measures, arms, the verdict and its caveats."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import UnknownName
from shapechanger.reports.numbers import (
    count,
    interval_text,
    list_text,
    number,
    share_text,
    spread_text,
)
from shapechanger.transfer.learners.evaluation import Evaluation
from shapechanger.transfer.metrics.intervals import Estimate
from shapechanger.transfer.metrics.measures import (
    ReachTimes,
    Summary,
    TimeToThreshold,
    asymptotic_gain,
    total_reward_gain,
)
from shapechanger.transfer.plan import NO_SKILL, SOURCE
from shapechanger.transfer.runs import RunResult
from shapechanger.transfer.study import Study

# Name, field of `Measures`, and whether a sign is printed, for each measure that is not a time. The
# first three are gains, in the unit of the summary; the others are pure numbers.
_MEASURES: Final = (
    ("Jumpstart", "jumpstart", True),
    ("Total reward gain", "total_reward_gain", True),
    ("Asymptotic gain", "asymptotic_gain", True),
    ("Area ratio", "auc_ratio", False),
    ("Forward transfer", "forward_transfer", True),
)
_GAINS: Final = 3


def estimate_text(estimate: Estimate, *, signed: bool = False) -> str:
    """Format an estimate with its interval, if they are defined."""
    return interval_text(estimate.value, estimate.low, estimate.high, signed=signed)


class MeasureRow(NamedTuple):
    """One measure of one arm against scratch, in target steps and in total steps."""

    arm: str
    measure: str
    unit: str
    target: str
    total: str
    method: str
    note: str


def measure_rows(study: Study) -> tuple[MeasureRow, ...]:
    """Format every measure of every arm other than scratch, gains first."""
    rows: list[MeasureRow] = []
    for arm, summary in study.summaries.items():
        ours, total = summary.in_target_steps, summary.in_total_steps
        for i, (name, field, signed) in enumerate(_MEASURES):
            unit = summary.unit if i < _GAINS else "pure number"
            both: tuple[Estimate, Estimate] = getattr(ours, field), getattr(total, field)
            rows.append(_measure_row(arm, name, unit, *both, signed=signed))
        for here, there in zip(ours.times_to_threshold, total.times_to_threshold, strict=True):
            name = f"Time to threshold {here.threshold:g}: steps saved"
            row = _measure_row(arm, name, "steps", here.steps_saved, there.steps_saved, signed=True)
            reached = _reached(arm, summary, here, there)
            rows.append(row._replace(note=" ".join(filter(None, (reached, row.note)))))
    return tuple(rows)


def _measure_row(
    arm: str, measure: str, unit: str, target: Estimate, total: Estimate, *, signed: bool
) -> MeasureRow:
    sides = (("In target steps", target), ("In total steps", total))
    notes = [f"{where}: {estimate.note}" for where, estimate in sides if estimate.note]
    return MeasureRow(
        arm=arm,
        measure=measure,
        unit=unit,
        target=estimate_text(target, signed=signed),
        total=estimate_text(total, signed=signed),
        method=" / ".join(dict.fromkeys((target.method, total.method))),
        note=target.note if target.note == total.note else " ".join(notes),
    )


def _reached(
    arm: str, summary: Summary, in_target: TimeToThreshold, in_total: TimeToThreshold
) -> str:
    """Describe how many seeds reached a threshold and how soon; empty if undefined."""
    ours, total, scratch = in_target.arm, in_total.arm, in_target.scratch
    if ours is None or total is None or scratch is None:
        return ""

    def seeds(reach: ReachTimes, n_seeds: int) -> str:
        return f"{round(reach.fraction * n_seeds)} of {n_seeds} seeds"

    missed = any(reach.fraction < 1.0 for reach in (ours, total, scratch))
    censored = f" Runs that did not reach it count as {count(summary.horizon)}." if missed else ""
    return (
        f"Reached by {seeds(ours, summary.n_seeds_arm)} of {arm} after a mean of "
        f"{count(ours.restricted_mean)} steps; in total steps by "
        f"{seeds(total, summary.n_seeds_arm)} after {count(total.restricted_mean)}; "
        f"by {seeds(scratch, summary.n_seeds_scratch)} of scratch after "
        f"{count(scratch.restricted_mean)}.{censored}"
    )


GOOD: Final = 0.9
"""A run counts as good from this share of the way from the value without skill to the best run."""

STRONG: Final = 0.8
"""Success rate from which an arm counts as strong on an individual, such as one finger."""


class ArmRow(NamedTuple):
    """Summary of the runs of one kind.

    Attributes:
        success: Share of successful episodes at the end, with its t-interval over seeds; empty if
            the env does not report success.
        good: Number of runs that covered 90 % of the way from the score without skill to the best
            run on the target; empty for source policies, and if no run learned.
    """

    kind: str
    seeds: int
    first: str
    final: str
    final_return: str
    length: str
    success: str
    good: str
    per_seed: str
    terms: dict[str, float]


def arm_rows(study: Study) -> tuple[ArmRow, ...]:
    """Summarise each kind of run, first the runs of the source and the policies without skill.

    The end of a run is the mean of its last `last_k` evaluations. The end of a source policy is its
    last evaluation, because the last policy is transferred.
    """
    return tuple(
        _row(study, kind) for kind in (SOURCE, *NO_SKILL, *study.plan.arms) if study.of(kind)
    )


def successes(study: Study, kind: str) -> NDArray[np.float64]:
    """Success rate of each run at the end, shape (n_seeds,); empty if not reported."""
    if any(e.success is None for result in study.of(kind) for e in _end(study, result)):
        return np.empty(0)
    return _means(study, kind, lambda e: e.success or 0.0)


def weak_individuals(study: Study) -> list[str]:
    """Return a sentence for each arm that names the individuals with less success than `STRONG`.

    An individual is a body such as one finger. The list is empty if all seeds share one body, or if
    the env does not report success.
    """
    sentences: list[str] = []
    noun = study.plan.individual.removesuffix("_seed")
    for arm in study.plan.arms if noun else ():
        shares = successes(study, arm)
        indices = [result.run.index for result in study.of(arm)]
        # Not strict, because `shares` is empty if the env does not report success.
        ends = sorted(zip(shares.tolist(), indices, strict=False))
        weak = [f"{noun} {index} ({share:.0%})" for share, index in ends if share < STRONG]
        if ends:
            strong = f"{arm} reaches {STRONG:.0%} on {len(ends) - len(weak)} of {len(ends)} {noun}s"
            sentences.append(f"{strong}{', not on ' if weak else ''}{', '.join(weak)}.")
    return sentences


def finals(study: Study, kind: str) -> NDArray[np.float64]:
    """Final value of each run, shape (n_seeds,)."""
    return _means(study, kind, partial(_value, study))


def _means(study: Study, kind: str, of: Callable[[Evaluation], float]) -> NDArray[np.float64]:
    """Mean of a number over the last evaluations of each run, shape (n_seeds,)."""
    ends = (_end(study, result) for result in study.of(kind))
    return np.array([float(np.mean([of(evaluation) for evaluation in end])) for end in ends])


def _end(study: Study, result: RunResult) -> tuple[Evaluation, ...]:
    """Return the last evaluations of a run, over which its final value is averaged."""
    return result.curve[-1 if result.run.kind == SOURCE else -study.plan.last_k :]


def _value(study: Study, evaluation: Evaluation) -> float:
    """Return the study's measure of an evaluation; NaN if the source env lacks it."""
    try:
        return evaluation.value(study.plan.measure)
    except UnknownName:
        return float("nan")


def _row(study: Study, kind: str) -> ArmRow:
    results, at_the_end = study.of(kind), finals(study, kind)
    ends = [evaluation for result in results for evaluation in _end(study, result)]
    terms = {name: None for evaluation in ends for name in evaluation.terms}

    def spread(values: NDArray[np.float64]) -> str:
        return "not reported" if np.isnan(values).any() else spread_text(values)

    return ArmRow(
        kind=kind,
        seeds=len(results),
        first=spread(np.array([_value(study, r.curve[0]) for r in results])),
        final=spread(at_the_end),
        final_return=spread_text(_means(study, kind, lambda e: e.mean_return)),
        length=number(float(np.mean([e.mean_length for e in ends]))),
        success=share_text(successes(study, kind)),
        good=_good(study, kind),
        per_seed=list_text([float(value) for value in at_the_end]),
        # A term that is missing in an evaluation counts as 0.
        terms={name: float(np.mean([e.terms.get(name, 0.0) for e in ends])) for name in terms},
    )


def _good(study: Study, kind: str) -> str:
    """Return how many runs ever came close to the best run, such as `4 of 5`."""
    if kind == SOURCE:
        return ""
    floor = next(iter(study.summaries.values())).reference.zero
    best = max(float(finals(study, arm).max()) for arm in study.plan.arms)
    if best <= floor:
        return ""
    height = floor + GOOD * (best - floor)
    results = study.of(kind)
    reached = sum(max(_value(study, e) for e in result.curve) >= height for result in results)
    return f"{reached} of {len(results)}"


Direction = Literal["up", "down", "unclear"]
Outcome = Literal["up", "down", "unclear", "no interval", "unlearned", "too few"]

# Verbs for an arm that is trained on the target, and for another arm.
_VERBS: Final[dict[Outcome, tuple[str, str]]] = {
    "up": ("helped", "came out ahead of scratch"),
    "down": ("hurt", "stayed behind scratch"),
    "unclear": ("made no clear difference", "did not clearly differ from scratch"),
    "no interval": ("cannot be judged without an interval", "cannot be judged without an interval"),
    "unlearned": ("did not learn", "cannot be judged"),
    "too few": ("cannot be judged yet", "cannot be judged yet"),
}
LEAST_SEEDS: Final = 3
"""Fewest seeds of a verdict: an interval of two is over ten times as wide as their difference."""
# With fewer seeds, intervals are so wide that they exclude 0 only for large effects.
_FEW_SEEDS: Final = 5
# An arm that rises by less than this share of the best end has not learned.
_FLAT: Final = 0.1


def direction(estimate: Estimate) -> Direction:
    """Return the direction of a difference: unclear if its interval contains 0 or is missing."""
    if estimate.low is not None and estimate.low > 0.0:
        return "up"
    if estimate.high is not None and estimate.high < 0.0:
        return "down"
    return "unclear"


def learned(study: Study, arm: str) -> bool:
    """Return whether an arm rose in training: by a tenth of the best end, and by more than noise.

    The noise is twice the standard error of scratch's start.
    """
    curves, untrained = study.curves(arm), study.curves("scratch").returns[:, 0]
    ends = {one: float(finals(study, one).mean()) for one in study.plan.arms}
    least = _FLAT * max(abs(ends[arm]), abs(max(ends.values())))
    noise = 2.0 * float(untrained.std(ddof=1)) / untrained.size**0.5
    return ends[arm] - float(curves.returns[:, 0].mean()) > max(least, noise)


def gain_over_scratch(study: Study, arm: str) -> Estimate:
    """Advantage of an arm over scratch averaged over the budget, in the unit of the measure.

    An arm without training on the target is compared with the end of scratch, because being ahead
    of an untrained policy is no success.
    """
    ours, scratch = study.curves(arm), study.curves("scratch")
    if ours.n_evals > 1:
        return total_reward_gain(ours, scratch)
    return asymptotic_gain(ours, scratch, last_k=min(study.plan.last_k, scratch.n_evals))


def outcome(study: Study, arm: str) -> Outcome:
    """Judge an arm, unless there are fewer than three seeds, or neither it nor scratch learned."""
    if study.plan.seeds < LEAST_SEEDS:
        return "too few"
    if not learned(study, arm) and not learned(study, "scratch"):
        return "unlearned"
    gain = gain_over_scratch(study, arm)
    return "no interval" if gain.low is None else direction(gain)


def verdict(study: Study) -> str:
    """State the finding in one sentence, and in a second one if more seeds are needed."""
    few = study.plan.seeds < LEAST_SEEDS
    return f"{finding(study)} {more_seeds('study')}" if few else finding(study)


def more_seeds(what: str) -> str:
    """Return how to add the seeds that a verdict on a study or a suite needs."""
    return (
        f"A verdict needs at least {LEAST_SEEDS} seeds: run the same {what} again with --seeds 5, "
        "and it keeps these runs and adds the others."
    )


def finding(study: Study) -> str:
    """State in one sentence of about 25 words whether transfer helped.

    With fewer than three seeds the sentence has means only, and if no arm learned, it states that.
    """
    arm, plan = study.headline_arm, study.plan
    budget, found = f"{count(plan.steps)} target steps", outcome(study, arm)
    ours, scratch = _change(study, arm), _change(study, "scratch")
    if not learned(study, arm) and not learned(study, "scratch"):
        others = any(learned(study, one) for one in plan.arms)
        who = f"Neither scratch nor {arm}" if others else "No arm"
        return f"{who} learned in {budget}: scratch's {plan.measure} {scratch}, and {arm}'s {ours}."
    if _is_trained(study, arm):
        head, text = f"Transfer {_VERBS[found][0]}", f"over {budget} {arm}'s {plan.measure}"
        text += f" averaged {_height(study, arm)} and scratch's {_height(study, 'scratch')}."
    else:
        head = f"{arm.capitalize()} {_VERBS[found][1]}"
        text = f"{arm}'s {plan.measure} {ours}, and scratch's {scratch} in {budget}."
    return f"{text[0].upper()}{text[1:]}" if found == "too few" else f"{head}: {text}"


def other_arms(study: Study) -> str:
    """Judge the arms other than scratch and the headline arm; empty if no arm learned.

    One sentence is about arms that are trained on the target, with the measure averaged over the
    budget in parentheses. Another compares the other arms with scratch.
    """
    if not any(learned(study, arm) for arm in study.plan.arms):
        return ""
    parts: tuple[dict[str, list[str]], ...] = ({}, {})
    for arm in study.summaries:
        if arm != study.headline_arm:
            side = 0 if _is_trained(study, arm) else 1
            verb = _VERBS[outcome(study, arm)][side]
            parts[side].setdefault(verb, []).append(f"{arm} ({_height(study, arm)})")
    trained, untrained = (
        "; ".join(f"{' and '.join(arms)} {verb}" for verb, arms in part.items()) for part in parts
    )
    scratch = f"scratch {_change(study, 'scratch')} in training"
    return " ".join(
        ([f"Of the other arms, {trained}."] if trained else [])
        + ([f"Without training, {untrained}; {scratch}."] if untrained else [])
    )


def _is_trained(study: Study, arm: str) -> bool:
    return study.curves(arm).n_evals > 1


def _height(study: Study, arm: str) -> str:
    """Return the mean over the budget, or the mean of an arm without training."""
    curves = study.curves(arm)
    return _mean(study, curves.auc() if curves.n_evals > 1 else curves.returns)


def _change(study: Study, arm: str) -> str:
    if not _is_trained(study, arm):
        return f"was {_height(study, arm)} without training"
    start = _mean(study, study.curves(arm).returns[:, 0])
    return f"went from {start} to {_mean(study, finals(study, arm))}"


def _mean(study: Study, values: NDArray[np.float64]) -> str:
    mean, unit = f"{float(f'{values.mean():.3g}'):,.10g}", study.plan.unit
    return mean if unit == "1" else f"{mean} {unit}"


def devices_of(study: Study) -> dict[str, list[str]]:
    """Return the kinds of runs that were trained on each device; old studies have no devices."""
    devices: dict[str, list[str]] = {}
    for result in study.runs:
        if result.device and result.run.kind not in devices.setdefault(result.device, []):
            devices[result.device].append(result.run.kind)
    return devices


def machine_text(studies: Iterable[Study]) -> str:
    """Return the machine of the first study, and the devices on which any study was trained."""
    first, *rest = studies
    devices = dict.fromkeys(device for study in (first, *rest) for device in devices_of(study))
    learned = f"; learned on {', '.join(devices)}" if devices else ""
    return f"{first.machine}{learned}"


def caveats(study: Study) -> tuple[str, ...]:
    """Return caveats about the numbers, one or two sentences each."""
    summary = next(iter(study.summaries.values()))
    source, budget = count(summary.source_steps), count(summary.horizon)
    sentences: list[str] = []
    # All measures in total steps except the jumpstart then compare no skill with scratch.
    if summary.source_steps >= summary.horizon:
        sentences.append(
            f"The source used {source} steps and the budget is {budget}, so in total steps "
            "no step is left for the target: only the jumpstart is meaningful there, and the "
            "other measures compare no skill with scratch."
        )
    elif summary.source_steps > 0.0:
        sentences.append(
            f"In total steps the budget stays {budget}: an arm counts as without skill until its "
            f"{source} source steps have passed."
        )
    if study.plan.source_policy:
        sentences.append(
            "All runs with a source policy start from the one that was given: the intervals do not "
            "cover other policies of the same source."
        )
    if study.plan.individual:
        sentences.append(
            f"Each seed has its own target, whose {study.plan.individual} is the index of the "
            "seed: the intervals include the variation between targets."
        )
    if len(devices := devices_of(study)) > 1:
        named = "; ".join(f"on {device} {', '.join(kinds)}" for device, kinds in devices.items())
        sentences.append(
            f"Not all runs learned on the same device ({named}): worlds on a GPU start and round "
            "differently, so a difference between arms may be due to the devices."
        )
    if len(study.looks) > 1:
        looks = " and ".join(map(str, study.looks))
        sentences.append(
            f"Results were computed with {looks} seeds: unless the last number was declared before "
            "the first results were seen, a 95 % interval covers less than 95 %."
        )
    if study.plan.seeds < _FEW_SEEDS:
        sentences.append(
            f"With {study.plan.seeds} seeds the intervals are wide: no clear difference does not "
            "mean that there is no difference."
        )
    return tuple(sentences)
