"""Applying edits to a model, and compiling the result."""

from __future__ import annotations

from collections.abc import Iterable

import mujoco

from shapechanger.errors import BrokenModel, ShapechangerError
from shapechanger.morphology.body import to_json
from shapechanger.morphology.edits.edit import Edit
from shapechanger.morphology.spec.explicit import make_explicit


def reshape(spec: mujoco.MjSpec, edits: Iterable[Edit]) -> mujoco.MjSpec:
    """Return a copy of a specification with edits applied in order.

    Args:
        spec: The specification; not changed.
        edits: The edits.

    Raises:
        UnknownName: If an edit names an element that the model lacks.
        MorphologyError: If an element cannot be changed that way.
    """
    result = spec.copy()
    effective = [edit for edit in edits if edit.amount > 0.0]
    if effective:
        make_explicit(result)
    for edit in effective:
        edit.apply(result)
    return result


def compile_body(spec: mujoco.MjSpec, edits: Iterable[Edit] = ()) -> mujoco.MjModel:
    """Compile a specification with edits applied; derived constants are computed anew.

    Args:
        spec: The specification; not changed.
        edits: The edits, applied in order.

    Raises:
        UnknownName: If an edit names an element that the model lacks.
        MorphologyError: If an element cannot be changed that way.
        BrokenModel: If MuJoCo does not compile the result.
    """
    body = tuple(edits)
    try:
        return reshape(spec, body).compile()
    except (ValueError, mujoco.FatalError) as error:
        if isinstance(error, ShapechangerError):
            raise
        lines = [" ".join(line.split()) for line in str(error).splitlines()]
        reason = "; ".join(filter(None, lines)).removeprefix("Error: ").removesuffix(".")
        raise BrokenModel(f"MuJoCo does not compile the body {to_json(body)}: {reason}.") from error
