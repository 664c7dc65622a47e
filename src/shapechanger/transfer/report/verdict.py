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

# Verbs for an arm that is trained on the target, and for one that is compared with trained scratch.
_TRAINED: Final[dict[Outcome, str]] = {
    "up": "helped",
    "down": "hurt",
    "unclear": "made no clear difference",
    "no interval": "cannot be judged without an interval",
    "unlearned": "did not learn",
    "too few": "cannot be judged yet",
}
_UNTRAINED: Final[dict[Outcome, str]] = {
    "up": "came out ahead of scratch",
    "down": "stayed behind scratch",
    "unclear": "did not clearly differ from scratch",
    "no interval": "cannot be judged without an interval against scratch",
    "unlearned": "cannot be judged against scratch",
    "too few": "cannot be judged yet against scratch",
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
    """Return whether an arm ends clearly above its own start.

    It must rise by a tenth of the best arm's end, and by twice the standard error of scratch's
    start. An arm that is not trained on the target never learned.
    """
    curves, untrained = study.curves(arm), study.curves("scratch").returns[:, 0]
    end = float(finals(study, arm).mean())
    best = max(float(finals(study, one).mean()) for one in study.plan.arms)
    noise = 2.0 * float(untrained.std(ddof=1)) / untrained.size**0.5
    rise = end - float(curves.returns[:, 0].mean())
    return curves.n_evals > 1 and rise > max(_FLAT * abs(end), _FLAT * abs(best), noise)


def gain_over_scratch(study: Study, arm: str) -> Estimate:
    """Advantage of an arm over scratch, by which it is judged, in the unit of the measure.

    It is averaged over the budget. An arm that is not trained on the target is compared with the
    end of scratch, because being ahead of an untrained policy is no success.
    """
    ours, scratch = study.curves(arm), study.curves("scratch")
    if ours.n_evals > 1:
        return total_reward_gain(ours, scratch)
    return asymptotic_gain(ours, scratch, last_k=min(study.plan.last_k, scratch.n_evals))


def outcome(study: Study, arm: str) -> Outcome:
    """Return the outcome for an arm, by the rule of all verdicts.

    A study with fewer than three seeds has no verdict, nor has an arm if neither it nor scratch
    learned.
    """
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

    The headline arm is judged by its gain over scratch, a measure chosen in advance. With fewer
    than three seeds the sentence states the means only, and if no arm learned, it says so.
    """
    arm, plan, few = study.headline_arm, study.plan, study.plan.seeds < LEAST_SEEDS
    curves, scratch, text = study.curves(arm), study.curves("scratch"), partial(_mean, plan.unit)
    budget, change = f"{count(plan.steps)} target steps", _change(study, "scratch")
    if not learned(study, arm) and not learned(study, "scratch"):
        others = any(learned(study, one) for one in plan.arms)
        who = f"Neither scratch nor {arm}" if others else "No arm"
        return (
            f"{who} learned in {budget}: scratch's {plan.measure} {change}, and {arm}'s "
            f"{_change(study, arm)}."
        )
    if curves.n_evals > 1:
        head = f"Transfer {_TRAINED[outcome(study, arm)]}"
        words = f"over {budget} {arm}'s {plan.measure} averaged {text(curves.auc())}"
        words += f" and scratch's {text(scratch.auc())}."
    else:
        head = f"{arm.capitalize()} {_UNTRAINED[outcome(study, arm)]}"
        words = f"{arm}'s {plan.measure} {_change(study, arm)}, and scratch's {change} in {budget}."
    return f"{words[0].upper()}{words[1:]}" if few else f"{head}: {words}"


def other_arms(study: Study) -> str:
    """State whether the arms other than scratch and the headline arm helped.

    One sentence is about arms that are trained on the target, with the measure averaged over the
    budget in parentheses. Another compares the other arms with scratch before and after training.
    The text is empty if there are no such arms, or if no arm learned.
    """
    plan = study.plan
    others = [arm for arm in study.summaries if arm != study.headline_arm]
    if not any(learned(study, arm) for arm in plan.arms):
        return ""
    trained: dict[str, list[str]] = {found: [] for found in _TRAINED.values()}
    untrained: dict[str, list[str]] = {found: [] for found in _UNTRAINED.values()}
    for arm in others:
        curves, found = study.curves(arm), outcome(study, arm)
        if curves.n_evals > 1:
            trained[_TRAINED[found]].append(f"{arm} ({_mean(plan.unit, curves.auc())})")
        else:
            value = _mean(plan.unit, curves.returns)
            untrained[_UNTRAINED[found]].append(f"{arm} ({value})")
    sentences: list[str] = []
    if parts := _listed(trained):
        sentences.append(f"Of the other arms, {parts}.")
    if parts := _listed(untrained):
        change = _change(study, "scratch")
        sentences.append(f"Without training, {parts}, which {change} in training.")
    return " ".join(sentences)


def _listed(arms: dict[str, list[str]]) -> str:
    """Return all arms before their verbs."""
    return "; ".join(
        f"{' and '.join(filter(None, (', '.join(some[:-1]), some[-1])))} {verb}"
        for verb, some in arms.items()
        if some
    )


def _change(study: Study, arm: str) -> str:
    """Return the mean before and after training, or without training."""
    values, text = study.curves(arm).returns, partial(_mean, study.plan.unit)
    if values.shape[1] == 1:
        return f"was {text(values)} without training"
    return f"went from {text(values[:, 0])} to {text(finals(study, arm))}"


def _mean(unit: str, values: NDArray[np.float64]) -> str:
    mean = f"{float(f'{values.mean():.3g}'):,.10g}"
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
            "nothing is left for the target: only the jumpstart is meaningful there, and the "
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
