"""Warp, mujoco-warp and torch, and the devices that they share."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any, TypeVar, cast

from shapechanger.errors import UnknownName, needing_extra

with needing_extra("gpu"):
    import torch
    from torch import Tensor
with needing_extra("gpu"):
    import mujoco_warp  # pyright: ignore[reportMissingTypeStubs]
    import warp

_Result = TypeVar("_Result")

wp: Any = warp
"""The module `warp`."""
mjw: Any = mujoco_warp
"""The module `mujoco_warp`."""

if wp.config.log_level == wp.LOG_INFO:
    # By default Warp prints a banner and a line for each kernel that it compiles. Without a CUDA
    # driver, its compiled library prints a warning at every level.
    wp.config.log_level = wp.LOG_ERROR


def find_device(name: str | None) -> str:
    """Return the name of a device that Warp and torch can both use.

    Args:
        name: Name of the device, such as `cpu` or `cuda:0`; None for the first GPU, or for the CPU
            if there is no GPU.

    Raises:
        UnknownName: If there is no such device.
    """
    gpus = min(int(wp.get_cuda_device_count()), torch.cuda.device_count())
    known = ["cpu", *(f"cuda:{number}" for number in range(gpus))]
    if name is None:
        return known[min(1, gpus)]
    wanted = "cuda:0" if name == "cuda" else name
    if wanted not in known:
        raise UnknownName("device", name, known)
    return wanted


@contextmanager
def without_gradients() -> Generator[None]:
    """Make ordinary tensors without gradients, also inside `torch.inference_mode()`.

    Tensors made in inference mode could not be changed outside of it.
    """
    with torch.inference_mode(mode=False), torch.no_grad():
        yield


def as_torch(array: Any) -> Tensor:
    """Return a tensor that shares the memory of a Warp array."""
    return cast("Tensor", wp.to_torch(array, requires_grad=False))


def as_warp(tensor: Tensor, dtype: Any) -> Any:
    """Return a Warp array, with elements of `dtype`, that shares a contiguous tensor's memory."""
    return wp.from_torch(tensor, dtype=dtype, requires_grad=False)


@contextmanager
def on(device: str) -> Generator[None]:
    """Let Warp allocate and launch on a device; on a GPU in torch's current stream."""
    with wp.ScopedDevice(device):
        if device == "cpu":
            yield
        else:
            with wp.ScopedStream(
                wp.stream_from_torch(cast("Any", torch.cuda.current_stream(device)))
            ):
                yield


@cache
def _streams(count: int, device: str) -> list[torch.cuda.Stream]:
    return [torch.cuda.Stream(device) for _ in range(count)]


def at_once(calls: Sequence[Callable[[], _Result]], device: str) -> list[_Result]:
    """Return the result of each call; a GPU runs them concurrently, a CPU one after another."""
    if len(calls) == 1 or device == "cpu":
        return [call() for call in calls]
    current = torch.cuda.current_stream(device)
    streams = _streams(len(calls), device)
    results: list[_Result] = []
    for stream, call in zip(streams, calls, strict=True):
        stream.wait_stream(current)
        with torch.cuda.stream(stream):
            results.append(call())
    for stream in streams:
        current.wait_stream(stream)
    return results
