"""Bodies as values: edits of a model, their JSON, the bodies between two, and their models.

>>> from shapechanger.morphology import Stretch, to_json
>>> to_json([Stretch("*shank*", 1.5)])
'[{"edit":"stretch","body":"*shank*","factor":1.5}]'
"""

from __future__ import annotations

import difflib
import json
from collections.abc import Hashable, Iterable, Mapping
from typing import Any, Final, cast

import msgspec
import mujoco
import numpy as np

from shapechanger.errors import BrokenModel, MorphologyError, ShapechangerError, UnknownName
from shapechanger.morphology.edits import EDITS, Edit, part_of_the_way
from shapechanger.morphology.spec import make_explicit
from shapechanger.morphology.spec.carried import carried

Body = tuple[Edit, ...]
"""The edits, in order, that make a body from the model of its family."""

# MuJoCo takes sparse constraint Jacobians from 60 degrees of freedom on. Newton's solver of this
# version then factorises a wrong Hessian, which 4.0.1 mends (google-deepmind/mujoco#3767).
_WRONG_SPARSE: Final = "4.0.0"
# A motor that only one of two bodies has exists between them, with a gear that fades to zero.
_ZERO_WHERE_NONE: Final = "gear"


def to_json(body: Iterable[Edit]) -> str:
    """Return the edits as a JSON list of tagged objects."""
    return msgspec.json.encode(list(body)).decode()


def from_json(text: str | bytes) -> Body:
    """Read a body from JSON as `to_json` writes it; a single object is a body of one edit.

    Raises:
        UnknownName: If there is no edit of a kind, or no field of a name.
        MorphologyError: If the text is not such a list, or a number is out of its range.
    """
    try:
        # A text that was read from a file may begin with a byte-order mark.
        parsed: Any = json.loads(text.removeprefix("\ufeff") if isinstance(text, str) else text)
    except (ValueError, RecursionError) as error:  # Not JSON, not UTF-8, or nested too deeply.
        raise MorphologyError(f"A body must be a JSON list of edits: {error}.") from error
    return tuple(map(_edit, cast("list[Any]", parsed) if isinstance(parsed, list) else [parsed]))


def as_body(value: Edit | Iterable[Edit] | str) -> Body:
    """Return a body from one edit, several, or their JSON, which may be parsed already.

    Raises:
        UnknownName: As of `from_json`.
        MorphologyError: If `value` is something else.
    """
    if isinstance(value, str):
        return from_json(value)
    given: Any = value  # Not checked at run time.
    one = isinstance(given, Edit | Mapping) or not isinstance(given, Iterable)
    return tuple(map(_edit, [given] if one else cast("Iterable[Any]", given)))


def _edit(item: Any) -> Edit:
    """Return an edit as it is, or from its parsed JSON."""
    if isinstance(item, Edit):
        return item
    if not isinstance(item, Mapping) or "edit" not in item:
        raise MorphologyError(
            "A body is made of edits such as Stretch('shank_*', 1.5), in JSON objects with the key "
            f'"edit", not of {item!r}.'
        )
    fields = dict(cast("Mapping[str, Any]", item))
    kind = EDITS.get(str(fields["edit"]))
    if kind is None:
        raise UnknownName("edit", str(fields["edit"]), EDITS)
    for name in fields:
        if name not in ("edit", *kind.__struct_fields__):
            raise UnknownName(f"field of {fields['edit']!r}", name, kind.__struct_fields__)
    try:
        return msgspec.convert(fields, kind)
    except msgspec.ValidationError as error:
        raise MorphologyError(f"{fields['edit']}: {error}") from error


def interpolate(a: Body, b: Body, alpha: float) -> Body:
    """Return a body on the way from `a` to `b`.

    Both ends are exact: 0 returns `a` itself, 1 returns `b` itself. Physical quantities are
    continuous in `alpha`, except the inertia of a segment that is split, which jumps by that of the
    rounded ends of its parts. Dimensions cannot be continuous: a limb or motor that only `b` has
    exists, small and weak, for every `alpha` above 0, and one that only `a` has, ever smaller, for
    every `alpha` below 1.

    Args:
        a: Body at 0.
        b: Body at 1, made from the same model as `a`.
        alpha: Position on the way, 0 to 1.

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
    """Return what two edits must share to be interpolated: everything but their numbers."""
    values: dict[str, Any] = msgspec.structs.asdict(edit)
    return type(edit), tuple(
        (name, None if isinstance(value, int | float | tuple) else value)
        for name, value in values.items()
        if value is not None and name != _ZERO_WHERE_NONE
    )


def _between(x: Edit, y: Edit, alpha: float) -> Edit:
    """Return the edit between two that differ in numbers only."""
    changes: dict[str, Any] = {}
    new: dict[str, Any] = msgspec.structs.asdict(y)
    for field, old in msgspec.structs.asdict(x).items():
        if old != new[field]:
            start, end = (np.array(number or 0.0, float) for number in (old, new[field]))
            value: Any = part_of_the_way(start, end, alpha)
            changes[field] = tuple(value.tolist()) if isinstance(old, tuple) else float(value)
    return msgspec.structs.replace(x, **changes)


def reshape(spec: mujoco.MjSpec, edits: Iterable[Edit]) -> mujoco.MjSpec:
    """Return a copy of a specification with edits applied in order.

    Raises:
        UnknownName: If an edit names an element that the model lacks.
        MorphologyError: If an element cannot be changed that way.
    """
    result = spec.copy()
    effective = [edit for edit in edits if edit.amount > 0.0]
    if not effective:
        return result
    make_explicit(result)
    with carried(result) as keyframes:
        for edit in effective:
            edit.require_effect(result)
            edit.apply(result)
            edit.follow_in_keyframes(result, keyframes)
    return result


def compile_body(spec: mujoco.MjSpec, edits: Iterable[Edit] = ()) -> mujoco.MjModel:
    """Compile a copy of a specification with edits applied in order.

    Raises:
        UnknownName: If an edit names an element that the model lacks.
        MorphologyError: If an element cannot be changed that way.
        BrokenModel: If MuJoCo does not compile the result.
    """
    body = tuple(edits)
    try:
        model = reshape(spec, body).compile()
    except (ValueError, mujoco.FatalError) as error:
        if isinstance(error, ShapechangerError):
            raise
        text = f"MuJoCo does not compile the body {to_json(body)}: {reason_of(error)}."
        raise BrokenModel(text) from error
    if mujoco.__version__ == _WRONG_SPARSE and mujoco.mj_isSparse(model):
        model.opt.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    return model


def reason_of(error: BaseException) -> str:
    """Return the message of an error of MuJoCo, which may have several lines, for a sentence."""
    lines = [" ".join(line.split()) for line in str(error).splitlines()]
    return "; ".join(filter(None, lines)).removeprefix("Error: ").removesuffix(".")
