"""Names of the elements of a compiled model, and the rows in which their fields are collected.

Elements without a name get one by the rule of `shapechanger.morphology.spec.name_elements`, so a
model equals a copy whose elements were named by that rule.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final, SupportsInt

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from shapechanger.morphology.spec.elements import unique_namer

_OBJ: Final = mujoco.mjtObj
_Bools = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Names:
    """Names of the elements in the model's order, unique within each kind.

    Attributes:
        bodies: Names of the bodies, the world first.
        joints: Names of the joints.
        geoms: Names of the geoms.
        sites: Names of the sites.
        tendons: Names of the tendons.
        equalities: Names of the equality constraints.
        flexes: Names of the flexes.
        actuators: Names of the actuators; by default that of the element that it drives.
        targets: For each actuator the name of the element that it drives.
    """

    bodies: tuple[str, ...]
    joints: tuple[str, ...]
    geoms: tuple[str, ...]
    sites: tuple[str, ...]
    tendons: tuple[str, ...]
    equalities: tuple[str, ...]
    flexes: tuple[str, ...]
    actuators: tuple[str, ...]
    targets: tuple[str, ...]


def names_of(model: mujoco.MjModel) -> Names:
    """Return the names of a model's elements, with a default for each that has none."""

    def given(kind: mujoco.mjtObj, count: int) -> list[str]:
        return [mujoco.mj_id2name(model, kind, i) or "" for i in range(count)]

    bodies, joints = given(_OBJ.mjOBJ_BODY, model.nbody), given(_OBJ.mjOBJ_JOINT, model.njnt)
    geoms, sites = given(_OBJ.mjOBJ_GEOM, model.ngeom), given(_OBJ.mjOBJ_SITE, model.nsite)
    tendons = given(_OBJ.mjOBJ_TENDON, model.ntendon)
    equalities = given(_OBJ.mjOBJ_EQUALITY, model.neq)
    flexes = given(_OBJ.mjOBJ_FLEX, model.nflex)
    actuators = given(_OBJ.mjOBJ_ACTUATOR, model.nactuator)

    joint_of_body: dict[int, str] = {}
    for name, body in zip(joints, model.jnt_bodyid.tolist(), strict=True):
        if name:
            joint_of_body.setdefault(body, name)
    parents = model.body_parentid.tolist()
    _fill(bodies, lambda i: joint_of_body.get(i) or f"{bodies[parents[i]]}_part")
    for kind, names, owners in (
        ("joint", joints, model.jnt_bodyid.tolist()),
        ("geom", geoms, model.geom_bodyid.tolist()),
        ("site", sites, model.site_bodyid.tolist()),
    ):
        _fill(names, lambda i, kind=kind, owners=owners: f"{bodies[owners[i]]}_{kind}")
    _fill(tendons, lambda _: "tendon")
    _fill(equalities, lambda _: "equality")
    _fill(flexes, lambda _: "flex")
    targets = _driven(model, bodies, joints, sites, tendons)
    _fill(actuators, targets.__getitem__)
    return Names(
        *map(
            tuple,
            (bodies, joints, geoms, sites, tendons, equalities, flexes, actuators, targets),
        )
    )


def _driven(
    model: mujoco.MjModel,
    bodies: Sequence[str],
    joints: Sequence[str],
    sites: Sequence[str],
    tendons: Sequence[str],
) -> list[str]:
    """Return for each actuator the name of the element that it drives."""
    driven = {
        "joint": joints,
        "jointinparent": joints,
        "slidercrank": sites,
        "tendon": tendons,
        "site": sites,
        "body": bodies,
    }
    return [
        # `so3` drives a ball joint, or a site with its reference site.
        driven.get(transmission, joints if second < 0 else sites)[int(first)]
        for transmission, (first, second) in zip(
            words(mujoco.mjtTrn, model.actuator_trntype), model.actuator_trnid.tolist(), strict=True
        )
    ]


def numbered(model: mujoco.MjModel, bodies: _Bools, geoms: _Bools, sites: _Bools) -> Names:
    """Return numbers in place of names, in the order of the model.

    Args:
        model: The model.
        bodies: Which bodies are numbered first, shape (nbody,), so that others between them change
            no number.
        geoms: The same of geoms, shape (ngeom,).
        sites: The same of sites, shape (nsite,).
    """

    def numbers(kind: str, first: _Bools | int) -> tuple[str, ...]:
        chosen = np.ones(first, np.bool_) if isinstance(first, int) else first
        places = np.argsort(np.argsort(~chosen, kind="stable"))
        return tuple(f"{kind} {place:06}" for place in places.tolist())

    named_bodies, named_sites = numbers("body", bodies), numbers("site", sites)
    joints, tendons = numbers("joint", model.njnt), numbers("tendon", model.ntendon)
    return Names(
        bodies=named_bodies,
        joints=joints,
        geoms=numbers("geom", geoms),
        sites=named_sites,
        tendons=tendons,
        equalities=numbers("equality", model.neq),
        flexes=numbers("flex", model.nflex),
        actuators=numbers("actuator", model.nactuator),
        targets=tuple(_driven(model, named_bodies, joints, named_sites, tendons)),
    )


def _fill(names: list[str], default: Callable[[int], str]) -> None:
    """Replace each empty name by its default, numbered if that is taken, in place.

    Args:
        names: The names of all elements of one kind.
        default: Takes the index of an element and returns its default name.
    """
    free = unique_namer(names)
    for i, name in enumerate(names):
        names[i] = name or free(default(i))


