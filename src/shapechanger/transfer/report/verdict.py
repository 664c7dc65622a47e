"""Whether transfer helped, in plain sentences, and what a reader must not make of them."""

from __future__ import annotations

from typing import Final, Literal, NamedTuple

from shapechanger.transfer.metrics import Estimate, Measures, Summary, estimate_difference
from shapechanger.transfer.plan import Arm, RunKind
from shapechanger.transfer.report.arms import finals, successes
from shapechanger.transfer.report.numbers import count, estimate_text
from shapechanger.transfer.report.spread import share_text, spread_text
from shapechanger.transfer.study import Study

__all__ = [
    "Direction",
    "caveats",
    "direction",
    "judged_arm",
    "scratch_gain",
    "source_takes_all",
    "verdict",
]

Direction = Literal["up", "down", "unclear"]

_TRANSFER: Final = {"up": "helped", "down": "hurt", "unclear": "made no clear difference"}
# Below this many seeds an interval is so wide that only large effects show.
_FEW_SEEDS: Final = 5


class _Finding(NamedTuple):
    """One clause of a sentence: what an estimate says, and the estimate."""

    clauses: dict[Direction, str]
    estimate: Estimate
    label: str

    @property
    def text(self) -> str:
        return f"{self.clauses[direction(self.estimate)]} ({self.label})"


def direction(estimate: Estimate) -> Direction:
    """Whether the interval of a difference lies above 0, below 0, or neither; then it is unclear.

    An estimate without an interval is unclear too, whatever its value.
    """
    if estimate.low is not None and estimate.low > 0.0:
        return "up"
    if estimate.high is not None and estimate.high < 0.0:
        return "down"
    return "unclear"


def verdict(study: Study) -> str:
    """Whether transfer helped: a sentence on target steps, one on total steps, and a warning.

    Fine-tune is judged by its total reward gain, which is chosen in advance, so that nobody can
    pick the measure that pleases; the asymptotic gain and the time to the highest threshold are
    told beside it. A study without fine-tune is judged by the jumpstart of its first other arm.
    Where the envs say what success is, a sentence tells how often each arm succeeds.
    """
    arm = judged_arm(study)
    summary = study.summaries[arm]
    if arm == "fine-tune":
        sentences = [_in_target_steps(summary), _in_total_steps(summary)]
    else:
        sentences = _untrained(summary)
    sentences += _successes(study)
    if direction(scratch_gain(study)) != "up":
        sentences.append(
            f"Scratch itself did not clearly learn: it ended at {_end(study, 'scratch')}, and the "
            f"random policy is worth {_end(study, 'random')}, so the comparison means little: "
            "try more target steps."
        )
    return " ".join(sentences)


def judged_arm(study: Study) -> Arm:
    """The arm that a study is judged by."""
    return "fine-tune" if "fine-tune" in study.summaries else next(iter(study.summaries))


def _successes(study: Study) -> list[str]:
    """How often each arm succeeds at the end; nothing where the envs do not say what success is."""
    kinds: list[RunKind] = ["source", *study.plan.arms]
    told = {kind: share_text(successes(study, kind)) for kind in kinds}
    names = {"source": "the source policy in the source"}
    parts = [f"{names.get(kind, kind)} {share}" for kind, share in told.items() if share]
    return [f"Success at the end: {'; '.join(parts)}."] if parts else []


def scratch_gain(study: Study) -> Estimate:
    """How much better scratch ended than the random policy, in units of return."""
    return estimate_difference(finals(study, "scratch"), finals(study, "random"))


def source_takes_all(summary: Summary) -> bool:
    """Whether the source has cost the whole budget, so that total steps leave none for the target.

    Every measure in total steps but the jumpstart then compares the random policy with scratch.
    """
    return summary.source_steps >= summary.horizon


def caveats(study: Study) -> tuple[str, ...]:
    """What a reader must not make of the numbers, one sentence or two each."""
    summary = next(iter(study.summaries.values()))
    source, budget = count(summary.source_steps), count(summary.horizon)
    told: list[str] = []
    if source_takes_all(summary):
        told.append(
            f"The source has cost {source} steps and the budget is {budget}, so in total steps "
            "nothing is left for the target: there only the jumpstart says something, and the "
            "other measures compare the random policy with scratch."
        )
    elif summary.source_steps > 0.0:
        told.append(
            f"In total steps the budget stays {budget}: an arm is worth what the random policy is "
            f"until its {source} source steps have passed."
        )
    if study.plan.source_policy:
        told.append(
            "All runs of zero-shot and fine-tune start from the one source policy that was brought "
            "along: the intervals say nothing about another policy of the same source."
        )
    if study.plan.individual:
        told.append(
            f"Each seed meets another target, whose {study.plan.individual} is the number of the "
            "seed from 0 on: the intervals are over these, too."
        )
    if study.plan.seeds < _FEW_SEEDS:
        told.append(
            f"With {study.plan.seeds} seeds the intervals are wide: no clear difference does not "
            "mean that there is none."
        )
    return tuple(told)


