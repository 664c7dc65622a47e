"""Detect edits to a compiled model in a few microseconds."""

from __future__ import annotations

import ctypes
import hashlib
import threading
from typing import Any, Final, cast
from weakref import WeakValueDictionary

import mujoco

# Sizes, options, visual settings and statistics lie at the beginning of an mjModel, in this order
# (mjmodel.h of MuJoCo 4.0.0), and take 1.8 kB together.
_LONGEST_HEAD: Final = 8192
# Pointers to arrays are rounded up to 64 bytes.
_ALIGNMENT: Final = 64


class Snapshot:
    """The bytes of a model, shared by all watches of models that were compiled equal.

    Sharing keeps the bytes in a core's caches while many envs compare their models with them.

    Args:
        parts: The bytes of each watched region of memory.

    Attributes:
        steps: Steps that all envs with such a model have taken without a fast model.
    """

    def __init__(self, parts: list[bytearray]) -> None:
        self.parts = parts
        self.steps = 0


_snapshots: WeakValueDictionary[bytes, Snapshot] = WeakValueDictionary()
_lock = threading.Lock()


def forget_steps() -> None:
    """Reset the counted steps of all models."""
    with _lock:
        for snapshot in _snapshots.values():
            snapshot.steps = 0


class ModelWatch:
    """Detects whether a model has changed since the watch was created.

    It compares memory: all sizes, options and statistics, and every array except the pixels of
    textures, which do not affect the physics. So no field can be forgotten, and restoring a field
    is detected too.

    Args:
        model: The model; the watch keeps it alive, because it reads the model's memory.

    Attributes:
        model: The watched model.
        sees: Whether this version of MuJoCo lays models out as expected; if not, `unedited` is
            always false.
        digest: Hash of the model as it was when the watch was created.
        snapshot: The bytes of the model then, shared with equal models.
        timestep: Its timestep then, s.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model = model
        self.timestep = float(model.opt.timestep)
        views = [(ctypes.c_char * size).from_address(start) for start, size in _regions(model)]
        self.sees = bool(views)
        # A bytearray compares itself with any buffer by memcmp; bytes would not.
        parts = [bytearray(view) for view in views]
        total = hashlib.blake2b(digest_size=16)
        for part in parts:
            total.update(part)
        self.digest = total.digest()
        with _lock:
            self.snapshot = _snapshots.setdefault(self.digest, Snapshot(parts))
        self._parts = list(zip(self.snapshot.parts, views, strict=True))

    def unedited(self) -> bool:
        """Return whether every number of the model is as it was, to the last bit."""
        for before, now in self._parts:
            if before != now:
                return False
        return self.sees


def _regions(model: mujoco.MjModel) -> list[tuple[int, int]]:
    """Address and length in bytes of the watched memory; empty if the layout is unknown."""
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
        return []  # pragma: no cover  # Another MuJoCo build.
    regions = [(head, stat_end - head)]
    if not model.ntexdata:
        return [*regions, (first, last - first)]
    pixels, after = _start(model.tex_data), _end(model.tex_data)
    if not first < pixels < after < last:
        return []  # pragma: no cover  # Another MuJoCo build.
    return [*regions, (first, pixels - first), (after, last - after)]


def _start(array: Any) -> int:
    return int(array.__array_interface__["data"][0])


def _end(array: Any) -> int:
    return _start(array) + int(array.nbytes)
