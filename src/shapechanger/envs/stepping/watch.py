"""Detect edits to a compiled model in a few microseconds."""

from __future__ import annotations

import ctypes
import hashlib
import threading
from functools import cache
from operator import attrgetter
from typing import Any, Final
from weakref import WeakValueDictionary

import mujoco
import numpy as np

# Arrays closer than this in memory, bytes, are compared together with the bytes between them.
_APART: Final = 64


class Snapshot:
    """The bytes of a model, shared by all watches of models that were compiled equal.

    Sharing keeps the bytes in a core's caches while many envs compare their models with them.

    Args:
        parts: The bytes of each watched region of memory.
        numbers: Options and statistics outside of these.

    Attributes:
        steps: Steps that all envs with such a model have taken without a fast model.
    """

    def __init__(self, parts: list[bytearray], numbers: tuple[Any, ...]) -> None:
        self.parts = parts
        self.numbers = numbers
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
        views = [(ctypes.c_char * size).from_address(start) for start, size in _regions(model)]
        # A bytearray compares itself with any buffer by memcmp; bytes would not.
        parts = [bytearray(view) for view in views]
        self._numbers = _parts(model)
        numbers = _scalars(*self._numbers)
        total = hashlib.blake2b(repr(numbers).encode(), digest_size=16)
        for part in parts:
            total.update(part)
        self.digest = total.digest()
        with _lock:
            self.snapshot = _snapshots.setdefault(self.digest, Snapshot(parts, numbers))
        self._parts = list(zip(self.snapshot.parts, views, strict=True))

    def unedited(self) -> bool:
        """Return whether every number of the model is as it was, to the last bit."""
        if _scalars(*self._numbers) != self.snapshot.numbers:
            return False
        for before, now in self._parts:  # noqa: SIM110  # `all` takes twice as long.
            if before != now:
                return False
        return True


def _regions(model: mujoco.MjModel) -> list[tuple[int, int]]:
    """Return address and length in bytes of the memory of all arrays, neighbours as one region."""
    inside = [
        _span(getattr(part, name)) for part in _parts(model) for name in _arrays(part.__class__)
    ]
    spans: list[tuple[int, int]] = []
    for name in _arrays(mujoco.MjModel):
        array: Any = getattr(model, name)
        # An array that owns its memory is a copy, which is gone at once.
        if array.size and not array.flags.owndata and name != "tex_data":
            spans.append(_span(array))
    regions: list[tuple[int, int]] = []
    for start, end in sorted(spans):
        if regions and start - sum(regions[-1]) < _APART:
            first = regions[-1][0]
            regions[-1] = first, max(sum(regions[-1]), end) - first
        else:
            regions.append((start, end - start))
    # Options and statistics are parts of the model, so that what lies between is of it, too. They
    # come first, wherever in memory, so that equal models have equal digests.
    first, last = min(start for start, _ in inside), max(end for _, end in inside)
    return [(first, last - first), *regions]


def _span(array: Any) -> tuple[int, int]:
    """Return the addresses of an array's first byte and of the one after its last."""
    start = int(array.__array_interface__["data"][0])
    return start, start + int(array.nbytes)


def _parts(model: mujoco.MjModel) -> tuple[Any, Any]:
    return model.opt, model.stat


@cache
def _arrays(kind: type[Any]) -> list[str]:
    """Return the names of the arrays of a kind of object of MuJoCo."""
    made: Any = _blank if kind is mujoco.MjModel else kind
    blank = made()
    return [name for name in dir(kind) if type(getattr(blank, name)) is np.ndarray]


def _blank() -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string("<mujoco/>")


@cache
def _readers() -> list[Any]:
    """Return functions that read the options, and the statistics, outside of the watched memory.

    Each number of a model is changed once, to see whether it lies within.
    """
    model = _blank()
    readers: list[Any] = []
    memory = [(ctypes.c_char * size).from_address(start) for start, size in _regions(model)]
    for part in _parts(model):
        outside: list[str] = []
        for name in dir(part):
            value: Any = getattr(part, name)
            if isinstance(value, int | float):
                before = [bytes(region) for region in memory]
                setattr(part, name, value + 1)
                if before == [bytes(region) for region in memory]:
                    outside.append(name)
                setattr(part, name, value)
        readers.append(attrgetter("__class__", *outside))
    return readers


def _scalars(options: Any, statistics: Any) -> tuple[Any, ...]:
    """Return the options and statistics of a model that are outside of the watched memory."""
    of_options, of_statistics = _readers()
    return of_options(options), of_statistics(statistics)
