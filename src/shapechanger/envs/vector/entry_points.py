"""Where Gymnasium finds the vector env of each id: `make_vec` with the id filled in.

Gymnasium calls a vector entry point without the id that it is for. A string can be written into a
spec's JSON and a function cannot, so each name of the catalogue is an attribute of this module:
`shapechanger.envs.vector.entry_points:BigAnt`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from shapechanger.envs.vector.make import make_vec

__all__: list[str] = []


def __getattr__(name: str) -> Callable[..., Any]:
    """`make_vec` for the env of this name."""
    if name.startswith("_"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return partial(make_vec, name)
