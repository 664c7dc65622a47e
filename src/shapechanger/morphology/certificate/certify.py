"""The certificate of a shift: the proven differences between two embodiments, or a refusal.

Shifts are easily declared and not applied: a friction that the floor's exceeds, a context that
nothing reads. So two environments are compared by their effective models and by their responses to
the same commands. A shift that changes neither is refused.
"""

from __future__ import annotations

from typing import Any, cast

import msgspec
import mujoco

from shapechanger.errors import EmptyShift, MorphologyError
from shapechanger.morphology.certificate.changes import (
    Change,
    compare,
    differ_in_names,
    fingerprint,
    grouped,
)
from shapechanger.morphology.certificate.consistency import inconsistencies, lone_masses
from shapechanger.morphology.certificate.rollout import (
    Certifiable,
    Rollout,
    Wrapped,
    attribute,
    compare_rollouts,
)
from shapechanger.own_modules import modules_of_env, own_modules


class Certificate(msgspec.Struct, frozen=True):
    """Certified differences between a target and its source.

    Attributes:
        source: Label of the source.
        target: Label of the target.
        source_fingerprint: Fingerprint of the source's effective model.
        target_fingerprint: Fingerprint of the target's.
        changes: Differences of the effective models, and of the standing heights.
        rollout: Responses of both to the same commands.
        source_inconsistencies: Inconsistencies of the source's model.
        target_inconsistencies: Inconsistencies of the target's model, or between the two.
        source_files: Hashes of the user's own modules that the source needs, by file.
        target_files: The same of the target.
    """

    source: str
    target: str
    source_fingerprint: str
    target_fingerprint: str
    changes: tuple[Change, ...]
    rollout: Rollout
    source_inconsistencies: tuple[str, ...] = ()
    target_inconsistencies: tuple[str, ...] = ()
    source_files: dict[str, str] = {}
    target_files: dict[str, str] = {}

    @property
    def same_model(self) -> bool:
        """Return whether the two models move equally, up to rounding and names."""
        return not self.changes

    @property
    def is_empty(self) -> bool:
        """Return whether models and rollouts differ by no more than rounding and names.

        One rule for all models: even equal ones may round differently, because MuJoCo computes
        relative to the centre of mass of the whole, with the masses of what cannot move.
        """
        return self.same_model and self.rollout.differs_by_rounding

    @property
    def verdict(self) -> str:
        """Verdict in one sentence."""
        alike = self.source_fingerprint == self.target_fingerprint
        if self.is_empty and alike and self.rollout.identical:
            return (
                f"{self.source} and {self.target} behave alike: both models have the fingerprint "
                f"{self.source_fingerprint}, and {self.rollout.steps} steps gave the same numbers."
            )
        if self.is_empty:
            return (
                f"{self.source} and {self.target} behave alike: their models and "
                f"{self.rollout.steps} steps differ by rounding only"
                f"{'' if alike else ', or in names'}."
            )
        if self.same_model:
            return (
                f"The models of {self.source} and {self.target} are the same "
                f"({self.source_fingerprint}); only what is sensed, done or rewarded differs."
            )
        if self.rollout.differs_by_rounding:
            return (
                f"The models of {self.source} and {self.target} differ, but "
                f"{self.rollout.steps} steps did not show it."
            )
        return f"{self.target} behaves differently from {self.source}."

    def __str__(self) -> str:
        """Return the certificate as text; a change that several elements share is listed once."""
        lines = [
            f"{self.source} [{self.source_fingerprint}] -> "
            f"{self.target} [{self.target_fingerprint}]",
            self.verdict,
        ]
        for title, sentences in (
            ("Changes", [item.sentence for item in grouped(self.changes)]),
            ("Rollout", [str(self.rollout)]),
            (f"Does not fit together in {self.source}", self.source_inconsistencies),
            (f"Does not fit together in {self.target}", self.target_inconsistencies),
            (f"Own files of {self.source}", _listed(self.source_files)),
            (f"Own files of {self.target}", _listed(self.target_files)),
        ):
            if sentences:
                lines += [f"{title}:", *(f"  {sentence}" for sentence in sentences)]
        return "\n".join(lines)

    def to_json(self) -> str:
        """Return the certificate as JSON."""
        return msgspec.json.encode(self).decode()

    @classmethod
    def from_json(cls, text: str | bytes) -> Certificate:
        """Read what `to_json` wrote.

        Raises:
            MorphologyError: If the text is not a certificate.
        """
        try:
            return msgspec.json.decode(text, type=cls)
        except msgspec.MsgspecError as error:
            raise MorphologyError(f"This is not a certificate: {error}.") from error


def certify(
    source: Certifiable | Wrapped,
    target: Certifiable | Wrapped,
    *,
    steps: int = 100,
    seed: int = 0,
    labels: tuple[str, str] | None = None,
    allow_empty: bool = False,
) -> Certificate:
    """Compare two environments and certify the shift between them.

    Both are reset and stepped, and left in the middle of an episode. Wrappers count: observations
    are those of the outermost one.

    Args:
        source: The environment in which a policy is trained.
        target: The environment that it is transferred to.
        steps: Number of commands of the rollout.
        seed: Seed of the resets and of the commands.
        labels: Labels of the two; by default the ids of the environments, or their classes.
        allow_empty: Whether to certify a shift that changes nothing.

    Raises:
        MorphologyError: If one of them has no model, such as that of a vehicle.
        EmptyShift: If nothing differs and `allow_empty` is false.
    """
    for env in (source, target):
        if not hasattr(getattr(env, "unwrapped", env), "model"):
            raise MorphologyError(f"{_label(env)} has no model to compare.")
    one, two = cast("list[mujoco.MjModel]", [attribute(env, "model") for env in (source, target)])
    changes = compare(one, two, standing_height=(_height(source), _height(target)))
    renamed = not changes and differ_in_names(one, two)
    rollout = compare_rollouts(source, target, steps=steps, seed=seed, renamed=renamed)
    names = labels or (_label(source), _label(target))
    certificate = Certificate(
        source=names[0],
        target=names[1],
        source_fingerprint=fingerprint(one),
        target_fingerprint=fingerprint(two),
        changes=changes,
        rollout=rollout,
        source_inconsistencies=inconsistencies(one),
        target_inconsistencies=(*inconsistencies(two), *lone_masses(one, two)),
        source_files=own_modules(modules_of_env(source)),
        target_files=own_modules(modules_of_env(target)),
    )
    if certificate.is_empty and not allow_empty:
        raise EmptyShift(
            f"{certificate.verdict} There is nothing to transfer across. A setting may have no "
            "effect, such as the friction of a foot below that of the floor, or may never be read."
        )
    return certificate


def _listed(files: dict[str, str]) -> list[str]:
    """Return files with their hashes."""
    return [f"{name} [{digest}]" for name, digest in files.items()]


def _height(env: Certifiable | Wrapped) -> float | None:
    """Return the standing height, if the environment states it."""
    try:
        return attribute(env, "standing_height")
    except AttributeError:
        return None


def _label(env: Any) -> str:
    """Return the label of an environment, its registered id, or the name of its class."""
    spec = getattr(env, "spec", None)
    inner = getattr(env, "unwrapped", env)
    own = getattr(inner, "label", None)
    return str(own or getattr(spec, "id", None) or type(inner).__name__)
