"""Everything in a compiled model that decides how it moves, and nothing that does not.

Two models may differ in colour, in the friction of a foot that stands on a rougher floor, or in the
range of a joint that has no limit, and still do the same. An `EffectiveModel` holds what is left
after all of that is taken away, as plain names and numbers: equal effective models move equally.

Not in it: sensors and cameras, which decide what is seen of the motion; keyframes and custom
numbers, which decide nothing by themselves. What an environment makes of those shows in a rollout
(see `shapechanger.morphology.certificate.certify`).
"""

from __future__ import annotations

import hashlib
import struct
from typing import Final

import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.morphology.effective import bodies, drive, world
from shapechanger.morphology.effective.contacts import (
    Contact,
    colliding_pairs,
    effective_contacts,
    geoms_of_pairs,
)
from shapechanger.morphology.effective.elements import Section, Value, is_any, names_of

_Bools = NDArray[np.bool_]


class EffectiveModel(msgspec.Struct, frozen=True):
    """Effective model: all that decides motion, as names and numbers in SI units, angles in rad.

    Joints and actuators stand in the order of the model, which decides what the numbers of its
    state and its control mean; everything else is sorted by name.

    Attributes:
        sections: ((section, ((element, ((field, values), ...)), ...)), ...).
    """

    sections: tuple[tuple[str, Section], ...]

    def __getitem__(self, section: str) -> dict[str, dict[str, tuple[Value, ...]]]:
        """For each element of a section its fields.

        Raises:
            KeyError: If there is no such section.
        """
        return {element: dict(fields) for element, fields in dict(self.sections)[section]}


def effective_model(model: mujoco.MjModel) -> EffectiveModel:
    """Extract everything that decides the motion of a compiled model.

    The sections are `options`, `sizes`, `bodies`, `joints`, `geoms`, `sites`, `contacts`,
    `actuators`, `tendons`, `equalities`, `flexes`, `plugins` and `derived`. The last holds what
    MuJoCo computes from the rest; it differs alone only where a compiled model was written to
    without `mujoco.mj_setConst`.
    """
    names = names_of(model)
    contacts = effective_contacts(model, names)
    geoms, sites = _relevant_geoms(model), _relevant_sites(model)
    carrying = np.zeros(model.nbody, np.bool_)
    carrying[model.geom_bodyid[geoms]] = True
    carrying[model.site_bodyid[sites]] = True
    carrying[_bound_bodies(model)] = True
    kept = bodies.bodies_that_matter(model, carrying)
    return EffectiveModel(
        (
            ("options", world.options(model)),
            ("sizes", world.sizes(model)),
            ("bodies", bodies.bodies(model, names, kept)),
            ("joints", bodies.joints(model, names)),
            ("geoms", bodies.geoms(model, names, geoms)),
            ("sites", bodies.sites(model, names, sites)),
            ("contacts", tuple((name, _fields(contact)) for name, contact in contacts.items())),
            ("actuators", drive.actuators(model, names)),
            ("tendons", drive.tendons(model, names)),
            ("equalities", drive.equalities(model, names)),
            ("flexes", world.flexes(model, names)),
            ("plugins", world.plugins(model)),
            ("derived", world.derived(model, kept, geoms)),
        )
    )


def _fields(contact: Contact) -> tuple[tuple[str, tuple[Value, ...]], ...]:
    """A contact as named numbers; what does not act is left out."""
    named = {
        "contact dimension": (float(contact.dim),),
        "contact friction": contact.friction,
        "contact solref": contact.solref,
        "contact friction solref": contact.solreffriction,
        "contact solimp": contact.solimp,
        "contact margin": (contact.margin,),
        "contact gap": (contact.gap,),
        "contact adhesion": (contact.adhesion,),
    }
    return tuple((name, values) for name, values in named.items() if values)


