"""Numbers of a compiled model, read by the table `fields.toml`, and its contacts.

A number is left out if the condition of its array does not hold for the element. Elements without
an effect are left out too: geoms that touch no other geom, guide no tendon and feel no fluid,
unused sites, and bodies without joint or moving mass that carry only such elements. Joints and
actuators are in the model's order, as are the numbers of state and control; all other elements are
sorted by name.

The friction of one geom may have no effect: a contact uses the larger coefficient of its two geoms,
so a slippery foot on a rough floor acts like a rough foot. `contact_arrays` follows the
rules by which MuJoCo 4.0.0 combines the parameters (`mujoco/doc/modeling.rst`, "Contact
parameters"). The tests compare them with the contacts of simulated scenes.

Measured, and easy to get wrong:

- margins add up, and so do gaps, for any priority;
- adhesions add up unless one geom has the higher priority;
- a friction coefficient is never below 1e-5;
- a time constant below two time steps counts as two time steps, unless the model switches
  `refsafe` off or integrates with `discrete`: contacts can be softer, but not harder.
"""

from __future__ import annotations

import hashlib
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.morphology.spec import unique_namer
from shapechanger.morphology.spec.references import COUPLINGS, TARGETS, WRAPS

Values = tuple[float | str, ...]
Numbers = dict[str, dict[str, dict[str, Values]]]
"""Numbers and words by section, element and quantity; SI units, angles in rad."""

_Ints = NDArray[np.int64]
_Floats = NDArray[np.float64]
_O: Final = mujoco.mjtObj
_J: Final = mujoco.mjtJoint
_T: Final = mujoco.mjtTrn
_W: Final = mujoco.mjtWrap
_E: Final = mujoco.mjtEq
_DISABLE: Final = mujoco.mjtDisableBit
_ENABLE: Final = mujoco.mjtEnableBit

# For each contact dimension how many of (slide, slide, spin, roll, roll) act.
_FRICTION_COUNT: Final = {1: 0, 3: 2, 4: 3, 6: 5}
_SLIDE_SPIN_ROLL: Final = [0, 0, 1, 2, 2]
_FLAT: Final = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))
# Switches without an effect on the motion, and switches whose effect is already contained in the
# numbers of contacts and limits.
_QUIET: Final = {
    *("sensor", "midphase", "energy", "fwdinv"),
    *("contact", "filterparent", "refsafe", "override"),
}
# Coordinates of a mesh are in single precision, and every machine rounds them in its own way.
_STEPS: Final = 60_000.0


