"""Row of a table of results."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass

from shapechanger.errors import UnknownName


@dataclass(frozen=True)
class Row:
    """One result next to its target.

    Attributes:
        name: Quantity that was measured.
        value: Result.
        spread: Spread of the rounds, or other context.
        target: Target, or "none".
        met: Whether the target was met.
    """

    name: str
    value: str
    spread: str
    target: str
    met: bool


def asked(kind: str, names: Iterable[str]) -> list[str]:
    """Return the names in `ONLY`, which are separated by spaces, or all if it is not set.

    Args:
        kind: Kind of the names, for the error message.
        names: All names.

    Raises:
        UnknownName: If `ONLY` contains an unknown name.
    """
    known = list(names)
    found = os.environ.get("ONLY", "").split() or known
    for name in found:
        if name not in known:
            raise UnknownName(kind, name, known)
    return found
