"""Versions of what a study and a policy are made of, and how two of them differ.

Identities are kept by the part that something plays: "source" and "target", "env" for the only env
of a policy, "learner", and "method NAME" for each arm. Parts without a model and without own files
have none.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import gymnasium as gym
import msgspec

from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import ForeignStudy, ShapechangerError
from shapechanger.files import make_folder, write_atomic
from shapechanger.identity import (
    IdentifiedEnv,
    Identity,
    identify_code,
    identify_env,
    model_changes,
)
from shapechanger.own_modules import texts_in
from shapechanger.transfer.methods import load_method

if TYPE_CHECKING:
    from shapechanger.transfer.learners.settings import Settings
    from shapechanger.transfer.plan import Plan, Run

Identities = dict[str, Identity]
"""Identities by part."""

ENV: Final = "env"
"""Part of the env in a policy's card."""
_LEARNER: Final = "learner"
_METHOD: Final = "method "
_NOTHING: Final = Identity()
_OURS: Final = "shapechanger/"
_MODELS: Final = "models"
_SETTINGS: Final = ("learner", "settings")


def known(identities: Mapping[str, Identity]) -> Identities:
    """Return the parts that have a model or own files."""
    return {part: each for part, each in identities.items() if each != _NOTHING}


def identities_of_code(settings: Settings, arms: Sequence[str] = ()) -> Identities:
    """Return the identities of a learner and of methods.

    Args:
        settings: Settings of the learner, which may name an algorithm of the user's own.
        arms: Names of methods.
    """
    learner = identify_code(texts_in(msgspec.to_builtins(settings)))
    methods = {f"{_METHOD}{arm}": identify_code([arm], load_method(arm)) for arm in arms}
    return known({_LEARNER: learner, **methods})


def identities_in(ref: EnvRef, made: gym.Env[Any, Any], settings: Settings) -> Identities:
    """Return the identities of the env and the learner of a policy.

    Args:
        ref: The env.
        made: The same, before its first reset, which may change its model.
        settings: Settings of the learner.
    """
    one = single_body(ref)
    env = steady(ref, identify_env(made, ref.id)) if one == ref else identify(ref)
    return known({ENV: env.identity, **identities_of_code(settings)})


def identify(ref: EnvRef) -> IdentifiedEnv:
    """Make an env, and return its identity.

    Args:
        ref: The env; one of many bodies has the identity of the unedited one.
    """
    with closing(single_body(ref).make()) as made:
        return steady(ref, identify_env(made, ref.id))


def steady(ref: EnvRef, found: IdentifiedEnv) -> IdentifiedEnv:
    """Return an identity without its model if the env draws another one each time it is made.

    Args:
        ref: The env; only those of others may draw.
        found: Its identity.
    """
    if not found.numbers or ref.id.startswith(_OURS):
        return found
    with closing(single_body(ref).make()) as made:
        again = identify_env(made, ref.id).identity
    if again == found.identity:
        return found
    return IdentifiedEnv(Identity(files=found.identity.files), b"")


def single_body(ref: EnvRef) -> EnvRef:
    """Return the env of one body, where a reference stands for many."""
    return EnvRef(ref.id, {name: v for name, v in ref.kwargs.items() if name != "bodies"})


def parts_of(plan: Plan, run: Run) -> Identities:
    """Return the identities that a run depends on."""
    from shapechanger.transfer.plan import NO_SKILL, SOURCE

    parts = {"target"} if run.kind in NO_SKILL else {"target", _LEARNER, f"{_METHOD}{run.kind}"}
    if run.kind == SOURCE:
        parts = {"source", _LEARNER}
    elif run.kind not in NO_SKILL and load_method(run.kind).uses_source:
        parts.add("source")
    return {part: each for part, each in plan.identity.items() if part in parts}


def shared(mine: Plan, theirs: Plan) -> Iterator[tuple[str, Identity, Identity]]:
    """Yield the parts that two plans name alike: a title, my identity and theirs."""
    envs = ("source", "target")
    for part in envs:
        for other in envs:
            ref: EnvRef = getattr(mine.task, part)
            if ref == getattr(theirs.task, other):
                yield f"{ref}", *_pair(mine, part, theirs, other)
    if all(getattr(mine, name) == getattr(theirs, name) for name in _SETTINGS):
        yield f"the learner {mine.learner}", *_pair(mine, _LEARNER, theirs, _LEARNER)
    for arm in (arm for arm in mine.arms if arm in theirs.arms):
        yield f"the method {arm}", *_pair(mine, _METHOD + arm, theirs, _METHOD + arm)


def _pair(mine: Plan, part: str, theirs: Plan, other: str) -> tuple[Identity, Identity]:
    return mine.identity.get(part, _NOTHING), theirs.identity.get(other, _NOTHING)


