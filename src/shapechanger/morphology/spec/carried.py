"""What a specification states by place or by order: keyframes, pins of loops, paths of tendons.

Edits see none of the keyframes, and pins as sites. Both are written back when all edits are made.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import mujoco
import numpy as np

from shapechanger.errors import MorphologyError
from shapechanger.morphology.spec.elements import compiled
from shapechanger.morphology.spec.geometry import Array
from shapechanger.morphology.spec.keyframes import Keyframes
from shapechanger.morphology.spec.loops import (
    close_loops,
    has_loops,
    mark_pins,
    open_loops,
    unmark_pins,
)
from shapechanger.morphology.spec.references import MARK, Element

_W: Final = mujoco.mjtWrap
_ROUND: Final = (int(_W.mjWRAP_SPHERE), int(_W.mjWRAP_CYLINDER))
# A tendon that is longer than its limit by less is within it, m or rad.
_WITHIN: Final = 1e-6


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
