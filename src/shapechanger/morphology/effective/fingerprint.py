"""A short name for what a model does: two models with the same fingerprint move equally."""

from __future__ import annotations

import hashlib
import struct
from typing import TYPE_CHECKING, Final

from shapechanger.morphology.effective.model import EffectiveModel, effective_model

if TYPE_CHECKING:
    import mujoco

    from shapechanger.morphology.effective.rows import Value

__all__ = ["fingerprint"]

# 64 bits: among a million different models two agree by chance once in 37 million tries.
_HEX_DIGITS: Final = 16


def fingerprint(model: mujoco.MjModel | EffectiveModel) -> str:
    """The first 16 hex digits of the SHA-256 of an effective model.

    It is the same in every process and on every machine on which the model compiles to the same
    numbers, and does not change with colours, cameras, lights, or anything else without effect.

    Args:
        model: A compiled model, or what was already taken from one.
    """
    effective = model if isinstance(model, EffectiveModel) else effective_model(model)
    total = hashlib.sha256()
    for section, elements in effective.sections:
        total.update(_text(section) + _count(elements))
        for element, fields in elements:
            total.update(_text(element) + _count(fields))
            for field, values in fields:
                total.update(_text(field) + _count(values) + b"".join(map(_value, values)))
    return total.hexdigest()[:_HEX_DIGITS]


def _value(value: Value) -> bytes:
    """A number as 8 bytes, little-endian; a word with its length."""
    return b"w" + _text(value) if isinstance(value, str) else b"n" + struct.pack("<d", value)


def _text(text: str) -> bytes:
    """A text after its length, so that no two sequences of texts look alike."""
    encoded = text.encode()
    return struct.pack("<I", len(encoded)) + encoded


def _count(items: tuple[object, ...]) -> bytes:
    """How many items follow."""
    return struct.pack("<I", len(items))
