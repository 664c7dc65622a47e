"""A fake device "cuda:0" on the CPU, which counts synchronisations and copies.

Its tensors are CPU tensors with a mark, and so are the results of computations with them. On a
machine without a GPU this finds operations that mix devices or pass a device tensor to NumPy,
synchronisations (the CPU waits for the device), and copies to the device.
"""

# Torch functions take and return anything.
# pyright: basic

from __future__ import annotations

import contextlib
import traceback
from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest
import torch
from torch.overrides import TorchFunctionMode
from torch.utils._pytree import tree_leaves

from shapechanger.envs import warp
from shapechanger.envs.warp import devices, env, kernels, worlds
from shapechanger.envs.warp.devices import wp

_CPU = torch.device("cpu")
_DEVICE = torch.device("cuda:0")
_SYNCS = frozenset(
    [
        *("item", "tolist", "__bool__", "__float__", "__int__", "__index__", "nonzero", "equal"),
        *("allclose", "unique", "masked_select"),
    ]
)
_TO_NUMPY = frozenset({"numpy", "__array__"})
_MAKES = frozenset({"to", "as_tensor", "tensor", "asarray"})
_READS = frozenset({"__setitem__", "index_put_", "index_put", "__getitem__"})
# Functions that accept tensors of two devices, or do not read a tensor's numbers.
_FREE = frozenset(
    ["copy_", "__repr__", "__format__", "__hash__", "__len__", "size", "dim", "as_tensor"]
)


def _marked(value: Any) -> bool:
    return isinstance(value, torch.Tensor) and value.__dict__.get("_fake", False)


def _mark(value: Any) -> Any:
    for tensor in tree_leaves(value):
        if isinstance(tensor, torch.Tensor):
            tensor._fake = True  # pyright: ignore[reportAttributeAccessIssue]
    return value


def _line() -> str:
    """Return the file and line in Shapechanger that called torch."""
    ours = [f for f in traceback.extract_stack() if "/shapechanger/" in f.filename]
    return f"{ours[-1].filename.rpartition('/')[2]}:{ours[-1].lineno}" if ours else "a test"


class FakeDevice(TorchFunctionMode):
    """Counts the calls that would be slow or fail on a GPU, keyed by their place in the code.

    Attributes:
        syncs: Calls in which the CPU waits for a result of the device.
        copies: Calls that copy to the device.
        mixed: Calls that mix tensors of two devices, which fails on a GPU.
    """

    def __init__(self) -> None:
        super().__init__()
        self.forget()

    def forget(self) -> None:
        self.syncs: Counter[str] = Counter()
        self.copies: Counter[str] = Counter()
        self.mixed: Counter[str] = Counter()

    def __torch_function__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        """Call a function of torch, and count what it would cost on a GPU."""
        kwargs = dict(kwargs or {})
        name = getattr(func, "__name__", "")
        if name == "__get__":
            return self._attribute(func, args)
        tensors = [x for x in tree_leaves((args, kwargs)) if isinstance(x, torch.Tensor)]
        there = [tensor for tensor in tensors if _marked(tensor)]
        target: bool | None = None
        if kwargs.get("device") is not None:
            target, kwargs["device"] = torch.device(kwargs["device"]).type == "cuda", _CPU
        if name == "to":
            named = [a for a in args if isinstance(a, str | torch.device)]
            target = torch.device(named[0]).type == "cuda" if named else target
            args = tuple(_CPU if isinstance(a, str | torch.device) else a for a in args)
        if name == "cpu":
            target = False
        if there and name in _TO_NUMPY:
            raise TypeError(f"can't convert a tensor of cuda:0 to NumPy, at {_line()}")
        self._note(name, args, tensors, there, target)
        result = func(*args, **kwargs)
        if name == "cpu" or (target is False and there):
            with torch._C.DisableTorchFunction():
                return result.detach().clone()
        in_place = name.endswith("_") and not name.endswith("__")
        if not in_place and (bool(there) if target is None else target):
            _mark(result)
        return result

    @staticmethod
    def _attribute(func: Any, args: Any) -> Any:
        name = getattr(getattr(func, "__self__", None), "__name__", "")
        if _marked(args[0]):
            if name == "device":
                return _DEVICE
            if name == "is_cuda":
                return True
        result = func(*args)
        return _mark(result) if _marked(args[0]) else result

    def _note(self, name: str, args: Any, tensors: Any, there: Any, target: bool | None) -> None:
        if there and (name in _SYNCS or target is False):
            self.syncs[f"{name} at {_line()}"] += 1
        if target and name in _MAKES and len(there) < max(1, len(tensors)):
            self.copies[f"{name} at {_line()}"] += 1
        if name == "copy_" and there and len(there) != len(tensors):
            counter = self.copies if _marked(args[0]) else self.syncs
            counter[f"copy_ at {_line()}"] += 1
        if name in _READS and there:
            self._note_index(name, args)
        elif there and target is None and name not in _FREE:
            here = [tensor for tensor in tensors if not _marked(tensor) and tensor.dim() > 0]
            self.mixed[f"{name} at {_line()}"] += bool(here)

    def _note_index(self, name: str, args: Any) -> None:
        indices = args[1] if isinstance(args[1], tuple) else (args[1],)
        if not _marked(args[0]):
            self.mixed[f"{name} of the CPU by the device at {_line()}"] += 1
            return
        for index in indices:
            if isinstance(index, torch.Tensor):
                if index.dtype == torch.bool:
                    self.syncs[f"a mask in {name} at {_line()}"] += 1
                elif not _marked(index) and index.dim() > 0:
                    self.copies[f"an index of {name} at {_line()}"] += 1
            elif not isinstance(index, int | slice | type(None) | type(...)):
                self.copies[f"a list in {name} at {_line()}"] += 1
        value = args[2] if len(args) > 2 else None
        if isinstance(value, torch.Tensor) and not _marked(value) and value.dim() > 0:
            self.copies[f"a value of {name} at {_line()}"] += 1


@contextlib.contextmanager
def fake_device(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeDevice]:
    """Let envs be made on the fake "cuda:0", which Warp's CPU device computes."""

    @contextlib.contextmanager
    def on(device: str) -> Iterator[None]:
        with wp.ScopedDevice("cpu"):
            yield

    def as_warp(tensor: torch.Tensor, dtype: Any) -> Any:
        with torch._C.DisableTorchFunction():
            return devices.as_warp(tensor, dtype)

    def run(self: Any, name: str, function: Any) -> None:
        """Skip the physics, which neither synchronises nor copies."""

    monkeypatch.setattr(warp, "find_device", lambda name: "cuda:0")
    monkeypatch.setattr(worlds, "on", on)
    monkeypatch.setattr(kernels, "on", on)
    # There are no streams without a GPU.
    monkeypatch.setattr(env, "at_once", lambda calls, device: devices.at_once(calls, "cpu"))
    monkeypatch.setattr(worlds, "as_torch", lambda array: _mark(devices.as_torch(array)))
    monkeypatch.setattr(kernels, "as_warp", as_warp)
    monkeypatch.setattr(worlds.Worlds, "_run", run)
    with FakeDevice() as device:
        yield device
