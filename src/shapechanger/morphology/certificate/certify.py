"""The certificate of a shift: the proven differences between two embodiments, or a refusal.

Shifts are easily declared and not applied: a friction that the floor's exceeds, a context that
nothing reads. So two environments are compared by their effective models and by their responses to
the same commands. A shift that changes neither is refused.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import Any, Final

import msgspec
import mujoco
import numpy as np

from shapechanger.errors import EmptyShift, MorphologyError
from shapechanger.morphology.certificate.changes import (
    Change,
    compare,
    differences,
    fingerprint,
    grouped,
)
from shapechanger.morphology.certificate.numbers import moved_numbers, names_of
from shapechanger.morphology.certificate.rollout import (
    Certifiable,
    Rollout,
    attribute,
    compare_rollouts,
)
from shapechanger.own_modules import modules_of_env, own_modules

# `mj_setConst` gives the same bits on an untouched model; the margin is for models that were
# compiled elsewhere and loaded from a file.
_STALE: Final = 1e-6
# What `mj_setConst` computes, and what goes wrong if it is stale.
_CONSTANTS: Final = {
    "body_subtreemass": "centres of mass are wrong",
    "body_invweight0": "constraints have the wrong softness",
    "body_sameframe": "body_ipos or body_iquat is ignored",
    "body_margin": "contacts may be missed",
    "dof_M0": "lengths and gains derived from it are wrong",
    "dof_invweight0": "constraints have the wrong softness",
    "geom_rbound": "contacts may be missed",
    "geom_sameframe": "geom_pos or geom_quat is ignored",
    "geom_fluid": "forces of the fluid still fit the old shape",
    "site_sameframe": "site_pos or site_quat is ignored",
    "jnt_actuatorid": "the actuator's damping or armature is ignored",
    "tendon_length0": "lengths derived from it are wrong",
    "tendon_invweight0": "constraints have the wrong softness",
    "tendon_actuatorid": "the actuator's damping or armature is ignored",
}
_FLAGS: Final = {
    "flg_gravcomp": "body_gravcomp is ignored",
    "flg_surfacevel": "geom_surfacevel is ignored",
    "flg_adhesion": "geom_adhesion and pair_adhesion are ignored",
}


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
        both, steps = f"{self.source} and {self.target}", f"{self.rollout.steps} steps"
        same_names = self.source_fingerprint == self.target_fingerprint
        if self.is_empty and same_names and self.rollout.identical:
            return (
                f"{both} behave the same: both models have the fingerprint "
                f"{self.source_fingerprint}, and {steps} gave the same numbers."
            )
        if self.is_empty:
            names = "" if same_names else ", or in names"
            return f"{both} behave the same: their models and {steps} differ by rounding{names}."
        if self.same_model:
            return (
                f"The models of {both} are the same ({self.source_fingerprint}); only what is "
                "sensed, done or rewarded differs."
            )
        if self.rollout.differs_by_rounding:
            return f"The models of {both} differ, but {steps} did not show it."
        return f"{self.target} behaves differently from {self.source}."

    def __str__(self) -> str:
        """Return the certificate as text; a change that several elements share is listed once."""
        lines = [
            f"{self.source} [{self.source_fingerprint}] -> "
            f"{self.target} [{self.target_fingerprint}]",
            self.verdict,
        ]
        files = [
            [f"{name} [{digest}]" for name, digest in each.items()]
            for each in (self.source_files, self.target_files)
        ]
        for title, sentences in (
            ("Changes", [item.sentence for item in grouped(self.changes)]),
            ("Rollout", [str(self.rollout)]),
            (f"Does not fit together in {self.source}", self.source_inconsistencies),
            (f"Does not fit together in {self.target}", self.target_inconsistencies),
            (f"Own files of {self.source}", files[0]),
            (f"Own files of {self.target}", files[1]),
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
    source: Certifiable,
    target: Certifiable,
    *,
    steps: int = 100,
    seed: int = 0,
    labels: tuple[str, str] | None = None,
    allow_empty: bool = False,
) -> Certificate:
    """Compare two environments and certify the shift between them.

    Both are reset and stepped, and left in the middle of an episode. Wrappers count: observations
    belong to the outermost one.

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
    one: mujoco.MjModel = attribute(source, "model")
    two: mujoco.MjModel = attribute(target, "model")
    heights = attribute(source, "standing_height", None), attribute(target, "standing_height", None)
    changes = compare(one, two, standing_height=heights)
    renamed = not changes and bool(differences(moved_numbers(one), moved_numbers(two)))
    names = labels or (_label(source), _label(target))
    certificate = Certificate(
        source=names[0],
        target=names[1],
        source_fingerprint=fingerprint(one),
        target_fingerprint=fingerprint(two),
        changes=changes,
        rollout=compare_rollouts(source, target, steps=steps, seed=seed, renamed=renamed),
        source_inconsistencies=inconsistencies(one),
        target_inconsistencies=inconsistencies(two, one),
        source_files=own_modules(modules_of_env(source)),
        target_files=own_modules(modules_of_env(target)),
    )
    if certificate.is_empty and not allow_empty:
        raise EmptyShift(
            f"{certificate.verdict} There is nothing to transfer across. A setting may have no "
            "effect, such as the friction of a foot below that of the floor, or may never be read."
        )
    return certificate


