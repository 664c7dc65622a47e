"""The table of the numbers that decide a compiled model's motion, and the arrays that it needs.

`MOVED` names what decides the motion, `SENSED` what else an env or a task may read. An array whose
condition does not hold for an element has no effect on it and is left out, and so are elements
that do nothing: geoms that neither touch nor push a fluid nor guide a tendon, sites that nothing
names, and bodies that carry nothing but those. Joints and actuators stand in the order of the
model, which decides what the numbers of its state and its control mean; all else is sorted by name.
"""

from __future__ import annotations

from operator import attrgetter
from pathlib import Path
from typing import Any, Final

import msgspec
import mujoco
import numpy as np

Values = tuple[float | str, ...]
Numbers = dict[str, dict[str, dict[str, Values]]]
"""Numbers and words by section, element and quantity; SI units, angles in rad."""

_T: Final = mujoco.mjtTrn
_W: Final = mujoco.mjtWrap
_ENABLE: Final = mujoco.mjtEnableBit


class Field(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The array of a quantity; `fields.toml` explains its keys."""

    array: str
    unit: str | tuple[str, str] = ""
    where: str = ""
    of: str = ""
    padded: bool = False


class Kind(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A kind of element, of MuJoCo where it has a type; `fields.toml` explains its keys."""

    title: str
    object: str = ""
    prefix: str = ""
    described_by: str = "type"

    @property
    def type(self) -> mujoco.mjtObj:
        """Return MuJoCo's type."""
        return getattr(mujoco.mjtObj, f"mjOBJ_{self.object}")


class _Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    drawn: list[str]
    in_order: list[str]
    quiet: list[str]
    quiet_without_flexes: list[str]
    kinds: dict[str, Kind]
    conditions: dict[str, list[str]]
    kinds_of_indices: dict[str, str]
    moved: dict[str, dict[str, Field]]
    sensed: dict[str, dict[str, Field]]
    first_rows: dict[str, str]
    whole: dict[str, list[str]]
    derived: dict[str, str]
    constants: dict[str, str]


TABLE: Final = msgspec.toml.decode(
    Path(__file__).with_name("fields.toml").read_bytes(), type=_Table
)
MOVED: Final = TABLE.moved
"""Sections of what decides the motion; `derived` constants of `mujoco.mj_setConst` follow them."""
SENSED: Final = {"places": MOVED["geoms"], "marks": MOVED["sites"]} | TABLE.sensed
"""Sections of what an env or a task may read besides, the last two where frames are observed."""
KINDS: Final = TABLE.kinds | {"places": TABLE.kinds["geoms"], "marks": TABLE.kinds["sites"]}
"""Kind of each section; the kinds with a type in MuJoCo have names."""


def made_arrays(m: mujoco.MjModel) -> dict[str, Any]:
    """Return the arrays of the table that MuJoCo does not have; see `numbers` for contacts."""
    option, wraps = m.opt, np.isin(m.wrap_type, [_W.mjWRAP_SPHERE.value, _W.mjWRAP_CYLINDER.value])
    moves, free = m.body_treeid >= 0, m.jnt_type == mujoco.mjtJoint.mjJNT_FREE
    medium = option.density > 0.0 or option.viscosity > 0.0
    sleeps = bool(option.enableflags & _ENABLE.mjENBL_SLEEP)
    overrides = m.nflex > 0 and bool(option.enableflags & _ENABLE.mjENBL_OVERRIDE)
    policies = np.zeros(m.nbody)
    policies[m.tree_bodyadr] = m.tree_sleep_policy
    found: dict[str, Any] = {
        "opt_medium": np.array([medium]),
        "opt_sleeps": np.array([sleeps]),
        "opt_overrides_flexes": np.array([overrides]),
        "body_moves": moves,
        # A free body starts from the `qpos0` of its joint.
        "body_placed": ~np.isin(np.arange(m.nbody), m.jnt_bodyid[free]),
        "body_floats": moves & (m.body_gravcomp != 0.0) & m.flg_gravcomp,
        "body_mocap": m.body_mocapid >= 0,
        "body_sleep_policy": policies,
        "body_sleeps": moves & sleeps,
        "jnt_bounded": (m.jnt_limited != 0) & ~free,
        # A plane's size is drawn, but has no effect on collisions.
        "geom_sized": m.geom_type != mujoco.mjtGeom.mjGEOM_PLANE,
        "geom_slides": m.geom_surfacevel.any(axis=1) & m.flg_surfacevel,
        # A fluid pushes on these by the ellipsoid model.
        "geom_in_fluid": (m.geom_fluid[:, 0] > 0.0) & medium,
        "wrap_side": np.where(wraps, m.wrap_prm, -1.0).astype(np.int64),
        "wrap_coefficient": np.where(wraps, 0.0, m.wrap_prm),
        "actuator_trnid0": m.actuator_trnid[:, 0],
        "actuator_trnid1": m.actuator_trnid[:, 1],
        "actuator_delays": m.actuator_historyadr >= 0,
        "actuator_disabled": (option.disableactuator >> m.actuator_group.clip(0, 30)) & 1,
        # Their joint or tendon knows of their damping and armature.
        "actuator_added": np.isin(
            np.arange(m.nactuator), np.concatenate([m.jnt_actuatorid, m.tendon_actuatorid])
        ),
    }
    for name, (array, *values) in TABLE.conditions.items():
        found[name] = np.isin(getattr(m, array), [attrgetter(v)(mujoco).value for v in values])
    quiet = TABLE.quiet + ([] if m.nflex else TABLE.quiet_without_flexes)
    for name, prefix, bits, switches in (
        ("opt_switched_off", "mjDSBL_", option.disableflags, mujoco.mjtDisableBit.__members__),
        ("opt_switched_on", "mjENBL_", option.enableflags, _ENABLE.__members__),
    ):
        on = [key for key, bit in switches.items() if bits & bit.value and key not in quiet]
        words = [key.removeprefix(prefix).lower() for key in on if key.startswith(prefix)]
        found[name] = np.array([words], np.str_)
    for of in ("jnt", "tendon"):
        springy = getattr(m, f"{of}_stiffness") != 0.0
        found[f"{of}_springy"] = springy | getattr(m, f"{of}_stiffnesspoly").any(axis=1)
        found[f"{of}_yields"] = found[f"{of}_springy"] & (getattr(m, f"{of}_plasticadr") >= 0)
    return found | kinds_of(m)


def kinds_of(m: mujoco.MjModel) -> dict[str, list[str]]:
    """Return the kinds of the elements that indices of several kinds are of; "" for none."""
    by_object = {kind.type.value: name for name, kind in TABLE.kinds.items() if kind.object}
    by_object[mujoco.mjtObj.mjOBJ_XBODY.value] = "bodies"
    named, ties = TABLE.kinds_of_indices, zip(m.eq_type, m.eq_objtype.tolist(), strict=True)
    ends = zip(m.actuator_trntype.tolist(), m.actuator_trnid[:, 1].tolist(), strict=True)
    return {
        "actuator_target_kinds": [
            # `so3` drives a ball joint, or a site with its reference site.
            "sites" if kind == _T.mjTRN_SO3 and end >= 0 else named.get(_T(kind).name, "joints")
            for kind, end in ends
        ],
        "wrap_kinds": [named.get(_W(kind).name, "geoms") for kind in m.wrap_type.tolist()],
        "eq_kinds": [
            named.get(mujoco.mjtEq(kind).name) or by_object.get(on, "flexes") for kind, on in ties
        ],
        "sensor_object_kinds": [by_object.get(kind, "") for kind in m.sensor_objtype.tolist()],
        "sensor_reference_kinds": [by_object.get(kind, "") for kind in m.sensor_reftype.tolist()],
    }
