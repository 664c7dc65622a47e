"""The page of a suite: a matrix of all pairs, methods by target, curves and films."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shapechanger.errors import StudyError
from shapechanger.reports.numbers import count, number
from shapechanger.reports.page import render
from shapechanger.transfer.metrics.curves import Reference
from shapechanger.transfer.metrics.intervals import (
    Estimate,
    interquartile_mean,
    probability_of_improvement,
)
from shapechanger.transfer.report.study import labels
from shapechanger.transfer.report.verdict import (
    LEAST_SEEDS,
    estimate_text,
    finals,
    finding,
    gain_over_scratch,
    machine_text,
    more_seeds,
    outcome,
)
from shapechanger.transfer.study import Study

# Colours of the largest gain and the largest loss in the heat map, as red, green and blue.
_HELPED: Final = (0, 114, 178)
_HURT: Final = (213, 94, 0)
# Largest share of the full colour, so that black text can be read on it.
_STRONGEST: Final = 0.55


class FilmStrip(NamedTuple):
    """One policy's behaviour as a row of images."""

    caption: str
    jpeg: bytes


class Sweep(NamedTuple):
    """A property in which the targets of a suite differ, with its value for each study."""

    name: str
    values: Mapping[str, float]


def suite_html(
    name: str,
    studies: Mapping[str, Study],
    *,
    seeds: int,
    strips: Mapping[str, Sequence[FilmStrip]] | None = None,
    films: Mapping[str, str] | None = None,
    sweep: Sweep | None = None,
) -> str:
    """Render the page of a suite."""
    if not studies:
        raise StudyError(f"The suite {name} has no finished study to make a page of.")
    # Imported here, because it imports Matplotlib.
    from shapechanger.transfer.report.curves import learning_curves, sweep_chart

    first = next(iter(studies.values()))
    arm, plan = first.headline_arm, first.plan
    tasks = [study.plan.task for study in studies.values()]
    names = labels(*(env for task in tasks for env in (task.source, task.target)))
    swept = sweep and sweep_chart(
        {sweep.values[one]: study for one, study in studies.items()}, sweep.name
    )
    return render(
        Path(__file__).with_name("suite.html"),
        title=name,
        arm=arm,
        basis="scratch, averaged over the target steps"
        if first.curves(arm).n_evals > 1
        else "the end of scratch, without training",
        measure=plan.measure,
        unit="" if plan.unit == "1" else plan.unit,
        verdict=_verdict(studies),
        looks=_looks(studies, seeds),
        matrix=_matrix(studies, names),
        sweep=swept,
        methods=_methods(studies, names),
        studies=[
            {
                "name": one,
                "finding": finding(study),
                "curves": learning_curves(study, "target")["target"],
                "film": (films or {}).get(one, ""),
                "strips": [(strip.caption, strip.jpeg) for strip in (strips or {}).get(one, ())],
            }
            for one, study in studies.items()
        ],
        settings=_settings(studies),
    )


def _verdict(studies: Mapping[str, Study]) -> str:
    arm = next(iter(studies.values())).headline_arm
    found = Counter(outcome(study, study.headline_arm) for study in studies.values())
    over = "one study" if len(studies) == 1 else f"{len(studies)} studies"
    sentences: list[str] = []
    if found["too few"] < len(studies):
        text = (
            f"Over {over}, {arm} is ahead of scratch in {found['up']}, behind in {found['down']}, "
            f"and without a clear difference in {found['unclear']}"
        )
        more = {"unlearned": "neither learned in", "no interval": "there is no interval in"}
        parts = [text, *(f"{label} {found[one]}" for one, label in more.items() if found[one])]
        sentences.append(f"{'; '.join(parts)}.")
    if found["too few"]:
        sentences.append(more_seeds("suite"))
    return " ".join(sentences)


def _looks(studies: Mapping[str, Study], declared: int) -> str:
    """State which numbers of seeds were declared, are present, and were evaluated before."""
    now = {study.plan.seeds for study in studies.values()}
    grown = sorted({study.looks for study in studies.values() if len(study.looks) > 1})
    text = f"The suite declares {declared} seeds"
    if now == {declared}:
        text += ", and every study has them."
    else:
        text += f"; the studies have {_listed(sorted(now))}"
        text += ", so these are interim results." if min(now) < declared else "."
    if grown:
        text += (
            " Results were also computed on the way, with "
            f"{_listed([look for looks in grown for look in looks[:-1]])} seeds: intervals hold "
            "for the declared number only."
        )
    return text


def _listed(numbers: Sequence[int]) -> str:
    return " and ".join(str(each) for each in dict.fromkeys(numbers))


