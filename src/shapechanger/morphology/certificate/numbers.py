"""Numbers of a compiled model, read by the table of `fields`, and its contacts.

A geom's friction alone decides nothing: the contact takes the larger of the two geoms'
coefficients, so a slippery foot on a rough floor is a rough foot. `contact_arrays` follows the
rules by which MuJoCo 4.0.0 combines the parameters (`mujoco/doc/modeling.rst`, "Contact
parameters"). The tests compare them with the contacts of simulated scenes.

Measured, and easy to get wrong:

- margins add up, and so do gaps, whatever the priority;
- adhesions add up unless one geom has the higher priority;
- a friction coefficient is never below 1e-5;
- a time constant below two time steps counts as two time steps, unless the model switches
  `refsafe` off or integrates with `discrete`: softer than that is possible, harder is not.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.morphology.certificate.fields import (
    CONTACT_FIELDS,
    MOVED,
    NAMED,
    SENSED,
    Field,
    Kind,
    Numbers,
    Values,
    kinds_of,
    made_arrays,
)
from shapechanger.morphology.spec.elements import unique_namer

_Ints = NDArray[np.int64]
_Floats = NDArray[np.float64]
_DISABLE: Final = mujoco.mjtDisableBit

# For each contact dimension how many of (slide, slide, spin, roll, roll) act.
_FRICTION_COUNT: Final = {1: 0, 3: 2, 4: 3, 6: 5}
_SLIDE_SPIN_ROLL: Final = [0, 0, 1, 2, 2]
_FLAT: Final = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))
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
# Arrays that count as a whole where there is one of an element.
_WHOLE: Final = {
    "shapes of flexes": (
        "nflex",
        *("flex_vertbodyid", "flex_nodebodyid", "flex_elem", "flex_vert", "flex_node"),
        *("flex_stiffness", "flex_bending", "flexedge_length0"),
    ),
    "engine plugins": (
        "nplugin",
        *("plugin", "plugin_attr", "body_plugin", "geom_plugin", "actuator_plugin"),
    ),
}
# Constants of `mujoco.mj_setConst`, and the mask of the elements that they count for.
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


def colliding_pairs(model: mujoco.MjModel) -> tuple[_Ints, _Ints]:
    """Return the pairs that MuJoCo tests for collision and whose contacts can move something.

    Returns:
        The indices of the explicit `<pair>` elements, shape (n,); and the geoms of every other
        pair, which pass the filters, shape (m, 2).
    """
    flags = model.opt.disableflags
    if flags & (_DISABLE.mjDSBL_CONSTRAINT | _DISABLE.mjDSBL_CONTACT):
        return np.zeros(0, np.int64), np.zeros((0, 2), np.int64)
    explicit = np.arange(model.npair)
    described = geoms_of_pairs(model, explicit)
    candidates = np.flatnonzero(model.geom_contype | model.geom_conaffinity)
    first, second = np.triu_indices(candidates.size, k=1)
    pairs = np.stack([candidates[first], candidates[second]], axis=1)
    bodies = model.geom_bodyid[pairs]
    welds = model.body_weldid[bodies]
    # Bodies carry the bits of all their geoms as they were compiled: bits that are set in a
    # compiled model later have no effect.
    accepted = _bits_match(model.geom_contype[pairs], model.geom_conaffinity[pairs])
    accepted &= _bits_match(model.body_contype[bodies], model.body_conaffinity[bodies])
    accepted &= _can_matter(model, pairs)
    accepted &= welds[:, 0] != welds[:, 1]
    if not flags & _DISABLE.mjDSBL_FILTERPARENT:
        parents = model.body_weldid[model.body_parentid[welds]]
        related = (welds == parents[:, ::-1]).any(axis=1)
        accepted &= ~(related & (welds != 0).all(axis=1))
    ends = np.sort(bodies, axis=1)
    accepted &= ~np.isin((ends[:, 0] << 16) + ends[:, 1], model.exclude_signature)
    codes, own = (x[:, 0] * model.ngeom + x[:, 1] for x in (pairs, np.sort(described, axis=1)))
    accepted &= ~np.isin(codes, own)
    return explicit[_can_matter(model, described)], pairs[accepted]


def _bits_match(types: NDArray[Any], affinities: NDArray[Any]) -> NDArray[np.bool_]:
    """Return for pairs whether the type of one is among the affinities of the other."""
    return ((types & affinities[:, ::-1]) != 0).any(axis=1)


def _can_matter(model: mujoco.MjModel, pairs: _Ints) -> NDArray[np.bool_]:
    """Return whether MuJoCo can collide the two shapes, and one of the two can move."""
    flat = np.isin(model.geom_type[pairs], _FLAT).all(axis=1)
    moving = model.body_treeid[model.geom_bodyid[pairs]] >= 0
    return np.logical_and(~flat, np.any(moving, axis=1))


def geoms_of_pairs(model: mujoco.MjModel, explicit: _Ints) -> _Ints:
    """Return the geoms of explicit contact pairs, shape (n, 2).

    Args:
        model: The model.
        explicit: Indices of the pairs, shape (n,).
    """
    both = np.stack([model.pair_geom1, model.pair_geom2], axis=1)
    return both[explicit].astype(np.int64)


def contact_arrays(model: mujoco.MjModel) -> dict[str, NDArray[Any]]:
    """Return the contacts that can move something, a row each, with the parameters that act.

    Arrays are called as those of explicit pairs, with `contact_` in front: `contact_geoms` (n, 2),
    `contact_dim`, `contact_friction` (n, 5): slide, slide, spin, roll, roll, 0 where it does not
    act; `contact_solref`, `contact_solreffriction`, `contact_solimp`, `contact_margin`,
    `contact_gap` and `contact_adhesion`. `contact_softens` tells whether friction has a solref of
    its own.
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
    acting = np.array([_FRICTION_COUNT[dimension] for dimension in dimensions.tolist()], np.int64)
    friction = np.maximum(values["friction"], mujoco.mjMINMU)
    values["friction"] = np.where(np.arange(5) < acting[:, None], friction, 0.0)
    softness, own = (_safe_solref(model, values[name]) for name in ("solref", "solreffriction"))
    # Pyramidal cones mix the normal with the friction directions, so only `solref` is used.
    elliptic = option.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    differs = values["solreffriction"].any(axis=1) & (own != softness).any(axis=1)
    values["softens"] = differs & (dimensions > 1) & elliptic
    # Read only if the compiler, or mj_setConst, found a geom or a pair that has some.
    values["adhesion"] = values["adhesion"] * model.flg_adhesion
    values["geoms"] = np.vstack([geoms_of_pairs(model, explicit), dynamic])
    return {f"contact_{name}": array for name, array in values.items()}


