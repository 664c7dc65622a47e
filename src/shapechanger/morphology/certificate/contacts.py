"""Contact parameters of pairs of geoms, combined as MuJoCo does.

A geom's friction alone decides nothing: the contact takes the larger of the two geoms'
coefficients, so a slippery foot on a rough floor is a rough foot. These are the rules by which
MuJoCo 4.0.0 combines the parameters (`mujoco/doc/modeling.rst`, "Contact parameters"). The tests
compare them with the contacts of simulated scenes.

Measured, and easy to get wrong:

- margins add up, and so do gaps, whatever the priority;
- adhesions add up unless one geom has the higher priority;
- a friction coefficient is never below 1e-5;
- a time constant below two time steps counts as two time steps, unless the model switches
  `refsafe` off or integrates with `discrete`: softer than that is possible, harder is not.
"""

from __future__ import annotations

from typing import Any, Final

import mujoco
import numpy as np
from numpy.typing import NDArray

_Ints = NDArray[np.int64]
_Bools = NDArray[np.bool_]
_Floats = NDArray[np.float64]

# For each contact dimension how many of (slide, slide, spin, roll, roll) act.
_FRICTION_COUNT: Final = {1: 0, 3: 2, 4: 3, 6: 5}
_SLIDE_SPIN_ROLL: Final = [0, 0, 1, 2, 2]
_FLAT: Final = (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD))


def colliding_pairs(model: mujoco.MjModel) -> tuple[_Ints, _Ints]:
    """Return the pairs that MuJoCo tests for collision and whose contacts can move something.

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
    of_geoms = model.geom_contype[pairs] & model.geom_conaffinity[pairs[:, ::-1]]
    of_bodies = model.body_contype[bodies] & model.body_conaffinity[bodies[:, ::-1]]
    return ((of_geoms[:, 0] | of_geoms[:, 1]) != 0) & ((of_bodies[:, 0] | of_bodies[:, 1]) != 0)


def _can_matter(model: mujoco.MjModel, pairs: _Ints) -> _Bools:
    """Return whether MuJoCo can collide the two shapes, and one of the two can move."""
    flat = np.isin(model.geom_type[pairs], _FLAT)
    moving = model.body_treeid[model.geom_bodyid[pairs]] >= 0
    return np.logical_and(~np.all(flat, axis=1), np.any(moving, axis=1))


def _not_related(model: mujoco.MjModel, pairs: _Ints) -> _Bools:
    """Return which bodies are neither welded together nor parent and child (except the world)."""
    weld = model.body_weldid[model.geom_bodyid[pairs]]
    distinct = weld[:, 0] != weld[:, 1]
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT:
        return distinct
    parent = model.body_weldid[model.body_parentid[weld]]
    related = (weld == parent[:, ::-1]).any(axis=1)
    return distinct & ~(related & (weld != 0).all(axis=1))


def _not_listed(model: mujoco.MjModel, pairs: _Ints) -> _Bools:
    """Return whether the pair is neither excluded nor described by an explicit pair."""
    bodies = np.sort(model.geom_bodyid[pairs], axis=1)
    excluded = np.isin((bodies[:, 0] << 16) + bodies[:, 1], model.exclude_signature)
    listed = np.sort(geoms_of_pairs(model, np.arange(model.npair)), axis=1)
    codes = pairs[:, 0] * model.ngeom + pairs[:, 1]
    return ~excluded & ~np.isin(codes, listed[:, 0] * model.ngeom + listed[:, 1])


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
    softness, own = (safe_solref(model, values[name]) for name in ("solref", "solreffriction"))
    # Pyramidal cones mix the normal with the friction directions, so only `solref` is used.
    elliptic = option.cone == mujoco.mjtCone.mjCONE_ELLIPTIC
    differs = values["solreffriction"].any(axis=1) & (own != softness).any(axis=1)
    values["softens"] = differs & (dimensions > 1) & elliptic
    # Read only if the compiler, or mj_setConst, found a geom or a pair that has some.
    values["adhesion"] = values["adhesion"] * model.flg_adhesion
    values["geoms"] = np.vstack([geoms_of_pairs(model, explicit), dynamic])
    return {f"contact_{name}": array for name, array in values.items()}


def mixed_parameters(model: mujoco.MjModel, pairs: _Ints) -> dict[str, _Floats]:
    """Return the parameters that MuJoCo mixes for pairs of geoms, by name as in `pair_*`.

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

    share = _share_of_first(model.geom_solmix[first], model.geom_solmix[second])[:, None]
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


def _share_of_first(one: _Floats, two: _Floats) -> _Floats:
    """Return the weight of the first geom's solver parameters; half if neither states one."""
    small = mujoco.mjMINVAL
    neither = (one < small) & (two < small)
    one, two = np.where(one < small, 0.0, one), np.where(two < small, 0.0, two)
    return np.where(neither, 0.5, one / np.where(neither, 1.0, one + two))


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
