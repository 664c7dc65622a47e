"""A body as a value: the edits that make it from its family's first body, and the same as JSON.

>>> from shapechanger.morphology import Stretch, to_json
>>> to_json([Stretch("*shank*", 1.5)])
'[{"edit":"stretch","body":"*shank*","factor":1.5}]'
"""

from __future__ import annotations

import difflib
import json
from collections.abc import Hashable, Iterable
from typing import Any, Final, cast

import msgspec

from shapechanger.errors import MorphologyError, UnknownName
from shapechanger.morphology.edits.edit import Edit, Vector
from shapechanger.morphology.edits.joints import JointRange, Lock
from shapechanger.morphology.edits.limbs import AddLimb, AddSegment, Cut, Remove, Split
from shapechanger.morphology.edits.values import (
    Damping,
    Density,
    Friction,
    Gear,
    Gravity,
    Mass,
    Radius,
    StartHeight,
    Stiffness,
    Stretch,
)

# The edits, in order, that make a body from the first body of its family.
Body = tuple[Edit, ...]

EDITS: Final[tuple[type[Edit], ...]] = (
    *(Stretch, Radius, Cut, Remove, Split, AddSegment, AddLimb),
    *(Mass, Density, Gear, Damping, Stiffness, Friction),
    *(JointRange, Lock, Gravity, StartHeight),
)

_TAGS: Final = {str(edit.__struct_config__.tag): edit for edit in EDITS}


def to_json(body: Iterable[Edit]) -> str:
    """The edits as a JSON list of tagged objects."""
    return msgspec.json.encode(list(body)).decode()


def from_json(text: str | bytes) -> Body:
    """Read what `to_json` wrote; a single object is a body of one edit.

    Raises:
        UnknownName: If an edit is of no known kind, or has a field that its kind lacks.
        MorphologyError: If the text is not such a list, or a number is out of its range.
    """
    try:
        parsed: Any = json.loads(text)
    except (ValueError, RecursionError) as error:  # No JSON, no UTF-8, or nested without end.
        raise MorphologyError(f"A body must be a JSON list of edits: {error}.") from error
    items = cast("list[Any]", parsed if isinstance(parsed, list) else [parsed])
    return tuple(_edit(item) for item in items)


def as_body(value: Edit | Iterable[Edit] | str) -> Body:
    """A body from one edit, several, or their JSON.

    Raises:
        MorphologyError: If it is none of these.
    """
    if isinstance(value, str):
        return from_json(value)
    if isinstance(value, Edit):
        return (value,)
    given: Any = value  # What a type checker knows, a notebook may not.
    edits = list(cast("Iterable[Any]", given)) if isinstance(given, Iterable) else [given]
    for edit in edits:
        if not isinstance(edit, Edit):
            raise MorphologyError(
                f"A body is made of edits such as Stretch('shank_*', 1.5), not of {edit!r}."
            )
    return tuple(edits)


def _edit(item: Any) -> Edit:
    """One edit from its parsed JSON."""
    if not isinstance(item, dict) or "edit" not in item:
        raise MorphologyError(f'An edit is an object with the key "edit", got {item!r}.')
    fields = cast("dict[str, Any]", item)
    kind = _TAGS.get(str(fields["edit"]))
    if kind is None:
        raise UnknownName("edit", str(fields["edit"]), _TAGS)
    for name in fields:
        if name not in ("edit", *kind.__struct_fields__):
            raise UnknownName(f"field of {fields['edit']!r}", name, kind.__struct_fields__)
    try:
        return msgspec.convert(fields, kind)
    except msgspec.ValidationError as error:
        raise MorphologyError(f"{fields['edit']}: {error}") from error


# A motor that only one of two bodies has is there in between, the weaker the farther that body is.
_ZERO_WHERE_NONE: Final = frozenset({"gear"})


def interpolate(a: Body, b: Body, alpha: float) -> Body:
    """The body at the part `alpha` of the way from `a` to `b`.

    Both ends are exact: 0 gives `a` itself, 1 gives `b` itself. Physical quantities are continuous
    in `alpha`, but for the inertia of a segment that is split, which jumps by what the rounded ends
    of its parts make up. Dimensions cannot be: a limb or motor that only `b` has is there, small
    and weak, from the first step on, and one that `b` lacks stays, ever smaller, until the last.

    Args:
        a: Where the path begins.
        b: Where it ends, made from the same first body as `a`.
        alpha: The part of the way, 0 to 1.

    Raises:
        MorphologyError: If `alpha` lies outside [0, 1].
    """
    if not 0.0 <= alpha <= 1.0:
        raise MorphologyError(f"alpha must be between 0 and 1, got {alpha}.")
    if alpha in (0.0, 1.0):
        return a if alpha == 0.0 else b
    steps: list[Edit] = []
    matcher = difflib.SequenceMatcher(None, [_key(x) for x in a], [_key(x) for x in b], False)
    for kind, a_from, a_to, b_from, b_to in matcher.get_opcodes():
        if kind == "equal":
            pairs = zip(a[a_from:a_to], b[b_from:b_to], strict=True)
            steps += [_between(x, y, alpha) for x, y in pairs]
        else:
            steps += [edit.partly(1.0 - alpha) for edit in a[a_from:a_to]]
            steps += [edit.partly(alpha) for edit in b[b_from:b_to]]
    return tuple(steps)


def _key(edit: Edit) -> Hashable:
    """Return the part of an edit that is equal at different strengths: all but its numbers."""
    values: dict[str, Any] = msgspec.structs.asdict(edit)
    return type(edit), tuple(
        (k, None if _is_number(v) else v)
        for k, v in values.items()
        if v is not None and k not in _ZERO_WHERE_NONE
    )


def _is_number(value: object) -> bool:
    return isinstance(value, int | float | tuple)


def _between(x: Edit, y: Edit, alpha: float) -> Edit:
    """The edit between two that differ in numbers only."""
    changes: dict[str, Any] = {}
    for field in x.__struct_fields__:
        old: Any = getattr(x, field)
        new: Any = getattr(y, field)
        if old == new:
            continue
        if field in _ZERO_WHERE_NONE:
            old, new = old or 0.0, new or 0.0
        if isinstance(old, tuple):
            pairs = zip(cast("Vector", old), cast("Vector", new), strict=True)
            changes[field] = tuple(p + alpha * (q - p) for p, q in pairs)
        else:
            changes[field] = old + alpha * (new - old)
    return msgspec.structs.replace(x, **changes)
