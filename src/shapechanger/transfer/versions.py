"""Versions of a study's parts, and the differences between two studies.

Identities are kept by the part that something plays: "source" and "target", "learner", and "method
NAME" for each arm. Parts without a model and without own files have none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

import msgspec

from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import ForeignStudy, ShapechangerError
from shapechanger.files import make_folder, write_atomic
from shapechanger.identity import IdentifiedEnv, Identity, identify_code
from shapechanger.registry import MODELS
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
_MODELS: Final = "models"


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


def _common(mine: Plan, theirs: Plan) -> Iterator[tuple[str, str, str]]:
    """Yield the parts that two plans have in common: a title, and the part in each of them."""
    envs = ("source", "target")
    for part in envs:
        for other in envs:
            ref: EnvRef = getattr(mine.task, part)
            if ref == getattr(theirs.task, other):
                yield f"{ref}", part, other
    if (mine.learner, mine.settings) == (theirs.learner, theirs.settings):
        yield f"the learner {mine.learner}", LEARNER, LEARNER
    for arm in (arm for arm in mine.arms if arm in theirs.arms):
        yield f"the method {arm}", _METHOD + arm, _METHOD + arm


def changes_between(old: Plan, new: Plan, *folders: Path) -> str:
    """Describe how the common parts of two plans differ; empty if they do not."""
    found: dict[str, str] = {}
    for title, part, other in _common(new, old):
        before, after = old.identity.get(other, NOTHING), new.identity.get(part, NOTHING)
        if before != after:
            found[title] = before.changes_to(after, _numbers(before, after, new, folders))
    return "; ".join(f"{title}: {text}" for title, text in found.items())


def _numbers(
    before: Identity, after: Identity, new: Plan, folders: Sequence[Path]
) -> Sequence[str]:
    """Return the differences of two models as far as their numbers can be found."""
    if not (before.model and after.model):
        return ()
    old, present = _kept(before, folders), _kept(after, folders)
    for ref in (new.task.source, new.task.target):
        with suppress(ShapechangerError):  # An env that cannot be made.
            if not present and (found := identify(ref)).identity.model == after.model:
                present = found.numbers
    with suppress(msgspec.MsgspecError):  # Only words of a message are lost.
        return MODELS.load("mujoco").changed_numbers(old, present) if old and present else ()
    return ()


def _kept(identity: Identity, folders: Sequence[Path]) -> bytes:
    files = (_model_file(folder, identity) for folder in folders)
    return next((file.read_bytes() for file in files if file.is_file()), b"")


def _model_file(folder: Path, identity: Identity) -> Path:
    return folder / _MODELS / f"{identity.model}-{identity.sensed}.msgpack"


def keep_models(folder: Path, *envs: IdentifiedEnv) -> None:
    """Write the numbers of models into a study's folder, so that a later change can be named."""
    for each in envs:
        file = _model_file(folder, each.identity)
        if each.numbers and not file.exists():
            make_folder(file.parent)
            write_atomic(file, each.numbers)


def differences(plan: Plan, old: Identities, new: Identities) -> str:
    """Describe how parts of a plan differ; empty if they do not."""
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
            # A robot is not connected to once more.
            is_robot = plan.exclusive and part == "target"
            found[part] = parts[part] if is_robot else identify(ref).identity
    if text := differences(plan, parts, found):
        raise ForeignStudy(
            f"What this study was planned with has changed. {text}. Restore it and run the same "
            "command again, or start again with another --out."
        )