def _relevant_geoms(model: mujoco.MjModel) -> _Bools:
    """Geoms that touch, push a fluid or guide a tendon, shape (ngeom,)."""
    explicit, dynamic = colliding_pairs(model)
    relevant = np.zeros(model.ngeom, np.bool_)
    relevant[geoms_of_pairs(model, explicit)] = True
    relevant[dynamic] = True
    relevant |= bodies.in_fluid(model)
    around = is_any(model.wrap_type, mujoco.mjtWrap.mjWRAP_SPHERE, mujoco.mjtWrap.mjWRAP_CYLINDER)
    relevant[model.wrap_objid[around]] = True
    if model.nflex:  # Any geom that can touch may touch a flex.
        relevant |= (model.geom_contype | model.geom_conaffinity) != 0
    return relevant


def _relevant_sites(model: mujoco.MjModel) -> _Bools:
    """Sites to which a tendon, an actuator or a constraint is fixed, shape (nsite,)."""
    relevant = np.zeros(model.nsite, np.bool_)
    wrap, transmission = mujoco.mjtWrap, mujoco.mjtTrn
    relevant[model.wrap_objid[model.wrap_type == wrap.mjWRAP_SITE]] = True
    around = is_any(model.wrap_type, wrap.mjWRAP_SPHERE, wrap.mjWRAP_CYLINDER)
    relevant[model.wrap_prm[around & (model.wrap_prm >= 0.0)].astype(np.int64)] = True
    on_sites = is_any(
        model.actuator_trntype,
        transmission.mjTRN_SITE,
        transmission.mjTRN_SLIDERCRANK,
        transmission.mjTRN_SO3,
    )
    # A servo on a ball joint has no second site, and its first number is a joint.
    on_sites &= (model.actuator_trntype != transmission.mjTRN_SO3) | (
        model.actuator_trnid[:, 1] >= 0
    )
    used = model.actuator_trnid[on_sites]
    relevant[used[used >= 0]] = True
    bound = model.eq_objtype == mujoco.mjtObj.mjOBJ_SITE
    relevant[np.concatenate([model.eq_obj1id[bound], model.eq_obj2id[bound]])] = True
    return relevant


def _bound_bodies(model: mujoco.MjModel) -> NDArray[np.int64]:
    """Bodies that an equality constraint binds or an actuator sticks to something."""
    bound = model.eq_objtype == mujoco.mjtObj.mjOBJ_BODY
    sticky = model.actuator_trntype == mujoco.mjtTrn.mjTRN_BODY
    return np.concatenate(
        [model.eq_obj1id[bound], model.eq_obj2id[bound], model.actuator_trnid[sticky, 0]]
    ).astype(np.int64)


# 64 bits: among a million different models two agree by chance once in 37 million tries.
_HEX_DIGITS: Final = 16


def fingerprint(model: mujoco.MjModel | EffectiveModel) -> str:
    """The first 16 hex digits of the SHA-256 of an effective model.

    It is the same in every process and on every machine on which the model compiles to the same
    numbers, and does not change with colours, cameras, lights, or anything else without effect.

    Args:
        model: A compiled model, or what was already taken from one.
    """
    effective = model if isinstance(model, EffectiveModel) else effective_model(model)
    total = hashlib.sha256()
    for section, elements in effective.sections:
        total.update(_text(section) + _count(elements))
        for element, fields in elements:
            total.update(_text(element) + _count(fields))
            for field, values in fields:
                total.update(_text(field) + _count(values) + b"".join(map(_value, values)))
    return total.hexdigest()[:_HEX_DIGITS]


def _value(value: Value) -> bytes:
    """A number as 8 bytes, little-endian; a word with its length."""
    return b"w" + _text(value) if isinstance(value, str) else b"n" + struct.pack("<d", value)


def _text(text: str) -> bytes:
    """A text after its length, so that no two sequences of texts look alike."""
    encoded = text.encode()
    return struct.pack("<I", len(encoded)) + encoded


def _count(items: tuple[object, ...]) -> bytes:
    """Encode the number of items that follow."""
    return struct.pack("<I", len(items))
