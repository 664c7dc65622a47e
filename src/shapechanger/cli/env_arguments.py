"""Options that commands share: envs, bodies, policies and learners."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Final, cast

import gymnasium as gym
import tyro

from shapechanger.contract.env_ref import EnvRef
from shapechanger.envs.catalogue import CATALOGUE, allow_own_modules, driven, env_ref
from shapechanger.errors import MorphologyError, StudyError, no_policy_file
from shapechanger.transfer.references import reference_policy

EnvId = Annotated[
    str,
    tyro.conf.Positional,
    tyro.conf.arg(metavar="ENV", help="Id of the env, such as BigAnt or shapechanger/BigAnt-v1."),
]
Body = Annotated[str, tyro.conf.arg(help="Another body of the family: its name, or edits as JSON.")]
OwnLearner = Annotated[
    str,
    tyro.conf.arg(
        help="Your class or function that the policy was trained with, as module:name. It is "
        "imported only if you give it here."
    ),
]
Learner = Annotated[
    str,
    tyro.conf.arg(
        help="Name of the learner's settings, a TOML file with settings, or your class or function "
        "as module:name; by default the settings tuned for the env, or for the target."
    ),
]
Settings = Annotated[
    tuple[str, ...],
    tyro.conf.arg(help="Changed settings of the learner, as NAME=VALUE: learning_rate=3e-4."),
]
_REFERENCE: Final = "reference"


def asked(env: gym.Env[Any, Any], ability: str) -> Any:
    """Return a method that an env offers beyond Gymnasium's."""
    offered = getattr(env.unwrapped, ability, None)
    if offered is None:
        name = env.spec.id if env.spec else type(env.unwrapped).__name__
        raise MorphologyError(f"{name} offers no {ability}; these envs do: {', '.join(CATALOGUE)}.")
    return offered


def opened(env: EnvRef, **more: Any) -> closing[gym.Env[Any, Any]]:
    """Make an env, which is closed at the end of the `with` block."""
    return closing(env.make(**more))


def options_of(given: str, flag: str) -> dict[str, Any]:
    """Parse further arguments of an env from JSON."""
    if not given:
        return {}
    try:
        options = json.loads(given)
    except ValueError as error:
        raise StudyError(f"{flag} must be JSON ({error}), got {given!r}.") from None
    if not isinstance(options, dict):
        raise StudyError(f'{flag} must be a JSON object such as {{"robot": "mine"}}, got {given}.')
    task = cast("dict[str, Any]", options).get("task")
    allow_own_modules(task if isinstance(task, str) else None)
    return cast("dict[str, Any]", options)


@dataclass(frozen=True, kw_only=True)
class OneEnv:
    """Options of a command for one env."""

    env: EnvId
    body: Body = ""
    options: str = ""
    """More arguments of the env as JSON, such as '{"frame_skip": 4}'."""

    @property
    def ref(self) -> EnvRef:
        """The env with its body and further arguments."""
        return env_ref(self.env, self.body).having(options_of(self.options, "--options"))


@dataclass(frozen=True, kw_only=True)
class TwoEnvs:
    """Options of a command that goes from one env to another."""

    source: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SOURCE")]
    """Id of the source env, in which a policy is learned, such as Ant."""
    target: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="TARGET")]
    """Id of the target env, such as ExtendedAnt."""
    source_body: str = ""
    """Another body of the source's family: its name, or edits as JSON."""
    target_body: str = ""
    """Another body of the target's family: its name, or edits as JSON."""
    source_options: str = ""
    """More arguments of the source as JSON, such as '{"actions": "length"}'."""
    target_options: str = ""
    """More arguments of the target as JSON, such as '{"gap": "real-like"}' for a finger."""

    def refs(self, *, studied: bool = False, lenses: Sequence[str] = ()) -> tuple[EnvRef, EnvRef]:
        """Return source and target with their bodies and options.

        In a study, vehicles are put back after a collision, and `lenses` disturb target cameras.
        """
        source = env_ref(self.source, self.source_body)
        target = env_ref(self.target, self.target_body)
        if studied:
            source, target = driven(source), driven(target, lenses)
        return (
            source.having(options_of(self.source_options, "--source-options")),
            target.having(options_of(self.target_options, "--target-options")),
        )


def policy_file(given: Path, env: EnvRef) -> Path:
    """Return the given policy file, or the shipped policy of an env for "reference"."""
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
                f"A setting must be NAME=VALUE, such as learning_rate=3e-4 or "
                f"net_arch=[64,64], got {text!r}."
            )
        if name in settings:
            raise StudyError(f"--set names {name} more than once.")
        settings[name] = parsed["value"]
    return settings
