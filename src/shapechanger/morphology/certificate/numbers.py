"""Numbers of a compiled model, read by the table of `fields`."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.morphology.certificate.contacts import contact_arrays, safe_solref
from shapechanger.morphology.certificate.fields import (
    ACTUATOR_FIELDS,
    CONTACT_FIELDS,
    EQUALITY_FIELDS,
    MOVED,
    NAMED,
    OPTIONS,
    SENSED,
    TENDON_FIELDS,
    Field,
    Kind,
    Numbers,
    Values,
    in_fluid,
    moving,
    targets_of,
)
from shapechanger.morphology.spec.elements import unique_namer

# Arrays with several rows to an element, and its first row.
_FIRST_ROWS: Final = {
    "qpos0": "jnt_qposadr",
    "qpos_spring": "jnt_qposadr",
    "wrap_type": "tendon_adr",
    "wrap_objid": "tendon_adr",
    "wrap_side": "tendon_adr",
    "wrap_coefficient": "tendon_adr",
    "actuator_gear": "actuator_outadr",
    "actuator_lengthrange": "actuator_outadr",
    "actuator_ctrlrange": "actuator_ctrladr",
    "actuator_ctrllimited": "actuator_ctrladr",
    "numeric_data": "numeric_adr",
}
# Switches that decide what is computed besides the motion, or that contacts and limits have already
# taken into account.
_DISABLE: Final = mujoco.mjtDisableBit
_ENABLE: Final = mujoco.mjtEnableBit
_QUIET: Final = (
    *(_DISABLE.mjDSBL_SENSOR, _DISABLE.mjDSBL_MIDPHASE, _ENABLE.mjENBL_ENERGY),
    _ENABLE.mjENBL_FWDINV,
)
_WITHOUT_FLEXES: Final = (
    *(_DISABLE.mjDSBL_CONTACT, _DISABLE.mjDSBL_FILTERPARENT, _DISABLE.mjDSBL_REFSAFE),
    _ENABLE.mjENBL_OVERRIDE,
)
_FLEX_ARRAYS: Final = (
    *("flex_vertbodyid", "flex_nodebodyid", "flex_elem", "flex_vert", "flex_node"),
    *("flex_stiffness", "flex_bending", "flexedge_length0"),
)
_PLUGIN_ARRAYS: Final = ("plugin", "plugin_attr", "body_plugin", "geom_plugin", "actuator_plugin")
# Constants of `mujoco.mj_setConst`, and the elements that they count for.
_DERIVED: Final = {
    "body_subtreemass": "moving",
    "body_invweight0": "moving",
    "body_margin": "bodies",
    "geom_rbound": "geoms",
    "dof_invweight0": "",
    "dof_M0": "",
    "tendon_length0": "",
    "tendon_invweight0": "",
    "actuator_length0": "",
    "actuator_acc0": "",
}
_DRAWN: Final = (
    *("geom_rgba", "geom_matid", "site_rgba", "site_matid", "skin_rgba", "mat_rgba", "mat_texid"),
    *("mat_texrepeat", "mat_texuniform", "mat_emission", "mat_specular", "mat_shininess"),
    *("mat_reflectance", "tex_type", "tex_height", "tex_width", "tex_nchannel", "tex_data"),
    *("light_pos", "light_dir", "light_diffuse", "light_ambient", "light_specular"),
    *("light_castshadow", "light_active", "light_type", "skin_vert", "skin_face", "tendon_rgba"),
    *("tendon_width", "mesh_texcoord", "mesh_normal"),
)


def moved_numbers(model: mujoco.MjModel, *, anonymous: bool = False) -> Numbers:
    """Return the numbers that decide the motion of a compiled model.

    Args:
        model: The compiled model.
        anonymous: Whether elements are numbered in the order of the model in place of their names.
    """
    return _Reader(model, anonymous=anonymous).moved()


def sensed_numbers(model: mujoco.MjModel, *, drawn: bool) -> Numbers:
    """Return what may be read of a compiled model besides its motion.

    Args:
        model: The compiled model.
        drawn: Whether frames are observed.
    """
    reader = _Reader(model)
    kinds = list(SENSED.items())
    found = {section: reader.section(kind) for section, kind in (kinds if drawn else kinds[:-2])}
    if drawn:
        found["drawing"] = {name: {"digest": (_digest(getattr(model, name)),)} for name in _DRAWN}
    return found


class _Reader:
    """Reads the arrays of a model by the table."""

    def __init__(self, model: mujoco.MjModel, *, anonymous: bool = False) -> None:
        self._model = model
        option, flags = model.opt, model.opt.enableflags
        round_parts = np.isin(
            model.wrap_type,
            (int(mujoco.mjtWrap.mjWRAP_SPHERE), int(mujoco.mjtWrap.mjWRAP_CYLINDER)),
        )
        policies = np.zeros(model.nbody)
        policies[model.tree_bodyadr] = model.tree_sleep_policy
        self._made: dict[str, Any] = contact_arrays(model) | {
            "actuator_trnid0": model.actuator_trnid[:, 0],
            "actuator_trnid1": model.actuator_trnid[:, 1],
            "actuator_disabled": (option.disableactuator >> model.actuator_group.clip(0, 30)) & 1,
            "wrap_side": np.where(round_parts, model.wrap_prm, -1.0).astype(np.int64),
            "wrap_coefficient": np.where(round_parts, 0.0, model.wrap_prm),
            "body_mocap": model.body_mocapid >= 0,
            "body_sleep_policy": policies,
            "opt_switched_off": self._switches(_DISABLE, option.disableflags),
            "opt_switched_on": self._switches(_ENABLE, flags),
        }
        self._made["geom_shape"] = [self._shape(geom) for geom in range(model.ngeom)]
        self.kept = self._relevant()
        self.names = self._numbered() if anonymous else names_of(model)

    def moved(self) -> Numbers:
        """Return all sections of `MOVED` and the derived constants."""
        model = self._model
        found = {
            section: self.section(kind, self.kept.get(section)) for section, kind in MOVED.items()
        }
        found["options"] = {"simulation": self._fields(OPTIONS, 1)[0]}
        found["sizes"] = {
            name: {"dimensions": (float(getattr(model, name)),)}
            for name in ("nq", "nv", "nu", "na")
        }
        geoms, free = self.names["geoms"], unique_namer((), " ({})")
        pairs: list[list[int]] = self._made["contact_geoms"].tolist()
        contacts = [free(" + ".join(sorted(geoms[geom] for geom in pair))) for pair in pairs]
        rows = self._fields(CONTACT_FIELDS, len(contacts))
        found["contacts"] = dict(sorted(zip(contacts, rows, strict=True)))
        whole = (("shapes of flexes", model.nflex, _FLEX_ARRAYS),)
        whole += (("engine plugins", model.nplugin, _PLUGIN_ARRAYS),)
        found["whole"] = {
            name: {"type": (_digest(*(_array(model, array) for array in arrays)),)}
            for name, count, arrays in whole
            if count
        }
        kept = self.kept | {"moving": self.kept["bodies"] & moving(model)}
        found["derived"] = {
            name: {"values": _plain(getattr(model, name)[kept[of]] if of else getattr(model, name))}
            for name, of in _DERIVED.items()
        }
        found["derived"]["meaninertia"] = {"values": (float(model.stat.meaninertia),)}
        return found

    def section(
        self, kind: Kind, kept: NDArray[np.bool_] | None = None
    ) -> dict[str, dict[str, Values]]:
        """Return the elements of a kind with their fields, those of a mask or all."""
        if kind.element is None:
            return {}
        names = self.names[next(key for key, each in NAMED.items() if each == kind.element)]
        pairs = list(zip(names, self._fields(kind.fields, len(names)), strict=True))
        if kept is not None:
            pairs = [pair for pair, wanted in zip(pairs, kept.tolist(), strict=True) if wanted]
        return dict(pairs if kind.in_order else sorted(pairs, key=lambda pair: pair[0]))

    def _fields(self, fields: tuple[Field, ...], count: int) -> list[dict[str, Values]]:
        """Return the fields of each of so many elements."""
        rows: list[dict[str, Values]] = [{} for _ in range(count)]
        for field in fields if count else ():
            parts = self._split(field.array, self._values(field), count)
            present = [True] * count
            if field.where:
                condition = field.where
                mask: Any = (
                    self._array(condition) if isinstance(condition, str) else condition(self._model)
                )
                whose = condition if isinstance(condition, str) else ""
                present = [bool(np.any(part)) for part in self._split(whose, mask, count)]
            for row, values, wanted in zip(rows, parts, present, strict=True):
                if wanted:
                    row[field.quantity] = _plain(values)
        return rows

    def _split(self, array: str, values: Any, count: int) -> list[Any]:
        """Return the rows of an array that belong to each element."""
        first = "jnt_dofadr" if array.startswith("dof_") else _FIRST_ROWS.get(array, "")
        if first:
            return np.split(values, getattr(self._model, first)[1:])
        return [values] if array.startswith("opt_") and count == 1 else list(values)

    def _array(self, name: str) -> Any:
        if name in self._made:
            return self._made[name]
        if name.startswith("opt_"):
            return np.asarray(getattr(self._model.opt, name.removeprefix("opt_"))).reshape(-1)
        return getattr(self._model, name)

    def _values(self, field: Field) -> Any:
        """Return an array with words in place of enumerations, and names in place of indices."""
        values = self._array(field.array)
        if field.of is None:
            if field.array.endswith("quat") and not field.array.startswith("key_"):
                return _canonical(values)
            solref = field.quantity.endswith("solref") and not field.array.startswith(
                ("flex_", "opt_")
            )
            return safe_solref(self._model, values) if solref else values
        if isinstance(field.of, type):
            return np.array([field.of(v).name.partition("_")[2].lower() for v in values.tolist()])
        return np.array(
            [
                (self.names[kind][index] if kind else str(index)) if index >= 0 else ""
                for kind, index in zip(self._kinds(field, values), values.tolist(), strict=True)
            ],
            np.str_,
        )

    def _kinds(self, field: Field, values: Any) -> list[str]:
        """Return the kind of element that each index of an array is of."""
        return [field.of] * len(values) if isinstance(field.of, str) else field.of(self._model)

    def _shape(self, geom: int) -> str:
        """Return a digest of the mesh or height field that shapes a geom; empty without one."""
        model, data = self._model, int(self._model.geom_dataid[geom])
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

    def _switches(self, enumeration: Any, bits: int) -> NDArray[np.str_]:
        """Return the words of the switches that are set and act."""
        quiet = _QUIET if self._model.nflex else (*_QUIET, *_WITHOUT_FLEXES)
        members = [each for each in enumeration.__members__.values() if each not in quiet]
        named = [each for each in members if each.name.startswith(("mjDSBL", "mjENBL"))]
        return np.array(
            [each.name.partition("_")[2].lower() for each in named if bits & each.value], np.str_
        )

    def _relevant(self) -> dict[str, NDArray[np.bool_]]:
        """Return masks of the bodies, geoms and sites that take part in the motion."""
        model = self._model
        used: dict[str, set[int]] = {kind: set() for kind in (*NAMED, "")}
        for field in (*ACTUATOR_FIELDS, *TENDON_FIELDS, *EQUALITY_FIELDS):
            if field.of is not None and not isinstance(field.of, type):
                values = self._array(field.array)
                if callable(field.where):  # The second number of a transmission may be no site.
                    values = np.where(field.where(model), values, -1)
                for kind, index in zip(self._kinds(field, values), values.tolist(), strict=True):
                    used[kind].add(index)
        geoms = in_fluid(model) | np.isin(np.arange(model.ngeom), list(used["geoms"]))
        geoms[self._made["contact_geoms"]] = True
        if model.nflex:  # Any geom that can touch may touch a flex.
            geoms |= (model.geom_contype | model.geom_conaffinity) != 0
        sites = np.isin(np.arange(model.nsite), list(used["sites"]))
        bodies = np.isin(np.arange(model.nbody), list(used["bodies"])) | (model.body_jntnum > 0)
        bodies |= (moving(model) & (model.body_mass > 0.0)) | (model.body_mocapid >= 0)
        bodies[model.geom_bodyid[geoms]] = True
        bodies[model.site_bodyid[sites]] = True
        for child in range(model.nbody - 1, 0, -1):  # A child's index is above its parent's.
            bodies[model.body_parentid[child]] |= bodies[child]
        bodies[0] = False  # The world is the same in every model.
        return {"bodies": bodies, "geoms": geoms, "sites": sites}

    def _numbered(self) -> dict[str, list[str]]:
        """Return numbers in place of names; elements that do not count change none of them."""
        found: dict[str, list[str]] = {}
        for kind, (_, count) in NAMED.items():
            everything = np.full(int(getattr(self._model, count)), fill_value=True)
            kept = self.kept.get(kind, everything).copy()
            if kind == "bodies":
                kept[0] = True  # The world comes first, whatever else matters.
            places = np.argsort(np.argsort(~kept, kind="stable"))
            found[kind] = [f"{kind} {place:06}" for place in places.tolist()]
        return found


def names_of(model: mujoco.MjModel) -> dict[str, list[str]]:
    """Return the names of a model's elements by kind, in the model's order.

    Elements without a name get one by the rule of `shapechanger.morphology.name_elements`.
    """
    names = {
        kind: [mujoco.mj_id2name(model, element, i) or "" for i in range(getattr(model, count))]
        for kind, (element, count) in NAMED.items()
    }
    joint_of_body: dict[int, str] = {}
    for name, body in zip(names["joints"], model.jnt_bodyid.tolist(), strict=True):
        if name:
            joint_of_body.setdefault(body, name)
    bodies, parents = names["bodies"], model.body_parentid.tolist()
    _fill(bodies, lambda i: joint_of_body.get(i) or f"{bodies[parents[i]]}_part")
    owners = {"joints": "jnt", "geoms": "geom", "sites": "site", "cameras": "cam"}
    for kind, prefix in owners.items():
        on, title = getattr(model, f"{prefix}_bodyid").tolist(), kind.removesuffix("s")
        _fill(names[kind], lambda i, on=on, title=title: f"{bodies[on[i]]}_{title}")
    for kind in ("tendons", "equalities", "flexes", "sensors", "keyframes", "custom"):
        title = MOVED.get(kind, SENSED.get(kind, MOVED["whole"])).title.partition(" ")[0]
        _fill(names[kind], lambda _, title=title: title)
    targets = list(zip(targets_of(model), model.actuator_trnid[:, 0].tolist(), strict=True))
    _fill(names["actuators"], lambda i: names[targets[i][0]][targets[i][1]])
    return names


def _fill(names: list[str], default: Callable[[int], str]) -> None:
    """Replace each empty name by its default, numbered if that is taken, in place."""
    free = unique_namer(names)
    for i, name in enumerate(names):
        names[i] = name or free(default(i))


def _plain(values: Any) -> Values:
    """Return the numbers or words of an array; -0.0 is 0.0, and a lone empty word is left out."""
    array = np.asarray(values)
    if array.dtype.kind == "U":
        return tuple(word for word in array.ravel().tolist() if word or array.size > 1)
    return tuple((array.astype(np.float64) + 0.0).ravel().tolist())


def _canonical(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return, of the two quaternions of each rotation, the one whose first number is above 0."""
    leading = np.argmax(quaternions != 0.0, axis=1)[:, None]
    return quaternions * np.where(np.take_along_axis(quaternions, leading, axis=1) < 0.0, -1.0, 1.0)


def _array(model: mujoco.MjModel, name: str) -> NDArray[Any]:
    values = getattr(model, name)
    return np.frombuffer(bytes(values), np.uint8) if name == "plugin_attr" else values


# Coordinates of a mesh are in single precision, and every machine rounds them in its own way.
_STEPS: Final = 60_000.0


def _digest(*arrays: NDArray[Any]) -> str:
    """Return 16 hex digits of the contents of arrays, rounded to a 60,000th of the largest."""
    total = hashlib.sha256()
    for array in arrays:
        if array.dtype.kind == "f" and array.size and (largest := float(np.abs(array).max())):
            total.update(f"{largest:.4g} ".encode())
            array = np.rint(array.astype(np.float64) * (_STEPS / largest)).astype(np.int64)
        total.update(f"{array.dtype.str}{array.shape}".encode() + array.tobytes())
    return total.hexdigest()[:16]
