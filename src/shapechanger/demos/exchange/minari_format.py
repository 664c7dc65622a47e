"""Layout of a Minari dataset exported by Shapechanger: names that reader and writer share.

An observation is the picture, the state, or a dictionary of both. A picture is stored as the JPEG
that was recorded, which Minari decodes on reading; it is not encoded again. Pictures below 32
pixels, which Minari does not store as JPEG, are stored as pixels, with the JPEG beside them. Minari
needs one observation more than there are steps, so the last one is repeated.

The infos of a step, by name:

- `applied`, `wanted`: as the action; `has_applied`, `has_wanted`: whether they are known.
- `driver`, `stop_reason`: text.
- `captured_ns`, `decided_ns`, `wall_ns`: times; `UNKNOWN_NS` if unknown.
- `frame`: index of the picture in the episode, from 0; the same for steps that share one.
- `rewarded`: whether the reward is known; it is NaN if not.
- `more`: JSON of everything else: `terms`, `marks`, `dropped`.

The headers of the episodes, the layouts and the rate are in `metadata.json`.

Minari's own writer (`MinariStorage.update_episodes`) is not used for the steps: it decodes and
encodes each picture again at JPEG quality 75, and needs the whole episode in memory.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from gymnasium import spaces

from shapechanger.errors import MissingExtra

DATA: Final = "data"
METADATA: Final = "metadata.json"
MAIN: Final = "main_data.hdf5"

IMAGE: Final = "image"
STATE: Final = "state"
JPEG: Final = "jpeg"

HEADERS: Final = "shapechanger"
"""Key of Shapechanger's own section in `metadata.json`."""

HEADERS_FORMAT: Final = 1
"""Version of that section."""

TIMES: Final = ("captured_ns", "decided_ns", "wall_ns")

UNKNOWN_NS: Final = -(2**63)
"""Placeholder for an unknown time, ns."""

_MIN_JPEG_PIXELS: Final = 32
_BRIGHTEST: Final = 255


def library(name: str) -> Any:
    """Import a module of h5py or Minari.

    Raises:
        MissingExtra: If it is not installed.
    """
    try:
        return import_module(name)
    except ImportError as error:
        raise MissingExtra(name.split(".")[0], "data") from error


def data_folder(folder: Path) -> Path | None:
    """Return the folder with the files of a dataset: `data`, or `folder` itself; None for none."""
    for place in (folder / DATA, folder):
        if (place / METADATA).is_file():
            return place
    return None


def is_minari(folder: Path) -> bool:
    """Return whether a folder is a Minari dataset."""
    return data_folder(folder) is not None


def stored_as_jpeg(space: spaces.Space[Any]) -> bool:
    """Return whether Minari stores a space as JPEG: `is_image_space` of its minari_storage.py."""
    if not isinstance(space, spaces.Box):
        return False
    box = cast("Any", space)
    return (
        len(box.shape) in {2, 3}
        and min(box.shape[:2]) >= _MIN_JPEG_PIXELS
        and box.dtype == np.uint8
        and bool(np.all(box.low == 0))
        and bool(np.all(box.high == _BRIGHTEST))
    )
