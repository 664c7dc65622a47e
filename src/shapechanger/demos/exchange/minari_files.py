"""What a Minari dataset of ours looks like: the names that writing and reading share.

An observation is the picture, the state, or a dictionary of both. A picture is stored as the bytes
of the JPEG that was recorded, which Minari decodes when it reads: nothing is encoded anew. Where
Minari does not store JPEG, for pictures below 32 pixels, they are stored as pixels and the bytes
beside them. Minari wants one observation more than there are steps: the last one is there twice.

The infos of a step, by name:

- `applied`, `wanted`: numbers as those of the action; `has_applied`, `has_wanted`: whether they are
  known. `driver`, `stop_reason`: text.
- `captured_ns`, `decided_ns`, `wall_ns`: times, and `UNKNOWN_NS` where nobody knows.
- `frame`: number of the picture in the episode, from 0, the same for steps that share one.
- `rewarded`: whether the reward is known; it is NaN if not.
- `more`: JSON of what has no place of its own: `terms`, `marks`, `dropped`.

The headers of the episodes, the layouts and the rate are in `metadata.json`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

__all__ = [
    "DATA",
    "HEADERS",
    "HEADERS_FORMAT",
    "IMAGE",
    "JPEG",
    "MAIN",
    "METADATA",
    "STATE",
    "TIMES",
    "UNKNOWN_NS",
    "data_folder",
]

DATA: Final = "data"
METADATA: Final = "metadata.json"
MAIN: Final = "main_data.hdf5"

IMAGE: Final = "image"
STATE: Final = "state"
JPEG: Final = "jpeg"

HEADERS: Final = "shapechanger"
"""Key of what only Shapechanger reads in `metadata.json`."""

HEADERS_FORMAT: Final = 1

TIMES: Final = ("captured_ns", "decided_ns", "wall_ns")

UNKNOWN_NS: Final = -(2**63)
"""A time that nobody knows, ns."""


def data_folder(folder: Path) -> Path | None:
    """The folder with the files of a Minari dataset: `data` in its own folder; None for none."""
    for place in (folder / DATA, folder):
        if (place / METADATA).is_file():
            return place
    return None