def _label(env: Any) -> str:
    """Return the label of an environment, its registered id, or the name of its class."""
    spec = getattr(env, "spec", None)
    inner = getattr(env, "unwrapped", env)
    own = getattr(inner, "label", None)
    return str(own or getattr(spec, "id", None) or type(inner).__name__)


def inconsistencies(model: mujoco.MjModel, source: mujoco.MjModel | None = None) -> tuple[str, ...]:
    """Return the inconsistencies of a compiled model that was written to, one sentence each.

    Writing mass without inertia, or either without calling `mujoco.mj_setConst`, leaves an
    inconsistent model: MuJoCo softens contacts and limits by inverse weights that no longer hold,
    copies frames that no longer coincide, and ignores gravity compensation, adhesion or an
    actuator's damping if there was none when the model was compiled.

    Args:
        model: The model.
        source: Another model with the same bodies, whose masses must not differ alone.
    """
    names, owner, found = names_of(model), model.geom_bodyid, list[str]()
    moving = np.flatnonzero(model.body_treeid >= 0).tolist()
    for i in (i for i in moving if model.body_mass[i] > 0.0):
        small, middle, large = sorted(model.body_inertia[i].tolist())
        what = f"{names['bodies'][i]}: mass {model.body_mass[i]:.4g} kg"
        if small < 0.0 or (large == 0.0 and model.body_dofnum[i] > 0):
            found.append(f"{what} comes with inertia {small:.3g} kg·m².")
        elif small + middle < large * (1.0 - _STALE):
            found.append(
                f"{what} comes with principal moments {small:.3g}, {middle:.3g}, {large:.3g} "
                "kg·m², of which the largest is more than the other two together."
            )
    late = model.geom_contype & ~model.body_contype[owner]
    late |= model.geom_conaffinity & ~model.body_conaffinity[owner]
    for i in np.flatnonzero(late).tolist():
        found.append(
            f"{names['geoms'][i]}: geom_contype or geom_conaffinity has bits that its body was "
            "compiled without, so they are ignored. Compile the model again."
        )
    found += _stale_constants(model, names)
    before = names_of(source)["bodies"] if source else []
    for i in moving:
        if source is None or names["bodies"][i] not in before:
            continue
        j = before.index(names["bodies"][i])
        old, new = float(source.body_mass[j]), float(model.body_mass[i])
        same_inertia = np.array_equal(source.body_inertia[j], model.body_inertia[i])
        if old != new and same_inertia and model.body_inertia[i].any():
            found.append(
                f"{names['bodies'][i]}: mass goes from {old:.4g} to {new:.4g} kg, but its inertia "
                f"stays {model.body_inertia[i].max():.3g} kg·m²: scale both."
            )
    return tuple(found)


def _stale_constants(model: mujoco.MjModel, names: dict[str, list[str]]) -> Iterator[str]:
    """Yield a sentence for each array that `mj_setConst` would change."""
    fresh = copy.deepcopy(model)
    try:
        mujoco.mj_setConst(fresh, mujoco.MjData(fresh))
    except mujoco.FatalError as error:
        yield f"MuJoCo cannot derive its constants from the model: {error}."
        return
    remedy = "Call mujoco.mj_setConst after writing to a compiled model."
    kinds = {"body": "bodies", "geom": "geoms", "site": "sites", "jnt": "joints"}
    owners = {prefix: names[kind] for prefix, kind in (kinds | {"tendon": "tendons"}).items()}
    owners["dof"] = [names["joints"][joint] for joint in model.dof_jntid.tolist()]
    for array, consequence in _CONSTANTS.items():
        rows = len(getattr(model, array))
        if not rows:
            continue
        old, new = (
            getattr(each, array).reshape(rows, -1).astype(np.float64) for each in (model, fresh)
        )
        scale = np.maximum(np.abs(old), np.abs(new))
        gap = np.abs(old - new) / np.where(scale > 0.0, scale, 1.0)
        if gap.max() > _STALE:  # The element that changes most is named.
            at = np.unravel_index(int(np.argmax(gap)), gap.shape)
            yield (
                f"{owners[array.partition('_')[0]][at[0]]}: {array} is {old[at]:.4g}, but the "
                f"model makes it {new[at]:.4g}, so {consequence}. {remedy}"
            )
    for flag, consequence in _FLAGS.items():
        if getattr(fresh, flag) and not getattr(model, flag):
            yield f"{flag} is not set, so {consequence}. {remedy}"
