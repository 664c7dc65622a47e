"""Names for every element of a compiled model, those without one included.

The rule is that of `shapechanger.morphology.spec.name_elements`, so a model compares as equal with
a copy of it whose elements were given names by that rule.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final, Protocol, SupportsInt

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

_TARGET: Final = {
    mujoco.mjtTrn.mjTRN_JOINT: "joints",
    mujoco.mjtTrn.mjTRN_JOINTINPARENT: "joints",
    mujoco.mjtTrn.mjTRN_SLIDERCRANK: "sites",
    mujoco.mjtTrn.mjTRN_TENDON: "tendons",
    mujoco.mjtTrn.mjTRN_SITE: "sites",
    mujoco.mjtTrn.mjTRN_BODY: "bodies",
}


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
        actuators: Names of the actuators; one without a name is called after what it drives.
        targets: For each actuator the name of what it drives.
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
    """The names of a model's elements, made up where there is none."""
    given_joints = _given(model, mujoco.mjtObj.mjOBJ_JOINT, model.njnt)
    given_bodies = _given(model, mujoco.mjtObj.mjOBJ_BODY, model.nbody)
    joint_of_body: dict[int, str] = {}
    for name, body in zip(given_joints, model.jnt_bodyid.tolist(), strict=True):
        if name:
            joint_of_body.setdefault(body, name)
    parents = model.body_parentid.tolist()
    bodies = list(given_bodies)
    free = _namer(given_bodies)
    for i, name in enumerate(given_bodies):
        bodies[i] = name or free(joint_of_body.get(i, "") or f"{bodies[parents[i]]}_part")

    def parts(kind: str, given: list[str], body_ids: list[int]) -> tuple[str, ...]:
        return _filled(given, lambda i: f"{bodies[body_ids[i]]}_{kind}")

    joints = parts("joint", given_joints, model.jnt_bodyid.tolist())
    geoms = parts(
        "geom",
        _given(model, mujoco.mjtObj.mjOBJ_GEOM, model.ngeom),
        model.geom_bodyid.tolist(),
    )
    sites = parts(
        "site",
        _given(model, mujoco.mjtObj.mjOBJ_SITE, model.nsite),
        model.site_bodyid.tolist(),
    )
    tendons = _filled(_given(model, mujoco.mjtObj.mjOBJ_TENDON, model.ntendon), lambda _: "tendon")
    by_kind = {"joints": joints, "sites": sites, "tendons": tendons, "bodies": tuple(bodies)}
    targets = tuple(
        by_kind[_kind_of_target(transmission, joint_like=second < 0)][int(first)]
        for transmission, (first, second) in zip(
            model.actuator_trntype.tolist(), model.actuator_trnid.tolist(), strict=True
        )
    )
    return Names(
        bodies=tuple(bodies),
        joints=joints,
        geoms=geoms,
        sites=sites,
        tendons=tendons,
        equalities=_filled(
            _given(model, mujoco.mjtObj.mjOBJ_EQUALITY, model.neq), lambda _: "equality"
        ),
        flexes=_filled(_given(model, mujoco.mjtObj.mjOBJ_FLEX, model.nflex), lambda _: "flex"),
        actuators=_filled(
            _given(model, mujoco.mjtObj.mjOBJ_ACTUATOR, model.nactuator), targets.__getitem__
        ),
        targets=targets,
    )


def _kind_of_target(transmission: int, *, joint_like: bool) -> str:
    """Return the kind of element that an actuator with this transmission drives."""
    so3 = "joints" if joint_like else "sites"  # A ball joint, or a site with its reference site.
    return _TARGET.get(mujoco.mjtTrn(transmission), so3)


def _given(model: mujoco.MjModel, kind: mujoco.mjtObj, count: int) -> list[str]:
    """The names in the model, empty where there is none."""
    return [mujoco.mj_id2name(model, kind, i) or "" for i in range(count)]


def _filled(given: list[str], wanted: Callable[[int], str]) -> tuple[str, ...]:
    """The given names, and for each that is empty the wanted one."""
    free = _namer(given)
    return tuple(name or free(wanted(i)) for i, name in enumerate(given))


def _namer(given: list[str]) -> Callable[[str], str]:
    """A function that gives the name asked for, or the next free one after it."""
    taken = set(given)

    def free(name: str) -> str:
        candidate, count = name, 1
        while candidate in taken:
            count += 1
            candidate = f"{name}_{count}"
        taken.add(candidate)
        return candidate

    return free


class _Member(Protocol):
    @property
    def name(self) -> str: ...


def is_any(values: NDArray[np.generic], *members: SupportsInt) -> NDArray[np.bool_]:
    """Return which of `values` are among some members of a MuJoCo enumeration."""
    return np.isin(values, [int(member) for member in members])


def named(names: tuple[str, ...], indices: NDArray[np.integer]) -> list[str]:
    """Return the names at some indices.

    Args:
        names: Names of all elements.
        indices: Shape (n,).
    """
    return [names[int(index)] for index in indices.tolist()]


def word(member: _Member) -> str:
    """Return the name of a member of a MuJoCo enumeration: `hinge` for `mjJNT_HINGE`."""
    return member.name.partition("_")[2].lower()


Value = float | str
Fields = tuple[tuple[str, tuple[Value, ...]], ...]
Element = tuple[str, Fields]
Section = tuple[Element, ...]

_Bools = NDArray[np.bool_]


class Rows:
    """The elements of one kind, each with the fields gathered for it so far."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names
        self._rows: list[dict[str, tuple[Value, ...]]] = [{} for _ in names]

    def numbers(self, field: str, values: ArrayLike, where: _Bools | None = None) -> None:
        """Give each element, or each where `where` holds, its row of `values`.

        Args:
            field: What the numbers are.
            values: Numbers of any type, shape (n,) or (n, ...).
            where: Which elements have the field, shape (n,); all where None.
        """
        if not self._rows:
            return
        # Adding zero turns -0.0, which nothing distinguishes from 0.0, into 0.0.
        flat = np.asarray(values, np.float64).reshape(len(self._rows), -1) + 0.0
        present = [True] * len(self._rows) if where is None else where.tolist()
        for row, numbers, has in zip(self._rows, flat.tolist(), present, strict=True):
            if has:
                row[field] = tuple(numbers)

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
        """The elements with their fields.

        Args:
            keep: Which elements to keep, shape (n,); all where None.
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
