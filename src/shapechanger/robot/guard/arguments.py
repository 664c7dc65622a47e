"""Reads the command lines of guard and supervisor, which only they write."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

__all__ = ["AFTER_FAILURE", "descriptors"]

AFTER_FAILURE: Final = "--after-failure"
"""The guard's argument that says that it follows processes which failed."""


def descriptors(arguments: Sequence[str], names: Sequence[str]) -> dict[str, int]:
    """The file descriptors of a command line such as `--plan-fd 3 --heartbeat-fd 4`.

    Raises:
        ValueError: If there are others, or one is missing.
    """
    pairs = dict(zip(arguments[::2], arguments[1::2], strict=True))
    if sorted(pairs) != sorted(names):
        raise ValueError(f"This takes {' N '.join(names)} N, not {' '.join(arguments)}.")
    return {name: int(value) for name, value in pairs.items()}