def _in_target_steps(summary: Summary) -> str:
    """The sentence on fine-tune, counted in target steps."""
    findings = _findings(summary.in_target_steps, summary.unit)
    towards = direction(findings[0].estimate)
    against = {"up": "down", "down": "up", "unclear": ""}[towards]
    text = f"Counted in target steps, transfer {_TRANSFER[towards]}: fine-tune {findings[0].text}"
    for finding in findings[1:]:
        link = " and" if finding is findings[-1] else ","
        text += f"{', but' if direction(finding.estimate) == against else link} {finding.text}"
    return f"{text}."


def _in_total_steps(summary: Summary) -> str:
    """The sentence on fine-tune, counted in total steps."""
    if source_takes_all(summary):
        return _nothing_left(summary)
    gain = summary.in_total_steps.total_reward_gain
    return (
        f"Counted in total steps, {count(summary.source_steps)} of which go to the source, it "
        f"{_TRANSFER[direction(gain)]} (total reward gain {estimate_text(gain, signed=True)}, "
        f"{summary.unit})."
    )


def _findings(measures: Measures, unit: str) -> list[_Finding]:
    """What the three measures of the verdict say of fine-tune; the first one decides."""
    gain, end = measures.total_reward_gain, measures.asymptotic_gain
    found = [
        _Finding(
            {
                "up": "earned more than scratch over the whole of its learning curve",
                "down": "earned less than scratch over the whole of its learning curve",
                "unclear": "earned neither clearly more nor clearly less than scratch over the "
                "whole of its learning curve",
            },
            gain,
            f"total reward gain {estimate_text(gain, signed=True)}, {unit}",
        ),
        _Finding(
            {
                "up": "ended higher",
                "down": "ended lower",
                "unclear": "ended neither clearly higher nor clearly lower",
            },
            end,
            f"asymptotic gain {estimate_text(end, signed=True)}, {unit}",
        ),
    ]
    last = measures.times_to_threshold[-1] if measures.times_to_threshold else None
    if last is not None and last.steps_saved.value is not None:
        reached = f"reached the score {last.threshold:g}"
        found.append(
            _Finding(
                {
                    "up": f"{reached} sooner",
                    "down": f"{reached} later",
                    "unclear": f"{reached} neither clearly sooner nor clearly later",
                },
                last.steps_saved,
                f"{estimate_text(last.steps_saved, signed=True)} steps saved",
            )
        )
    return found


def _nothing_left(summary: Summary) -> str:
    """The sentence on total steps where the source has cost the whole budget."""
    start = summary.in_total_steps.jumpstart
    compared = {
        "up": "fine-tune starts above where scratch has come by then",
        "down": "fine-tune starts below where scratch has come by then",
        "unclear": "fine-tune starts neither clearly above nor clearly below where scratch has "
        "come by then",
    }[direction(start)]
    return (
        "Counted in total steps, the budget cannot show a gain: the source alone has cost "
        f"{count(summary.source_steps)} steps of {count(summary.horizon)}, and {compared} "
        f"(jumpstart {estimate_text(start, signed=True)}, {summary.unit})."
    )


def _untrained(summary: Summary) -> list[str]:
    """The sentences on a policy that was moved and not trained on the target."""
    measures, unit = summary.in_target_steps, summary.unit
    start, end = measures.jumpstart, measures.asymptotic_gain
    late = summary.in_total_steps.jumpstart
    when = (
        f"at its end, though the source has cost {count(summary.source_steps)} steps"
        if source_takes_all(summary)
        else f"after {count(summary.source_steps)} steps, as many as the source has cost"
    )
    better = {"up": "better than", "down": "worse than", "unclear": "not clearly different from"}
    return [
        f"Counted in target steps, transfer {_TRANSFER[direction(start)]} at the start: the moved "
        f"policy, which is not trained on the target, is {better[direction(start)]} an untrained "
        f"one (jumpstart {estimate_text(start, signed=True)}, {unit}) and "
        f"{better[direction(end)]} what scratch ends with (asymptotic gain "
        f"{estimate_text(end, signed=True)}, {unit}).",
        f"Counted in total steps, it is {better[direction(late)]} scratch {when} "
        f"(jumpstart {estimate_text(late, signed=True)}, {unit}).",
    ]


def _end(study: Study, kind: Literal["scratch", "random"]) -> str:
    """Where the runs of a kind ended, with the t-interval."""
    return spread_text(finals(study, kind))
