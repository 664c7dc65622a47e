"""Paths that a fingertip follows: shapes, functions of time, and recorded tables.

The frame is the finger's: x distal, y radial, z dorsal, in metres from the knuckle (the MCP joint);
time is in seconds. The env checks whether a finger reaches a path.

>>> from shapechanger.finger.paths import as_path
>>> path = as_path({"kind": "circle", "radius": 0.01, "hz": 1.0})
>>> path.at([0.0, 0.5]).round(3).tolist()
[[0.06, 0.0, -0.045], [0.04, 0.0, -0.045]]
"""

from __future__ import annotations

from shapechanger.finger.paths.path import (
    FASTEST_MPS,
    FingertipPath,
    circle,
    curve_3d,
    figure_eight,
    line,
    sample,
)
from shapechanger.finger.paths.sources import KINDS, PathSource, as_path, from_callable, from_csv

__all__ = [
    "FASTEST_MPS",
    "KINDS",
    "FingertipPath",
    "PathSource",
    "as_path",
    "circle",
    "curve_3d",
    "figure_eight",
    "from_callable",
    "from_csv",
    "line",
    "sample",
]
