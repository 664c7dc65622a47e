"""Reading the arrays of a compiled model as names and words."""

from __future__ import annotations

from typing import Protocol, SupportsInt

import numpy as np
from numpy.typing import NDArray

__all__ = ["is_any", "named", "word"]


class _Member(Protocol):
    @property
    def name(self) -> str: ...


def is_any(values: NDArray[np.generic], *members: SupportsInt) -> NDArray[np.bool_]:
    """Which of `values` is one of some members of a MuJoCo enumeration."""
    return np.isin(values, [int(member) for member in members])


def named(names: tuple[str, ...], indices: NDArray[np.integer]) -> list[str]:
    """The names that stand at the indices, shape (n,)."""
    return [names[int(index)] for index in indices.tolist()]


def word(member: _Member) -> str:
    """What a member of a MuJoCo enumeration is called: `mjJNT_HINGE` becomes `hinge`."""
    return member.name.partition("_")[2].lower()
