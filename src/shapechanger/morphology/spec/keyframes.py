"""Keyframes by name, because edits add and remove joints, actuators and bodies."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

import mujoco
import numpy as np

from shapechanger.morphology.spec.elements import compiled
from shapechanger.morphology.spec.geometry import Array

_J: Final = mujoco.mjtJoint
_SIZES: Final = {_J.mjJNT_FREE: (7, 6), _J.mjJNT_BALL: (4, 3)}
_FIELDS: Final = ("qpos", "qvel", "act", "ctrl", "mpos", "mquat")
Slices = dict[str, dict[str, slice]]


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