def is_any(values: NDArray[np.generic], *members: SupportsInt) -> NDArray[np.bool_]:
    """Return which of `values` are among some members of a MuJoCo enumeration.

    Args:
        values: Values of the enumeration, any shape.
        members: Its members to look for.
    """
    return np.isin(values, [int(member) for member in members])


def named(names: Sequence[str], indices: NDArray[np.integer]) -> list[str]:
    """Return the names at some indices.

    Args:
        names: Names of all elements.
        indices: Shape (n,).
    """
    return [names[int(index)] for index in indices]


def words(enumeration: Any, values: NDArray[np.integer]) -> list[str]:
    """Return the words of values of a MuJoCo enumeration: `hinge` for `mjJNT_HINGE`.

    Args:
        enumeration: The enumeration.
        values: Its values, shape (n,).
    """
    return [word(enumeration(value)) for value in values.tolist()]


def word(member: Any) -> str:
    """Return the word of a member of a MuJoCo enumeration."""
    return member.name.partition("_")[2].lower()


ROUNDING: Final = 1e-9
"""Part of a field's largest number up to which two numbers are equal. Writing out a total mass,
another order of a sum and another processor change the last bits, and constants that MuJoCo derives
lose more."""
NOISE: Final = 1e-14
"""The same, as a part of the largest number of this field in the whole model: a zero that was
computed, as by turning a frame, is not zero."""
_DIGITS: Final = 10  # Of the largest number of a field: a half of `ROUNDING` at most.

Value = float | str
Fields = tuple[tuple[str, tuple[Value, ...]], ...]
Element = tuple[str, Fields]
Section = tuple[Element, ...]


class Rows:
    """The elements of one kind, each with the fields collected so far.

    Args:
        names: Names of the elements.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names
        self._rows: list[dict[str, tuple[Value, ...]]] = [{} for _ in names]

    def numbers(
        self,
        field: str,
        values: ArrayLike,
        where: _Bools | None = None,
        counts: Sequence[int | None] | None = None,
    ) -> None:
        """Set a field of each element to its row of `values`.

        Args:
            field: Name of the field.
            values: Numbers of any type, shape (n,) or (n, ...).
            where: Which elements have the field, shape (n,); all by default.
            counts: How many numbers of its row each element has, None for all; one with 0 lacks
                the field.
        """
        if not self._rows:
            return
        # Adding zero turns -0.0, which equals 0.0, into 0.0.
        flat = np.asarray(values, np.float64).reshape(len(self._rows), -1) + 0.0
        present = [True] * len(self._rows) if where is None else where.tolist()
        sizes = [None] * len(self._rows) if counts is None else counts
        for row, numbers, has, size in zip(self._rows, flat.tolist(), present, sizes, strict=True):
            if has and size != 0:
                row[field] = tuple(numbers[:size])

    def words(self, field: str, words: Iterable[str | tuple[Value, ...]]) -> None:
        """Set a field of each element to one or several words.

        Args:
            field: Name of the field.
            words: Words of each element; an empty word is left out.
        """
        for row, word in zip(self._rows, words, strict=True):
            if word:
                row[field] = (word,) if isinstance(word, str) else word

    def parts(
        self, field: str, values: ArrayLike, starts: Sequence[int], counts: Sequence[int]
    ) -> None:
        """Set a field of each element to some rows of an array.

        Args:
            field: Name of the field.
            values: The array; its rows belong to elements.
            starts: First row of each element.
            counts: Number of rows of each element; without any, the field is left out.
        """
        flat = np.asarray(values, np.float64) + 0.0
        for row, start, count in zip(self._rows, starts, counts, strict=True):
            if count > 0:
                row[field] = tuple(flat[start : start + count].ravel().tolist())

    def section(self, keep: _Bools | None = None, *, in_order: bool = False) -> Section:
        """Return the elements with their fields.

        Args:
            keep: Which elements to keep, shape (n,); all by default.
            in_order: Keep the model's order, because it decides what the numbers of a state or a
                control mean; sort by name otherwise.
        """
        kept = [True] * len(self._rows) if keep is None else keep.tolist()
        elements = [
            (name, tuple(row.items()))
            for name, row, wanted in zip(self._names, self._rows, kept, strict=True)
            if wanted
        ]
        return tuple(elements if in_order else sorted(elements))


def scales(section: Section) -> dict[str, float]:
    """Return the largest finite number of each field over the elements of a section."""
    found: dict[str, float] = {}
    for _, fields in section:
        for field, values in fields:
            found[field] = max(found.get(field, 0.0), _largest(values))
    return found


def margin(values: Iterable[Value], scale: float) -> float:
    """Return by how much two numbers of a field may differ by rounding.

    Args:
        values: The numbers of the field, of both models.
        scale: The largest number of this field in the models.
    """
    return max(ROUNDING * _largest(values), NOISE * scale)


def rounded(values: Sequence[Value], scale: float) -> tuple[Value, ...]:
    """Round the numbers of a field to as many digits as all machines agree on.

    Args:
        values: The numbers; words stay as they are.
        scale: The largest number of this field in the model.
    """
    # Slightly more, so that a number just below a power of ten counts as that power.
    largest = max(_largest(values), NOISE / 10.0 ** (1 - _DIGITS) * scale) * (1.0 + ROUNDING)
    places = _DIGITS - 1 - math.floor(math.log10(largest)) if largest > 0.0 else 0
    return tuple(
        value if isinstance(value, str) or not math.isfinite(value) else round(value, places) + 0.0
        for value in values
    )


def _largest(values: Iterable[Value]) -> float:
    """Return the largest magnitude of the finite numbers; 0 without any."""
    return max(
        (abs(value) for value in values if not isinstance(value, str) and math.isfinite(value)),
        default=0.0,
    )