def mixed_parameters(model: mujoco.MjModel, pairs: _Ints) -> dict[str, _Floats]:
    """Return the parameters that MuJoCo mixes for pairs of geoms, called as in `pair_*`.

    Args:
        model: The model.
        pairs: The geoms, shape (n, 2).
    """
    first, second = pairs.T
    one = model.geom_priority[first] > model.geom_priority[second]
    two = model.geom_priority[first] < model.geom_priority[second]

    def pick(values: _Floats, if_equal: _Floats) -> _Floats:
        wide = (slice(None),) + (None,) * (values.ndim - 1)
        chosen = np.where(two[wide], values[second], if_equal)
        return np.where(one[wide], values[first], chosen)

    # The weight of the first geom's solver parameters; half if neither states one.
    weights = model.geom_solmix[pairs]
    weights = np.where(weights < mujoco.mjMINVAL, 0.0, weights)
    total = weights.sum(axis=1)
    share = np.where(total, weights[:, 0] / np.where(total, total, 1.0), 0.5)[:, None]
    dims, frictions = model.geom_condim.astype(np.float64), model.geom_friction
    refs, imps, adhesions = model.geom_solref, model.geom_solimp, model.geom_adhesion
    mixed_ref = share * refs[first] + (1.0 - share) * refs[second]
    both_standard = (refs[first, 0] > 0.0) & (refs[second, 0] > 0.0)
    mixed_ref = np.where(both_standard[:, None], mixed_ref, np.minimum(refs[first], refs[second]))
    friction = pick(frictions, np.maximum(frictions[first], frictions[second]))
    return {
        "dim": pick(dims, np.maximum(dims[first], dims[second])),
        "friction": friction[:, _SLIDE_SPIN_ROLL],
        "solref": pick(refs, mixed_ref),
        "solreffriction": np.zeros((len(pairs), 2)),
        "solimp": pick(imps, share * imps[first] + (1.0 - share) * imps[second]),
        "margin": model.geom_margin[first] + model.geom_margin[second],
        "gap": model.geom_gap[first] + model.geom_gap[second],
        "adhesion": pick(adhesions, adhesions[first] + adhesions[second]),
    }


