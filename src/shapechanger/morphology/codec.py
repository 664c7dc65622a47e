"""A body as a value: the edits that make it from its family's first body, and the same as JSON.

>>> from shapechanger.morphology import Stretch, to_json
>>> to_json([Stretch("*shank*", 1.5)])
'[{"edit":"stretch","body":"*shank*","factor":1.5}]'
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any, Final, cast

import msgspec

from shapechanger.errors import MorphologyError, UnknownName
from shapechanger.morphology.edits.edit import Edit
from shapechanger.morphology.edits.joints import JointRange, Lock
from shapechanger.morphology.edits.limbs import AddLimb, AddSegment, Cut, Remove, Split
from shapechanger.morphology.edits.shapes import Radius, Stretch
from shapechanger.morphology.edits.values import Damping, Density, Friction, Gear, Mass, Stiffness
from shapechanger.morphology.edits.world import Gravity, StartHeight

__all__ = ["EDITS", "Body", "as_body", "from_json", "to_json"]

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
