"""Noticing that somebody has edited a compiled model, in a microsecond or two."""

from __future__ import annotations

import ctypes
import hashlib
from typing import Any, Final, cast

import mujoco

__all__ = ["ModelWatch"]

# Sizes, options, visual settings and statistics lie at the beginning of an mjModel, in this order
# (mjmodel.h of MuJoCo 4.0.0), and take 1.8 kB together.
_LONGEST_HEAD: Final = 8192
# Pointers to arrays are rounded up to 64 bytes.
_ALIGNMENT: Final = 64


class ModelWatch:
    """Tells whether a model is as it was when the watch began.

    It compares memory: all sizes, options and statistics, and every array but the pixels of
    textures, which move nothing. So no field can be forgotten, and restoring a field is noticed
    too.

    Args:
        model: The model; the watch keeps it alive, because it looks at its memory.

    Attributes:
        model: The model that is watched.
        sees: Whether this version of MuJoCo lays models out as known; if not, `unedited` is never
            true.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model = model
        regions = _regions(model)
        self.sees = bool(regions)
        # A bytearray compares itself with any buffer by memcmp; bytes would not.
        self._parts: list[tuple[bytearray, Any]] = []
        for address, size in regions:
            view = (ctypes.c_char * size).from_address(address)
            self._parts.append((bytearray(view), view))

    def unedited(self) -> bool:
        """Whether every number of the model is as it was, to the last bit."""
        for before, now in self._parts:
            if before != now:
                return False
        return self.sees

    @property
    def digest(self) -> bytes:
        """A name for the model as it was when the watch began."""
        total = hashlib.blake2b(digest_size=16)
        for before, _ in self._parts:
            total.update(before)
        return total.digest()


def _regions(model: mujoco.MjModel) -> list[tuple[int, int]]:
    """Address and length in bytes of what is watched; empty if the layout is not as known."""
    head = int(cast("Any", model)._address)
    gravity = _start(model.opt.gravity)
    lamp = _start(model.vis.headlight.ambient)
    stat_end = _end(model.stat.center)
    first, last = _start(model.qpos0), _end(model.mapD2M)
    if not (
        model.qpos0.size
        and model.mapD2M.size
        and head < gravity < lamp < stat_end < head + _LONGEST_HEAD
        and 0 <= int(model.nbuffer) - (last - first) <= 2 * _ALIGNMENT
    ):
        return []
    regions = [(head, stat_end - head)]
    if not model.ntexdata:
        return [*regions, (first, last - first)]
    pixels, after = _start(model.tex_data), _end(model.tex_data)
    if not first < pixels < after < last:
        return []
    return [*regions, (first, pixels - first), (after, last - after)]


def _start(array: Any) -> int:
    return int(array.__array_interface__["data"][0])


def _end(array: Any) -> int:
    return _start(array) + int(array.nbytes)
