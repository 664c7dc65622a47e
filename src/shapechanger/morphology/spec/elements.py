"""Find elements of a model by name or glob, and name those that have no name."""

from __future__ import annotations

import fnmatch
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Protocol, TypeVar

import mujoco

from shapechanger.errors import MorphologyError, UnknownName

if TYPE_CHECKING:
    from collections.abc import Iterator


class _Named(Protocol):
    name: str


_N = TypeVar("_N", bound=_Named)


def select(kind: str, pattern: str, elements: Iterable[_N]) -> list[_N]:
    """Return the elements whose name is `pattern` or matches it as a glob, in the model's order.

    Args:
        kind: Kind of element for the message, such as "body".
        pattern: A name, or a glob such as `*shank*`.
        elements: The elements to select from.

    Raises:
        UnknownName: If none matches.
    """
    candidates = list(elements)
    exact = [element for element in candidates if element.name == pattern]
    found = exact or [e for e in candidates if fnmatch.fnmatchcase(e.name, pattern)]
    if not found:
        raise UnknownName(kind, pattern, [element.name for element in candidates])
    return found


def limbs_and_trunks(spec: mujoco.MjSpec) -> list[mujoco.MjsBody]:
    """Return all bodies except the world."""
    return [body for body in spec.bodies if body.parent is not None]


def require_limb(body: mujoco.MjsBody, what: str) -> None:
    """Refuse to cut a trunk: a body attached to the world that carries the whole robot.

    Args:
        body: The body to cut.
        what: The edit, for the message.

    Raises:
        MorphologyError: If `body` is a trunk.
    """
    if body.parent.parent is None:
        raise MorphologyError(
            f"{body.name!r} is the trunk that carries all limbs, so it cannot be {what}; "
            f"its limbs can: {', '.join(child.name for child in body.bodies) or 'it has none'}."
        )


def require_free_name(spec: mujoco.MjSpec, kind: str, name: str) -> None:
    """Refuse a name that an element of the kind already has.

    Args:
        spec: The specification.
        kind: Kind of element, such as "body".
        name: The name.

    Raises:
        MorphologyError: If `name` is empty or taken.
    """
    elements = getattr(spec, {"body": "bodies", "equality": "equalities"}.get(kind, f"{kind}s"))
    if not name or any(element.name == name for element in elements):
        raise MorphologyError(f"A new {kind} needs an unused name, got {name!r}.")


def subtree(body: mujoco.MjsBody) -> Iterator[mujoco.MjsBody]:
    """Yield a body and its descendants, parents first."""
    yield body
    for child in body.bodies:
        yield from subtree(child)


def name_elements(spec: mujoco.MjSpec, bodies_by_joint: Mapping[str, str] | None = None) -> None:
    """Name every body, joint, geom, site, camera, light and actuator without a name, in place.

    A body is named after `bodies_by_joint`, or its joint, or its parent; an actuator after the
    element that it drives; anything else after its body. Names change no physics.

    Args:
        spec: The model.
        bodies_by_joint: Names for unnamed bodies by the names of their joints.
    """
    chosen = bodies_by_joint or {}
    body_name = unique_namer(body.name for body in spec.bodies)
    for body in limbs_and_trunks(spec):
        if not body.name:
            joint = next((j.name for j in body.joints if j.name), "")
            body.name = body_name(chosen.get(joint, joint or f"{body.parent.name}_part"))
    for kind, elements in (
        ("joint", spec.joints),
        ("geom", spec.geoms),
        ("site", spec.sites),
        ("camera", spec.cameras),
        ("light", spec.lights),
    ):
        free = unique_namer(element.name for element in elements)
        for element in elements:
            element.name = element.name or free(f"{element.parent.name}_{kind}")
    free = unique_namer(actuator.name for actuator in spec.actuators)
    for actuator in spec.actuators:
        actuator.name = actuator.name or free(actuator.target)


def unique_namer(taken: Iterable[str], numbered: str = "_{}") -> Callable[[str], str]:
    """Return a function that returns the name it is given, numbered if that is taken.

    Args:
        taken: Names that are taken; so is each name that the function has returned.
        numbered: Format of the number after the name.
    """
    used = set(taken)

    def free(name: str) -> str:
        candidate, count = name, 1
        while candidate in used:
            count += 1
            candidate = name + numbered.format(count)
        used.add(candidate)
        return candidate

    return free


def compiled(spec: mujoco.MjSpec) -> mujoco.MjModel:
    """Compile a copy in which every body stands for itself, in its own frame.

    Args:
        spec: The specification; not changed.
    """
    copy = spec.copy()
    copy.compiler.fusestatic = copy.compiler.alignfree = copy.compiler.discardvisual = False
    return copy.compile()
