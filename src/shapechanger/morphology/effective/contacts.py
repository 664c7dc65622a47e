"""Contact parameters of pairs of geoms, combined as MuJoCo does.

A geom's friction alone decides nothing: the contact takes the larger of the two geoms'
coefficients, so a slippery foot on a rough floor is a rough foot. These are the rules by which
MuJoCo 4.0.0 combines what the two say (`mujoco/doc/modeling.rst`, "Contact parameters"). The tests
compare them with the contacts of simulated scenes.

Measured, and easy to get wrong:

- margins add up, and so do gaps, whatever the priority;
- adhesions add up unless one geom has the higher priority;
- a friction coefficient is never below 1e-5;
- a time constant below two time steps counts as two time steps, unless the model switches
  `refsafe` off or integrates with `discrete`: softer than that is possible, harder is not.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Final

import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.morphology.effective.elements import Names, is_any, names_of

_Ints = NDArray[np.int64]
_Bools = NDArray[np.bool_]


def colliding_pairs(model: mujoco.MjModel) -> tuple[_Ints, _Ints]:
    """The pairs that MuJoCo tests for collision and whose contacts can move something.

    Returns:
        The indices of the explicit `<pair>` elements, shape (n,); and the geoms of every other
        pair, which pass the filters, shape (m, 2).
    """
    flags = model.opt.disableflags
    if flags & (mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_CONTACT):
        return np.zeros(0, np.int64), np.zeros((0, 2), np.int64)
    explicit = np.arange(model.npair)
    explicit = explicit[_can_matter(model, geoms_of_pairs(model, explicit))]
    candidates = np.flatnonzero(model.geom_contype | model.geom_conaffinity)
    first, second = np.triu_indices(candidates.size, k=1)
    pairs = np.stack([candidates[first], candidates[second]], axis=1)
    for accepts in (_bits_match, _can_matter, _not_related, _not_listed):
        pairs = pairs[accepts(model, pairs)]
    return explicit, pairs


def _bits_match(model: mujoco.MjModel, pairs: _Ints) -> _Bools:
    """Return whether the type of one geom is among the affinities of the other.

    Their bodies, which carry the bits of all their geoms as they were compiled, must agree: bits
    that are set in a compiled model later have no effect.
    """
    bodies = model.geom_bodyid[pairs]
    of_geoms = _meet(model.geom_contype[pairs], model.geom_conaffinity[pairs])
    return of_geoms & _meet(model.body_contype[bodies], model.body_conaffinity[bodies])


def _meet(types: NDArray[np.int32], affinities: NDArray[np.int32]) -> _Bools:
    """Return whether the type of one of two is among the affinities of the other, shape (n,)."""
    return ((types[:, 0] & affinities[:, 1]) | (types[:, 1] & affinities[:, 0])) != 0


def _can_matter(model: mujoco.MjModel, pairs: _Ints) -> _Bools:
    """Return whether MuJoCo can collide the two shapes, and one of the two can move."""
    flat = is_any(model.geom_type[pairs], mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD)
    moving = model.body_treeid[model.geom_bodyid[pairs]] >= 0
    return ~(flat[:, 0] & flat[:, 1]) & (moving[:, 0] | moving[:, 1])


def _not_related(model: mujoco.MjModel, pairs: _Ints) -> _Bools:
    """Return which bodies are neither welded together nor parent and child (except the world)."""
    weld = model.body_weldid[model.geom_bodyid[pairs]]
    distinct = weld[:, 0] != weld[:, 1]
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT:
        return distinct
    parent = model.body_weldid[model.body_parentid[weld]]
    related = (weld[:, 0] == parent[:, 1]) | (weld[:, 1] == parent[:, 0])
    return distinct & ~(related & (weld != 0).all(axis=1))


def _not_listed(model: mujoco.MjModel, pairs: _Ints) -> _Bools:
    """Return whether the pair is neither excluded nor described by an explicit pair."""
    bodies = np.sort(model.geom_bodyid[pairs], axis=1)
    excluded = np.isin((bodies[:, 0] << 16) + bodies[:, 1], model.exclude_signature)
    listed = np.sort(np.stack([model.pair_geom1, model.pair_geom2], axis=1), axis=1)
    count = model.ngeom
    explicit = np.isin(
        pairs[:, 0] * count + pairs[:, 1], listed[:, 0].astype(np.int64) * count + listed[:, 1]
    )
    return ~excluded & ~explicit


def geoms_of_pairs(model: mujoco.MjModel, explicit: _Ints) -> _Ints:
    """Return the geoms of explicit contact pairs, shape (n, 2).

    Args:
        model: The model.
        explicit: Indices of the pairs, shape (n,).
    """
    both = np.stack([model.pair_geom1, model.pair_geom2], axis=1)
    return both[explicit].astype(np.int64)


_Floats = NDArray[np.float64]

# For each contact dimension how many of (slide, slide, spin, roll, roll) act.
_FRICTION_COUNT: Final = {1: 0, 3: 2, 4: 3, 6: 5}
_SLIDE_SPIN_ROLL: Final = [0, 0, 1, 2, 2]


class Contact(msgspec.Struct, frozen=True):
    """The parameters with which two geoms touch.

    Attributes:
        dim: 1 without friction, 3 with sliding friction, 4 with torsional, 6 with rolling friction.
        friction: The `dim` - 1 coefficients that act: slide, slide, spin, roll, roll. Sliding ones
            are pure numbers, the others are in m.
        solref: Time constant in s and damping ratio, or minus stiffness and minus damping.
        solreffriction: The same for the friction directions; empty where they use `solref`.
        solimp: Impedance: at contact, at full width, width in m, midpoint, power.
        margin: Distance in m below which the geoms push each other.
        gap: Distance in m beyond the margin up to which a contact is found, but does not push.
        adhesion: Force in N with which the contact can pull.
    """

    dim: int
    friction: tuple[float, ...]
    solref: tuple[float, ...]
    solreffriction: tuple[float, ...]
    solimp: tuple[float, ...]
    margin: float
    gap: float
    adhesion: float


@dataclass(frozen=True, slots=True)
class _Rows:
    """The parameters of n contacts, as columns."""

    dim: _Ints
    friction: _Floats
    solref: _Floats
    solreffriction: _Floats
    solimp: _Floats
    margin: _Floats
    gap: _Floats
    adhesion: _Floats


def effective_contacts(model: mujoco.MjModel, names: Names | None = None) -> dict[str, Contact]:
    """The contacts that a model can have and that can move something, by the names of the geoms.

    Args:
        model: The compiled model.
        names: Names of its elements, where they are known already.

    Returns:
        For each pair of geoms, named `floor + left_foot` in alphabetical order and sorted by name,
        its parameters. A second explicit `<pair>` of the same geoms is another contact, named
        `floor + left_foot (2)`.
    """
    geom_names = (names or names_of(model)).geoms
    explicit, dynamic = colliding_pairs(model)
    rows = _overridden(model, _joined(_explicit_rows(model, explicit), _mixed(model, dynamic)))
    solref = safe_solref(model, rows.solref)
    solreffriction = safe_solref(model, rows.solreffriction)
    # Pyramidal cones mix the normal with the friction directions, so only `solref` is used.
    own = rows.solreffriction.any(axis=1) & (solreffriction != solref).any(axis=1)
    own &= (rows.dim > 1) & (model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC)
    pairs = np.vstack([geoms_of_pairs(model, explicit), dynamic]).tolist()
    columns = zip(
        pairs,
        rows.dim.tolist(),
        (rows.friction + 0.0).tolist(),
        (solref + 0.0).tolist(),
        (solreffriction + 0.0).tolist(),
        own.tolist(),
        (rows.solimp + 0.0).tolist(),
        (rows.margin + 0.0).tolist(),
        (rows.gap + 0.0).tolist(),
        (rows.adhesion + 0.0).tolist(),
        strict=True,
    )
    found: dict[str, Contact] = {}
    for (g1, g2), dim, friction, ref, ref_friction, has_own, *numbers in columns:
        first, second = sorted((geom_names[int(g1)], geom_names[int(g2)]))
        name, count = f"{first} + {second}", 1
        while name in found:
            count += 1
            name = f"{first} + {second} ({count})"
        impedance, margin, gap, adhesion = numbers
        found[name] = Contact(
            dim=dim,
            friction=tuple(friction[: _FRICTION_COUNT[dim]]),
            solref=tuple(ref),
            solreffriction=tuple(ref_friction) if has_own else (),
            solimp=tuple(impedance),
            margin=margin,
            gap=gap,
            adhesion=adhesion,
        )
    return dict(sorted(found.items()))


def safe_solref(model: mujoco.MjModel, solref: _Floats) -> _Floats:
    """Return reference parameters as the solver uses them, shape (n, 2).

    A positive time constant is raised to two time steps, unless `refsafe` is off or the integrator
    is `discrete`, which is stable at any.

    Args:
        model: The model.
        solref: Reference parameters as stated, shape (n, 2).
    """
    off = model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_REFSAFE
    if off or model.opt.integrator == mujoco.mjtIntegrator.mjINT_DISCRETE:
        return solref
    safe = solref.copy()
    safe[:, 0] = np.where(
        solref[:, 0] > 0.0, np.maximum(solref[:, 0], 2.0 * model.opt.timestep), solref[:, 0]
    )
    return safe


def _explicit_rows(model: mujoco.MjModel, explicit: _Ints) -> _Rows:
    """Return the parameters of explicit pairs."""
    return _Rows(
        dim=model.pair_dim[explicit].astype(np.int64),
        friction=model.pair_friction[explicit],
        solref=model.pair_solref[explicit],
        solreffriction=model.pair_solreffriction[explicit],
        solimp=model.pair_solimp[explicit],
        margin=model.pair_margin[explicit],
        gap=model.pair_gap[explicit],
        adhesion=model.pair_adhesion[explicit],
    )


def _mixed(model: mujoco.MjModel, pairs: _Ints) -> _Rows:
    """Return the mixed parameters of pairs of geoms."""
    first, second = pairs[:, 0], pairs[:, 1]
    one = model.geom_priority[first] > model.geom_priority[second]
    two = model.geom_priority[first] < model.geom_priority[second]

    def pick(values: _Floats, if_equal: _Floats) -> _Floats:
        wide = (slice(None),) + (None,) * (values.ndim - 1)
        chosen = np.where(two[wide], values[second], if_equal)
        return np.where(one[wide], values[first], chosen)

    share = _share_of_first(model.geom_solmix[first], model.geom_solmix[second])[:, None]
    dims, frictions = model.geom_condim.astype(np.float64), model.geom_friction
    refs, imps = model.geom_solref, model.geom_solimp
    mixed_ref = share * refs[first] + (1.0 - share) * refs[second]
    both_standard = (refs[first, 0] > 0.0) & (refs[second, 0] > 0.0)
    mixed_ref = np.where(both_standard[:, None], mixed_ref, np.minimum(refs[first], refs[second]))
    friction = pick(frictions, np.maximum(frictions[first], frictions[second]))
    return _Rows(
        dim=pick(dims, np.maximum(dims[first], dims[second])).astype(np.int64),
        friction=friction[:, _SLIDE_SPIN_ROLL],
        solref=pick(refs, mixed_ref),
        solreffriction=np.zeros((len(pairs), 2)),
        solimp=pick(imps, share * imps[first] + (1.0 - share) * imps[second]),
        margin=model.geom_margin[first] + model.geom_margin[second],
        gap=model.geom_gap[first] + model.geom_gap[second],
        adhesion=pick(
            model.geom_adhesion, model.geom_adhesion[first] + model.geom_adhesion[second]
        ),
    )


def _share_of_first(one: _Floats, two: _Floats) -> _Floats:
    """The weight of the first geom's solver parameters; half when neither geom claims one."""
    small = mujoco.mjMINVAL
    neither = (one < small) & (two < small)
    one, two = np.where(one < small, 0.0, one), np.where(two < small, 0.0, two)
    return np.where(neither, 0.5, one / np.where(neither, 1.0, one + two))


def _joined(one: _Rows, two: _Rows) -> _Rows:
    """Both sets of contacts."""
    return _Rows(
        *(np.concatenate([getattr(one, f.name), getattr(two, f.name)]) for f in fields(_Rows))
    )


def _overridden(model: mujoco.MjModel, rows: _Rows) -> _Rows:
    """The contacts after the model's switches, and with friction at its floor or above."""
    option, count = model.opt, len(rows.dim)
    if option.enableflags & mujoco.mjtEnableBit.mjENBL_OVERRIDE:
        rows = replace(
            rows,
            friction=np.tile(option.o_friction, (count, 1)),
            solref=np.tile(option.o_solref, (count, 1)),
            solreffriction=np.tile(option.o_solref, (count, 1)),
            solimp=np.tile(option.o_solimp, (count, 1)),
            margin=np.full(count, option.o_margin),
        )
    return replace(
        rows,
        friction=np.maximum(rows.friction, mujoco.mjMINMU),
        # Read only if the compiler, or mj_setConst, found a geom or a pair that has some.
        adhesion=rows.adhesion * model.flg_adhesion,
    )
