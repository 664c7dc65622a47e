"""The continuous path between two bodies of one family.

REvolveR (Liu et al., ICML 2022) evolves a policy along such a path. Here the path is itself a body
at each of its points: edits that both bodies have move from one strength to the other, edits that
only one has fade out or in.
"""

from __future__ import annotations

import difflib
from collections.abc import Hashable
from typing import Any, Final, cast

import msgspec

from shapechanger.errors import MorphologyError
from shapechanger.morphology.codec import Body
from shapechanger.morphology.edits.edit import Edit, Vector

__all__ = ["interpolate"]

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
    """What must be equal for two edits to be one edit at two strengths: all but its numbers."""
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