def changes_between(old: Plan, new: Plan, *folders: Path) -> str:
    """Return how what two plans name alike has changed; empty if it has not.

    Args:
        old: The older plan.
        new: The newer one.
        folders: Folders of the two studies, which may hold the numbers of their models.
    """
    found = {
        title: before.changes_to(after, _numbers(before, after, new, folders))
        for title, after, before in shared(new, old)
        if before != after
    }
    return "; ".join(f"{title}: {words}" for title, words in found.items())


def _numbers(
    before: Identity, after: Identity, new: Plan, folders: Sequence[Path]
) -> Sequence[str]:
    """Return the differences of two models as far as their numbers can be found."""
    if not (before.model and after.model):
        return ()
    old = _kept(before, folders)
    present = _kept(after, folders) or next(
        (each.numbers for each in _present(new) if each.identity.model == after.model), b""
    )
    try:
        return model_changes(old, present) if old and present else ()
    except msgspec.MsgspecError:  # Only words of a message are lost.
        return ()


def _present(plan: Plan) -> Iterator[IdentifiedEnv]:
    """Yield the present versions of a plan's envs, as far as they can be made."""
    for ref in (plan.task.source, plan.task.target):
        try:
            yield identify(ref)
        except ShapechangerError:
            continue


def _kept(identity: Identity, folders: Sequence[Path]) -> bytes:
    files = (_model_file(folder, identity) for folder in folders)
    return next((file.read_bytes() for file in files if file.is_file()), b"")


def _model_file(folder: Path, identity: Identity) -> Path:
    return folder / _MODELS / f"{identity.model}-{identity.sensed}.msgpack"


def keep_models(folder: Path, *envs: IdentifiedEnv) -> None:
    """Write the numbers of models beside a study, so that a later change can be named.

    Args:
        folder: Folder of the study.
        envs: Its envs.

    Raises:
        OutputError: If they cannot be written.
    """
    for each in envs:
        file = _model_file(folder, each.identity)
        if each.numbers and not file.exists():
            make_folder(file.parent)
            write_atomic(file, each.numbers)


def require_versions(wanted: Plan, parts: Identities, found: Identities, remedy: str) -> None:
    """Refuse parts that are no longer those of a plan.

    Args:
        wanted: The plan.
        parts: The parts of it that count.
        found: The present ones.
        remedy: What the user can do, as the end of a sentence.

    Raises:
        ForeignStudy: If a part has changed.
    """
    if words := differences(wanted, parts, found):
        raise ForeignStudy(f"What this study was planned with has changed. {words}. {remedy}")


def differences(plan: Plan, old: Identities, new: Identities) -> str:
    """Return how parts of a plan differ, in words; empty if they do not.

    Args:
        plan: The plan.
        old: The parts.
        new: The same of a newer version.
    """
    titles = {"source": f"{plan.task.source}", "target": f"{plan.task.target}"}
    changed = {
        titles.get(part, f"the {part}"): old.get(part, _NOTHING).changes_to(new.get(part, _NOTHING))
        for part in sorted({*old, *new})
    }
    return "; ".join(f"{title}: {words}" for title, words in changed.items() if words)


def require_planned(plan: Plan, run: Run) -> None:
    """Refuse a run whose robot, task, method or learner is not the planned one in this process.

    A file may be edited while a study runs, and another node of a cluster may have another version.

    Raises:
        ForeignStudy: If something has changed.
    """
    parts = parts_of(plan, run)
    arms = [run.kind] if _METHOD + run.kind in parts else []
    code = identities_of_code(plan.settings, arms)
    found = {part: each for part, each in code.items() if part in parts}
    for part in ("source", "target"):
        # A robot is not connected to once more.
        if part in parts and not (plan.exclusive and part == "target"):
            ref: EnvRef = getattr(plan.task, part)
            found[part] = identify(ref).identity
        elif part in parts:
            found[part] = parts[part]
    remedy = "Restore it and run the same command again, or start again with another --out."
    require_versions(plan, parts, found, remedy)


def require_same_env(
    card: Mapping[str, Identity], ref: EnvRef, made: Identity, policy: object, remedy: str
) -> None:
    """Refuse a policy whose env has changed since its training.

    Args:
        card: Identities of its card.
        ref: The env.
        made: Its present identity.
        policy: The policy's file, for the message.
        remedy: What the user can do, as the end of a sentence.

    Raises:
        ForeignStudy: If it has.
    """
    if words := card.get(ENV, _NOTHING).changes_to(made):
        raise ForeignStudy(f"{ref} has changed since {policy} was trained in it: {words}. {remedy}")