class Field(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The array of a quantity; `fields.toml` explains its keys."""

    array: str
    unit: str | tuple[str, str] = ""
    where: str = ""
    of: str = ""
    padded: bool = False


TABLE: Final[dict[str, Any]] = tomllib.loads(
    Path(__file__).with_name("fields.toml").read_text(encoding="utf-8")
)
MOVED: Final = msgspec.convert(TABLE["moved"], dict[str, dict[str, Field]])
"""Quantities that decide the motion, by section; constants that MuJoCo derives are not included."""
_IN_ORDER: Final = ("joints", "actuators")

KINDS: Final = {
    "bodies": ("body", "body", _O.mjOBJ_BODY),
    "joints": ("joint", "jnt", _O.mjOBJ_JOINT),
    "geoms": ("geom", "geom", _O.mjOBJ_GEOM),
    "sites": ("site", "site", _O.mjOBJ_SITE),
    "tendons": ("tendon", "tendon", _O.mjOBJ_TENDON),
    "actuators": ("actuator", "actuator", _O.mjOBJ_ACTUATOR),
    "equalities": ("equality constraint", "eq", _O.mjOBJ_EQUALITY),
    "flexes": ("flex", "flex", _O.mjOBJ_FLEX),
    "sensors": ("sensor", "sensor", _O.mjOBJ_SENSOR),
    "keyframes": ("keyframe", "key", _O.mjOBJ_KEY),
    "custom": ("custom number", "numeric", _O.mjOBJ_NUMERIC),
}
"""Title of each kind of named element, the prefix of its arrays in a model, and MuJoCo's type."""


def kinds_of(m: mujoco.MjModel) -> dict[str, list[str]]:
    """Return the kind of element of each index in arrays of mixed kinds; "" for no element."""
    section = {kind: name for name, (_, _, kind) in KINDS.items()}
    ends = zip(m.actuator_trntype.tolist(), m.actuator_trnid[:, 1].tolist(), strict=True)
    ties = zip(m.eq_type.tolist(), m.eq_objtype.tolist(), strict=True)
    return {
        # `so3` drives a ball joint, or a site with its reference site.
        "actuator_target_kinds": [
            "sites"
            if kind == _T.mjTRN_SO3 and end >= 0
            else section[TARGETS.get(_T(kind), _O.mjOBJ_JOINT)]
            for kind, end in ends
        ],
        "wrap_kinds": [
            section[WRAPS[_W(kind)]] if _W(kind) in WRAPS else "" for kind in m.wrap_type.tolist()
        ],
        "eq_kinds": [section.get(COUPLINGS.get(_E(kind), _O(on)), "flexes") for kind, on in ties],
    }


def made_arrays(m: mujoco.MjModel) -> dict[str, Any]:
    """Return the arrays of the table that MuJoCo does not have, except the arrays of contacts."""
    option, moves, free = m.opt, m.body_treeid >= 0, m.jnt_type == _J.mjJNT_FREE
    medium = option.density > 0.0 or option.viscosity > 0.0
    wraps = np.isin(m.wrap_type, [_W.mjWRAP_SPHERE.value, _W.mjWRAP_CYLINDER.value])
    sites = [_T.mjTRN_SITE.value, _T.mjTRN_SLIDERCRANK.value, _T.mjTRN_SO3.value]
    found: dict[str, Any] = {
        "opt_medium": np.array([medium]),
        "opt_sleeps": np.array([bool(option.enableflags & _ENABLE.mjENBL_SLEEP)]),
        "body_moves": moves,
        # A free body starts from the `qpos0` of its joint.
        "body_placed": ~np.isin(np.arange(m.nbody), m.jnt_bodyid[free]),
        "body_floats": moves & (m.body_gravcomp != 0.0) & m.flg_gravcomp,
        "body_mocap": m.body_mocapid >= 0,
        "jnt_anchored": ~free,
        "jnt_one_way": np.isin(m.jnt_type, [_J.mjJNT_SLIDE.value, _J.mjJNT_HINGE.value]),
        "jnt_bounded": (m.jnt_limited != 0) & ~free,
        # A plane's size is drawn, but has no effect on collisions.
        "geom_sized": m.geom_type != mujoco.mjtGeom.mjGEOM_PLANE,
        "geom_shape": [_shape(m, geom) for geom in range(m.ngeom)],
        # Geoms on which a fluid acts by MuJoCo's ellipsoid model.
        "geom_in_fluid": (m.geom_fluid[:, 0] > 0.0) & medium,
        "wrap_side": np.where(wraps, m.wrap_prm, -1.0).astype(np.int64),
        "wrap_coefficient": np.where(wraps, 0.0, m.wrap_prm),
        "actuator_trnid0": m.actuator_trnid[:, 0],
        "actuator_trnid1": m.actuator_trnid[:, 1],
        "actuator_has_sites": np.isin(m.actuator_trntype, sites),
        "actuator_is_crank": m.actuator_trntype == _T.mjTRN_SLIDERCRANK,
        "actuator_is_muscle": m.actuator_gaintype == mujoco.mjtGain.mjGAIN_MUSCLE,
        # Actuators whose damping and armature act on their joint or tendon.
        "actuator_added": np.isin(
            np.arange(m.nactuator), np.concatenate([m.jnt_actuatorid, m.tendon_actuatorid])
        ),
    }
    for of in ("jnt", "tendon"):
        springy = getattr(m, f"{of}_stiffness") != 0.0
        found[f"{of}_springy"] = springy | getattr(m, f"{of}_stiffnesspoly").any(axis=1)
    for name, prefix, bits, switches in (
        ("opt_switched_off", "mjDSBL_", option.disableflags, _DISABLE.__members__),
        ("opt_switched_on", "mjENBL_", option.enableflags, _ENABLE.__members__),
    ):
        on = [key for key, bit in switches.items() if bits & bit.value and key.startswith(prefix)]
        words = [key.removeprefix(prefix).lower() for key in on]
        found[name] = np.array([[word for word in words if word not in _QUIET]])
    return found | kinds_of(m)


def colliding_pairs(model: mujoco.MjModel) -> tuple[_Ints, _Ints]:
    """Return the pairs that MuJoCo tests for collision and whose contacts can have an effect.

    Returns:
        The indices of the explicit `<pair>` elements, shape (n,); and the geoms of each other pair
        that passes the filters, shape (m, 2).
    """
    flags = model.opt.disableflags
    if flags & (_DISABLE.mjDSBL_CONSTRAINT | _DISABLE.mjDSBL_CONTACT):
        return np.zeros(0, np.int64), np.zeros((0, 2), np.int64)
    described = geoms_of_pairs(model)
    candidates = np.flatnonzero(model.geom_contype | model.geom_conaffinity)
    pairs = candidates[np.stack(np.triu_indices(candidates.size, k=1), axis=1)]
    bodies = model.geom_bodyid[pairs]
    welds = model.body_weldid[bodies]
    accepted = _can_matter(model, pairs) & (welds[:, 0] != welds[:, 1])
    # Bodies carry the bits of all their geoms as they were compiled: bits that are set in a
    # compiled model later have no effect.
    for types, affinities in (
        (model.geom_contype[pairs], model.geom_conaffinity[pairs]),
        (model.body_contype[bodies], model.body_conaffinity[bodies]),
    ):
        accepted &= ((types & affinities[:, ::-1]) != 0).any(axis=1)
    if not flags & _DISABLE.mjDSBL_FILTERPARENT:
        parents = model.body_weldid[model.body_parentid[welds]]
        related = (welds == parents[:, ::-1]).any(axis=1)
        accepted &= ~(related & (welds != 0).all(axis=1))
    ends = np.sort(bodies, axis=1)
    accepted &= ~np.isin((ends[:, 0] << 16) + ends[:, 1], model.exclude_signature)
    codes, own = (x[:, 0] * model.ngeom + x[:, 1] for x in (pairs, np.sort(described, axis=1)))
    accepted &= ~np.isin(codes, own)
    return np.flatnonzero(_can_matter(model, described)), pairs[accepted]


def _can_matter(model: mujoco.MjModel, pairs: _Ints) -> NDArray[np.bool_]:
    """Return whether MuJoCo can collide the geoms of each pair, and one of them can move."""
    moving = model.body_treeid[model.geom_bodyid[pairs]] >= 0
    flat = np.isin(model.geom_type[pairs], _FLAT)
    return np.logical_and(~np.all(flat, axis=1), np.any(moving, axis=1))


def geoms_of_pairs(model: mujoco.MjModel) -> _Ints:
    """Return the geoms of the explicit contact pairs of a model, shape (npair, 2)."""
    return np.stack([model.pair_geom1, model.pair_geom2], axis=1).astype(np.int64)


def contact_arrays(model: mujoco.MjModel) -> dict[str, NDArray[Any]]:
    """Return the contacts that can have an effect, a row each, with their effective parameters.

    Keys are the names of `pair_*` with the prefix `contact_`, and `contact_geoms` (n, 2). Friction
    (n, 5) is slide, slide, spin, roll, roll, and 0 for a direction that has no friction;
    `contact_softens` is true if friction has a different solref from the normal direction.
    """
    explicit, dynamic = colliding_pairs(model)
    values: dict[str, NDArray[Any]] = {
        name: np.concatenate([getattr(model, f"pair_{name}")[explicit], mixed])
        for name, mixed in mixed_parameters(model, dynamic).items()
    }
    option = model.opt
    if option.enableflags & mujoco.mjtEnableBit.mjENBL_OVERRIDE:
        values["friction"][:] = option.o_friction
        values["solref"][:] = values["solreffriction"][:] = option.o_solref
        values["solimp"][:] = option.o_solimp
        values["margin"][:] = option.o_margin
    dimensions = values["dim"].astype(np.int64)
    acting = np.array([_FRICTION_COUNT[dimension] for dimension in dimensions.tolist()])
    friction = np.maximum(values["friction"], mujoco.mjMINMU)
    values["friction"] = np.where(np.arange(5) < acting[:, None], friction, 0.0)
    softness, own = (_safe_solref(model, values[name]) for name in ("solref", "solreffriction"))
    # Pyramidal cones mix the normal with the friction directions, so only `solref` is used.
    elliptic = option.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    differs = values["solreffriction"].any(axis=1) & (own != softness).any(axis=1)
    values["softens"] = differs & (dimensions > 1) & elliptic
    # MuJoCo reads adhesion only if the compiler, or mj_setConst, has found some.
    values["adhesion"] = values["adhesion"] * model.flg_adhesion
    values["geoms"] = np.vstack([geoms_of_pairs(model)[explicit], dynamic])
    return {f"contact_{name}": array for name, array in values.items()}


def mixed_parameters(model: mujoco.MjModel, pairs: _Ints) -> dict[str, _Floats]:
    """Return the parameters that MuJoCo mixes for pairs of geoms (n, 2), named as in `pair_*`."""
    priority = model.geom_priority[pairs[:, 0]] - model.geom_priority[pairs[:, 1]]
    # The weight of the first geom's solver parameters; half if both weights are zero.
    weights = np.where(model.geom_solmix < mujoco.mjMINVAL, 0.0, model.geom_solmix)[pairs]
    total = weights.sum(axis=1)
    share = np.where(total, weights[:, 0] / np.where(total, total, 1.0), 0.5)[:, None]

    def weighted(one: _Floats, two: _Floats) -> _Floats:
        return share * one + (1.0 - share) * two

    def reference(one: _Floats, two: _Floats) -> _Floats:
        both_standard = (one[:, :1] > 0.0) & (two[:, :1] > 0.0)
        return np.where(both_standard, weighted(one, two), np.minimum(one, two))

    def mixed(name: str, if_equal: Callable[[_Floats, _Floats], _Floats]) -> _Floats:
        one, two = (getattr(model, f"geom_{name}")[side].astype(np.float64) for side in pairs.T)
        first = priority.reshape(-1, *[1] * (one.ndim - 1))
        return np.where(first > 0, one, np.where(first < 0, two, if_equal(one, two)))

    return {
        "dim": mixed("condim", np.maximum),
        "friction": mixed("friction", np.maximum)[:, _SLIDE_SPIN_ROLL],
        "solref": mixed("solref", reference),
        "solreffriction": np.zeros((len(pairs), 2)),
        "solimp": mixed("solimp", weighted),
        "margin": model.geom_margin[pairs].sum(axis=1),
        "gap": model.geom_gap[pairs].sum(axis=1),
        "adhesion": mixed("adhesion", np.add),
    }


def _safe_solref(model: mujoco.MjModel, solref: _Floats) -> _Floats:
    """Return reference parameters as the solver uses them: positive time constants are raised."""
    off = model.opt.disableflags & _DISABLE.mjDSBL_REFSAFE
    if off or model.opt.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE:
        return solref
    safe, times = solref.copy(), solref[:, 0]
    safe[:, 0] = np.where(times > 0.0, np.maximum(times, 2.0 * model.opt.timestep), times)
    return safe


def moved_numbers(model: mujoco.MjModel) -> Numbers:
    """Return the numbers of a compiled model that determine its motion."""
    reader = _Reader(model)
    found = {section: reader.section(section) for section in MOVED}
    found["options"] = {"simulation": reader.rows(MOVED["options"], 1)[0]}
    found["sizes"] = {
        name: {"dimensions": (float(getattr(model, name)),)} for name in ("nq", "nv", "nu", "na")
    }
    geoms, free = reader.names["geoms"], unique_namer((), " ({})")
    pairs: list[list[int]] = reader.array("contact_geoms").tolist()
    contacts = [free(" + ".join(sorted(geoms[geom] for geom in pair))) for pair in pairs]
    rows = reader.rows(MOVED["contacts"], len(contacts))
    found["contacts"] = dict(sorted(zip(contacts, rows, strict=True)))
    found["whole"] = {
        name: {"type": (_digest(*(reader.array(array) for array in arrays)),)}
        for name, (condition, *arrays) in TABLE["whole"].items()
        if np.any(reader.array(condition))
    }
    found["derived"] = {
        name: {"values": _plain(getattr(model, name)[reader.kept[mask] if mask else slice(None)])}
        for name, mask in TABLE["derived"].items()
    }
    found["derived"]["meaninertia"] = {"values": (float(model.stat.meaninertia),)}
    return found


def sensed_values(model: mujoco.MjModel, *, drawn: bool) -> list[Values]:
    """Return data that an env may read besides the motion; with `drawn`, also data of frames."""
    reader = _Reader(model)
    found = [tuple[float | str, ...](reader.names[kind]) for kind in TABLE["read_by_name"]]
    found += [_plain(reader.values(Field(name))) for name in TABLE["sensed"]]
    if drawn:
        found.append(tuple(_digest(getattr(model, name)) for name in TABLE["drawn"]))
    return found


class _Reader:
    def __init__(self, model: mujoco.MjModel) -> None:
        self._model = model
        self._made: dict[str, Any] = contact_arrays(model) | made_arrays(model)
        self.names = names_of(model)
        self.kept = self._relevant()

    def section(self, section: str) -> dict[str, dict[str, Values]]:
        names = self.names.get(section, [])
        rows = self.rows(MOVED[section], len(names))
        kept = self.kept.get(section, [True] * len(names))
        found = {name: row for name, row, keep in zip(names, rows, kept, strict=True) if keep}
        return found if section in _IN_ORDER else dict(sorted(found.items()))

    def rows(self, fields: dict[str, Field], count: int) -> list[dict[str, Values]]:
        rows: list[dict[str, Values]] = [{} for _ in range(count)]
        for quantity, field in fields.items() if count else ():
            acts = field.where and self._split(field.where, self.array(field.where))
            for i, values in enumerate(self._split(field.array, self.values(field))):
                if not acts or np.any(acts[i]):
                    rows[i][quantity] = _plain(values)
        return rows

    def array(self, name: str) -> Any:
        """Return an array of the table; arrays of the options have one row."""
        if name in self._made:
            return self._made[name]
        if name.startswith("opt_"):
            return np.asarray(getattr(self._model.opt, name.removeprefix("opt_"))).reshape(1, -1)
        return getattr(self._model, name)

    def _split(self, array: str, values: Any) -> list[Any]:
        first = "jnt_dofadr" if array.startswith("dof_") else TABLE["first_rows"].get(array)
        return np.split(values, getattr(self._model, first)[1:]) if first else list(values)

    def values(self, field: Field) -> Any:
        """Return an array with words for enumerations, and names for indices."""
        values = self.array(field.array)
        if field.of.startswith("mjt"):
            members = [getattr(mujoco, field.of)(value) for value in values.ravel().tolist()]
            return np.array([member.name.partition("_")[2].lower() for member in members])
        if field.of:
            # Elements without a kind, such as pulleys, have the index -1.
            words = ["" if i < 0 else self.names[kind][i] for kind, i in self._indices(field)]
            return np.array(words)
        if field.array.endswith("quat") and not field.array.startswith("key_"):
            # Of the two quaternions of a rotation, use the one that begins with a positive number.
            leading = np.argmax(values != 0.0, axis=1)[:, None]
            return values * np.where(np.take_along_axis(values, leading, axis=1) < 0.0, -1.0, 1.0)
        if "_solref" in field.array:
            return _safe_solref(self._model, values)
        return values

    def _indices(self, field: Field) -> list[tuple[str, int]]:
        values: list[int] = self.array(field.array).tolist()
        kinds: list[str] = self._made.get(field.of, [field.of] * len(values))
        return list(zip(kinds, values, strict=True))

    def _relevant(self) -> dict[str, NDArray[np.bool_]]:
        """Return masks of the bodies, geoms and sites that take part in the motion."""
        model, moving = self._model, self._made["body_moves"]
        used: dict[str, set[int]] = {kind: set() for kind in (*self.names, "")}
        for section in ("actuators", "tendons", "equalities"):
            for field in MOVED[section].values():
                if field.of and not field.of.startswith("mjt"):
                    for kind, index in self._indices(field):
                        used[kind].add(index)
        geoms, sites, bodies = (
            np.isin(np.arange(len(self.names[kind])), list(used[kind]))
            for kind in ("geoms", "sites", "bodies")
        )
        geoms |= self._made["geom_in_fluid"]
        geoms[self._made["contact_geoms"]] = True
        if model.nflex:  # Any geom that can touch may touch a flex.
            geoms |= (model.geom_contype | model.geom_conaffinity) != 0
        bodies |= (model.body_jntnum > 0) | (moving & (model.body_mass > 0.0))
        bodies |= model.body_mocapid >= 0
        bodies[model.geom_bodyid[geoms]] = True
        bodies[model.site_bodyid[sites]] = True
        for child in range(model.nbody - 1, 0, -1):  # A child's index is above its parent's.
            bodies[model.body_parentid[child]] |= bodies[child]
        bodies[0] = False  # The world is the same in every model.
        return {"bodies": bodies, "geoms": geoms, "sites": sites, "moving": bodies & moving}


def _shape(model: mujoco.MjModel, geom: int) -> str:
    """Return a digest of the mesh or height field that shapes a geom; empty without one."""
    data = int(model.geom_dataid[geom])
    if data < 0:
        return ""
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_HFIELD:
        start, rows = model.hfield_adr[data], model.hfield_nrow[data : data + 1]
        heights = model.hfield_data[start : start + int(rows[0]) * model.hfield_ncol[data]]
        return _digest(model.hfield_size[data], rows, heights)
    vertex, face = model.mesh_vertadr[data], model.mesh_faceadr[data]
    return _digest(
        model.mesh_vert[vertex : vertex + model.mesh_vertnum[data]],
        model.mesh_face[face : face + model.mesh_facenum[data]],
    )


def names_of(model: mujoco.MjModel) -> dict[str, list[str]]:
    """Return the names of a model's elements by kind, in the model's order.

    Elements without a name get one by the rule of `shapechanger.morphology.name_elements`.
    """
    names = {
        name: [mujoco.mj_id2name(model, kind, i) or "" for i in range(getattr(model, f"n{prefix}"))]
        for name, (_, prefix, kind) in KINDS.items()
    }
    joints = list(zip(names["joints"], model.jnt_bodyid.tolist(), strict=True))
    first_joints = {body: name for name, body in reversed(joints) if name}
    bodies, parents = names["bodies"], model.body_parentid.tolist()
    target_kinds = kinds_of(model)["actuator_target_kinds"]

    def default(section: str, i: int) -> str:
        if section == "bodies":
            return first_joints.get(i) or f"{bodies[parents[i]]}_part"
        if section == "actuators":
            return names[target_kinds[i]][model.actuator_trnid[i, 0]]
        title, prefix, _ = KINDS[section]
        owners = getattr(model, f"{prefix}_bodyid", None)
        owner = "" if owners is None else f"{bodies[owners[i]]}_"
        return owner + title.partition(" ")[0]

    for section in KINDS:  # Actuators, which are named after their targets, come after them.
        free = unique_namer(names[section])
        for i, name in enumerate(names[section]):
            names[section][i] = name or free(default(section, i))
    return names


def _plain(values: Any) -> Values:
    """Return the numbers or words of an array; -0.0 is 0.0, and a lone empty word is left out."""
    array = np.asarray(values)
    if array.dtype.kind == "U":
        return tuple(word for word in array.ravel().tolist() if word or array.size > 1)
    return tuple((array.astype(np.float64) + 0.0).ravel().tolist())


def _digest(*arrays: NDArray[Any]) -> str:
    """Return 16 hex digits of the contents of arrays, rounded to a 60,000th of the largest."""
    total = hashlib.sha256()
    for array in arrays:
        if array.dtype.kind == "f" and array.size and (largest := float(np.abs(array).max())):
            total.update(f"{largest:.4g} ".encode())
            array = np.rint(array.astype(np.float64) * (_STEPS / largest)).astype(np.int64)
        total.update(f"{array.dtype.str}{array.shape}".encode() + array.tobytes())
    return total.hexdigest()[:16]
