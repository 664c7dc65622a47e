"""Parsing of env ids, bodies, options and seeds."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Final, Literal, cast

import gymnasium as gym
import tyro

from shapechanger.contract.env_ref import EnvRef
from shapechanger.envs.catalogue import CATALOGUE
from shapechanger.envs.naming import allow_own_modules
from shapechanger.errors import (
    MorphologyError,
    StudyError,
    check_seed,
    no_policy_file,
)
from shapechanger.transfer.executor import Executor, Processes
from shapechanger.transfer.references import reference_policy

EnvId = Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ENV")]
"""Argument: the id of an env."""
Body = Annotated[str, tyro.conf.arg(help="Another body of the family: its name, or edits as JSON.")]
"""Option: the body of an env."""
EnvOptions = Annotated[
    str, tyro.conf.arg(help="More arguments of the env as JSON, such as '{\"frame_skip\": 4}'.")
]
"""Option: more arguments of an env."""
OwnLearner = Annotated[
    str,
    tyro.conf.arg(
        help="Your class or function that the policy was trained with, as module:name; the file "
        "alone may not import it."
    ),
]
"""Option: the algorithm that a policy's file names."""
ExecutorKind = Annotated[
    Literal["processes", "ray"],
    tyro.conf.arg(help="Where runs run: in processes of this machine, or on a Ray cluster."),
]
"""Option: what runs the jobs of a study."""
ClusterAddress = Annotated[
    str | None,
    tyro.conf.arg(
        help="Address of the Ray cluster, as 10.0.0.1:6379 or auto; Ray on this machine if not "
        "given."
    ),
]
"""Option: the Ray cluster of a study."""
_REFERENCE: Final = "reference"


def asked(env: gym.Env[Any, Any], ability: str) -> Any:
    """Return a method that an env offers beyond Gymnasium's."""
    offered = getattr(env.unwrapped, ability, None)
    if offered is None:
        name = env.spec.id if env.spec else type(env.unwrapped).__name__
        raise MorphologyError(f"{name} offers no {ability}; these envs do: {', '.join(CATALOGUE)}.")
    return offered


@contextmanager
def opened(env: EnvRef, **more: Any) -> Generator[gym.Env[Any, Any]]:
    """Make an env and close it afterwards."""
    made = env.make(**more)
    try:
        yield made
    finally:
        made.close()


def options_of(given: str, flag: str) -> dict[str, Any]:
    """Parse further arguments of an env."""
    if not given:
        return {}
    try:
        options = json.loads(given)
    except ValueError as error:
        raise StudyError(f"{flag} must be JSON ({error}), got {given!r}.") from None
    if not isinstance(options, dict):
        raise StudyError(f'{flag} are a JSON object such as {{"robot": "mine"}}, got {given}.')
    task = cast("dict[str, Any]", options).get("task")
    allow_own_modules(task if isinstance(task, str) else None)
    return cast("dict[str, Any]", options)


def executor_of(kind: str, workers: int | None, address: str | None) -> Executor:
    """Return the executor of a study's jobs.

    Args:
        kind: "processes" or "ray".
        workers: Number of processes; None for one per core.
        address: Address of the Ray cluster; None to start Ray on this machine.
    """
    if kind == "ray":
        if workers is not None:
            raise StudyError("Ray runs one run on each core of its nodes: leave out --workers.")
        from shapechanger.transfer.ray_executor import RayCluster  # An extra.

        return RayCluster(address)
    if address is not None:
        raise StudyError("--address names a Ray cluster: give --executor ray, too.")

    return Processes(workers)


def policy_file(given: Path, env: EnvRef) -> Path:
    """Return a policy's file: the one given, or the one that ships for an env."""
    if given.exists():
        return given
    if str(given) == _REFERENCE:
        return reference_policy(env.id)

    raise StudyError(no_policy_file(given, [_REFERENCE]))


def settings_of(given: Sequence[str]) -> dict[str, Any]:
    """Parse settings of a learner."""
    settings: dict[str, Any] = {}
    for text in given:
        name, equals, value = text.partition("=")
        try:
            parsed = tomllib.loads(f"value = {value}") if equals and name else {}
        except tomllib.TOMLDecodeError:
            parsed = {}
        if len(parsed) != 1:
            raise StudyError(
                f"A setting is written NAME=VALUE, such as learning_rate=3e-4 or "
                f"net_arch=[64,64], not {text!r}."
            )
        if name in settings:
            raise StudyError(f"--set names {name} more than once.")
        settings[name] = parsed["value"]
    return settings


def require_seed(seed: int) -> None:
    """Refuse a seed that a random generator does not accept."""
    check_seed(seed, StudyError)