def _matrix(studies: Mapping[str, Study], names: Mapping[str, str]) -> dict[str, Any] | None:
    """Return a table of gains by source and target; None if there are too few pairs for one."""
    pairs = {
        (names[str(study.plan.task.source)], names[str(study.plan.task.target)]): (one, study)
        for one, study in studies.items()
    }
    sources, targets = (list(dict.fromkeys(pair[side] for pair in pairs)) for side in (0, 1))
    if len(sources) < 2 or len(studies) < 3:
        return None
    # Targets that are also sources come first, in the order of the sources.
    targets.sort(key=lambda one: sources.index(one) if one in sources else len(sources))
    gains = {
        pair: gain_over_scratch(study, study.headline_arm) for pair, (_, study) in pairs.items()
    }
    widest = max((abs(gain.value or 0.0) for gain in gains.values()), default=0.0) or 1.0

    def colour(share: float) -> str:
        """Return the CSS colour of a gain divided by the largest, -1 to 1."""
        full = _HELPED if share >= 0.0 else _HURT
        mixed = (round(255 + _STRONGEST * abs(share) * (part - 255)) for part in full)
        return "#{:02x}{:02x}{:02x}".format(*mixed)

    cells = {
        pair: {
            "name": one,
            "gain": estimate_text(gains[pair], signed=True),
            "colour": colour((gains[pair].value or 0.0) / widest),
            "ends": ", ".join(
                f"{arm} {number(float(finals(study, arm).mean()), 2)}" for arm in study.plan.arms
            ),
        }
        for pair, (one, study) in pairs.items()
    }
    return {"sources": sources, "targets": targets, "cells": cells}


def _methods(studies: Mapping[str, Study], names: Mapping[str, str]) -> list[tuple[str, ...]]:
    """Return rows of each arm's scores and chance to beat scratch, by target and in total."""
    by_target: dict[str, list[Study]] = {}
    for study in studies.values():
        by_target.setdefault(names[str(study.plan.task.target)], []).append(study)
    rows: list[tuple[str, ...]] = []
    merged: dict[str, list[NDArray[np.float64]]] = {}
    for target, some in by_target.items():
        scores = _score_ends(some)
        rows += _method_rows(target, scores, len(some))
        for arm, groups in scores.items():
            merged.setdefault(arm, []).extend(groups)
    if len(by_target) > 1:
        rows += _method_rows("all targets", merged, len(studies))
    return rows


def _score_ends(studies: Sequence[Study]) -> dict[str, list[NDArray[np.float64]]]:
    """Return final scores of each arm, 1 for the target's reference or best arm; empty if none."""
    values = {
        arm: [finals(study, arm) for study in studies if arm in study.plan.arms]
        for arm in dict.fromkeys(arm for study in studies for arm in study.plan.arms)
    }
    scales = [next(iter(study.summaries.values())).reference for study in studies]
    zero = max(scale.zero for scale in scales)
    one = max(float(group.mean()) for groups in values.values() for group in groups)
    if scales[0].shipped:
        one = scales[0].one
    reference = Reference(zero, one)
    if not reference.defined:
        return {}
    return {
        arm: [(group - zero) / (one - zero) for group in groups] for arm, groups in values.items()
    }


def _method_rows(
    target: str, scores: Mapping[str, list[NDArray[np.float64]]], n_studies: int
) -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for arm, groups in scores.items():
        rng = np.random.default_rng(0)
        few = max(group.size for group in groups) < LEAST_SEEDS

        def text(estimate: Estimate, few: bool = few) -> str:
            # If all resamples are equal, they do not define an interval.
            if few or estimate.low == estimate.high:
                estimate = Estimate(estimate.value)
            return estimate_text(estimate)

        better = "baseline"
        if arm != "scratch" and len(groups) == n_studies:
            better = text(probability_of_improvement(groups, scores["scratch"], rng=rng))
        elif arm != "scratch":
            better = f"only in {len(groups)} of {n_studies} studies"
        mean = text(interquartile_mean(groups, rng=rng))
        rows.append((target, arm, str(sum(group.size for group in groups)), mean, better))
    return rows


def _settings(studies: Mapping[str, Study]) -> list[tuple[str, str]]:
    """Return the settings, versions and cost of the studies."""
    plans = [study.plan for study in studies.values()]
    first = next(iter(studies.values()))
    hours = sum(run.wall_s for study in studies.values() for run in study.runs) / 3600.0
    return [
        ("Command", first.command or "called from Python"),
        ("Learner", ", ".join(dict.fromkeys(plan.learner for plan in plans))),
        ("Target steps", _listed([plan.steps for plan in plans])),
        ("Source steps", _listed([plan.source_steps for plan in plans])),
        ("Seed", _listed([plan.seed for plan in plans])),
        ("Machine", machine_text(studies.values())),
        ("Time", f"{number(hours, 1)} h for all runs; shared runs count in each study"),
        ("Runs", count(sum(len(study.runs) for study in studies.values()))),
        ("Versions", ", ".join(f"{name} {version}" for name, version in plans[0].versions.items())),
    ]