def _safe_solref(model: mujoco.MjModel, solref: _Floats) -> _Floats:
    """Return reference parameters as the solver uses them: positive time constants are raised."""
    off = model.opt.disableflags & _DISABLE.mjDSBL_REFSAFE
    if off or model.opt.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE:
        return solref
    safe, times = solref.copy(), solref[:, 0]
    safe[:, 0] = np.where(times > 0.0, np.maximum(times, 2.0 * model.opt.timestep), times)
    return safe


def moved_numbers(model: mujoco.MjModel, *, anonymous: bool = False) -> Numbers:
    """Return the numbers that decide the motion of a compiled model.

    Args:
        model: The compiled model.
        anonymous: Whether elements are numbered in the order of the model instead of named.
    """
    reader = _Reader(model, anonymous=anonymous)
    kept = reader.kept
    found = {section: reader.section(kind, kept.get(section)) for section, kind in MOVED.items()}
    found["options"] = {"simulation": reader.rows(MOVED["options"].fields, 1)[0]}
    found["sizes"] = {
        name: {"dimensions": (float(getattr(model, name)),)} for name in ("nq", "nv", "nu", "na")
    }
    geoms, free = reader.names["geoms"], unique_namer((), " ({})")
    pairs: list[list[int]] = reader.array("contact_geoms").tolist()
    contacts = [free(" + ".join(sorted(geoms[geom] for geom in pair))) for pair in pairs]
    rows = reader.rows(CONTACT_FIELDS, len(contacts))
    found["contacts"] = dict(sorted(zip(contacts, rows, strict=True)))
    found["whole"] = {
        name: {"type": (_digest(*(reader.array(array) for array in arrays)),)}
        for name, (count, *arrays) in _WHOLE.items()
        if getattr(model, count)
    }
    found["derived"] = {
        name: {"values": _plain(getattr(model, name)[kept[of]] if of else getattr(model, name))}
        for name, of in _DERIVED.items()
    }
    found["derived"]["meaninertia"] = {"values": (float(model.stat.meaninertia),)}
    return found


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
        self._made = contact_arrays(model) | made_arrays(model)
        self._made["geom_shape"] = [self._shape(geom) for geom in range(model.ngeom)]
        self.kept = self._relevant()
        self.names = self._numbered() if anonymous else names_of(model)

    def section(
        self, kind: Kind, kept: NDArray[np.bool_] | None = None
    ) -> dict[str, dict[str, Values]]:
        """Return the elements of a kind with their fields, those of a mask or all."""
        if not kind.element:
            return {}
        names = self.names[kind.element]
        pairs = list(zip(names, self.rows(kind.fields, len(names)), strict=True))
        if kept is not None:
            pairs = [pair for pair, wanted in zip(pairs, kept.tolist(), strict=True) if wanted]
        return dict(pairs if kind.in_order else sorted(pairs, key=lambda pair: pair[0]))

    def rows(self, fields: tuple[Field, ...], count: int) -> list[dict[str, Values]]:
        """Return the fields of each of so many elements."""
        rows: list[dict[str, Values]] = [{} for _ in range(count)]
        for field in fields if count else ():
            parts = self._split(field.array, self._values(field), count)
            counts = self._split(field.where, self.array(field.where), count) if field.where else ()
            for i, values in enumerate(parts):
                if not field.where or np.any(counts[i]):
                    rows[i][field.quantity] = _plain(values)
        return rows

    def _split(self, array: str, values: Any, count: int) -> list[Any]:
        """Return the rows of an array that belong to each element."""
        first = "jnt_dofadr" if array.startswith("dof_") else _FIRST_ROWS.get(array, "")
        if first:
            return np.split(values, getattr(self._model, first)[1:])
        return [values] if array.startswith("opt_") and count == 1 else list(values)

    def array(self, name: str) -> Any:
        """Return an array of the table."""
        if name in self._made:
            return self._made[name]
        if name.startswith("opt_"):
            return np.asarray(getattr(self._model.opt, name.removeprefix("opt_"))).reshape(-1)
        values = getattr(self._model, name)
        return np.frombuffer(bytes(values), np.uint8) if name == "plugin_attr" else values

    def _values(self, field: Field) -> Any:
        """Return an array with words for enumerations, and names for indices."""
        values = self.array(field.array)
        if isinstance(field.of, type):
            return np.array([field.of(v).name.partition("_")[2].lower() for v in values.tolist()])
        if field.of is not None:
            pairs = zip(self._kinds(field, values), values.tolist(), strict=True)
            words: list[str] = [
                (self.names[kind][i] if kind else str(i)) if i >= 0 else "" for kind, i in pairs
            ]
            return np.array(words, np.str_)
        if field.array.endswith("quat") and not field.array.startswith("key_"):
            # Of the two quaternions of each rotation, the one whose first number is above 0.
            leading = np.argmax(values != 0.0, axis=1)[:, None]
            return values * np.where(np.take_along_axis(values, leading, axis=1) < 0.0, -1.0, 1.0)
        solref = field.quantity.endswith("solref")
        if solref and not field.array.startswith(("flex_", "opt_")):
            return _safe_solref(self._model, values)
        return values

    def _kinds(self, field: Field, values: Any) -> list[str]:
        """Return the kind of element that each index of an array is of."""
        return [field.of] * len(values) if field.of in NAMED else list(self._made[field.of])

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

    def _relevant(self) -> dict[str, NDArray[np.bool_]]:
        """Return masks of the bodies, geoms and sites that take part in the motion."""
        model, moving = self._model, self._made["body_moves"]
        used: dict[str, set[int]] = {kind: set() for kind in (*NAMED, "")}
        for kind in (MOVED["actuators"], MOVED["tendons"], MOVED["equalities"]):
            for field in (field for field in kind.fields if isinstance(field.of, str)):
                values = self.array(field.array)
                if field.where:  # The second number of a transmission may be no site.
                    values = np.where(self.array(field.where), values, -1)
                for of, index in zip(self._kinds(field, values), values.tolist(), strict=True):
                    used[of].add(index)
        geoms = self._made["geom_in_fluid"] | np.isin(np.arange(model.ngeom), list(used["geoms"]))
        geoms[self._made["contact_geoms"]] = True
        if model.nflex:  # Any geom that can touch may touch a flex.
            geoms |= (model.geom_contype | model.geom_conaffinity) != 0
        sites = np.isin(np.arange(model.nsite), list(used["sites"]))
        bodies = np.isin(np.arange(model.nbody), list(used["bodies"])) | (model.body_jntnum > 0)
        bodies |= (moving & (model.body_mass > 0.0)) | (model.body_mocapid >= 0)
        bodies[model.geom_bodyid[geoms]] = True
        bodies[model.site_bodyid[sites]] = True
        for child in range(model.nbody - 1, 0, -1):  # A child's index is above its parent's.
            bodies[model.body_parentid[child]] |= bodies[child]
        bodies[0] = False  # The world is the same in every model.
        return {"bodies": bodies, "geoms": geoms, "sites": sites, "moving": bodies & moving}

    def _numbered(self) -> dict[str, list[str]]:
        """Return numbers for names; elements that do not count change none of them."""
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
        title = (MOVED | SENSED)[kind].title.partition(" ")[0]
        _fill(names[kind], lambda _, title=title: title)
    targets = kinds_of(model)["actuator_target_kinds"]
    ends = list(zip(targets, model.actuator_trnid[:, 0].tolist(), strict=True))
    _fill(names["actuators"], lambda i: names[ends[i][0]][ends[i][1]])
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
