"""Read bodies for a device: arrays per world, and arrays that all worlds of a batch share."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, Final, NamedTuple, cast

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.envs.warp.devices import mjw, on, wp

Rows = Mapping[str, NDArray[Any]]
"""Arrays of one body, keyed by name."""

ARMS: Final = "wrap_prm"
"""Moment arms of tendons over joints, which may differ between worlds; see `kernels`."""
# Only used for rendering, sleeping bodies and sensors, which the tasks do not have.
_UNREAD: Final = (
    *("cam_", "light_", "mat_", "geom_rgba", "geom_matid", "geom_group", "site_type"),
    *("dof_length", "site_size"),
)


class DeviceBody(NamedTuple):
    """Arrays of a body for a device.

    Attributes:
        name: Its name or edits, for messages.
        shared: Numbers and arrays that all worlds of a batch have in common, as bytes.
        rows: Arrays that may differ between worlds; those of the options begin with `opt.`.
        static: Places and orientations of the geoms that never move, which the device's kinematics
            leaves as they are: `geom_xpos` (k, 3) and `geom_xmat` (k, 3, 3).
        constants: Numbers of the task that depend on the body.
    """

    name: str
    shared: Mapping[str, bytes]
    rows: Rows
    static: Rows
    constants: Rows


def device_body(name: str, model: mujoco.MjModel, constants: Rows) -> DeviceBody:
    """Read a compiled body, as mujoco-warp reads it; other arguments as for `DeviceBody`."""
    with on("cpu"):
        made = mjw.put_model(model)
    rows: dict[str, NDArray[Any]] = {}
    shared: dict[str, bytes] = {}
    for prefix, owner in (("", made), ("opt.", made.opt)):
        for field in dataclasses.fields(owner):
            key, kind = prefix + field.name, cast("Any", field.type)
            if field.name.startswith(_UNREAD):
                continue
            if kind is int or kind is bool:
                shared[key] = str(int(getattr(owner, field.name))).encode()
            elif isinstance(kind, wp.array):
                array = getattr(owner, field.name).numpy()
                is_row = kind.shape[0] == "*"
                if key == ARMS:  # For a pulley, this array contains the divisor.
                    is_row = bool((model.wrap_type == mujoco.mjtWrap.mjWRAP_JOINT).all())
                if is_row:
                    rows[key] = array
                shared[key] = str(array.shape).encode() + (b"" if is_row else array.tobytes())
    # The memory for constraints depends on which of these are zero, in a batch's first body.
    for key in ("dof_frictionloss", "tendon_frictionloss"):
        shared[f"zeros of {key}"] = (getattr(model, key) > 0.0).tobytes()
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    fixed = static_geoms(model)
    places = {"geom_xpos": data.geom_xpos[fixed]}
    places["geom_xmat"] = data.geom_xmat[fixed].reshape(-1, 3, 3)
    return DeviceBody(name, shared, rows, places, constants)


def static_geoms(model: mujoco.MjModel) -> NDArray[np.intp]:
    """Return the indices of the geoms that are fixed to the world."""
    return np.flatnonzero(model.body_weldid[model.geom_bodyid] == 0)


def geom_type(model: mujoco.MjModel, geom: int) -> str:
    """Return the name of a geom's shape, such as `CAPSULE`."""
    return mujoco.mjtGeom(int(model.geom_type[geom])).name.removeprefix("mjGEOM_")


def differing_arrays(one: DeviceBody, other: DeviceBody) -> list[str]:
    """Return the names of the arrays because of which two bodies cannot share a batch."""
    names = {**one.shared, **other.shared}
    return [name for name in names if one.shared.get(name) != other.shared.get(name)]
