"""Vector entry points of all ids: `make_vec` with the id filled in.

Gymnasium calls a vector entry point without its id. A spec's JSON can hold a string but not a
function, so each name of the catalogue is an attribute of this module:
`shapechanger.envs.vector.entry_points:BigAnt`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

from shapechanger.envs.vector.make import make_vec


def __getattr__(name: str) -> Callable[..., Any]:
    """Return `make_vec` for the env of this name."""
    if name.startswith("_"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return partial(make_vec, name)
