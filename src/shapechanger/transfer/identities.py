"""Identities of the env and the learner of a policy, keyed by "env" and "learner"."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import closing
from typing import Any, Final

import gymnasium as gym
import msgspec

from shapechanger.contract.env_ref import EnvRef
from shapechanger.errors import ForeignStudy
from shapechanger.identity import Identity, identify_code, identify_env, texts_in

Identities = dict[str, Identity]
"""Identities, keyed by part."""

ENV: Final = "env"
"""Key of the env's identity in a policy's card."""
LEARNER: Final = "learner"
"""Key of the learner's identity."""
NOTHING: Final = Identity()
"""Identity of a part that has neither a model nor custom files."""


def known(identities: Mapping[str, Identity]) -> Identities:
    """Return the identities of the parts that have a model or custom files."""
    return {part: each for part, each in identities.items() if each != NOTHING}


def identify_learner(settings: object) -> Identity:
    """Return the identity of a learner."""
    return identify_code(texts_in(msgspec.to_builtins(settings)), settings)


def identities_in(ref: EnvRef, made: gym.Env[Any, Any], settings: object) -> Identities:
    """Return the identities of the env and the learner of a policy."""
    is_single = "bodies" not in ref.kwargs
    env = steady(ref, identify_env(made, ref.id)) if is_single else identify(ref)
    return known({ENV: env, LEARNER: identify_learner(settings)})


def identify(ref: EnvRef) -> Identity:
    """Make an env with a single body, and return its identity."""
    with closing(ref.without("bodies").make()) as made:
        return steady(ref, identify_env(made, ref.id))


def steady(ref: EnvRef, found: Identity) -> Identity:
    """Return an identity, without its model if the env draws a new model each time it is made."""
    if not found.model or ref.id.startswith("shapechanger/"):
        return found
    with closing(ref.without("bodies").make()) as made:
        again = identify_env(made, ref.id)
    return found if again == found else Identity(files=found.files)


def require_same_env(
    card: Mapping[str, Identity], ref: EnvRef, made: Identity, policy: object, remedy: str
) -> None:
    """Refuse a policy whose env has changed since its training."""
    if text := card.get(ENV, NOTHING).changes_to(made):
        raise ForeignStudy(f"{ref} has changed since {policy} was trained in it: {text}. {remedy}")
