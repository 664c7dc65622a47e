"""Resolve settings of learners: shipped presets, and files or classes of a user."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import msgspec

from shapechanger.errors import StudyError, UnknownName, require_known
from shapechanger.files import converted, place_of, read_toml
from shapechanger.registry import LEARNERS as KINDS
from shapechanger.transfer.learners import LearnerSettings
from shapechanger.transfer.learners.settings import ImportedSettings

_Kind = TypeVar("_Kind", bound=msgspec.Struct)
# Keys of a preset that are not settings.
_ABOUT: Final = ("kind", "like", "tuned_on", "in_many_bodies")


@cache
def _tables() -> dict[str, dict[str, Any]]:
    return tomllib.loads(Path(__file__).with_name("presets.toml").read_text("utf-8"))


class _Presets(Mapping[str, LearnerSettings]):
    """Shipped settings, keyed by name; each preset is converted when it is accessed."""

    def __getitem__(self, name: str) -> LearnerSettings:
        table = _tables()[name]
        # Missing values come from the preset named by `like`.
        while like := table.get("like"):
            table = {**_tables()[like], **{n: v for n, v in table.items() if n != "like"}}
        values = {key: value for key, value in table.items() if key not in _ABOUT}
        return _converted(name, KINDS.load(table["kind"]), values)

    def __iter__(self) -> Iterator[str]:
        return iter(_tables())

    def __len__(self) -> int:
        return len(_tables())


LEARNERS: Final[Mapping[str, LearnerSettings]] = _Presets()
"""The shipped settings, keyed by name."""


def in_many_bodies(name: str) -> str:
    """Return the preset that replaces a preset in many bodies; the same preset if none does."""
    return _tables().get(name, {}).get("in_many_bodies", name)


def tuned_on(name: str) -> tuple[str, ...]:
    """Return the envs that the settings of a learner were tuned on; empty if unknown."""
    return tuple(_tables().get(name, {}).get("tuned_on", ()))


def tuning_text(learner: str, env: str) -> str:
    """State whether the settings of a learner were tuned on an env."""
    if not (names := tuned_on(learner)):
        return "It is not stated what these settings were tuned on."
    name = env.rpartition("/")[2].removesuffix("-v1")
    *first, last = names
    tuned = f"{', '.join(first)} and {last}" if first else last
    text = f"The settings were tuned on {tuned}"
    return f"{text}." if name in names else f"{text}, not on {name}."


def learner_settings(name: str) -> LearnerSettings:
    """Return the shipped settings of a learner."""
    require_known("learner", LEARNERS, name)
    return LEARNERS[name]


def resolve_learner(learner: str, changed: Mapping[str, Any]) -> tuple[str, LearnerSettings]:
    """Return the name and the settings of a learner, with some of them replaced.

    Args:
        learner: Name of shipped settings; a TOML file; the name of a kind of learner that another
            package adds; or `module:name`, a class of models that is compatible with
            Stable-Baselines3, or a function that builds one.
        changed: New values, keyed by name, of the types of TOML and JSON. With `module:name`,
            unknown names are arguments of the class or function.

    Raises:
        UnknownName: If there is no such learner, or it has no such setting.
        StudyError: If a value is wrong, or the file cannot be read.
    """
    if learner.endswith(".toml"):
        return _read_learner(Path(learner), changed)
    if ":" in learner:
        from shapechanger.transfer.learners.policy_file import checked_settings  # Imports PyTorch.

        ours = {field.name for field in msgspec.structs.fields(ImportedSettings)}
        values = {name: value for name, value in changed.items() if name in ours}
        values["arguments"] = {n: value for n, value in changed.items() if n not in ours}
        values = {"algorithm": learner, **values}
        return learner, checked_settings(_converted(learner, ImportedSettings, values))
    if learner not in LEARNERS and learner in KINDS.added():
        return learner, _converted(learner, KINDS.load(learner), dict(changed))
    settings = learner_settings(learner)
    known: dict[str, Any] = msgspec.structs.asdict(cast("Any", settings))
    require_known(f"setting of {learner}", known, *changed)
    kind = cast("Any", type(settings))
    return learner, _converted(learner, kind, {**msgspec.to_builtins(settings), **changed})


def _read_learner(path: Path, changed: Mapping[str, Any]) -> tuple[str, LearnerSettings]:
    """Read a TOML file that names a preset or an algorithm, and changes some of its settings."""
    text, given = read_toml(path, "learner", LEARNERS)
    start = given.pop("preset", None) or given.pop("algorithm", None)
    if not isinstance(start, str) or start.endswith(".toml"):
        raise StudyError(
            f"{path} must name a starting point: `preset` is one of {', '.join(LEARNERS)}, or "
            "`algorithm` is a class or function as module:name."
        )
    try:
        _, settings = resolve_learner(start, {**given, **changed})
    except (StudyError, UnknownName) as error:
        raise StudyError(f"{path}{place_of(text, error)}: {error}") from error
    return path.stem, settings


def _converted(name: str, kind: type[_Kind], values: dict[str, Any]) -> _Kind:
    return converted(values, kind, StudyError, f"The settings of {name} are wrong")
