"""What a specification states by place or by order: keyframes, pins of loops, paths of tendons.

Edits see none of the keyframes, and pins as sites. Both are written back when all edits are made.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

import mujoco
import numpy as np

from shapechanger.errors import MorphologyError
from shapechanger.morphology.spec.elements import compiled
from shapechanger.morphology.spec.geometry import Array
from shapechanger.morphology.spec.loops import (
    close_loops,
    has_loops,
    mark_pins,
    open_loops,
    unmark_pins,
)
from shapechanger.morphology.spec.references import MARK, Element

_J: Final = mujoco.mjtJoint
_SIZES: Final = {_J.mjJNT_FREE: (7, 6), _J.mjJNT_BALL: (4, 3)}
_FIELDS: Final = ("qpos", "qvel", "act", "ctrl", "mpos", "mquat")
Slices = dict[str, dict[str, slice]]
_W: Final = mujoco.mjtWrap
_ROUND: Final = (int(_W.mjWRAP_SPHERE), int(_W.mjWRAP_CYLINDER))
# A tendon that is longer than its limit by less is within it, m or rad.
_WITHIN: Final = 1e-6


class Keyframes:
    """The keyframes of a specification, out of the way of its edits."""

    def __init__(self) -> None:
        self._values: list[tuple[dict[str, Any], dict[str, dict[str, Array]]]] = []

    def take(self, spec: mujoco.MjSpec, model: mujoco.MjModel) -> None:
        """Take the keyframes out of a specification.

        Args:
            spec: The specification; its keyframes are deleted.
            model: The model that it compiles to.
        """
        slices = _slices_of(model)
        for i, key in enumerate(list(spec.keys)):
            values: dict[str, dict[str, Array]] = {}
            for field in [field for field in _FIELDS if len(getattr(key, field))]:
                row = getattr(model, f"key_{field}")[i].ravel()
                values[field] = {name: row[at].copy() for name, at in slices[field].items()}
            self._values.append(({"name": key.name, "time": key.time}, values))
            spec.delete(key)

    def copy(self, originals: Mapping[str, str]) -> None:
        """Give copied joints, actuators and bodies the values of those that they were copied from.

        Args:
            originals: Names of the elements that were copied, by those of the copies.
        """
        for _, values in self._values:
            for known in values.values():
                known |= {
                    copy: known[original]
                    for copy, original in originals.items()
                    if original in known
                }

    def change(self, joint: str, changed: Callable[[Array], Array]) -> None:
        """Change the position of a joint in every keyframe that gives positions.

        Args:
            joint: Name of the joint.
            changed: Returns the new position (1, 4 or 7 numbers) from the old one.
        """
        for _, values in self._values:
            positions = values.get("qpos", {})
            if joint in positions:
                positions[joint] = changed(positions[joint])

    def put_back(self, spec: mujoco.MjSpec) -> None:
        """Add the keyframes to the edited specification; new elements have their own pose.

        Args:
            spec: The edited specification.
        """
        if not self._values:
            return
        model = compiled(spec)
        slices = _slices_of(model)
        data = mujoco.MjData(model)
        for about, values in self._values:
            key = spec.add_key(**about)
            for field, known in values.items():
                own = {"mpos": "mocap_pos", "mquat": "mocap_quat"}.get(field, field)
                row = np.array(getattr(data, own)).ravel()
                for name, at in slices[field].items():
                    if name in known and known[name].size == row[at].size:
                        row[at] = known[name]
                setattr(key, field, row)


class Carried:
    """The keyframes, pins and tendons of a specification that edits are applied to.

    Args:
        spec: The specification, with its elements named and its frames resolved.

    Attributes:
        keyframes: Its keyframes.
    """

    def __init__(self, spec: mujoco.MjSpec) -> None:
        self.keyframes = Keyframes()
        self._tendons: dict[str, _Tendon] = {}
        self._open: set[Element] = set()
        if not (spec.keys or spec.tendons or has_loops(spec)):
            return
        for i, tendon in enumerate(spec.tendons):
            tendon.name = tendon.name or f"{MARK}tendon{i}"
        model = compiled(spec)
        self.keyframes.take(spec, model)
        self._tendons = _tendons(model)
        if has_loops(spec):
            mark_pins(spec, model)
            self._open = open_loops(spec, compiled(spec))

    def put_back(self, spec: mujoco.MjSpec) -> None:
        """Write everything into the edited specification.

        Args:
            spec: The specification.

        Raises:
            MorphologyError: If a loop cannot be closed, or a tendon does not fit its new path.
        """
        if has_loops(spec):
            data, balls = close_loops(spec, compiled(spec), self._open)
            for joint, turn in balls.items():
                self.keyframes.change(joint, lambda pose, turn=turn: _before(turn, pose))
            unmark_pins(spec, data)
        if spec.tendons and self._tendons:
            self._follow_tendons(spec)
        self.keyframes.put_back(spec)

    def _follow_tendons(self, spec: mujoco.MjSpec) -> None:
        """Refuse paths that mean something else now, and fit muscles to their new lengths."""
        new = _tendons(compiled(spec))
        for name, old in self._tendons.items():
            if name not in new:
                continue
            if old.inside != new[name].inside and len(old.inside) == len(new[name].inside):
                raise MorphologyError(
                    f"The tendon {name!r} would pass a geom on its other side, because its side "
                    "site gets into the geom or out of it: change the geom less."
                )
            if old.fits and not new[name].fits:
                raise MorphologyError(
                    f"The tendon {name!r} would start {new[name].length:.3g} long, outside of its "
                    "limits: write other limits into the model first."
                )
        for actuator in spec.actuators:
            old = self._tendons.get(actuator.target)
            tendon = actuator.trntype == mujoco.mjtTrn.mjTRN_TENDON
            muscle = actuator.gaintype == mujoco.mjtGain.mjGAIN_MUSCLE
            if tendon and muscle and old and np.any(actuator.lengthrange):
                # As in musculoskeletal models that are fitted to a person: S. Delp and others,
                # OpenSim, IEEE Transactions on Biomedical Engineering 54(11), 2007.
                actuator.lengthrange = actuator.lengthrange * (
                    new[actuator.target].length / old.length
                )
        for tendon in spec.tendons:
            if tendon.name.startswith(MARK):
                tendon.name = ""


class _Tendon(NamedTuple):
    """A tendon in the model's own pose.

    Attributes:
        length: Its length, m, or of a fixed one the sum of its joints.
        fits: Whether the length is within its limits, if it has any.
        inside: For each geom that it passes with a side site, whether the site is inside.
    """

    length: float
    fits: bool
    inside: tuple[bool, ...]


def _tendons(model: mujoco.MjModel) -> dict[str, _Tendon]:
    """Return the tendons of a model in its own pose, by name."""
    data = mujoco.MjData(model)
    mujoco.mj_fwdPosition(model, data)
    found: dict[str, _Tendon] = {}
    for i in range(model.ntendon):
        inside: list[bool] = []
        for j in range(model.tendon_adr[i], model.tendon_adr[i] + model.tendon_num[i]):
            if model.wrap_type[j] not in _ROUND or model.wrap_prm[j] < 0.0:
                continue
            geom = model.wrap_objid[j]
            site = data.site_xpos[int(model.wrap_prm[j])] - data.geom_xpos[geom]
            place = data.geom_xmat[geom].reshape(3, 3).T @ site
            # A cylinder has no ends for a tendon.
            reach = place[:2] if model.wrap_type[j] == _W.mjWRAP_CYLINDER else place
            inside.append(bool(np.linalg.norm(reach) < model.geom_size[geom, 0]))
        length = float(data.ten_length[i])
        low, high = model.tendon_range[i]
        fits = not model.tendon_limited[i] or low - _WITHIN <= length <= high + _WITHIN
        found[model.tendon(i).name] = _Tendon(length, bool(fits), tuple(inside))
    return found


def _before(turn: Array, pose: Array) -> Array:
    """Return the position of a ball whose reference has turned, as quaternions (w, x, y, z)."""
    back, result = np.empty(4), np.empty(4)
    mujoco.mju_negQuat(back, turn)
    mujoco.mju_mulQuat(result, back, pose)
    return result


def _slices_of(model: mujoco.MjModel) -> Slices:
    """Return where each element's numbers are, by field of a keyframe and by name."""
    found: Slices = {field: {} for field in _FIELDS}
    for i in range(model.njnt):
        position, velocity = _SIZES.get(_J(model.jnt_type[i]), (1, 1))
        name, at, dof = model.joint(i).name, model.jnt_qposadr[i], model.jnt_dofadr[i]
        found["qpos"][name] = slice(at, at + position)
        found["qvel"][name] = slice(dof, dof + velocity)
    for i in range(model.nactuator):
        name = model.actuator(i).name
        for field, starts, counts in (
            ("act", model.actuator_actadr, model.actuator_actnum),
            ("ctrl", model.actuator_ctrladr, model.actuator_ctrlnum),
        ):
            if counts[i]:
                found[field][name] = slice(starts[i], starts[i] + counts[i])
    for body in np.flatnonzero(model.body_mocapid >= 0).tolist():
        name, i = model.body(body).name, int(model.body_mocapid[body])
        found["mpos"][name] = slice(3 * i, 3 * i + 3)
        found["mquat"][name] = slice(4 * i, 4 * i + 4)
    return found
