"""Suites in TOML files: envs, learner, budget and arms of several studies."""

from __future__ import annotations

import json
import re
from collections.abc import Generator
from contextlib import contextmanager
from itertools import permutations, product
from pathlib import Path
from typing import Annotated, Any, Final

import msgspec

from shapechanger.contract.env_ref import EnvRef
from shapechanger.envs.catalogue import driven, env_ref, short_name
from shapechanger.errors import StudyError, UnknownName
from shapechanger.files import place_of, read_text, read_toml
from shapechanger.transfer.plan import TransferTask

_SHIPPED: Final = Path(__file__).parent / "suites"


class _Body(msgspec.Struct, forbid_unknown_fields=True):
    """An env, with another body, lenses or arguments if they are given."""

    env: str
    name: str = ""
    body: str | list[dict[str, Any]] = ""
    lenses: tuple[str, ...] = ()
    options: dict[str, Any] = {}


class _Sweep(msgspec.Struct, forbid_unknown_fields=True):
    """Targets that differ in one number of one edit."""

    env: str
    edit: dict[str, Any]
    field: str
    values: tuple[float, ...]


_Env = str | _Body


class SuiteFile(msgspec.Struct, forbid_unknown_fields=True):
    """Contents of a suite's file: `envs`, or `pairs`, or `sources` with `targets`, `sweep` or both.

    Attributes:
        name: Title of the suite's page; the file's name without its suffix if not given.
        learner: Name of the learner; empty for the target's default.
        arms: Arms of each study; empty for scratch, zero-shot and fine-tune.
        steps: Target steps of a run; None for the learner's number.
        source_steps: Source steps of a source policy; None for the learner's number.
    """

    name: Annotated[str, msgspec.Meta(min_length=1)] = ""
    envs: tuple[_Env, ...] = ()
    pairs: tuple[tuple[_Env, _Env], ...] = ()
    sources: tuple[_Env, ...] = ()
    targets: tuple[_Env, ...] = ()
    sweep: _Sweep | None = None
    learner: str = ""
    settings: dict[str, Any] = {}
    arms: tuple[str, ...] = ()
    measure: str = ""
    seeds: int = 5
    steps: int | None = None
    source_steps: int | None = None
    seed: int = 0


def shipped_suites() -> tuple[str, ...]:
    """Return the names of the suites that come with Shapechanger."""
    return tuple(sorted(path.stem for path in _SHIPPED.glob("*.toml")))


def load_suite(name: str) -> SuiteFile:
    """Load a suite by its name, or from a file."""
    path = _SHIPPED / f"{name}.toml" if name in shipped_suites() else Path(name)
    text, given = read_toml(path, "suite", shipped_suites())
    try:
        return msgspec.convert({"name": path.stem, **given}, SuiteFile)
    except msgspec.ValidationError as error:
        reason: Exception = error
        if unknown := re.search(r"unknown field `(\w+)`(?: - at `\$\.(\w+))?", str(error)):
            key, table = unknown.groups()
            kind = {None: SuiteFile, "sweep": _Sweep}.get(table, _Body)
            known = [field.name for field in msgspec.structs.fields(kind)]
            reason = UnknownName(f"key in {table}" if table else "key of a suite", key, known)
        sentence = str(reason).rstrip(".")
        raise StudyError(f"{path}{place_of(text, reason)}: {sentence}.") from None


@contextmanager
def located_errors(name: str) -> Generator[None]:
    """Begin the message of an error about a name in a suite's file with the file and the line."""
    try:
        yield
    except (StudyError, UnknownName) as error:
        path = Path(name)
        if where := path.is_file() and place_of(read_text(path), error):
            raise StudyError(f"{path}{where}: {error}") from error
        raise


def suite_tasks(suite: SuiteFile) -> list[tuple[str, TransferTask]]:
    """Return the name and the task of each study of a suite."""
    ways = [bool(suite.envs), bool(suite.pairs), bool(suite.sources)]
    if sum(ways) != 1 or bool(suite.sources) != bool(suite.targets or suite.sweep):
        raise StudyError(
            "A suite names its studies in one way: as envs, as pairs, or as sources with targets "
            "or a sweep."
        )
    targets = [*suite.targets]
    if sweep := suite.sweep:
        targets += [
            _Body(sweep.env, f"{sweep.env}-{value:g}", [{**sweep.edit, sweep.field: value}])
            for value in sweep.values
        ]
    pairs = [*permutations(suite.envs, 2), *suite.pairs, *product(suite.sources, targets)]
    tasks = [
        (f"{_name(one)}-to-{_name(other)}", TransferTask(_ref(one), _ref(other)))
        for one, other in pairs
    ]
    names = [name for name, _ in tasks]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise StudyError(f"Several studies are called {twice[0]}: give their envs a `name`.")
    return tasks


def _ref(env: _Env) -> EnvRef:
    if isinstance(env, str):
        return driven(env_ref(env))
    body = env.body if isinstance(env.body, str) else json.dumps(env.body)
    return driven(env_ref(env.env, body), env.lenses).having(env.options)


def _name(env: _Env) -> str:
    """Return the env's name as a part of a folder's name."""
    if isinstance(env, str):
        return short_name(env)
    return env.name or "-".join([short_name(env.env), *env.lenses])
