"""Where MuJoCo puts the frames of a compiled model, which is not always where its arrays say.

The compiler notes which frames coincide, and the simulation then copies the one instead of
computing the other. Writing another position into a compiled model moves nothing until
`mujoco.mj_setConst` has noted it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.morphology.effective.reading import is_any

__all__ = ["Frames", "canonical", "geom_frames", "inertial_frames", "site_frames"]

_Floats = NDArray[np.float64]
_SAME: Final = mujoco.mjtSameFrame
_IDENTITY: Final = (1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Frames:
    """Frames relative to a body.

    Attributes:
        position: Position in m, shape (n, 3).
        orientation: Unit quaternion, its first nonzero number above 0, shape (n, 4).
    """

    position: _Floats
    orientation: _Floats


def inertial_frames(model: mujoco.MjModel) -> Frames:
    """Centres of mass and principal axes of the bodies."""
    same = model.body_sameframe
    at_body = is_any(same, _SAME.mjSAMEFRAME_BODY)[:, None]
    turned_as_body = is_any(same, _SAME.mjSAMEFRAME_BODY, _SAME.mjSAMEFRAME_BODYROT)[:, None]
    return Frames(
        np.where(at_body, 0.0, model.body_ipos),
        canonical(np.where(turned_as_body, _IDENTITY, model.body_iquat)),
    )


def geom_frames(model: mujoco.MjModel) -> Frames:
    """Frames of the geoms."""
    return _attached(
        model, model.geom_sameframe, model.geom_bodyid, model.geom_pos, model.geom_quat
    )


def site_frames(model: mujoco.MjModel) -> Frames:
    """Frames of the sites."""
    return _attached(
        model, model.site_sameframe, model.site_bodyid, model.site_pos, model.site_quat
    )


def canonical(quaternions: _Floats) -> _Floats:
    """Of the two quaternions of each rotation the one whose first number is above 0; (n, 4)."""
    leading = np.argmax(quaternions != 0.0, axis=1)[:, None]
    sign = np.sign(np.take_along_axis(quaternions, leading, axis=1))
    return np.where(sign < 0.0, -quaternions, quaternions)


def _attached(
    model: mujoco.MjModel,
    same: NDArray[np.uint8],
    bodies: NDArray[np.int32],
    position: _Floats,
    orientation: _Floats,
) -> Frames:
    """Frames that may coincide with that of their body or with its inertial frame."""
    inertial = inertial_frames(model)

    def choose(own: _Floats, of_body: _Floats, *, rotation: bool) -> _Floats:
        body, inertia = [_SAME.mjSAMEFRAME_BODY], [_SAME.mjSAMEFRAME_INERTIA]
        if rotation:
            body.append(_SAME.mjSAMEFRAME_BODYROT)
            inertia.append(_SAME.mjSAMEFRAME_INERTIAROT)
        rest = _IDENTITY if rotation else (0.0, 0.0, 0.0)
        chosen = np.where(is_any(same, *inertia)[:, None], of_body[bodies], own)
        return np.where(is_any(same, *body)[:, None], rest, chosen)

    return Frames(
        choose(position, inertial.position, rotation=False),
        canonical(choose(orientation, inertial.orientation, rotation=True)),
    )
