"""Identities of the parts of a study, and the differences between two studies.

The keys are "source", "target", "learner", and "method NAME" for each arm. A part that has neither
a model nor custom files has no identity.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from shapechanger.errors import ForeignStudy
from shapechanger.identity import identify_code
from shapechanger.transfer.identities import (
    LEARNER,
    NOTHING,
    Identities,
    identify,
    identify_learner,
    known,
)
from shapechanger.transfer.methods import load_method
from shapechanger.transfer.plan import NO_SKILL, SOURCE, Plan, Run

_METHOD: Final = "method "


def identities_of_code(settings: object, arms: Sequence[str] = ()) -> Identities:
    """Return the identities of a learner and of methods."""
    methods = {f"{_METHOD}{arm}": identify_code([arm], load_method(arm)) for arm in arms}
    return known({LEARNER: identify_learner(settings), **methods})


def parts_of(plan: Plan, run: Run) -> Identities:
    """Return the identities that a run depends on."""
    parts = {"target"} if run.kind in NO_SKILL else {"target", LEARNER, f"{_METHOD}{run.kind}"}
    if run.kind == SOURCE:
        parts = {"source", LEARNER}
    elif run.kind not in NO_SKILL and load_method(run.kind).uses_source:
        parts.add("source")
    return {part: each for part, each in plan.identity.items() if part in parts}


def changes_between(old: Plan, new: Plan) -> str:
    """Describe how the common parts of two plans differ; empty if they are equal."""
    mine, theirs = ({"source": p.task.source, "target": p.task.target} for p in (new, old))
    common = [(f"{mine[a]}", a, b) for a in mine for b in theirs if mine[a] == theirs[b]]
    if (new.learner, new.settings) == (old.learner, old.settings):
        common.append((f"the learner {new.learner}", LEARNER, LEARNER))
    arms = [arm for arm in new.arms if arm in old.arms]
    common += [(f"the method {arm}", _METHOD + arm, _METHOD + arm) for arm in arms]
    found: dict[str, str] = {}
    for title, part, other in common:
        before, after = old.identity.get(other, NOTHING), new.identity.get(part, NOTHING)
        if before != after:
            found[title] = before.changes_to(after)
    return "; ".join(f"{title}: {text}" for title, text in found.items())


def differences(plan: Plan, old: Identities, new: Identities) -> str:
    """Describe how identities of a plan's parts differ; empty if they are equal."""
    titles = {"source": f"{plan.task.source}", "target": f"{plan.task.target}"}
    changed = {
        titles.get(part, f"the {part}"): old.get(part, NOTHING).changes_to(new.get(part, NOTHING))
        for part in sorted({*old, *new})
    }
    return "; ".join(f"{title}: {text}" for title, text in changed.items() if text)


def require_planned(plan: Plan, run: Run) -> None:
    """Refuse a run if its robot, task, method or learner differs from the plan in this process.

    A file may be edited while a study runs, and another node of a cluster may have another version.
    """
    parts = parts_of(plan, run)
    arms = [run.kind] if _METHOD + run.kind in parts else []
    code = identities_of_code(plan.settings, arms)
    found = {part: each for part, each in code.items() if part in parts}
    for part, ref in (("source", plan.task.source), ("target", plan.task.target)):
        if part in parts:
            # Do not connect to a robot a second time.
            is_robot = plan.exclusive and part == "target"
            found[part] = parts[part] if is_robot else identify(ref)
    if text := differences(plan, parts, found):
        raise ForeignStudy(
            f"An env or code of this study has changed since its plan. {text}. Restore it and run "
            "the same command again, or start again with another --out."
        )
