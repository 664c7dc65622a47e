"""Which pairs of geoms can collide, by MuJoCo's own filters.

Source: MuJoCo 4.0.0, `mujoco/doc/computation/index.rst`, "Collision detection, selection". Two
geoms can collide if

- the contact type of one is among the contact affinities of the other, for the geoms and, with the
  bits of all their geoms taken together when the model was compiled, for their bodies;
- their bodies are not welded together, and are not parent and child, unless the parent is the world
  or the model switches `filterparent` off; bodies welded together count as one;
- no `<exclude>` names their bodies;

or if an explicit `<pair>` names them, whatever the rest says.
"""

from __future__ import annotations

import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.morphology.effective.reading import is_any

__all__ = ["colliding_pairs", "geoms_of_pairs"]

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
    """Whether the type of one geom is among the affinities of the other.

    Their bodies, which carry the bits of all their geoms as they were compiled, must agree: bits
    that are set in a compiled model later have no effect.
    """
    bodies = model.geom_bodyid[pairs]
    of_geoms = _meet(model.geom_contype[pairs], model.geom_conaffinity[pairs])
    return of_geoms & _meet(model.body_contype[bodies], model.body_conaffinity[bodies])


def _meet(types: NDArray[np.int32], affinities: NDArray[np.int32]) -> _Bools:
    """Whether the type of one of two is among the affinities of the other, shape (n,)."""
    return ((types[:, 0] & affinities[:, 1]) | (types[:, 1] & affinities[:, 0])) != 0


def _can_matter(model: mujoco.MjModel, pairs: _Ints) -> _Bools:
    """Whether MuJoCo can collide the two shapes, and one of the two can move."""
    flat = is_any(model.geom_type[pairs], mujoco.mjtGeom.mjGEOM_PLANE, mujoco.mjtGeom.mjGEOM_HFIELD)
    moving = model.body_treeid[model.geom_bodyid[pairs]] >= 0
    return ~(flat[:, 0] & flat[:, 1]) & (moving[:, 0] | moving[:, 1])


def _not_related(model: mujoco.MjModel, pairs: _Ints) -> _Bools:
    """Whether the bodies are neither welded together nor parent and child (the world is none)."""
    weld = model.body_weldid[model.geom_bodyid[pairs]]
    distinct = weld[:, 0] != weld[:, 1]
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_FILTERPARENT:
        return distinct
    parent = model.body_weldid[model.body_parentid[weld]]
    related = (weld[:, 0] == parent[:, 1]) | (weld[:, 1] == parent[:, 0])
    return distinct & ~(related & (weld != 0).all(axis=1))


def _not_listed(model: mujoco.MjModel, pairs: _Ints) -> _Bools:
    """Whether the pair is neither excluded nor described by an explicit pair."""
    bodies = np.sort(model.geom_bodyid[pairs], axis=1)
    excluded = np.isin((bodies[:, 0] << 16) + bodies[:, 1], model.exclude_signature)
    listed = np.sort(np.stack([model.pair_geom1, model.pair_geom2], axis=1), axis=1)
    count = model.ngeom
    explicit = np.isin(
        pairs[:, 0] * count + pairs[:, 1], listed[:, 0].astype(np.int64) * count + listed[:, 1]
    )
    return ~excluded & ~explicit


def geoms_of_pairs(model: mujoco.MjModel, explicit: _Ints) -> _Ints:
    """The geoms of explicit pairs, shape (n, 2)."""
    both = np.stack([model.pair_geom1, model.pair_geom2], axis=1)
    return both[explicit].astype(np.int64)
