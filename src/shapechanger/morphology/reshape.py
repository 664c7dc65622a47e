"""Applying edits to a model, and compiling the result."""

from __future__ import annotations

from collections.abc import Iterable

import mujoco

from shapechanger.errors import BrokenModel
from shapechanger.morphology.codec import to_json
from shapechanger.morphology.edit import Edit

__all__ = ["compile_body", "reshape"]


def reshape(spec: mujoco.MjSpec, edits: Iterable[Edit]) -> mujoco.MjSpec:
    """A copy of `spec` with `edits` applied in order; `spec` is untouched.

    Raises:
        UnknownName: If an edit names an element that the model lacks.
        MorphologyError: If an element cannot be changed that way.
    """
    result = spec.copy()
    for edit in edits:
        if edit.amount > 0.0:
            edit.apply(result)
    return result


def compile_body(spec: mujoco.MjSpec, edits: Iterable[Edit] = ()) -> mujoco.MjModel:
    """The compiled model of `spec` with `edits` applied; all that is derived is computed anew.

    Raises:
        UnknownName: If an edit names an element that the model lacks.
        MorphologyError: If an element cannot be changed that way.
        BrokenModel: If MuJoCo does not compile the result.
    """
    body = tuple(edits)
    try:
        return reshape(spec, body).compile()
    except (ValueError, mujoco.FatalError) as error:
        if isinstance(error, BrokenModel) or type(error) not in (ValueError, mujoco.FatalError):
            raise
        reason = " ".join(str(error).split())
        raise BrokenModel(f"MuJoCo does not compile the body {to_json(body)}: {reason}.") from error
