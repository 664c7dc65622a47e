"""Detect edits to a compiled model in a few microseconds."""

from __future__ import annotations

import ctypes
import hashlib
import sys
import threading
from collections import OrderedDict
from functools import cache
from operator import attrgetter
from typing import Any, Final

import mujoco
import numpy as np

# Arrays closer than this in memory, bytes, are compared together with the bytes between them.
_APART: Final = 64
# Bodies whose snapshots are kept after their envs have gone.
_REMEMBERED: Final = 32


class Snapshot:
    """What all watches of models that were compiled equal share.

    Sharing keeps the bytes in a core's caches while many envs compare their models with them.

    Args:
        parts: The bytes of each watched region of memory.
        numbers: Options and statistics outside of these.

    Attributes:
        steps: Steps that all envs with such a model have taken without a fast model.
        searched: Whether a fast model has been looked for.
        fast: The fast model; None if none is known to move equally.
    """

    def __init__(self, parts: list[bytearray], numbers: tuple[Any, ...]) -> None:
        self.parts = parts
        self.numbers = numbers
        self.steps = 0
        self.searched = False
        self.fast: mujoco.MjModel | None = None


snapshots: OrderedDict[bytes, Snapshot] = OrderedDict()
"""The latest snapshots, keyed by the digests of their models."""
_lock = threading.Lock()


class ModelWatch:
    """Detects whether a model has changed since the watch was created.

    It compares all options and statistics, and the memory of every array except the pixels of
    textures, which do not affect the physics. So no field can be forgotten, and restoring a field
    is detected too.

    Args:
        model: The model; the watch keeps it alive, because it reads the memory of its arrays.

    Attributes:
        model: The watched model.
        digest: Hash of the model as it was when the watch was created.
        snapshot: The bytes of the model then, shared with equal models.
        timestep: Its timestep then, s.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        self.model = model
        self.timestep = float(model.opt.timestep)
        self._options, self._statistics = model.opt, model.stat
        self._of_options, self._of_statistics = _readers()
        # These come first, wherever they are in memory, so that equal models have equal digests.
        views = [*_views(sys.maxsize, model.opt, model.stat), *_views(_APART, model)]
        # A bytearray compares itself with any buffer by memcmp; bytes would not.
        parts = [bytearray(view) for view in views]
        numbers = self._read_numbers()
        total = hashlib.blake2b(repr(numbers).encode(), digest_size=16)
        for part in parts:
            total.update(part)
        self.digest = total.digest()
        with _lock:
            self.snapshot = snapshots.setdefault(self.digest, Snapshot(parts, numbers))
            snapshots.move_to_end(self.digest)
            while len(snapshots) > _REMEMBERED:
                snapshots.popitem(last=False)
        self._parts = list(zip(self.snapshot.parts, views, strict=True))

    def unedited(self) -> bool:
        """Return whether every number of the model is as it was, to the last bit."""
        if self._read_numbers() != self.snapshot.numbers:
            return False
        for before, now in self._parts:  # noqa: SIM110  # `all` takes twice as long.
            if before != now:
                return False
        return True

    def _read_numbers(self) -> tuple[Any, ...]:
        return self._of_options(self._options), self._of_statistics(self._statistics)


def _views(apart: int, *owners: Any) -> list[Any]:
    """Return views of the memory of all arrays; those closer than `apart` bytes share one."""
    spans: list[tuple[int, int]] = []
    for owner in owners:
        for name in _array_names(owner.__class__):
            array: Any = getattr(owner, name)
            # An array that owns its memory is a copy, which is gone at once.
            if array.size and not array.flags.owndata:
                start = int(array.__array_interface__["data"][0])
                spans.append((start, start + int(array.nbytes)))
    regions: list[tuple[int, int]] = []
    for start, end in sorted(spans):
        if regions and start - sum(regions[-1]) < apart:
            start = regions[-1][0]
            end = max(sum(regions.pop()), end)
        regions.append((start, end - start))
    return [(ctypes.c_char * size).from_address(start) for start, size in regions]


@cache
def _array_names(kind: type[Any]) -> list[str]:
    """Return the names of the arrays of a kind of object of MuJoCo, except `tex_data`."""
    blank: Any = mujoco.MjSpec().compile() if kind is mujoco.MjModel else kind()
    names = (name for name in dir(kind) if type(getattr(blank, name)) is np.ndarray)
    return [name for name in names if name != "tex_data"]


@cache
def _readers() -> list[Any]:
    """Return functions that read the options, and the statistics, outside of the watched memory.

    Each number of a model is changed once, to see whether it lies within.
    """
    model = mujoco.MjSpec().compile()
    (memory,) = _views(sys.maxsize, model.opt, model.stat)
    readers: list[Any] = []
    for part in (model.opt, model.stat):
        outside: list[str] = []
        for name in dir(part):
            before, value = bytes(memory), getattr(part, name)
            if isinstance(value, int | float):
                setattr(part, name, value + 1)
                if before == bytes(memory):
                    outside.append(name)
        readers.append(attrgetter("__class__", *outside))
    return readers
