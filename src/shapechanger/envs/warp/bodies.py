"""Read bodies for a device: arrays per world, and arrays that all worlds of a batch share."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, Final, NamedTuple, cast

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.envs.warp.devices import mjw, wp

Rows = Mapping[str, NDArray[Any]]
"""Arrays of one body, keyed by name."""

# Only used for rendering, which does not happen on the device.
_DRAWN: Final = ("cam_", "light_", "mat_", "geom_rgba", "geom_matid", "geom_group", "site_type")
# Options that may differ between worlds.
_OPTIONS: Final = ("timestep", "gravity", "wind", "magnetic", "density", "viscosity")
# Options that are the same for all worlds.
_SHARED_OPTIONS: Final = (
    *("tolerance", "ls_tolerance", "noslip_tolerance", "ccd_tolerance", "impratio"),
    *("integrator", "cone", "jacobian", "solver", "iterations", "ls_iterations"),
    *("noslip_iterations", "ccd_iterations", "disableflags", "enableflags"),
)
ARMS: Final = "wrap_prm"
"""Moment arms of tendons over joints, which may differ between worlds; see `kernels`."""
# Arrays of which mujoco-warp checks whether all numbers are zero, or which.
_ANY_ZERO: Final = (
    *("tendon_stiffness", "tendon_stiffnesspoly", "tendon_damping", "tendon_dampingpoly"),
    *("actuator_damping", "actuator_dampingpoly", "dof_frictionloss"),
    *("tendon_frictionloss", "geom_adhesion", "geom_surfacevel"),
)
_EACH_ZERO: Final = ("actuator_gainprm", "actuator_biasprm", "actuator_gear", "body_mass")
# Used only by sleeping bodies and sensors, which the tasks do not have.
_UNREAD: Final = ("dof_length", "site_size")


class DeviceBody(NamedTuple):
    """Arrays of a body for a device.

    Attributes:
        name: Its name or edits, for messages.
        shared: Arrays that all worlds of a batch have in common, as bytes.
        rows: Arrays that may differ between worlds.
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
    """Read a compiled body.

    Args:
        name: Its name or edits, for messages.
        model: The compiled model.
        constants: Numbers of the task that depend on the body.
    """
    names = [field.name for field in _fields() if _has_rows(field)]
    rows = {name: np.array(getattr(model, name)) for name in (*names, ARMS)}
    rows |= {f"opt.{name}": np.array(getattr(model.opt, name)) for name in _OPTIONS}
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    static = static_geoms(model)
    places = {
        "geom_xpos": data.geom_xpos[static],
        "geom_xmat": data.geom_xmat[static].reshape(-1, 3, 3),
    }
    return DeviceBody(name, dict(_shared(model)), rows, places, constants)


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


@cache
def _fields() -> list[Any]:
    """Return the fields of mujoco-warp's model that are not for rendering."""
    return [f for f in dataclasses.fields(mjw.Model) if not f.name.startswith(_DRAWN)]


def _has_rows(field: Any) -> bool:
    """Return whether a field is an array that may differ between worlds."""
    return isinstance(field.type, wp.array) and field.type.shape[0] == "*"


def _shared(model: mujoco.MjModel) -> Iterator[tuple[str, bytes]]:
    """Yield name and bytes of all data that mujoco-warp keeps once for all worlds."""
    for field in _fields():
        name = field.name
        if name in _UNREAD or not hasattr(model, name):
            continue
        value: Any = getattr(model, name)
        if field.type is int or field.type is bool:
            yield name, str(int(value)).encode()
        elif isinstance(field.type, wp.array):
            array: NDArray[Any] = np.asarray(value)
            # Rows only share their shape. A pulley's divisor takes the place of the arms.
            only_joints = bool(np.all(model.wrap_type == mujoco.mjtWrap.mjWRAP_JOINT))
            own = _has_rows(field) or (name == ARMS and only_joints)
            yield name, str(array.shape).encode() + (b"" if own else array.tobytes())
    for name in _SHARED_OPTIONS:
        yield f"opt.{name}", str(getattr(model.opt, name)).encode()
    # If arrays are zero, mujoco-warp skips the related computations. It decides this once for all
    # worlds, from the model that a batch is created from (`put_model`).
    for name in _ANY_ZERO:
        yield f"zeros of {name}", str(np.any(getattr(model, name))).encode()
    for name in _EACH_ZERO:
        yield f"zeros of {name}", (np.asarray(getattr(model, name)) != 0.0).tobytes()
    options = cast("Any", model.opt)
    in_fluid = options.wind.any() or options.density > 0.0 or options.viscosity > 0.0
    yield "zeros of opt.wind, opt.density and opt.viscosity", str(bool(in_fluid)).encode()
