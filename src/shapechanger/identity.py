"""What an env, a method or a learner is made of: the model of its robot, and the user's own files.

A study, a policy and a robot are known by names: an id, a path, `module:Name`. Those stay the same
when a file is edited. Identities tell such versions apart, so that runs of two of them are never
averaged and a policy is never taken for one of another robot.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import msgspec

from shapechanger.own_modules import (
    HASH_DIGITS,
    modules_of,
    modules_of_env,
    named_modules,
    own_modules,
    texts_in,
)
from shapechanger.registry import MODELS

if TYPE_CHECKING:
    import gymnasium as gym

# Files that a compiled model holds the meaning of, comments left out.
_MODEL_FILES: Final = (".xml", ".mjcf", ".urdf")
_MOST_CHANGES: Final = 4  # Named in a message.


class Identity(msgspec.Struct, frozen=True, omit_defaults=True):
    """Version of an env, a method or a learner.

    Attributes:
        model: Fingerprint of its compiled model, see `shapechanger.morphology.certificate`; empty
            without one.
        sensed: The same for parts that decide no motion and may be observed: sensors, keyframes,
            sites and, where frames are observed, all that is drawn.
        files: The first 16 hex digits of the SHA-256 of each own file that it needs, by its place
            below the folder that it is imported from, or its name.
    """

    model: str = ""
    sensed: str = ""
    files: dict[str, str] = {}

    def changes_to(self, other: Identity, numbers: Iterable[str] = ()) -> str:
        """Return in words how another version differs; empty if it is the same.

        Models are compared where both are known.

        Args:
            other: The other version, which is the newer one.
            numbers: The differences of the models, if they are known.
        """

        def changed(what: str, old: str, new: str) -> Iterator[str]:
            if old and new and old != new:
                yield f"{what} has changed from {old} to {new}"
            elif old != new:
                yield f"{what} is gone (was {old})" if old else f"{what} is new ({new})"

        found: list[str] = []
        if self.model and other.model:
            found += changed("its model", self.model, other.model)
            if not found:
                found += changed("what is sensed of its model", self.sensed, other.sensed)
                found = [f"{text}, and its motion is the same" for text in found]
        if found and (known := list(numbers)):
            more = "; ..." if known[_MOST_CHANGES:] else ""
            found[0] += f" ({'; '.join(known[:_MOST_CHANGES])}{more})"
        for name in sorted(self.files.keys() | other.files.keys()):
            found += changed(name, self.files.get(name, ""), other.files.get(name, ""))
        return ", and ".join(found)


class IdentifiedEnv(NamedTuple):
    """The identity of an env, with the numbers that its fingerprints are made of.

    Attributes:
        identity: The identity.
        numbers: The numbers of its model as MessagePack, for `model_changes`; empty without one.
    """

    identity: Identity
    numbers: bytes


def identify_env(env: gym.Env[Any, Any], env_id: str = "") -> IdentifiedEnv:
    """Return the identity of an env that has been made.

    Args:
        env: The env, with its wrappers.
        env_id: Its id, which may name a module, as `module:id`.
    """
    arguments: dict[str, Any] = {} if env.spec is None else dict(env.spec.kwargs)
    names = modules_of_env(env, env_id)
    model = getattr(env.unwrapped, "model", None)
    # No import of MuJoCo for an env that does without.
    if type(model).__module__.partition(".")[0] != "mujoco" or type(model).__name__ != "MjModel":
        files = own_modules(names) | dict(_files(arguments, ()))
        return IdentifiedEnv(Identity(files=files), b"")
    moved, sensed, numbers = MODELS.load("mujoco").read(model, drawn=_sees(env.observation_space))
    files = own_modules(names) | dict(_files(arguments, _MODEL_FILES))
    return IdentifiedEnv(Identity(moved, sensed, files), numbers)


def identify_code(names: Iterable[str], *objects: Any) -> Identity:
    """Return the identity of a part without a model, such as a method.

    Args:
        names: Names such as `my_methods:warm-start`, and other texts, which are skipped.
        *objects: Objects whose modules count, too.
    """
    return Identity(files=own_modules({*named_modules(names), *modules_of(*objects)}))


def model_changes(old: bytes, new: bytes) -> tuple[str, ...]:
    """Return the differences of two models in words.

    Args:
        old: Numbers of the old model, see `IdentifiedEnv`.
        new: Numbers of the new one.

    Raises:
        msgspec.MsgspecError: If they are not such numbers.
    """
    return MODELS.load("mujoco").changes(old, new)


def _files(arguments: Mapping[str, Any], without: tuple[str, ...]) -> Iterator[tuple[str, str]]:
    """Yield name and hash of each file that an argument names, such as a robot's profile."""
    for text in filter(None, texts_in(arguments)):
        for place in (text, f"{text}.toml"):  # `my-car` stands for my-car.toml.
            # Unlike `Path.is_file`, this is false for texts that are too long for a path, such as
            # the JSON of a body.
            if os.path.isfile(place) and not place.endswith(without):
                content = b"\n".join(Path(place).read_bytes().splitlines())
                yield Path(place).name, hashlib.sha256(content).hexdigest()[:HASH_DIGITS]


def _sees(space: gym.Space[Any]) -> bool:
    """Return whether an observation has frames: whole numbers in rows and columns."""
    inner: Any = getattr(space, "spaces", None)
    if inner is not None:
        return any(map(_sees, getattr(inner, "values", lambda: inner)()))
    return len(space.shape or ()) >= 2 and str(space.dtype) == "uint8"
